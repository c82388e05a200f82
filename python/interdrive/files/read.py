"""Opens CommonRoad files. XML is read by the core, protobuf by commonroad-io (`protobuf`)."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import logging
import os
import re
import warnings
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from interdrive.errors import InputError, InterdriveError
from interdrive.files import document
from interdrive.files.content import content_of_input
from interdrive.files.convert import converted
from interdrive.files.elements import read_elements
from interdrive.files.encoding import text_of
from interdrive.files.facts import Facts
from interdrive.files.later import later
from interdrive.files.protobuf import PROTOBUF_ENDINGS, open_protobuf
from interdrive.files.shapes import Foreign
from interdrive.files.shipped import scenario_file
from interdrive.files.sources import SourceFile, recognised, scenario_of
from interdrive.files.sumo_folder import is_sumo_folder, read_sumo_folder
from interdrive.recordings import joined, part_of, repaired, with_own_overlaps
from interdrive.scenario import OptionValue, Scenario, SourceOptions
from interdrive.scenario.limits import require_scenario

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from commonroad.planning.planning_problem import PlanningProblem, PlanningProblemSet
    from commonroad.scenario.scenario import Scenario as CommonRoadScenario

#: A scenario: a `Scenario`, the path of a CommonRoad file, the name of a shipped scenario, or an object of
#: commonroad-io, alone or as a pair with its planning problems or one of them.
ScenarioSpec: TypeAlias = (
    "Scenario | str | os.PathLike[str] | CommonRoadScenario "
    "| tuple[CommonRoadScenario, PlanningProblemSet | PlanningProblem]"
)

#: Letters of a message about a source.
_LONGEST = 500


def read_scenario(path: str | os.PathLike[str], *, raw: bool = False) -> Scenario:
    """Reads a CommonRoad file as arrays: roads, recorded traffic, planning problems.

    It reads XML of the versions 2018b and 2020a and the protobuf files of the installed commonroad-io: up to 2024.3 one
    `.pb` file; from 2026.1 on three of them, found by name beside the given one: `X.pb` (traffic), `X-SC.pb` (planning
    problems, may be absent) and the map, named by the leading part of `X` (`DEU_Muc-1` for `DEU_Muc-1_2_T-1`).

    Values that a recording does not state are derived from its positions, see `Obstacles`. An obstacle with a set-based
    prediction or none at all is present at its initial time step only. Uncertain states are replaced by their middle.
    Environment obstacles such as buildings become static obstacles; phantom obstacles are left out. `Scenario.notes`
    lists these cases with the ids of the obstacles.

    Recordings are repaired: headings that are off by one angle are turned, and `Scenario.overlaps` lists participants
    that overlap (see `interdrive.recordings`).

    Args:
        path: The file.
        raw: Read recordings without repairs.

    Returns:
        The scenario; `path` and `sha256` are set.

    Raises:
        InputError: The file cannot be used; one line names it and says what to do.
    """
    path = Path(path)
    if path.suffix.lower() not in PROTOBUF_ENDINGS:
        return _read_any(path, SourceOptions(), raw=raw)
    data = _bytes(path)
    file, sha256 = str(path), hashlib.sha256(data).hexdigest()
    with quiet(file) as remarks:
        scenario, problems, lacking = open_protobuf(path, data)
        facts = Facts(notes=lacking)
        result = converted(scenario, _by_id(problems), file=file, path=path, sha256=sha256, facts=facts)
    return _repaired(_with_remarks(result, remarks), raw=raw)


def read_source(path: str | os.PathLike[str], *, raw: bool = False, **options: OptionValue) -> Scenario:
    """Reads a map or a recording of another tool as a scenario; CommonRoad files as `read_scenario` does.

    Args:
        path: The file or folder; its format is recognised by its content, never by its name.
        raw: Read recordings without repairs, as in `read_scenario`.
        options: `SourceOptions` by name, as texts or values: `dt=0.1`, `keep=["bus"]`, `map="town.xodr"`.

    Returns:
        The scenario; `source` names format, files and options, `notes` count what was left out.

    Raises:
        InputError: It cannot be read; one line names it and says what to do.
    """
    return _read_any(Path(path), SourceOptions.read(options), raw=raw)


def is_source(path: Path) -> bool:
    """Whether a file or folder is a map, a recording or a scenario of another tool."""
    try:
        return is_sumo_folder(path) or recognised(SourceFile(path)) is not None
    except (InputError, OSError):
        return False


def _read_any(path: Path, options: SourceOptions, *, raw: bool) -> Scenario:
    if is_sumo_folder(path):
        return read_sumo_folder(path, functools.partial(read_document, raw=raw))
    file = SourceFile(path)
    found = recognised(file)
    if found is not None:
        try:
            with quiet(str(path)):
                read_map = functools.partial(_read_any, raw=True)
                return _repaired(scenario_of(file, found, options, read_map), raw=raw)
        except InputError as error:  # it may quote what is in the file
            text = str(error)
            raise InputError(text if len(text) <= _LONGEST else f"{text[:_LONGEST]} ...") from error.__cause__
    if file.is_folder:
        raise InputError(
            f"{path}: is a folder; it holds no Argoverse 2 scenario (scenario_*.parquet and log_map_archive_*.json)"
            " and no tracks that are known: give a file in it"
        )
    scenario = read_document(file.data, str(path), path, raw=raw)
    return dataclasses.replace(scenario, sha256=file.files[0][1])


def read_document(data: bytes, file: str, path: Path | None = None, *, raw: bool = False) -> Scenario:
    """The same for the contents of an XML file.

    Args:
        data: The document.
        file: Its name in messages.
        path: Where it lies; None: in memory only.
        raw: Leave recordings as the document has them.
    """
    sha256 = "" if path is None else hashlib.sha256(data).hexdigest()
    if not data.strip():
        raise InputError(f"{file}: the file is empty; give a CommonRoad file")
    with quiet(file):
        try:
            found = read_elements(text_of(data, file), file)
        except SyntaxError as error:
            document.parse(data, file)  # says more of what is wrong
            raise InputError(f"{file}: broken XML ({error}); correct the file there") from None
        result = converted(found, found.problems, file=file, path=path, sha256=sha256, facts=found.facts)
    return _repaired(result, raw=raw)


def scenario_from_commonroad(
    scenario: CommonRoadScenario,
    planning_problems: PlanningProblemSet | PlanningProblem | None = None,
    *,
    raw: bool = False,
) -> Scenario:
    """Converts a scenario that was loaded by commonroad-io, or built with its classes, to arrays.

    Args:
        scenario: `commonroad.scenario.scenario.Scenario`. It is not changed.
        planning_problems: Its planning problems, or one of them.
        raw: Convert recordings without repairs, as in `read_scenario`.

    Returns:
        The scenario; `path` is None. commonroad-io sets values that are missing in the initial state of a file to 0, so
        they count as stated here; use `read_scenario` to have them derived.

    Raises:
        InputError: The objects cannot be used; one line states why.
    """
    file = f"scenario {getattr(scenario, 'scenario_id', '')}".strip()
    if not (hasattr(scenario, "lanelet_network") and hasattr(scenario, "dynamic_obstacles")):
        raise InputError(f"{type(scenario).__name__} is not a commonroad.scenario.scenario.Scenario")
    problems = _by_id(planning_problems)
    with quiet(file) as remarks:
        facts = Facts()
        result = converted(scenario, problems, file=file, path=None, sha256="", facts=facts)
    return _repaired(_with_remarks(result, remarks), raw=raw)


def _repaired(scenario: Scenario, *, raw: bool) -> Scenario:
    return dataclasses.replace(scenario, raw=True) if raw else repaired(scenario)


def _by_id(problems: Foreign) -> Mapping[int, Foreign]:
    """Planning problems of commonroad-io by id, from a set, from one, or from None."""
    if problems is None:
        return {}
    if hasattr(problems, "planning_problem_id"):
        return {problems.planning_problem_id: problems}
    if not hasattr(problems, "planning_problem_dict"):
        raise InputError(f"{type(problems).__name__} is neither a PlanningProblemSet nor a PlanningProblem")
    found: Mapping[int, Foreign] = problems.planning_problem_dict
    return found


def _bytes(path: Path) -> bytes:
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give a CommonRoad file in it")
    return content_of_input(path)


@contextmanager
def quiet(file: str) -> Iterator[list[str]]:
    """Collects log messages and warnings of commonroad-io, and turns its exceptions into one `InputError`."""
    remarks: list[str] = []

    class Collector(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            remarks.append(record.getMessage())

    logger = logging.getLogger("commonroad")
    collector = Collector(logging.WARNING)
    propagate = logger.propagate
    logger.propagate = False
    logger.addHandler(collector)
    try:
        with warnings.catch_warnings(record=True) as caught, np.errstate(all="ignore"):
            warnings.simplefilter("always")
            yield remarks
        remarks += [str(one.message) for one in caught if not issubclass(one.category, DeprecationWarning)]
    except InterdriveError as error:
        if str(error).isprintable():
            raise
        # Messages quote text of the document, which is arbitrary.
        raise type(error)("".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in str(error))) from None
    except Exception as error:
        place = _place(error)
        advice = "correct that element" if place else "correct the file"
        raise InputError(f"{file}: cannot be read{place} ({_reason(error)}); {advice}") from error
    finally:
        logger.removeHandler(collector)
        logger.propagate = propagate


#: Messages of Python about values, and what they mean to the author of a file.
_MEANINGS = (
    (re.compile(r"could not convert string to float: ('.*')"), r"\1 is not a number"),
    (re.compile(r"invalid literal for int\(\) with base 10: ('.*')"), r"\1 is not a whole number"),
    (re.compile(r"cannot convert float .* to integer"), "a number is not finite"),
    (re.compile(r"None is not a valid (\w+)"), r"the \1 is missing"),
    (re.compile(r"(.*) is not a valid (\w+)"), r"\1 is no \2"),
)
#: Words that only a programmer knows, and no message of commonroad-io about a file has.
_INTERNAL = re.compile(
    r"None|<(class|enum) |\w\(\)|object has no|out of range|not subscriptable|reshape|\['|field error"
)


def _reason(error: Exception) -> str:
    """What is wrong in the words of a file, without names of classes and functions of Python and commonroad-io."""
    text = re.sub(r"^<[^<>]*>:? *", "", " ".join(str(error).split()))[:200]
    for pattern, meaning in _MEANINGS:
        found = pattern.fullmatch(text)
        if found:
            words = re.sub(r"(?<=[a-z])([A-Z])", lambda letter: f" {letter[1].lower()}", found[found.lastindex or 0])
            return found.expand(meaning).replace(found[found.lastindex or 0], words[:1].lower() + words[1:])
    if isinstance(error, KeyError):
        return f"{text} is not known" if text.isdigit() else "a part of it is missing or not known"
    stated = isinstance(error, AssertionError | ValueError | Warning)
    return (
        text if text and stated and not _INTERNAL.search(text) else "a part of it is missing, empty or of a wrong kind"
    )


def _place(error: Exception) -> str:
    """The element of a message that commonroad-io was reading: a local variable whose name ends with `_msg`."""
    owner = ""
    trace = error.__traceback__
    while trace is not None:
        for name, value in trace.tb_frame.f_locals.items():
            kind = name.removesuffix("_msg")
            if kind != name and isinstance(getattr(value, f"{kind}_id", None), int):
                owner = f" at {kind.replace('_', ' ')} {getattr(value, f'{kind}_id')}"
        trace = trace.tb_next
    return owner


def _with_remarks(scenario: Scenario, remarks: list[str]) -> Scenario:
    """Adds one line per kind of remark, without those about its own old formats."""
    kinds: dict[str, list[str]] = {}
    for remark in remarks:
        text = " ".join(remark.split())[:200]
        if "deprecated" not in text and "After 2020a format" not in text:
            kinds.setdefault(re.sub(r"\d+", "#", text), []).append(text)
    lines = (texts[0] + (f" ({len(texts)} like this)" if len(texts) > 1 else "") for texts in kinds.values())
    return dataclasses.replace(scenario, notes=(*scenario.notes, *(f"commonroad-io: {line}" for line in lines)))


def open_scenario(
    spec: ScenarioSpec, *, raw: bool = False, start: int = 0, source: SourceOptions | None = None
) -> Scenario:
    """The scenario that a specification means.

    Args:
        spec: The specification.
        raw: Leave recordings as they are; a scenario that was read before stays as it is.
        start: Time step of the recording that is to be the first one; a scenario that begins there stays as it is.
        source: How files of other tools are read.

    Raises:
        InputError: There is no such file or scenario, or it cannot be used; one line that says why.
    """
    found = _opened(spec, raw=raw, source=source)
    return found if start in (0, found.start) else later(found, start)


def _opened(spec: ScenarioSpec, *, raw: bool, source: SourceOptions | None) -> Scenario:
    if isinstance(spec, Scenario):
        require_scenario(spec, spec.name)
        if raw and spec.path is not None and not spec.raw:
            raise InputError(f"{spec.name}: was read with repaired recordings; use read_scenario(path, raw=True)")
        return spec
    if isinstance(spec, str | os.PathLike):
        path = scenario_file(spec)
        if path.suffix.lower() in PROTOBUF_ENDINGS:
            return read_scenario(path, raw=raw)
        return _read_any(path, source or SourceOptions(), raw=raw)
    if isinstance(spec, tuple):
        return scenario_from_commonroad(*spec, raw=raw)
    return scenario_from_commonroad(spec, raw=raw)


def join(
    paths: Sequence[str | os.PathLike[str]], *, raw: bool = False, first: int | None = None, last: int | None = None
) -> Scenario:
    """Joins consecutive recordings, such as windows of one long recording.

    Participants with the same id, kind and size continue in the next recording. Planning problems are left out. See
    `interdrive.recordings.joined`.

    Args:
        paths: At least two CommonRoad files, in any order.
        raw: Read recordings without repairs.
        first: First time step of the part that is wanted; None: that of the whole.
        last: Last time step of that part; None: that of the whole.

    Returns:
        The scenario, without path; its time steps follow the names of the files, or begin at 0. Those of a part begin
        at 0; it has the participants that are there in its time.

    Raises:
        InputError: A file cannot be read, the recordings do not belong together, or the whole has no such part; one
            line that says why.
    """
    if isinstance(paths, str | os.PathLike):
        raise InputError("join: give a list of files")
    whole = joined([read_scenario(path, raw=True) for path in paths], raw=raw)
    if first is None and last is None:
        return whole
    known = np.flatnonzero(whole.obstacles.valid.any(axis=0))
    begins, ends = int(known.min(initial=whole.obstacles.n_steps)), int(known.max(initial=0))
    start, end = begins if first is None else first, ends if last is None else last
    if not begins <= start < end <= ends:
        raise InputError(f"join: no part from time step {start} to {end}; the whole has {begins} to {ends}")
    part = with_own_overlaps(part_of(whole, start, end + 1))
    name = whole.name.removesuffix(f"_{whole.name.split('_')[-2]}_T-{ends}") + f"_{start}_T-{end}"
    said = f"time steps {start} to {end} of the whole, which has {begins} to {ends}: they are 0 to {end - start} here"
    return dataclasses.replace(part, name=name, benchmark_id=name, notes=(*part.notes, said))
