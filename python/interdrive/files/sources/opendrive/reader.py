"""OpenDRIVE 1.1 to 1.9 (.xodr): lanes that vehicles may drive, with links, limits and lines."""

from __future__ import annotations

import math
from collections import Counter, defaultdict, deque
from typing import TYPE_CHECKING

from interdrive.errors import InputError
from interdrive.files.sources.model import Lane, Roads, Source
from interdrive.files.sources.notes import Notes
from interdrive.files.sources.opendrive.borders import borders_of
from interdrive.files.sources.opendrive.lines import line_names
from interdrive.files.sources.opendrive.links import LaneKey, links_of
from interdrive.files.sources.opendrive.records import number_or, roads_of
from interdrive.files.sources.opendrive.signals import add_signals

if TYPE_CHECKING:
    from collections.abc import Mapping
    from xml.etree.ElementTree import Element

    from interdrive.array_types import Floats
    from interdrive.files.sources.opendrive.records import LaneRecord, Road
    from interdrive.files.sources.opening import SourceFile
    from interdrive.scenario import SourceOptions

#: CommonRoad's types of lanes that are always read, by their types in OpenDRIVE; "": that of the road.
DRIVEN = {
    **dict.fromkeys(("driving", "connectingRamp", "slipLane", "bidirectional"), ""),
    **dict.fromkeys(("entry", "onRamp"), "accessRamp"),
    **dict.fromkeys(("exit", "offRamp"), "exitRamp"),
}
#: The same of those that are read if they are kept.
_KEPT = {
    "bus": dict.fromkeys(("bus", "taxi", "HOV"), "busLane"),
    "parking": {"parking": "parking"},
    "shoulder": dict.fromkeys(("shoulder", "stop"), "shoulder"),
    "bike": {"biking": "bicycleLane"},
}
#: A road whose coefficients of elevation are all below this is flat.
_FLAT = 1e-3
_DIRECTIONS = {"bidirectional": "both"}
#: CommonRoad's types of lanes by the type of the road.
_BY_ROAD = {"motorway": "highway", "rural": "country"}


def read(file: SourceFile, options: SourceOptions) -> Source:
    """Reads a map.

    Raises:
        InputError: It has no lane for vehicles, or roads cannot be told apart.
    """
    root, notes = file.document(), Notes()
    kinds = dict(DRIVEN)
    for kept in options.keep:
        kinds |= _KEPT[kept]
    roads = roads_of(root, kinds, str(file.path), notes)
    move = _move(root, options.offset, notes)
    places: dict[LaneKey, int] = {}
    lanes: list[Lane] = []
    for road in roads.values():
        for place in range(len(road.sections)):
            _read_section(road, place, kinds, move, notes, lanes, places)
    if not lanes:
        counts = Counter(
            lane.kind for road in roads.values() for one in road.sections for lane in one.lanes if lane.number
        )
        types = ", ".join(f"{kind} {count}" for kind, count in sorted(counts.items())) or "no lanes at all"
        types = "; ".join((types, *(line for line in notes.lines() if line.startswith("roads left out"))))
        raise InputError(f"{file.path}: has no lane that vehicles may drive (types: {types}); --keep adds types")
    links = [(places[a], places[b]) for a, b in links_of(roads, root, notes) if a in places and b in places]
    found = Roads(lanes, links, location=_location(root))
    connecting = [roads[key.road].junction != "" for key in places]
    add_signals(found, root, roads, places, move, notes)
    _infer_speeds(lanes, links, connecting)
    if any(abs(number_or(one, name, 0.0)) > _FLAT for one in root.iter("elevation") for name in "abcd"):
        notes.say("heights are not read: ways above each other cross in the plane")
    if any(root.iter("include")):
        notes.say("files named by <include> are not read")
    found.left_hand = Counter(road.left_hand for road in roads.values()).most_common(1)[0][0]
    return Source(found, notes=notes)


