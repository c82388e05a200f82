"""The search: which worlds are driven, in which order, and what is kept of it."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive import _core
from interdrive.errors import InputError, ResultsError
from interdrive.failure_search.disturbed_worlds import disturbed, implausible
from interdrive.failure_search.evaluation import Drive, Judged, drive_of, judged, require_text, witness
from interdrive.failure_search.failures import Failure, begin, failures, finish, give_up
from interdrive.failure_search.shrinking import shrunk
from interdrive.failure_search.spaces import Disturbance, Pair, Space, disturbance, pairs, undisturbed
from interdrive.files import read_scenario, scenario_file
from interdrive.files.roads import road_elements
from interdrive.run import OUTCOMES
from interdrive.storage import Column, Origin, arrow_table, replacing, write_table
from interdrive.storage.reading import read_json
from interdrive.storage.writing import json_text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from interdrive.array_types import Floats
    from interdrive.scenario import Scenario

#: Runs whose points are chosen before any of them is driven.
ROUND = 32
#: Of the rounds behind the first one, every other run is a neighbour of a critical one: of this share of all of them.
_CRITICAL_SHARE, _STEP = 0.1, 0.15
#: Draws of a point until the search takes the pair for one without a plausible world.
_DRAWS = 50
_CLOSED_AFTER = 3
_SAME_IDS = "vehicles have the ids of parts of the road, so a file of a failure would name them otherwise"
_FILE, _LOG, _TABLE = "search.json", "evaluations.jsonl", "evaluations.parquet"

#: Columns of evaluations.parquet.
EVALUATION_COLUMNS = (
    Column("index", "integer", "number of the run"),
    Column("scenario", "label", "name of the scenario file"),
    Column("agent_id", "integer", "the agent under test"),
    Column("uniform", "truth", "drawn uniformly over all pairs and points, so it counts for the rate"),
    Column("draws", "integer", "points that were drawn until one was plausible"),
    Column("point", "text", "coordinates from 0 to 1, as JSON"),
    Column("outcome", "label", "one of interdrive.run.OUTCOMES", labels=OUTCOMES, null="no draw was plausible"),
    Column("failure", "label", "kind of the failure; empty: none"),
    Column("partner_id", "integer", "with whom it collided", null="no collision with a participant"),
    Column("criticality", "number", "below 0: a failure; from 0 (near) to 1", "1", null="no draw was plausible"),
    Column("signature", "label", "scenario, agent, kind and partner of a failure; empty: none"),
    Column("folder", "label", "folder of the failure; empty: none"),
    Column("digest", "text", "SHA-256 of all states"),
)


@dataclass(frozen=True)
class Found:
    """What a search found.

    Attributes:
        failures: Failures, in the order in which they were found.
        runs: Runs that were driven.
        uniform_runs: Of these, drawn uniformly.
        uniform_failures: Failures among them.
        rate: Share of uniform runs that fail, with its 95 % interval (Clopper and Pearson).
        undisturbed: Agents that fail without any disturbance, as "scenario agent".
        left_out: Files that were left out, each with the reason.
    """

    failures: tuple[Failure, ...]
    runs: int
    uniform_runs: int
    uniform_failures: int
    rate: tuple[float, float, float]
    undisturbed: tuple[str, ...]
    left_out: tuple[str, ...]


def search(
    paths: str | Path | Sequence[str | Path],
    planner: str,
    *,
    runs: int = 300,
    seed: int = 0,
    out: str | Path,
    agent_id: int | None = None,
    traffic: str = "idm",
    predictor: str = "lane_following",
    space: Space | None = None,
    on_run: Callable[[int, int], None] | None = None,
) -> Found:
    """Searches disturbances of recordings under which a planner fails by its own fault.

    Results depend on the arguments alone. An interrupted search goes on where it was when it is called with the same
    ones; what it found until then is in the folder.

    Args:
        paths: CommonRoad files, folders of them, or names of shipped scenarios.
        planner: The planner under test, as on the command line.
        runs: Number of runs.
        seed: Chooses the points.
        out: Folder of the search.
        agent_id: Only this agent.
        traffic: Planner of all other vehicles, or "recorded".
        predictor: Predictor of all agents.
        space: What may change; the defaults otherwise.
        on_run: Called with the number of runs and of failures until now.

    Raises:
        InputError: No agent has a vehicle near, the planner is an object, or the folder holds another search.
        ResultsError: The folder is damaged or cannot be written.
    """
    given = [paths] if isinstance(paths, str | Path) else list(paths)
    text = require_text(planner)
    chosen = space or Space()
    files = _files(given)
    read = [read_scenario(path) for path in files]
    scenarios = [scenario for scenario in read if _can_be_kept(scenario)]
    left_out = tuple(f"{scenario.name}: {_SAME_IDS}" for scenario in read if not _can_be_kept(scenario))
    if not scenarios:
        raise InputError(f"nothing to search: {left_out[0]}")
    found = [pair for scenario in scenarios for pair in pairs(scenario, chosen.others)]
    found = [pair for pair in found if agent_id is None or pair.agent_id == agent_id]
    if not found:
        raise InputError(_no_pair(scenarios, agent_id))
    if runs < 1:
        raise InputError(f"runs: must be positive, is {runs}")
    what = {
        "files": [[scenario.name, scenario.sha256] for scenario in scenarios],
        "planner": text,
        "agent_id": agent_id,
        "seed": seed,
        "traffic": traffic,
        "predictor": predictor,
        "space": json.loads(json.dumps(asdict(chosen))),
        "version": _core.__version__,
    }
    work = _Search(Path(out), found, chosen, (text, traffic, predictor), seed, what)
    work.run(runs, on_run)
    return replace(work.found(), left_out=left_out)


class _Search:
    """A search under way."""

    def __init__(
        self,
        folder: Path,
        found: Sequence[Pair],
        space: Space,
        drivers: tuple[str, str, str],
        seed: int,
        what: dict[str, Any],
    ) -> None:
        self.folder, self.pairs, self.space, self.seed = folder, list(found), space, seed
        self.drivers = drivers
        self.neutral = undisturbed(space)
        stored = self._opened(what)
        self.rows = self._logged()
        self.bare: list[str] = self._undisturbed_failures() if stored is None else stored
        (self.folder / _FILE).write_text(
            json_text({**what, "undisturbed": self.bare}, indent=2) + "\n", encoding="utf-8"
        )

    def _opened(self, what: dict[str, Any]) -> list[str] | None:
        """Agents that fail undisturbed, if the folder holds the same search; None if it holds none yet."""
        path = self.folder / _FILE
        if not path.exists():
            if self.folder.exists() and any(self.folder.iterdir()):
                raise InputError(f"{self.folder}: is no search, and not empty")
            self.folder.mkdir(parents=True, exist_ok=True)
            return None
        try:
            stored = read_json(path)
            bare = [str(name) for name in stored["undisturbed"]]
        except (OSError, ValueError, KeyError, TypeError) as cause:
            raise ResultsError(f"{path}: damaged ({cause!r})") from None
        other = [name for name in what if stored.get(name) != what[name]]
        if other:
            raise InputError(f"{self.folder}: holds another search ({', '.join(other)} differ); choose another --out")
        return bare

    def _logged(self) -> list[dict[str, Any]]:
        """The runs of the log, without what a killed process left of a line."""
        log = self.folder / _LOG
        if not log.exists():
            return []
        whole = [line for line in log.read_text(encoding="utf-8").splitlines(keepends=True) if line.endswith("\n")]
        try:
            rows: list[dict[str, Any]] = [json.loads(line) for line in whole]
            in_order = [row["index"] for row in rows] == list(range(len(rows)))
        except (ValueError, KeyError, TypeError) as cause:
            raise ResultsError(f"{log}: damaged ({cause!r})") from None
        if not in_order:
            raise ResultsError(f"{log}: damaged (runs are missing)")
        with replacing(log) as part:
            part.write_text("".join(whole), encoding="utf-8")
        return rows

    def _undisturbed_failures(self) -> list[str]:
        """Agents that fail in the recording as it is."""
        failing = []
        for pair in self.pairs:
            found = self._driven(pair, self.neutral)
            if found is not None and found[1].failure:
                failing.append(f"{pair.scenario.name} {pair.agent_id}")
        return failing

    def run(self, runs: int, on_run: Callable[[int, int], None] | None) -> None:
        """Drives until so many runs are done; each is in the log when the next one begins."""
        with (self.folder / _LOG).open("a", encoding="utf-8") as log:
            try:
                for row in self._missing(runs):
                    self.rows.append(row)
                    log.write(json_text(row) + "\n")
                    log.flush()
                    if on_run is not None:
                        on_run(len(self.rows), sum(bool(one["folder"]) for one in self.rows))
            finally:
                self._write_table()

    def _missing(self, runs: int) -> Iterator[dict[str, Any]]:
        index = len(self.rows)
        while index < runs:
            # A round rests on whole rounds before it, wherever the search was interrupted.
            first = index - index % ROUND
            critical = self._critical(first)
            for number in range(index, min(first + ROUND, runs)):
                yield self._evaluated(number, critical)
            index = min(first + ROUND, runs)

    def _critical(self, first: int) -> list[tuple[int, Floats]]:
        """Pairs and points of the most critical runs before a round."""
        known = [row for row in self.rows[:first] if row["criticality"] is not None]
        known.sort(key=lambda row: (row["criticality"], row["index"]))
        chosen = known[: math.ceil(_CRITICAL_SHARE * len(known))]
        return [(row["pair"], np.array(row["point"])) for row in chosen]

    def _evaluated(self, index: int, critical: Sequence[tuple[int, Floats]]) -> dict[str, Any]:
        """The row of a run."""
        random = np.random.default_rng([self.seed, index])
        is_uniform = index % 2 == 0 or not critical
        place = 0
        draws, found = 0, None
        while found is None and draws < _DRAWS:
            draws += 1
            if is_uniform:
                place, point = int(random.integers(len(self.pairs))), random.random(self.space.size)
            else:
                place, parent = critical[int(random.integers(len(critical)))]
                point = _neighbour(parent, random)
            found = self._driven(self.pairs[place], point)
        pair = self.pairs[place]
        row: dict[str, Any] = {
            "index": index,
            "pair": place,
            "scenario": pair.scenario.name,
            "agent_id": pair.agent_id,
            "uniform": is_uniform,
            "draws": draws,
            "point": point.tolist(),
            **dict.fromkeys(("outcome", "criticality")),
            **dict.fromkeys(("failure", "signature", "folder", "digest"), ""),
            "partner_id": -1,
        }
        if found is None:
            return row
        verdict = found[1]
        row |= {
            "outcome": verdict.outcome,
            "criticality": verdict.criticality,
            "failure": verdict.failure,
            "partner_id": verdict.partner_id,
            "digest": verdict.digest,
        }
        if verdict.failure:
            row["signature"] = self._signature(pair, verdict)
            row["folder"] = self._kept(pair, point, row["signature"])
        return row

    def _driven(self, pair: Pair, point: Floats) -> tuple[Scenario, Judged] | None:
        """The world of a point and what happens in it; None if it is not plausible."""
        change = disturbance(self.space, pair, point)
        scenario = disturbed(pair.scenario, change)
        if implausible(pair.scenario, scenario, _moved(change)):
            return None
        try:
            drive = self._drive(scenario, pair, change)
            return scenario, judged(drive.run(scenario), pair.agent_id)
        except InputError:  # a vehicle has no route any more
            return None

    def _drive(self, scenario: Scenario, pair: Pair, change: Disturbance) -> Drive:
        planner, traffic, predictor = self.drivers
        drive = replace(drive_of(scenario, pair.agent_id, planner, traffic, predictor), sight=change.sight)
        error = change.error
        if error is None or error.who not in drive.others:
            return drive
        if error.kind == "disobeys":
            return replace(drive, others={**drive.others, error.who: f"{traffic},rules.enabled=false"})
        others = {number: name for number, name in drive.others.items() if number != error.who}
        return replace(drive, agents=tuple(number for number in drive.agents if number != error.who), others=others)

    @staticmethod
    def _signature(pair: Pair, verdict: Judged) -> str:
        return f"{pair.scenario.name} {pair.agent_id} {verdict.failure} {verdict.partner_id}"

    def _kept(self, pair: Pair, point: Floats, signature: str) -> str:
        """Stores a failure, shrunk; "" if there are enough like it, or if the file of its world does not fail."""
        if sum(bool(row["folder"]) and row["signature"] == signature for row in self.rows) >= _CLOSED_AFTER:
            return ""

        def still_fails(other: Floats) -> bool:
            found = self._driven(pair, other)
            return found is not None and self._signature(pair, found[1]) == signature

        small = shrunk(point, self.neutral, still_fails)
        change = disturbance(self.space, pair, small)
        name = f"{1 + sum(bool(row['folder']) for row in self.rows):03d}"
        folder = self.folder / "failures" / name
        scenario = begin(folder, disturbed(pair.scenario, change))
        drive = self._drive(scenario, pair, change)
        run = drive.run(scenario)
        verdict = judged(run, pair.agent_id)
        if not verdict.failure:
            give_up(folder)
            return ""
        avoided_by, avoided = witness(scenario, drive)
        finish(
            Failure(
                folder,
                drive,
                verdict.failure,
                verdict.words,
                change.words(),
                avoided_by,
                verdict.digest,
                signature,
                _core.__version__,
            ),
            run,
            avoided,
        )
        return name

    def _write_table(self) -> None:
        values: dict[str, list[Any]] = {
            column.name: [row[column.name] for row in self.rows] for column in EVALUATION_COLUMNS
        }
        values["point"] = [json.dumps(point) for point in values["point"]]
        values["partner_id"] = [None if number < 0 else number for number in values["partner_id"]]
        with replacing(self.folder / _TABLE) as part:
            write_table(arrow_table(EVALUATION_COLUMNS, values), part, Origin({"planner": self.drivers[0]}))

    def found(self) -> Found:
        """What is found until now."""
        uniform = [row for row in self.rows if row["uniform"] and row["outcome"] is not None]
        failed = sum(bool(row["failure"]) for row in uniform)
        kept = tuple(failures(self.folder))
        rate = _interval(failed, len(uniform))
        return Found(kept, len(self.rows), len(uniform), failed, rate, tuple(self.bare), ())


def _moved(change: Disturbance) -> set[int]:
    return {who for who, time in change.times.items() if time != 0.0 or change.speeds[who] != 1.0}


def _neighbour(parent: Floats, random: np.random.Generator) -> Floats:
    """A point near another one: every other coordinate moves, reflected at the bounds."""
    step = _STEP * random.standard_normal(len(parent)) * (random.random(len(parent)) < 0.5)
    moved = np.abs(parent + step)
    point: Floats = np.clip(np.where(moved > 1.0, 2.0 - moved, moved), 0.0, 1.0)
    return point


def _can_be_kept(scenario: Scenario) -> bool:
    """Whether a file of it has the same ids, by which a failure names its agents."""
    _, _, roads = road_elements(scenario)
    return set(roads).isdisjoint(scenario.obstacles.ids.tolist())


def _files(given: Sequence[str | Path]) -> list[Path]:
    found: list[Path] = []
    for item in given:
        path = Path(item)
        if path.is_dir():
            inside = sorted(path.rglob("*.xml"))
            if not inside:
                raise InputError(f"{item}: there are no CommonRoad files")
            found += inside
        else:
            found.append(scenario_file(item))
    return found


def _no_pair(scenarios: Sequence[Scenario], agent_id: int | None) -> str:
    names = ", ".join(scenario.name for scenario in scenarios[:3]) + (", ..." if len(scenarios) > 3 else "")
    if agent_id is not None:
        return f"agent {agent_id}: no vehicle of {names} that can be an agent with another one within 30 m"
    return f"{names}: no vehicle that can be an agent has another one within 30 m"


def _interval(failed: int, runs: int) -> tuple[float, float, float]:
    """Share of failures, and its 95 % interval."""
    if not runs:
        return math.nan, 0.0, 1.0

    def at_most(k: int, p: float) -> float:
        terms = [math.lgamma(runs + 1) - math.lgamma(i + 1) - math.lgamma(runs - i + 1) for i in range(k + 1)]
        logs = [term + i * math.log(p) + (runs - i) * math.log1p(-p) for i, term in enumerate(terms)]
        return math.fsum(map(math.exp, logs))

    def solved(is_below: Callable[[float], bool]) -> float:
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if is_below(middle) else (low, middle)
        return low

    low = 0.0 if failed == 0 else solved(lambda p: 1.0 - at_most(failed - 1, p) < 0.025)
    high = 1.0 if failed == runs else solved(lambda p: at_most(failed, p) > 0.025)
    return failed / runs, low, high
