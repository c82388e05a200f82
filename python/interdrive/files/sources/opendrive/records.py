"""What an OpenDRIVE document says of roads, as records; a road that cannot be used is left out with a note."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from interdrive.errors import InputError
from interdrive.files.sources.opendrive.curves import Piece, Profile, ReferenceLine, is_unordered, shape_of

if TYPE_CHECKING:
    from collections.abc import Container, Sequence
    from xml.etree.ElementTree import Element

    from interdrive.files.sources.notes import Notes

#: Numbers beyond this are no measures of roads.
_LARGEST = 1e9
#: A longer road is left out [m].
_LONGEST = 1e5
_FORMS = ("line", "arc", "spiral", "poly3", "paramPoly3")
_NOTHING = Profile(())
_UNITS = {"": 1.0, "m/s": 1.0, "km/h": 1 / 3.6, "kmh": 1 / 3.6, "mph": 0.44704}


class UnusableError(ValueError):
    """A number or attribute without which a road cannot be used; the text says which."""


@dataclass
class LaneRecord:
    """A lane of a section.

    Attributes:
        number: Its id: positive on the left of the reference line, negative on the right, 0 for the line itself.
        kind: Its type.
        direction: The attribute of that name, "standard" unless it is stated.
        width: By the distance from the start of the section [m]; without records `border` counts.
        border: Distance of the outer border from the lane offset [m].
        predecessors: Ids of lanes before it, along s.
        successors: Ids of lanes after it.
        speeds: Where each of its limits begins in the section [m], and the limit [m/s], nan for none.
        marks: Where each of its lines begins in the section [m], its type and weight.
    """

    number: int
    kind: str
    direction: str
    width: Profile
    border: Profile
    predecessors: tuple[int, ...]
    successors: tuple[int, ...]
    speeds: tuple[tuple[float, float], ...]
    marks: tuple[tuple[float, str, str], ...]


@dataclass
class Section:
    """A lane section: its start and end along the road [m], and its lanes from left to right, the line among them."""

    start: float
    end: float
    lanes: list[LaneRecord]

    def lane(self, number: int) -> LaneRecord | None:
        """The lane with that id."""
        return next((lane for lane in self.lanes if lane.number == number), None)


@dataclass
class RoadLink:
    """What a road is linked to at one end: an element of a type, and the end of it that is met."""

    kind: str
    element: str
    contact: str


@dataclass
class Road:
    """A road."""

    name: str
    length: float
    left_hand: bool
    junction: str
    line: ReferenceLine
    offset: Profile
    superelevation: Profile
    sections: list[Section]
    speeds: tuple[tuple[float, float], ...]
    kinds: tuple[tuple[float, str], ...]
    links: dict[str, RoadLink] = field(default_factory=dict)

    def is_forward(self, lane: LaneRecord) -> bool:
        """Whether a lane is driven along s."""
        return ((lane.number < 0) != self.left_hand) != (lane.direction == "reversed")


def roads_of(root: Element, kinds: Container[str], file: str, notes: Notes) -> dict[str, Road]:
    """Roads by id, in the order of the document.

    Args:
        root: The document.
        kinds: Types of the lanes that are read; widths of lanes outside of them are not.
        file: Its name in messages.
        notes: On roads that are left out.

    Raises:
        InputError: Two roads have the same id.
    """
    found: dict[str, Road] = {}
    for element in root.iterfind("road"):
        name = element.get("id", "")
        if name in found:
            raise InputError(f"{file}: two roads have the id {name}; give each its own")
        try:
            found[name] = _road(element, kinds, notes)
        except UnusableError as error:
            notes.name(f"roads left out, {error}", name or "(without id)")
    return found


def number_of(element: Element, name: str, usual: float | None = None) -> float:
    """An attribute as a number; if it is not stated the usual one.

    Raises:
        UnusableError: It is not stated and needed, or no number of any use.
    """
    text = element.get(name)
    if text is None or not text.strip():
        if usual is None:
            raise UnusableError(f"<{element.tag}> without {name}")
        return usual
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not abs(number) <= _LARGEST:
        raise UnusableError(f"{name} of <{element.tag}> is no possible number")
    return number


def _road(element: Element, kinds: Container[str], notes: Notes) -> Road:
    name = element.get("id")
    if name is None:
        raise UnusableError("without id")
    length = number_of(element, "length")
    if not 0.0 <= length <= _LONGEST:
        raise UnusableError("longer than 100 km" if length > 0.0 else "of negative length")
    pieces = [_piece(one, name, notes) for one in element.iterfind("planView/geometry")]
    if not pieces:
        raise UnusableError("without geometry")
    sections = _sections(element, length, name, kinds, notes)
    if not sections:
        raise UnusableError("without lanes")
    if is_unordered([piece.s for piece in pieces]) or is_unordered([section.start for section in sections]):
        notes.name("records that were not in order are sorted, roads", name)
    types = [(number_of(one, "s", 0.0), one) for one in element.iterfind("type")]
    road = Road(
        name,
        length,
        left_hand=element.get("rule", "").upper() == "LHT",
        junction="" if element.get("junction", "-1") == "-1" else element.get("junction", ""),
        line=ReferenceLine(pieces),
        offset=_profile(element.findall("lanes/laneOffset"), name, notes, "s"),
        superelevation=_profile(element.findall("lateralProfile/superelevation"), name, notes, "s"),
        sections=sections,
        speeds=tuple(sorted((s, speed_of(one.find("speed"))) for s, one in types)),
        kinds=tuple(sorted((s, one.get("type", "")) for s, one in types)),
    )
    for which in ("predecessor", "successor"):
        link = element.find(f"link/{which}")
        if link is not None:
            road.links[which] = RoadLink(
                link.get("elementType", ""), link.get("elementId", ""), link.get("contactPoint", "")
            )
    return road


def _piece(element: Element, road: str, notes: Notes) -> Piece:
    s, x, y, heading, length = (number_of(element, name) for name in ("s", "x", "y", "hdg", "length"))
    form = next((child for child in element if child.tag in _FORMS), None)
    if form is None:
        notes.name("geometries of unknown form are lines, roads", road)
        return Piece(s, x, y, heading)
    curvature, shape = shape_of(
        form.tag,
        lambda name: number_of(form, name, 0.0),
        length,
        by_arc_length=form.get("pRange") == "arcLength",
    )
    return Piece(s, x, y, heading, curvature, shape)


def _profile(elements: Sequence[Element], road: str, notes: Notes, start: str) -> Profile:
    if not elements:
        return _NOTHING
    names = (start, "a", "b", "c", "d")
    try:  # the common case: there are thousands
        records = [tuple([float(one.attrib[name]) for name in names]) for one in elements]
        is_usable = all(abs(number) <= _LARGEST for record in records for number in record)
    except (KeyError, ValueError):
        is_usable = False
    if not is_usable:
        records = [tuple([number_of(one, name, 0.0) for name in names]) for one in elements]
    if len(records) > 1 and is_unordered([record[0] for record in records]):
        notes.name("records that were not in order are sorted, roads", road)
    return Profile(records)


def _sections(element: Element, length: float, road: str, kinds: Container[str], notes: Notes) -> list[Section]:
    stated = sorted(
        ((number_of(one, "s"), one) for one in element.iterfind("lanes/laneSection")), key=lambda pair: pair[0]
    )
    ends = [s for s, _ in stated[1:]] + [length]
    sections = []
    for (start, one), end in zip(stated, ends, strict=True):
        elements = [
            (_lane_number(lane), lane) for side in ("left", "center", "right") for lane in one.iterfind(f"{side}/lane")
        ]
        read = [number for number, lane in elements if lane.get("type") in kinds]
        # What lies outside of all lanes that are read does not matter.
        needed = range(min((0, *read)), max((0, *read)) + 1)
        lanes: dict[int, LaneRecord] = {}
        for number, lane in elements:
            if number in lanes:
                notes.name("a lane id occurs twice in a section, the first counts, roads", road)
            else:
                lanes[number] = _lane(lane, road, notes, is_needed=number in needed)
        sections.append(
            Section(start, max(start, min(end, length)), [lanes[key] for key in sorted(lanes, reverse=True)])
        )
    return sections


def _lane(element: Element, road: str, notes: Notes, *, is_needed: bool) -> LaneRecord:
    parts: dict[str, list[Element]] = {"width": [], "border": [], "link": [], "speed": [], "roadMark": []}
    for child in element:
        if child.tag in parts:
            parts[child.tag].append(child)
    width, border = _NOTHING, _NOTHING
    if is_needed:
        width = _profile(parts["width"], road, notes, "sOffset")
        border = _profile(parts["border"], road, notes, "sOffset")
        if width and border:
            notes.name("lanes with width and border: the width counts, roads", road)
    marks = [(number_of(one, "sOffset", 0.0), one.get("type", ""), one.get("weight", "")) for one in parts["roadMark"]]
    return LaneRecord(
        _lane_number(element),
        element.get("type", "none"),
        element.get("direction", "standard"),
        width,
        border,
        _numbers(parts["link"], "predecessor"),
        _numbers(parts["link"], "successor"),
        tuple(sorted((number_of(one, "sOffset", 0.0), speed_of(one)) for one in parts["speed"])),
        tuple(sorted(marks)),
    )


def _lane_number(element: Element) -> int:
    try:
        return int(element.get("id", "missing"))
    except ValueError:
        raise UnusableError("a lane without a whole number as id") from None


def _numbers(links: Sequence[Element], which: str) -> tuple[int, ...]:
    found = []
    for link in links:
        for one in link.iterfind(which):
            try:
                found.append(int(one.get("id", "missing")))
            except ValueError:
                continue
    return tuple(found)


def speed_of(element: Element | None) -> float:
    """The limit that a speed element states [m/s]; nan for none, such as "no limit"."""
    if element is None:
        return math.nan
    try:
        value = float(element.get("max", "missing")) * _UNITS[(element.get("unit") or "").strip().lower()]
    except (ValueError, KeyError):
        return math.nan
    return value if 0.0 < value < _LARGEST else math.nan


def number_or(element: Element, name: str, usual: float) -> float:
    """An attribute as a number; the usual one if it is not stated or of no use."""
    try:
        return number_of(element, name, usual)
    except UnusableError:
        return usual
