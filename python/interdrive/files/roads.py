"""The road part of a CommonRoad 2020a document: from the scenario's file if available, otherwise from the arrays."""

from __future__ import annotations

import hashlib
import re
import tempfile
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement, fromstring, tostring

from interdrive.errors import InputError
from interdrive.files import document
from interdrive.files.content import content_of_file
from interdrive.files.network import add_speed_signs, network_document, taken_ids
from interdrive.files.protobuf import PROTOBUF_ENDINGS, open_protobuf
from interdrive.files.read import quiet, read_scenario

if TYPE_CHECKING:
    from interdrive.scenario import Scenario

ROAD_TAGS = ("lanelet", "trafficSign", "trafficLight", "intersection")
_TRAFFIC_TAGS = ("dynamicObstacle", "staticObstacle", "obstacle", "planningProblem")
UNKNOWN_LOCATION = (
    "<location><geoNameId>-999</geoNameId><gpsLatitude>999</gpsLatitude><gpsLongitude>999</gpsLongitude></location>"
)
#: Date of scenarios without one; never the present date, so that equal runs give equal bytes.
NO_DATE = "1970-01-01"
_DATE = re.compile(r"\d{4}-\d{2}-\d{2}")
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]*")


@dataclass(frozen=True)
class Header:
    """Metadata of a document.

    Attributes:
        author: As in the original. affiliation: The same. source: The same. date: The same.
        location: The `location` element as text.
        tags: Names of the scenario tags, without "simulated".
    """

    author: str = "interdrive"
    affiliation: str = ""
    source: str = ""
    date: str = NO_DATE
    location: str = UNKNOWN_LOCATION
    tags: tuple[str, ...] = ()


def road_elements(scenario: Scenario) -> tuple[Header, list[str], set[int]]:
    """Header and road part of a document for a scenario.

    Args:
        scenario: The scenario; its file is read again if it is still there and unchanged.

    Returns:
        The header, the elements of the road (lanelets, signs, lights, intersections, in the order of the format) as
        text, and the ids that they use.
    """
    root = None if scenario.source is not None else _original(scenario)
    if root is None:
        root = network_document(scenario)
    elif root.get("commonRoadVersion") == "2018b":
        _modernise(root, taken_ids(root, scenario))
    _set_cycles(root, scenario)
    elements = [element for tag in ROAD_TAGS for element in root.iterfind(tag)]
    ids = {int(element.get("id", "0")) for element in elements}
    ids |= {int(incoming.get("id", "0")) for incoming in root.iterfind("intersection/incoming")}
    return _header_of(scenario, root), [_text(element) for element in elements], ids


def _set_cycles(root: Element, scenario: Scenario) -> None:
    """Cycles of traffic lights begin when those of the scenario do, which may have other time steps than its file."""
    begins = {light.id: light.offset for light in scenario.traffic_lights}
    for light in root.iterfind("trafficLight"):
        cycle, begin = light.find("cycle"), begins.get(int(light.get("id", "0")))
        if cycle is None or begin is None or int(cycle.findtext("timeOffset", "0")) == begin:
            continue
        offset = cycle.find("timeOffset")
        if offset is None:
            offset = SubElement(cycle, "timeOffset")
        offset.text = str(begin)


def _text(element: Element) -> str:
    """An element as text without the white space between its children, which would be most of the file."""
    for inner in element.iter():
        inner.tail = None
        if len(inner) and not (inner.text or "").strip():
            inner.text = None
    return tostring(element, encoding="unicode")


def _header_of(scenario: Scenario, root: Element) -> Header:
    header, source = _header(root), scenario.source
    if source is None:
        return header
    files = ", ".join(name for name, _ in source.files)
    header = replace(header, source=f"{source.format} {files}")
    if not source.location:
        return header
    location = fromstring(UNKNOWN_LOCATION)
    SubElement(SubElement(location, "geoTransformation"), "geoReference").text = source.location
    return replace(header, location=_text(location))


def _header(root: Element) -> Header:
    tags = root.find("scenarioTags")
    names = root.get("tags", "").split() if tags is None or len(tags) == 0 else [tag.tag for tag in tags]
    date = root.get("date", "")
    location = root.find("location")
    header = Header(
        author=root.get("author", "") or "interdrive",
        affiliation=root.get("affiliation", ""),
        source=root.get("source", ""),
        date=date if _DATE.fullmatch(date) else NO_DATE,
        tags=tuple(name for name in names if name != "simulated" and _NAME.fullmatch(name)),
    )
    if location is None or not _is_location(location):
        return header
    return replace(header, location=_text(deepcopy(location)))


def _is_location(element: Element) -> bool:
    """Whether it has the parts required by 2020a; those of 2018b differ."""
    try:
        int(element.findtext("geoNameId", ""))
        float(element.findtext("gpsLatitude", ""))
        float(element.findtext("gpsLongitude", ""))
    except ValueError:
        return False
    return True


def _original(scenario: Scenario) -> Element | None:
    """Root element of the scenario's file, or None if it is missing, has changed, or there never was one."""
    if scenario.path is None:
        return None
    try:
        data = content_of_file(scenario.path)
        if hashlib.sha256(data).hexdigest() != scenario.sha256:
            return None
        if scenario.path.suffix.lower() in PROTOBUF_ENDINGS:
            data = _xml_from_protobuf(scenario.path, data)
        root = document.parse(data, str(scenario.path), but=_TRAFFIC_TAGS)
        document.drop_dangling_relations(root)
    except (OSError, InputError):
        return None
    return root


def _xml_from_protobuf(path: Path, data: bytes) -> bytes:
    """The roads of a protobuf file as XML.

    Raises:
        InputError: commonroad-io cannot read its own output, for instance a traffic light without a cycle.
    """
    from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile  # noqa: PLC0415
    from commonroad.common.util import FileFormat  # noqa: PLC0415
    from commonroad.planning.planning_problem import PlanningProblemSet  # noqa: PLC0415

    with quiet(str(path)), tempfile.TemporaryDirectory() as folder:
        scenario, _problems, _notes = open_protobuf(path, data)
        target = Path(folder) / "roads.xml"
        writer = CommonRoadFileWriter(
            scenario, PlanningProblemSet(), "", "", "", set(), decimal_precision=8, file_format=FileFormat.XML
        )
        writer.write_to_file(str(target), OverwriteExistingFile.SKIP)
        read_scenario(target)
        return target.read_bytes()


def _modernise(root: Element, taken: set[int]) -> None:
    """Converts lanelets of 2018b to 2020a: limits become signs (whose ids are not `taken`), each lanelet has a type."""
    limits = {}
    for lanelet in root.iterfind("lanelet"):
        limit = lanelet.find("speedLimit")
        if limit is not None:
            lanelet.remove(limit)
            limits[int(lanelet.get("id", "0"))] = float(limit.text or "nan")
        if lanelet.find("laneletType") is None:
            SubElement(lanelet, "laneletType").text = "unknown"
    add_speed_signs(root, limits, taken)
