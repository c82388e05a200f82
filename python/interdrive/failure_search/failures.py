"""Failures as folders that anybody can repeat, and suites of them.

A folder holds `start.xml` (the disturbed scenario), `run.toml` and `failure.json` (who drives what), the run folders
`run` and `witness`, the picture `failure.png`, the film `failure.gif` and `README.md`.
"""

from __future__ import annotations

import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interdrive.config.agent_config import modules_named
from interdrive.errors import InputError, ResultsError
from interdrive.failure_search.evaluation import Drive, judged
from interdrive.files import read_scenario
from interdrive.files.write import scenario_document
from interdrive.storage import replacing
from interdrive.storage.reading import read_json
from interdrive.storage.writing import json_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.runs import Run
    from interdrive.scenario import Scenario

_FILE, _START = "failure.json", "start.xml"
#: Frames per second of films.
_FILM_RATE = 5.0
#: Smallest and largest height of films, as shares of their width.
_FILM_ASPECTS = 0.4, 0.75
#: What is said of a failure whose disturbance may be larger than it has to be.
UNSHRUNK = " (not made as small as it can be: the search ended before, or was not to do it, or the process was lost)"
_TEXTS = ("failure", "words", "disturbance", "witness", "digest", "signature", "version")


@dataclass(frozen=True)
class Failure:
    """A failure that was found.

    Attributes:
        folder: Where it is.
        drive: Who drives what.
        failure: Its kind: of a fault, "off_road", "infeasible" or "planner_error".
        words: What happened.
        disturbance: What is different from the recording.
        witness: A planner that does not fail in the agent's place; "": none of those that were tried.
        digest: Of the run.
        signature: Failures with the same one are alike.
        version: Of interdrive.
        scenario: Name of the recording.
        is_small: Its disturbance was made as small as it can be; otherwise the search ended, or was lost, before.
    """

    folder: Path
    drive: Drive
    failure: str
    words: str
    disturbance: str
    witness: str
    digest: str
    signature: str
    version: str
    scenario: str = ""
    is_small: bool = True

    @property
    def scenario_path(self) -> Path:
        """The disturbed scenario."""
        return self.folder / _START

    def __str__(self) -> str:
        return self.folder.name

    def replay(self, *, trust: bool = False) -> Run:
        """The run once more; `interdrive.failure_search.replay` says whether it has the same bits, too.

        Args:
            trust: Import planners that the failure names as module:object.

        Raises:
            InputError: It names code and is not trusted.
            ResultsError: The folder is damaged.
        """
        return replay(self, trust=trust)[0]

    def check(self, planner: str) -> None:
        """A test case in one line: a planner must not fail in the agent's place.

        Args:
            planner: The planner, as on the command line.

        Raises:
            AssertionError: It fails, too.
        """
        found = check_failure(self, planner, trust=True)
        if found.failure:
            raise AssertionError(f"{self.folder}: {planner}: {found.failure}: {found.words}")


@dataclass(frozen=True)
class Verdict:
    """What a planner does in a failure's world: the kind of its failure, "" without one, and what happened in words."""

    failure: str
    words: str


def failures(folder: str | Path) -> list[Failure]:
    """The failures of a search, or of a suite, in the order in which they were found.

    Args:
        folder: Folder of the search or suite.

    Raises:
        ResultsError: The folder holds none of either, or a file is damaged.
    """
    root = Path(folder)
    inside = root / "failures" if (root / "search.json").exists() else root
    found = sorted(path.parent for path in inside.glob(f"*/{_FILE}"))
    if not found and not (root / "search.json").exists():
        raise ResultsError(f"{folder}: there are no failures")
    return [read_failure(path) for path in found]


def read_failure(folder: str | Path) -> Failure:
    """One failure.

    Raises:
        ResultsError: It is not the folder of a failure, or damaged.
    """
    path = Path(folder) / _FILE
    try:
        stored = read_json(path)
        drive = stored["drive"]
        texts = {name: str(stored[name]) for name in _TEXTS}
        scenario, is_small = str(stored.get("scenario", "")), bool(stored.get("is_small", True))
        others = {int(number): str(planner) for number, planner in drive["others"].items()}
        made = Drive(
            tuple(int(number) for number in drive["agents"]),
            int(drive["agent_id"]),
            str(drive["planner"]),
            others,
            str(drive["predictor"]),
            None if drive["sight"] is None else float(drive["sight"]),
            bool(drive.get("occluded", False)),
            {str(name): str(value) for name, value in drive.get("settings", {}).items()},
            {str(name): value for name, value in drive.get("perception", {}).items()},
        )
    except FileNotFoundError:
        raise ResultsError(f"{folder}: not the folder of a failure: there is no {_FILE}") from None
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as cause:
        raise ResultsError(f"{path}: damaged ({cause!r})") from None
    return Failure(Path(folder), made, **texts, scenario=scenario, is_small=is_small)


def begin(folder: Path, scenario: Scenario) -> Scenario:
    """Writes the disturbed scenario of a failure, and gives it back as everybody else will read it.

    What the file of the recording did not state (yaw rates, for instance) is derived again.
    """
    folder.mkdir(parents=True)
    (folder / _START).write_bytes(scenario_document(scenario))
    return _read(folder / _START)


def _read(path: Path) -> Scenario:
    """The file as it is: what the search drove was repaired before it was disturbed."""
    return read_scenario(path, raw=True)


