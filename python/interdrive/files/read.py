"""Opens CommonRoad files. Only this module, convert.py and write.py of this package import commonroad-io."""

from __future__ import annotations

import dataclasses
import hashlib
import logging
import os
import re
import warnings
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias
from xml.etree.ElementTree import Element

import numpy as np

from interdrive.errors import InputError, InterdriveError
from interdrive.files import document
from interdrive.files.content import content_of_file, content_of_input
from interdrive.files.convert import converted
from interdrive.files.numbers import check_message
from interdrive.files.shapes import Foreign
from interdrive.files.shipped import scenario_file
from interdrive.scenario import Scenario
from interdrive.scenario.limits import require_scenario

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from commonroad.planning.planning_problem import PlanningProblem, PlanningProblemSet
    from commonroad.scenario.scenario import Scenario as CommonRoadScenario

#: A scenario: one that was read, the path of a CommonRoad file, the name of a shipped scenario, or an object of
#: commonroad-io, alone or as a pair with its planning problems or one of them.
ScenarioSpec: TypeAlias = (
    "Scenario | str | os.PathLike[str] | CommonRoadScenario "
    "| tuple[CommonRoadScenario, PlanningProblemSet | PlanningProblem]"
)

#: Endings of protobuf files; all other files are read as XML.
PROTOBUF_ENDINGS = (".pb", ".proto", ".protobuf")


def read_scenario(path: str | os.PathLike[str]) -> Scenario:
    """Reads a CommonRoad file as arrays: roads, recorded traffic, planning problems.

    It reads XML of the versions 2018b and 2020a and the protobuf files of the installed commonroad-io: up to 2024.3 one
    `.pb` file; from 2026.1 on three of them, found by name beside the given one: `X.pb` (traffic), `X-SC.pb` (planning
    problems, may be absent) and the map, named by the leading part of `X` (`DEU_Muc-1` for `DEU_Muc-1_2_T-1`).

    Values that a recording does not state are derived from its positions, see `Obstacles`. An obstacle with a set-based
    prediction or none at all is present at its initial time step only. Uncertain states are replaced by their middle.
    Phantom and environment obstacles are left out. `Scenario.notes` lists these cases with the ids of the obstacles.

    Args:
        path: The file.

    Returns:
        The scenario; `path` and `sha256` are set.

    Raises:
        InputError: The file cannot be used; one line names it and says what to do.
    """
    path = Path(path)
    file = str(path)
    data = _bytes(path)
    sha256 = hashlib.sha256(data).hexdigest()
    with quiet(file) as remarks:
        if path.suffix.lower() in PROTOBUF_ENDINGS:
            scenario, problems = open_protobuf(path, data)
            facts = document.Facts()
        else:
            root = document.parse(data, file)
            document.check(root, file)
            facts = document.facts(root, file)
            scenario, problems = _open_xml(root, data)
        result = converted(scenario, _by_id(problems), file=file, path=path, sha256=sha256, facts=facts)
    return _with_remarks(result, remarks)