def _read_section(
    road: Road,
    place: int,
    kinds: Mapping[str, str],
    move: tuple[float, float],
    notes: Notes,
    lanes: list[Lane],
    places: dict[LaneKey, int],
) -> None:
    """Adds the lanes of a section, from left to right, with their neighbours."""
    section = road.sections[place]
    read = [row for row, lane in enumerate(section.lanes) if lane.number and lane.kind in kinds]
    for lane in section.lanes:
        if lane.number and lane.kind not in kinds:
            notes.leave_out("lanes", lane.kind if lane.kind.isprintable() else "unknown")
        elif lane.number and "both" in (lane.direction, _DIRECTIONS.get(lane.kind)):
            notes.name("lanes for both directions are read in one, that of their side, roads", road.name)
    if not read:
        return
    numbers = [lane.number for lane in section.lanes]
    borders = {row: (row, row + 1) if numbers[row] > 0 else (row - 1, row) for row in read}
    if 0 not in numbers:
        notes.name("a section has no lane 0, roads left out", road.name)
        return
    points = borders_of(road, section, sorted({row for pair in borders.values() for row in pair}))
    if move != (0.0, 0.0):
        points = points + move
    before: tuple[int, int] | None = None
    for row in read:
        lane = section.lanes[row]
        upper, lower = borders[row]
        forward = road.is_forward(lane)
        if lane.border and not lane.width and _is_below(points[upper], points[lower]):
            notes.name("borders of lanes lie on the other side of the reference line, as stated, roads", road.name)
            upper, lower = lower, upper
        made = _lane(road, place, lane, points[upper], points[lower], forward=forward, kind=kinds[lane.kind])
        made.left_line, made.right_line = line_names(section, row, forward=forward)
        places[LaneKey(road.name, place, lane.number)] = at = len(lanes)
        lanes.append(made)
        if before is not None and _touch(section.lanes, before[0], row):
            other = lanes[before[1]]
            same = road.is_forward(section.lanes[before[0]]) == forward
            _set_neighbour(made, before[1], same, is_left=forward)
            _set_neighbour(other, at, same, is_left=not road.is_forward(section.lanes[before[0]]))
        before = (row, at)


def _is_below(upper: Floats, lower: Floats) -> bool:
    """Whether a border lies on the right of another along s, halfway."""
    at = (len(upper) - 1) // 2
    ahead, across = (upper + lower)[at + 1] - (upper + lower)[at], upper[at] - lower[at]
    return bool(ahead[0] * across[1] - ahead[1] * across[0] < 0.0)


def _touch(lanes: list[LaneRecord], left: int, right: int) -> bool:
    """Whether no other lane lies between two of a section."""
    return all(lane.number == 0 for lane in lanes[left + 1 : right])


def _set_neighbour(lane: Lane, other: int, same: bool, *, is_left: bool) -> None:
    if is_left:
        lane.left_neighbour = (other, same)
    else:
        lane.right_neighbour = (other, same)


def _lane(road: Road, place: int, lane: LaneRecord, upper: Floats, lower: Floats, *, forward: bool, kind: str) -> Lane:
    section = road.sections[place]
    key = str(LaneKey(road.name, place, lane.number))
    left, right = (upper, lower) if forward else (lower[::-1], upper[::-1])
    middle = 0.5 * (section.end - section.start)
    stated = [speed for at, speed in lane.speeds if at <= middle] or [speed for _, speed in lane.speeds[:1]]
    of_road = [speed for at, speed in road.speeds if at <= section.start + 1e-6]
    speed = stated[-1] if stated else of_road[-1] if of_road else math.nan
    types = [name for at, name in road.kinds if at <= section.start + 1e-6]
    return Lane(key, left, right, speed, kind=kind or _BY_ROAD.get(types[-1] if types else "", "urban"), road=road.name)


def _infer_speeds(lanes: list[Lane], links: list[tuple[int, int]], is_connecting: list[bool]) -> None:
    """Lanes of junctions that state no limit have the smallest one of what leads there."""
    before: dict[int, list[int]] = defaultdict(list)
    after: dict[int, list[int]] = defaultdict(list)
    for start, end in links:
        before[end].append(start)
        after[start].append(end)
    # Crosswalks come last, and connect nothing.
    connecting = zip(lanes, is_connecting, strict=False)
    open_lanes = {place for place, (lane, inner) in enumerate(connecting) if inner and math.isnan(lane.speed_limit)}
    waiting = deque(sorted(open_lanes))
    while waiting:
        place = waiting.popleft()
        limits = [lanes[other].speed_limit for other in before[place] if not math.isnan(lanes[other].speed_limit)]
        least = min(limits, default=math.nan)
        if not math.isnan(least) and not lanes[place].speed_limit <= least:
            lanes[place].speed_limit = least
            waiting.extend(other for other in after[place] if other in open_lanes)


def _move(root: Element, wanted: str, notes: Notes) -> tuple[float, float]:
    """What is added to all coordinates because of the header's offset."""
    offset = root.find("header/offset")
    if offset is None:
        return 0.0, 0.0
    x, y = (number_or(offset, name, 0.0) for name in ("x", "y"))
    if (x, y) == (0.0, 0.0):
        return 0.0, 0.0
    done = {"none": "is not applied", "add": "is added", "subtract": "is subtracted"}[wanted]
    notes.say(f"offset ({x:g}, {y:g}) of the header {done}")
    sign = {"none": 0.0, "add": 1.0, "subtract": -1.0}[wanted]
    return sign * x, sign * y


def _location(root: Element) -> str:
    return " ".join((root.findtext("header/geoReference") or "").split())
