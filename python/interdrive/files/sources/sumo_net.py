"""SUMO nets (.net.xml): lanes of edges and of junctions as SUMO drives them."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError
from interdrive.files.sources.model import Lane, Roads, Source
from interdrive.files.sources.notes import Notes
from interdrive.files.sources.polylines import distinct, offset
from interdrive.files.sources.sumo_control import finite, lights_of, signs_of

if TYPE_CHECKING:
    from collections.abc import Container
    from xml.etree.ElementTree import Element

    from interdrive.array_types import Floats
    from interdrive.files.sources.opening import SourceFile
    from interdrive.scenario import SourceOptions

#: Width of lanes that state none [m].
_WIDTH = 3.2
#: Lanes of opposite edges lie beside each other if their ends are no farther apart than half their widths and this [m].
_BESIDE = 0.3
#: Functions of edges that no vehicle drives on.
_NO_ROADS = ("walkingarea", "connector")
#: CommonRoad's types of lanes by the vehicles of which one must be allowed.
_KINDS = (("urban", "", "passenger"), ("busLane", "bus", "bus"), ("bicycleLane", "bike", "bicycle"))


@dataclass
class _Lane:
    """A lane of the net: its middle line, width, limit, edge, and place among the lanes of the edge."""

    name: str
    middle: Floats
    width: float
    speed: float
    kind: str
    edge: str
    index: int
    is_internal: bool
    before: list[_Lane] = field(default_factory=list)
    after: list[_Lane] = field(default_factory=list)


def read(file: SourceFile, options: SourceOptions) -> Source:
    """Reads a net.

    Raises:
        InputError: It has no lane for vehicles.
    """
    root, notes = file.document(), Notes()
    left_hand = root.get("lefthand") in ("1", "true")
    lanes = {lane.name: lane for lane in _lanes(root, options.keep, notes, left_hand=left_hand)}
    if not lanes:
        kinds = ", ".join(f"{kind} {count}" for kind, count in notes.left_out("lanes").items()) or "none"
        raise InputError(f"{file.path}: has no lane that vehicles may drive (lanes: {kinds}); --keep adds types")
    _connect(root, lanes)
    places = {name: place for place, name in enumerate(lanes)}
    roads = Roads(
        [_converted(lane) for lane in lanes.values()],
        [(places[lane.name], places[following.name]) for lane in lanes.values() for following in lane.after],
        left_hand=left_hand,
    )
    roads.lights, roads.signs = lights_of(root, places, notes), signs_of(root, places)
    roads.lanes += _crosswalks(root, notes)
    _set_neighbours(roads, list(lanes.values()), root, left_hand=left_hand)
    location = root.find("location")
    moved = "" if location is None else location.get("netOffset", "")
    if any(finite(part, 0.0) != 0.0 for part in moved.split(",")):
        notes.say(f"coordinates are those of the net, whose netOffset is {moved}")
    return Source(roads, notes=notes)


def _lanes(root: Element, keep: Container[str], notes: Notes, *, left_hand: bool) -> list[_Lane]:
    """Lanes that vehicles may drive, by edge, from left to right."""
    found: list[_Lane] = []
    names: set[str] = set()
    for edge in root.iterfind("edge"):
        function = edge.get("function", "")
        inner = edge.findall("lane")
        if function == "crossing":
            continue
        if function in _NO_ROADS:
            notes.leave_out("lanes", function, len(inner))
            continue
        lanes = []
        for place, element in enumerate(inner):
            name = element.get("id", "")
            kind = _kind(element, keep)
            middle = _shape(element.get("shape", ""))
            if kind is None:
                notes.leave_out("lanes", "closed to passenger vehicles")
            elif middle is None or name in names:
                notes.name("lanes without a shape of two points, or with the id of another, left out", name)
            else:
                names.add(name)
                width, speed = (finite(element.get(key), usual) for key, usual in (("width", 0.0), ("speed", math.nan)))
                index = int(finite(element.get("index"), place))
                lanes.append(
                    _Lane(
                        name,
                        middle,
                        width if width > 0.0 else _WIDTH,
                        speed if speed > 0.0 else math.nan,
                        kind,
                        edge.get("id", ""),
                        index,
                        function == "internal",
                    )
                )
        found += sorted(lanes, key=lambda lane: lane.index if left_hand else -lane.index)
    return found


def _crosswalks(root: Element, notes: Notes) -> list[Lane]:
    found = []
    for edge in root.iterfind("edge[@function='crossing']"):
        for element in edge.iterfind("lane"):
            middle, width = _shape(element.get("shape", "")), finite(element.get("width"), _WIDTH)
            if middle is None or not width > 0.0:
                notes.name("crosswalks without a shape of two points left out", edge.get("id", ""))
            else:
                left, right = (offset(middle, side * width / 2.0) for side in (1.0, -1.0))
                found.append(Lane(edge.get("id", ""), left, right, kind="crosswalk"))
    return found


def _kind(lane: Element, keep: Container[str]) -> str | None:
    allow, disallow = (lane.get(name, "").split() for name in ("allow", "disallow"))
    for kind, kept, vehicle in _KINDS:
        is_open = bool({vehicle, "all"} & set(allow)) if allow else not {vehicle, "all"} & set(disallow)
        if is_open and (not kept or kept in keep):
            return kind
    return None


def _shape(text: str) -> Floats | None:
    try:
        points = np.array([[float(number) for number in point.split(",")[:2]] for point in text.split()])
    except ValueError:
        return None
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        return None
    points = points[distinct(points)]
    return points if len(points) > 1 else None


def _connect(root: Element, lanes: dict[str, _Lane]) -> None:
    """From lanes to those inside a junction, and from there on; directly where a junction has none."""
    for connection in root.iterfind("connection"):
        start, end = (lanes.get(f"{connection.get(a)}_{connection.get(a + 'Lane')}") for a in ("from", "to"))
        via = lanes.get(connection.get("via", ""))
        following = via if connection.get("via") else end
        if start is not None and following is not None and following not in start.after:
            start.after.append(following)
            following.before.append(start)


def _converted(lane: _Lane) -> Lane:
    heads: list[float | None] = [None, None]
    if lane.is_internal:  # borders meet those of the roads outside if they have their direction
        heads[0] = next((_heading(one.middle[-2:]) for one in lane.before if not one.is_internal), None)
        heads[1] = next((_heading(one.middle[:2]) for one in lane.after if not one.is_internal), None)
    left, right = (offset(lane.middle, side * lane.width / 2.0, *heads) for side in (1.0, -1.0))
    return Lane(lane.name, left, right, lane.speed, kind=lane.kind)


def _heading(ends: Floats) -> float:
    return math.atan2(*(ends[1] - ends[0])[::-1])


def _set_neighbours(roads: Roads, lanes: list[_Lane], root: Element, *, left_hand: bool) -> None:
    by_edge: dict[str, list[int]] = defaultdict(list)
    for place, lane in enumerate(lanes):
        if not lane.is_internal:
            by_edge[lane.edge].append(place)
    for places in by_edge.values():
        for left, right in itertools.pairwise(places):
            if abs(lanes[left].index - lanes[right].index) == 1:
                roads.lanes[left].right_neighbour, roads.lanes[right].left_neighbour = (right, True), (left, True)
    ends = {edge.get("id", ""): (edge.get("from"), edge.get("to")) for edge in root.iterfind("edge")}
    between = defaultdict(list)
    for name, pair in ends.items():
        between[pair].append(name)
    inner = -1 if left_hand else 0
    for name, places in by_edge.items():
        start, end = ends[name]
        for other in between[end, start] if start and start != end else ():
            if other in by_edge and _is_beside(lanes[places[inner]], lanes[by_edge[other][inner]]):
                beside = (by_edge[other][inner], False)
                if left_hand:
                    roads.lanes[places[inner]].right_neighbour = beside
                else:
                    roads.lanes[places[inner]].left_neighbour = beside


def _is_beside(one: _Lane, other: _Lane) -> bool:
    apart = np.hypot(*(one.middle[[0, -1]] - other.middle[[-1, 0]]).T)
    return bool((apart <= 0.5 * (one.width + other.width) + _BESIDE).all())