def scenario_from_commonroad(
    scenario: CommonRoadScenario, planning_problems: PlanningProblemSet | PlanningProblem | None = None
) -> Scenario:
    """Converts a scenario that was loaded by commonroad-io, or built with its classes, to arrays.

    Args:
        scenario: `commonroad.scenario.scenario.Scenario`. It is not changed.
        planning_problems: Its planning problems, or one of them.

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
        facts = document.Facts()
        result = converted(scenario, problems, file=file, path=None, sha256="", facts=facts)
    return _with_remarks(result, remarks)


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


def _open_xml(root: Element, data: bytes) -> tuple[Foreign, Foreign]:
    from commonroad.common.reader.file_reader_xml import XMLFileReader  # noqa: PLC0415 - a fifth of a second

    class Reader(XMLFileReader):  # type: ignore[misc] # commonroad-io has no types
        """Reads the checked document, so that it is not parsed twice."""

        def _parse_file(self) -> None:
            self._tree = document.tree(root)

    opened: tuple[Foreign, Foreign] = Reader(data).open(lanelet_assignment=False)
    return opened


def open_protobuf(path: Path, data: bytes) -> tuple[Foreign, Foreign]:
    """Opens protobuf as scenario and planning problem set of commonroad-io, in the format of its version."""
    try:
        from commonroad.common.file_reader import FileFormat  # noqa: PLC0415
    except ImportError:
        return _open_protobuf_parts(path)
    from commonroad.common.file_reader import CommonRoadFileReader  # noqa: PLC0415
    from commonroad.scenario_definition.protobuf_format.generated_scripts.commonroad_pb2 import (  # noqa: PLC0415
        CommonRoad,
    )

    _check_angles(CommonRoad(), data, path)
    opened: tuple[Foreign, Foreign] = CommonRoadFileReader(data, file_format=FileFormat.PROTOBUF).open()
    return opened


def _open_protobuf_parts(path: Path) -> tuple[Foreign, Foreign]:
    """The same for commonroad-io from 2026.1 on, with separate files for map, traffic and planning problems."""
    from commonroad.common.file_reader import CommonRoadFileReader  # noqa: PLC0415

    traffic, problems, roads = _protobuf_parts(path)
    for part, meaning in ((traffic, "traffic"), (roads, "map")):
        if not part.is_file():
            raise InputError(f"{path}: the {meaning} file {part.name} is not beside it; put it there or convert to XML")
    from commonroad.common.protobuf.dynamic.commonroad_dynamic_pb2 import CommonRoadDynamic  # noqa: PLC0415
    from commonroad.common.protobuf.map.commonroad_map_pb2 import CommonRoadMap  # noqa: PLC0415
    from commonroad.common.protobuf.scenario.commonroad_scenario_pb2 import CommonRoadScenario  # noqa: PLC0415

    parts = ((traffic, CommonRoadDynamic()), (roads, CommonRoadMap()), (problems, CommonRoadScenario()))
    for part, message in parts:
        if part.is_file():
            _check_angles(message, content_of_file(part), part)
    reader = CommonRoadFileReader(filename_map=roads, filename_dynamic=traffic, filename_scenario=problems)
    if problems.is_file():
        scenario, problem_set, _cooperative = reader.open_all()
        return scenario, problem_set
    return reader.open_map_dynamic(), None


def _check_angles(message: Foreign, data: bytes, path: Path) -> None:
    message.ParseFromString(data)
    check_message(message, str(path))


def _protobuf_parts(path: Path) -> tuple[Path, Path, Path]:
    """The expected paths of traffic, planning problems and map of a protobuf file."""
    name = path.stem.removesuffix("-SC")
    return (
        path.with_name(name + path.suffix),
        path.with_name(f"{name}-SC{path.suffix}"),
        path.with_name("_".join(name.split("_")[:2]) + path.suffix),
    )


def scenario_parts(path: str | os.PathLike[str]) -> tuple[Path, ...]:
    """The files beside `path` that `read_scenario` may open with it, in a fixed order; XML files have none."""
    path = Path(path)
    if path.suffix.lower() not in PROTOBUF_ENDINGS:
        return ()
    return tuple(part for part in _protobuf_parts(path) if part != path and part.is_file())


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


def _reason(error: Exception) -> str:
    """The message of commonroad-io without the names of its classes and functions."""
    text = re.sub(r"^<[^<>]*>:? *", "", " ".join(str(error).split()))[:200]
    if text and isinstance(error, AssertionError):
        return text
    return f"{type(error).__name__}: {text or 'no reason given'}"


def _place(error: Exception) -> str:
    """The element that commonroad-io was reading, which its messages do not name: the local variable `xml_node`."""
    owner = inner = ""
    trace = error.__traceback__
    while trace is not None:
        node = trace.tb_frame.f_locals.get("xml_node")
        if isinstance(node, Element):
            number = node.get("id")
            owner, inner = (f" of {node.tag} {number}", "") if number else (owner, node.tag)
        trace = trace.tb_next
    if inner and inner != "commonRoad":
        return f" at <{inner}>{owner}"
    return owner.replace(" of ", " at ", 1)


def _with_remarks(scenario: Scenario, remarks: list[str]) -> Scenario:
    """Adds one line per kind of remark, without those about its own old formats."""
    kinds: dict[str, list[str]] = {}
    for remark in remarks:
        text = " ".join(remark.split())[:200]
        if "deprecated" not in text and "After 2020a format" not in text:
            kinds.setdefault(re.sub(r"\d+", "#", text), []).append(text)
    lines = (texts[0] + (f" ({len(texts)} like this)" if len(texts) > 1 else "") for texts in kinds.values())
    return dataclasses.replace(scenario, notes=(*scenario.notes, *(f"commonroad-io: {line}" for line in lines)))


def open_scenario(spec: ScenarioSpec) -> Scenario:
    """The scenario that a specification means.

    Raises:
        InputError: There is no such file or scenario, or it cannot be used; one line that says why.
    """
    if isinstance(spec, Scenario):
        require_scenario(spec, spec.name)
        return spec
    if isinstance(spec, str | os.PathLike):
        return read_scenario(scenario_file(spec))
    if isinstance(spec, tuple):
        return scenario_from_commonroad(*spec)
    return scenario_from_commonroad(spec)
