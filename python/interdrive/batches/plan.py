"""The runs of a batch: every combination of scenario, planner, predictor and seed, each with its key."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from interdrive import _core
from interdrive.config.agent_config import AgentConfig, run_config, stored
from interdrive.config.binding import flatten
from interdrive.config.plugins import read_choice, versions
from interdrive.config.schema import SimulationSettings
from interdrive.config.specs import read_planner, read_predictor, spec_label
from interdrive.errors import InputError
from interdrive.files import (
    content_of_input,
    content_sha256,
    is_source,
    scenario_file,
    scenario_parts,
    shipped_scenarios,
)
from interdrive.planners import NATIVE
from interdrive.planners.workers import can_be_sent
from interdrive.predictors.neural import SHIPPED
from interdrive.storage.names import path_of, readable

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from interdrive.config.specs import AgentChoice, PlannerSpecs, PredictorSpecs, Resolved

#: Version of the data set's columns and of the folder; raised when one changes its name or meaning.
FORMAT = 6

#: The layout before, whose `score` is `score_1` now: such data sets are read, but nothing is added to them.
FORMER = 5

#: What vehicles do that could be agents but are not under test: replay their recordings (`REPLAY` is another word for
#: that), drive by the planner under test, or by a native planner.
_FIRST = ("recorded", "velocity_adjusting", "same")
TRAFFIC = (*_FIRST, *(name for name in NATIVE if name not in (*_FIRST, "policy")))
REPLAY = "replay"

#: What tables call runs in which one agent of several is under test.
ALONE = "alone"

#: Endings of scenario files that are looked for in folders; and of files that are scenarios if they are recognised.
_ENDINGS = (".xml", ".pb")
_SOURCE_ENDINGS = (".xodr", ".osm", ".gz", ".json", ".osi", ".mcap")

#: Files that mark folders whose scenarios are results.
_RESULT_MARKS = ("run.json", "batch.json", "study.json")


@dataclass(frozen=True)
class ScenarioFile:
    """A scenario file that a batch uses.

    Attributes:
        path: Where it is.
        name: Without its ending.
        category: Its folder, seen from the folder that was given.
        sha256: Of its content.
        parts_sha256: Of the content of files that belong to it; "" if there are none.
        size: Of its content [bytes].
    """

    path: str
    name: str
    category: str
    sha256: str
    parts_sha256: str
    size: int


class Problem(NamedTuple):
    """Why a run cannot be done.

    Attributes:
        status: What that is called, one of `interdrive.batches.columns.STATUS`.
        text: In words.
    """

    status: str
    text: str


@dataclass(frozen=True)
class RunSpec:
    """One run of a batch; everything that a process needs to know to do it.

    Attributes:
        key: Made of everything that decides about the result.
        path: Scenario file. scenario: Its name. category: Its folder. sha256: Of its content. size: [bytes].
        parts_sha256: Of files that belong to it; "" if there are none.
        planner: Under test. planner_label: What tables call it.
        predictor: Of all agents. predictor_label: What tables call it.
        agents: Agents under test: "all", a maximum number, or ids.
        traffic: One of `TRAFFIC`.
        panel: Drivers that drive in the place of the agent under test, for its score; empty: none.
        seed: Chooses a number of agents.
        settings: Of the simulation.
        problem: Why it cannot be done; None if nothing is known against it.
        content: Planner, predictor and settings in plain values when the batch was planned, for the key.
    """

    key: str
    path: str
    scenario: str
    category: str
    sha256: str
    parts_sha256: str
    size: int
    planner: AgentChoice
    planner_label: str
    predictor: Resolved
    predictor_label: str
    agents: str | int | tuple[int, ...]
    traffic: str
    seed: int
    settings: SimulationSettings
    panel: tuple[str, ...] = ()
    problem: Problem | None = None
    content: Mapping[str, Any] = field(default_factory=dict, repr=False, compare=False)

    @property
    def agents_label(self) -> str:
        """The agents under test, as named in tables."""
        return ALONE if isinstance(self.agents, tuple) else str(self.agents)

    @property
    def settings_label(self) -> str:
        """Settings that are not the defaults, as named in tables."""
        usual = flatten(SimulationSettings())
        own = {name: value for name, value in flatten(self.settings).items() if value != usual[name]}
        return " ".join(f"{name}={value}" for name, value in own.items())

    def of_agents(self, ids: Sequence[int]) -> RunSpec:
        """The same run with the given agents under test; a seed has nothing left to choose."""
        return _keyed(replace(self, agents=tuple(ids), seed=0 if ids else self.seed))

    def impossible(self, problem: Problem) -> RunSpec:
        """The same run, which cannot be done."""
        return replace(self, problem=problem)


@dataclass(frozen=True)
class BatchPlan:
    """What a batch is to do.

    Attributes:
        specs: One per run.
        notes: One line per thing the user should know.
    """

    specs: tuple[RunSpec, ...]
    notes: tuple[str, ...] = field(default=())


def planned(
    paths: Iterable[str | Path],
    *,
    planner: PlannerSpecs,
    predictor: PredictorSpecs,
    agents: str | int,
    traffic: str | None,
    alone: bool,
    seeds: int,
    settings: SimulationSettings,
    panel: tuple[str, ...] = (),
) -> BatchPlan:
    """Every combination of scenario, planner, predictor and seed; the arguments are those of `batch`.

    Raises:
        InputError: Nothing to do, or something that cannot be used.
    """
    agents, traffic = _who(agents, traffic, alone=alone, seeds=seeds, is_drawn=settings.traffic.is_on)
    if panel and not alone:
        raise InputError("panel: it drives in the place of one agent; test every agent alone (--alone)")
    files, notes = scenario_files(paths)
    planners = {key: read_planner(one, settings.planner) for key, one in choices(planner, "planner").items()}
    predictors = {key: read_predictor(one, settings.predictor) for key, one in choices(predictor, "predictor").items()}
    # What cannot be used is refused before anything is simulated.
    contents = {
        (planner_label, predictor_label): _plain(chosen, expected, settings)
        for planner_label, chosen in planners.items()
        for predictor_label, expected in predictors.items()
    }
    for label, thing in [(f"planner {n}", p) for n, p in planners.items()] + [
        (f"predictor {n}", p) for n, p in predictors.items()
    ]:
        if not can_be_sent(thing):
            raise InputError(label, "it cannot be sent to other processes (it cannot be pickled); give its class")
    specs = [
        _keyed(
            RunSpec(
                "", file.path, file.name, file.category, file.sha256, file.parts_sha256, file.size,
                chosen, planner_label, expected, predictor_label, agents, traffic, seed, settings,
                panel=panel, content=contents[planner_label, predictor_label],
            )
        )
        for file in files
        for planner_label, chosen in planners.items()
        for predictor_label, expected in predictors.items()
        for seed in range(seeds)
    ]  # fmt: skip
    return BatchPlan(tuple(specs), tuple(notes))


def _who(agents: str | int, traffic: str | None, *, alone: bool, seeds: int, is_drawn: bool) -> tuple[str | int, str]:
    """Agents and traffic, checked together; with generated traffic (`is_drawn`) every seed makes another run."""
    if agents == 0 and agents is not False:
        raise InputError(
            "agents: 0 leaves nobody under test, whom a batch is about; "
            "`interdrive run --agents 0 --traffic rate=600` drives generated vehicles alone, one --seed at a time"
        )
    if agents not in ("all", "reachable") and (not isinstance(agents, int) or isinstance(agents, bool) or agents < 1):
        raise InputError(f"agents: expected all, reachable or a number of at least 1, not {agents!r}")
    traffic = traffic_kind(traffic)
    if seeds < 1:
        raise InputError(f"seeds: expected at least 1, not {seeds}")
    together = agents == "all" and not alone
    if together and traffic not in (None, "same"):
        raise InputError(
            f"traffic {traffic}: with agents all no vehicles are left as traffic; "
            "test every agent alone (--alone), or a number of them (--agents N)"
        )
    if isinstance(agents, str) and seeds > 1 and not is_drawn:
        raise InputError(
            f"seeds {seeds}: a seed chooses a number of agents; with agents {agents} every run would be equal"
        )
    return agents, traffic or ("same" if together else "recorded")


def traffic_kind(given: str | None) -> str | None:
    """How traffic is called in tables; None stays None.

    Raises:
        InputError: There is no such traffic, or its planner is not native.
    """
    if given == REPLAY:
        return "recorded"
    if given is not None and given not in TRAFFIC:
        raise InputError(f"traffic: expected one of {REPLAY}, {', '.join(TRAFFIC)}, not {given!r}")
    return given


def scenario_files(paths: Iterable[str | Path]) -> tuple[list[ScenarioFile], list[str]]:
    """Scenario files by their paths, those in folders and the folders below included; and notes.

    Folders of results and hidden ones are not searched. Files with the same content are used once.

    Raises:
        InputError: A path that does not exist, a folder without scenario files, or nothing at all.
    """
    found: list[ScenarioFile] = []
    notes: list[str] = []
    for given in paths:
        path = Path(given)
        if path.is_dir() and not is_source(path):
            inside = list(_inside(path))
            if not inside:
                raise InputError(f"{given}: this folder holds no scenario files ({', '.join(_ENDINGS)})")
            found += [
                _file(file, str(file.parent.relative_to(path)) if file.parent != path else path.resolve().name)
                for file in inside
            ]
        else:
            is_shipped = not path.exists() and str(given) in shipped_scenarios()
            path = scenario_file(given)
            found.append(_file(path, "shipped" if is_shipped else path.resolve().parent.name))
    if not found:
        raise InputError("batch: no scenarios; give CommonRoad files, folders or names of shipped scenarios")
    first: dict[str, ScenarioFile] = {}
    for file in found:
        kept = first.setdefault(file.sha256 + file.parts_sha256, file)
        if Path(kept.path).resolve() != Path(file.path).resolve():
            notes.append(f"{file.path} has the same content as {kept.path}: it is run once")
    return list(first.values()), notes


def _inside(folder: Path, above: tuple[Path, ...] = ()) -> Iterable[Path]:
    if (place := folder.resolve()) in above:
        return  # a symbolic link to a folder that it lies in
    entries = sorted(folder.iterdir())
    if any(entry.name in _RESULT_MARKS for entry in entries):
        return
    for entry in entries:
        if entry.name.startswith("."):
            continue
        if entry.is_dir() and is_source(entry):
            yield entry
        elif entry.is_dir():
            yield from _inside(entry, (*above, place))
        elif (entry.suffix in _ENDINGS and not _is_part(entry)) or (
            entry.suffix in _SOURCE_ENDINGS and is_source(entry)
        ):
            yield entry


def _is_part(path: Path) -> bool:
    """A protobuf file that belongs to another one: planning problems (X-SC.pb), or a map (two words in its name)."""
    return path.suffix == ".pb" and (path.stem.endswith("-SC") or path.stem.count("_") < 2)


def _file(path: Path, category: str) -> ScenarioFile:
    if path.is_dir():
        inner = [one.stat().st_size for one in path.iterdir() if one.is_file()]
        return ScenarioFile(
            path=str(path.resolve()),
            name=readable(path.resolve().name),
            category=readable(category),
            sha256=content_sha256(path),
            parts_sha256="",
            size=sum(inner),
        )
    content = content_of_input(path)
    parts = [content_of_input(part) for part in scenario_parts(path)]
    return ScenarioFile(
        path=str(path.resolve()),
        name=readable(path.stem),
        category=readable(category),
        sha256=hashlib.sha256(content).hexdigest(),
        parts_sha256=parts_hash(parts),
        size=len(content),
    )


def parts_hash(parts: Sequence[bytes]) -> str:
    """SHA-256 of the files that belong to a scenario; "" if there are none."""
    hashes = [hashlib.sha256(part).hexdigest() for part in parts]
    return hashlib.sha256(" ".join(hashes).encode()).hexdigest() if hashes else ""


def choices(given: Any, what: Literal["planner", "predictor"]) -> dict[str, Any]:  # noqa: ANN401 - as `batch` takes it
    """Planners or predictors by their labels.

    Args:
        given: A text "frenet,level=1,idm_mobil" (a name begins a new one, NAME=VALUE belongs to the one before), a
            sequence of texts or anything else that can be chosen, or a mapping from labels to these.
        what: Which of both.

    Raises:
        InputError: None, a label twice, or a text that is not spelled like that.
    """
    found: dict[str, Any] = {}
    if isinstance(given, Mapping) and given and what not in given:
        return dict(given)
    for item in given if isinstance(given, list | tuple | Mapping) and what not in given else [given]:
        for choice in _separated(item, what) if isinstance(item, str) else [item]:
            label = choice if isinstance(choice, str) else spec_label(read_choice(choice, what))
            if label in found:
                raise InputError(f"{what} {label} is given twice; in Python give a mapping from labels to {what}s")
            found[label] = choice
    if not found:
        raise InputError(f"{what}: none is given")
    return found


def labels_of(texts: Sequence[str], what: Literal["planner", "predictor"]) -> list[str]:
    """What tables call planners or predictors that are written as for `batch`.

    Raises:
        InputError: A text that is not spelled like that.
    """
    return [label for text in texts for label in _separated(text, what)]


def _separated(text: str, what: str) -> list[str]:
    found: list[str] = []
    for part in (part.strip() for part in re.split(r",(?![^\[]*\])", text)):
        if not part:
            raise InputError(f"{what} {text!r}: nothing before or after a comma")
        if "=" in part and found:
            found[-1] += f",{part}"
        else:
            found.append(part)
    return found


def _keyed(spec: RunSpec) -> RunSpec:
    """The run with its key."""
    content = {
        "format": FORMAT,
        "version": _core.__version__,
        "scenario": [spec.sha256, spec.parts_sha256],
        "labels": [spec.planner_label, spec.predictor_label],
        "agents": spec.agents,
        "traffic": spec.traffic,
        "panel": spec.panel,
        "seed": spec.seed,
        **spec.content,
    }
    text = json.dumps(content, sort_keys=True, default=str)
    return replace(spec, key=hashlib.sha256(text.encode()).hexdigest()[:32])


def _plain(planner: AgentChoice, expected: Resolved, settings: SimulationSettings) -> dict[str, Any]:
    """Planner, predictor and settings as plain values, with the content of the user's modules and of files they name.

    Raises:
        InputError: One that cannot be used, or that other processes would not find by its name.
    """
    own, chosen = run_config(settings, planner).settings, planner.planner
    chosen.check_found_elsewhere(own.planner)
    expected.check_found_elsewhere(own.predictor)
    found = stored({0: AgentConfig(chosen, own.view, own.rules)}, expected, own)
    modules = {name.partition(":")[0] for name in (chosen.name, expected.name) if ":" in name}
    plain = {
        "base": flatten(settings),
        "planner": found["planner"],
        "predictor": found["predictor"],
        "settings": flatten(own),
        "modules": {name: _source(name) for name in sorted(modules)},
    }
    given = [*flatten(own).values(), *chosen.values.values(), *expected.values.values()]
    files = {value: _hash(path_of(value)) for value in given if _names_a_file(value)}
    if expected.name == "neural":
        files["neural"] = _hash(SHIPPED)
    if files:
        plain["files"] = files
    if planner.drivers is not None:
        plain["drivers"] = planner.drivers.plain()
    if planner.driver:
        plain["driver"] = dict(planner.driver)
    libraries = versions(chosen.name, "planner") | versions(expected.name, "predictor")
    if libraries:
        plain["libraries"] = libraries
    return plain


def _source(module: str) -> str:
    """SHA-256 of a module's file: a planner that was changed is another one."""
    found = importlib.util.find_spec(module)
    if found is None or found.origin is None or not Path(found.origin).is_file():
        return ""
    return _hash(Path(found.origin))


def _names_a_file(value: object) -> bool:
    try:
        return isinstance(value, str) and value != "" and path_of(value).is_file()
    except (OSError, InputError):  # too long, no such user
        return False


def _hash(path: Path) -> str:
    return hashlib.sha256(content_of_input(path)).hexdigest()