def finish(found: Failure, run: Run, avoided: Run | None) -> None:
    """Writes the rest of the folder; `failure.json` comes last, so a folder that has it is whole."""
    from interdrive.plots import animate_run, draw_run, save_figure  # noqa: PLC0415 - matplotlib
    from interdrive.plots.view import view_of_end  # noqa: PLC0415

    folder = found.folder
    run.save(folder / "run")
    if avoided is not None:
        avoided.save(folder / "witness")
    view = view_of_end(run, found.drive.agent_id)
    save_figure(draw_run(run, view=view), folder / "failure.png")
    animate_run(run, folder / "failure.gif", fps=_FILM_RATE, view=view.shaped(*_FILM_ASPECTS))
    (folder / "run.toml").write_text(_configuration(found.drive), encoding="utf-8")
    (folder / "README.md").write_text(_words(found), encoding="utf-8")
    drive = {**vars(found.drive), "others": {str(key): value for key, value in found.drive.others.items()}}
    content = {"drive": drive, **{name: getattr(found, name) for name in (*_TEXTS, "scenario", "is_small")}}
    with replacing(folder / _FILE) as part:
        part.write_text(json_text(content, indent=2) + "\n", encoding="utf-8")


def replay(failure: Failure | str | Path, *, trust: bool = False) -> tuple[Run, bool]:
    """Repeats a failure.

    Args:
        failure: It, or its folder.
        trust: Import planners that it names as module:object.

    Returns:
        The run, and whether its digest is the stored one.

    Raises:
        InputError: It names code and is not trusted.
        ResultsError: The folder is damaged.
    """
    found = failure if isinstance(failure, Failure) else read_failure(failure)
    _require_trust(found.drive, trust=trust)
    run = found.drive.run(_read(found.scenario_path))
    return run, run.digest == found.digest


def check_failure(failure: Failure, planner: str, *, trust: bool = False) -> Verdict:
    """What a planner does in the agent's place.

    Args:
        failure: The failure.
        planner: The planner, as on the command line.
        trust: Import planners of other agents that the failure names as module:object.

    Raises:
        InputError: There is no such planner, or code is named and not trusted.
    """
    _require_trust(replace(failure.drive, planner="idm"), trust=trust)
    drive = failure.drive.by(planner)
    found = judged(drive.run(_read(failure.scenario_path)), drive.agent_id)
    return Verdict(found.failure, found.words)


def collect(source: str | Path, suite: Path) -> list[Path]:
    """Copies the failures of a search into a suite, under the name of their search and number.

    Raises:
        ResultsError: There are none, or one of the same name is in the suite.
    """
    copied = []
    root = Path(source)
    found = failures(root)
    if not found:
        raise ResultsError(f"{source}: the search found no failures")
    for one in found:
        target = suite / f"{root.resolve().name}-{one.folder.name}"
        if target.exists():
            raise ResultsError(f"{target}: exists")
        target.parent.mkdir(parents=True, exist_ok=True)
        with replacing(target) as part:
            shutil.copytree(one.folder, part)
        copied.append(target)
    return copied


def _require_trust(drive: Drive, *, trust: bool) -> None:
    code = modules_named({str(key): value for key, value in drive.planners.items()}, drive.predictor)
    if code and not trust:
        raise InputError(f"this failure names code outside interdrive ({', '.join(code)}); --trust imports it")


def _configuration(drive: Drive) -> str:
    """The drive as a file for `interdrive run --config`."""
    lines = ["[run]", f'scenario = "{_START}"', f"agents = {list(drive.agents)}", f'predictor = "{drive.predictor}"']
    for number, planner in sorted(drive.planners.items(), key=lambda item: int(item[0])):
        lines += ["", f"[agent.{number}]", *_toml(str(planner))]
    tables: dict[str, list[str]] = {}
    for name, value in sorted(drive.settings.items()):
        table, _, leaf = name.rpartition(".")
        tables.setdefault(table, []).extend(_entries([f"{leaf}={value}"]))
    for table, entries in tables.items():
        lines += ["", f"[{table}]", *entries]
    lines += ["", "[recording]", "raw = true"]
    return "\n".join(lines) + "\n"


def _toml(planner: str) -> list[str]:
    """A planner as text, as the entries of its table."""
    name, *settings = planner.split(",")
    return [f'planner = "{name}"', *_entries(settings)]


def _entries(settings: Sequence[str]) -> list[str]:
    """Settings as NAME=VALUE, as entries of a table."""
    entries = []
    for setting in settings:
        key, _, value = setting.partition("=")
        is_plain: Any = value in ("true", "false") or value.replace(".", "").replace("-", "").isdigit()
        entries.append(f"{key} = {value if is_plain else repr(value)}")
    return entries


def trust_option(found: Failure) -> str:
    """The option with which a command imports the planners that are code."""
    return " --trust" if modules_named(found.drive.planners, found.drive.predictor) else ""


def _where(found: Failure) -> str:
    """What has to be importable there."""
    named = modules_named(found.drive.planners, found.drive.predictor)
    return f" (Python has to find {', '.join(named)}: set PYTHONPATH)" if named else ""


def _words(found: Failure) -> str:
    avoided = (
        f"`{found.witness}` in its place does not fail." if found.witness else "None of the tried drivers avoids it."
    )
    return f"""# {found.failure} of agent {found.drive.agent_id} of {found.scenario}, planner `{found.drive.planner}`

{found.words}.

Different from the recording: {found.disturbance}{UNSHRUNK if not found.is_small else ""}.

{avoided}

In this folder{_where(found)}:

    interdrive search replay .{trust_option(found)}        # exit code 0 if the digest is {found.digest[:12]}...
    interdrive run --config run.toml --out again
    interdrive report run
"""
