"""Signs of priority, stop lines, signed limits and crosswalks of OpenDRIVE."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.files.sources.control import crosswalk
from interdrive.files.sources.model import Sign
from interdrive.files.sources.opendrive.borders import offsets_at, points_at
from interdrive.files.sources.opendrive.links import LaneKey
from interdrive.files.sources.opendrive.records import UnusableError, number_of, number_or
from interdrive.scenario.signs import KIND_BY_NUMBER

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from xml.etree.ElementTree import Element

    from interdrive.array_types import Floats
    from interdrive.files.sources.model import Lane, Roads
    from interdrive.files.sources.notes import Notes
    from interdrive.files.sources.opendrive.records import Road

#: Numbers of a stop line and of a limit.
_STOP_LINE, _LIMIT = "294", "274"
#: Countries whose numbers are read; "": the catalogue is not stated.
_CATALOGUES = ("", "OPENDRIVE", "DE", "DEU", "GERMANY", "US", "USA")
_UNITS = {"": 1 / 3.6, "km/h": 1 / 3.6, "mph": 0.44704, "m/s": 1.0}
#: A stop line is at most this far from its sign along the road [m].
_LINE_AWAY = 15.0
_NO_OUTLINE: Floats = np.zeros((0, 2))


@dataclass(frozen=True)
class _Signal:
    """A signal at a place of a road, and the lanes for which it counts."""

    road: Road
    s: float
    number: str
    lanes: tuple[LaneKey, ...]


def add_signals(
    roads: Roads,
    root: Element,
    by_name: Mapping[str, Road],
    places: Mapping[LaneKey, int],
    move: tuple[float, float],
    notes: Notes,
) -> None:
    """Adds signs and crosswalks, and limits to lanes that state none.

    Args:
        roads: The lanes that are read, with their links.
        root: The document.
        by_name: Roads by id.
        places: Positions of lanes by their keys.
        move: What is added to all coordinates [m].
        notes: What is not read is counted.
    """
    elements = {one.get("id", ""): one for one in root.iterfind("road/signals/signal")}
    stops: list[_Signal] = []
    lines: list[_Signal] = []
    n_lights, others = 0, Counter[str]()
    for road, element, said in _signals(root, by_name, elements):
        if said.get("dynamic") == "yes":
            n_lights += element is said
            continue
        number = said.get("type", "") if said.get("country", "").upper() in _CATALOGUES else ""
        signal = _placed(road, element, number, places)
        if signal is None or number not in (_LIMIT, _STOP_LINE, *KIND_BY_NUMBER):
            others[number] += element is said
        elif number == _LIMIT:
            _set_limits(roads, said, signal, places)
        else:
            (lines if number == _STOP_LINE else stops).append(signal)
    found: dict[tuple[int, str], Sign] = {}
    before: dict[int, list[int]] = defaultdict(list)
    along: dict[int, list[int]] = defaultdict(list)
    names = {place: key.road for key, place in places.items()}
    for start, end in roads.links:
        before[end].append(start)
        if names[start] == names[end]:
            along[start].append(end)
    for signal in stops:
        kind = KIND_BY_NUMBER[signal.number]
        for key in signal.lanes:
            line = _line_for(signal, key, lines, move) if kind == "stop" else None
            for lane in _ends(signal, key, places[key], before, along, kind):
                found.setdefault((lane, kind), Sign(lane, kind, line))
    roads.signs += found.values()
    roads.lanes += _crosswalks(root, by_name, move, notes)
    for count, what in (
        (n_lights, "traffic lights, whose cycles are unknown"),
        (sum(others.values()), "other signs"),
    ):
        if count:
            notes.leave_out(what, "", count)


def _signals(
    root: Element, by_name: Mapping[str, Road], elements: Mapping[str, Element]
) -> Iterator[tuple[Road, Element, Element]]:
    """Roads, what is placed there, and the signal itself, which a reference names."""
    for element in root.iterfind("road"):
        road = by_name.get(element.get("id", ""))
        if road is None:
            continue
        for one in element.iterfind("signals/signal"):
            yield road, one, one
        for one in element.iterfind("signals/signalReference"):
            if one.get("id", "") in elements:
                yield road, one, elements[one.get("id", "")]


def _placed(road: Road, element: Element, number: str, places: Mapping[LaneKey, int]) -> _Signal | None:
    """A signal with the lanes that are read for which it counts: those it names, else those of its direction."""
    try:
        s = number_of(element, "s")
    except UnusableError:
        return None
    section = max((at for at, one in enumerate(road.sections) if one.start <= s + 1e-6), default=0)
    spans = []
    for validity in element.iterfind("validity"):
        try:
            span = int(validity.get("fromLane", "")), int(validity.get("toLane", ""))
        except ValueError:
            continue
        spans.append((min(span), max(span)))
    orientation = element.get("orientation", "none")
    keys = []
    for lane in road.sections[section].lanes:
        key = LaneKey(road.name, section, lane.number)
        is_named = any(low <= lane.number <= high for low, high in spans)
        is_faced = orientation not in ("+", "-") or road.is_forward(lane) == (orientation == "+")
        if key in places and (is_named if spans else is_faced):
            keys.append(key)
    return _Signal(road, s, number, tuple(keys))


def _ends(
    signal: _Signal,
    key: LaneKey,
    place: int,
    before: Mapping[int, list[int]],
    along: Mapping[int, list[int]],
    kind: str,
) -> list[int]:
    """Lanes at whose ends a sign counts: the last one of its road, or those that lead to it.

    Stop signs at the start of a lane in a junction are for those that lead there; one that gives way may do so inside.
    """
    section = signal.road.sections[key.section]
    record = section.lane(key.number)
    if record is None:
        return []
    driven = signal.s - section.start if signal.road.is_forward(record) else section.end - signal.s
    if kind == "stop" and signal.road.junction and driven < 0.5 * (section.end - section.start):
        return before.get(place, [])
    passed = {place}
    while len(nexts := along.get(place, [])) == 1 and nexts[0] not in passed:
        [place] = nexts
        passed.add(place)
    return [place]


def _line_for(signal: _Signal, key: LaneKey, lines: list[_Signal], move: tuple[float, float]) -> Floats | None:
    """Ends of the stop line of a sign on the same road for the same lane [m], left first; None: there is none."""
    near = [line for line in lines if key in line.lanes and abs(line.s - signal.s) <= _LINE_AWAY]
    if not near:
        return None
    road, section = signal.road, signal.road.sections[key.section]
    rows = {lane.number: row for row, lane in enumerate(section.lanes)}
    s = np.array([min(max(near[0].s, section.start), section.end)])
    inner = key.number - 1 if key.number > 0 else key.number + 1
    if inner not in rows:
        return None
    at = points_at(road, offsets_at(road, section, s), s)[:, 0]
    upper, lower = (rows[key.number], rows[inner]) if key.number > 0 else (rows[inner], rows[key.number])
    ends: Floats = at[[upper, lower]] + np.array(move)
    is_forward = road.is_forward(section.lanes[rows[key.number]])
    return ends if is_forward else ends[::-1]


def _set_limits(roads: Roads, said: Element, signal: _Signal, places: Mapping[LaneKey, int]) -> None:
    """The limit of a sign for the lanes of its road from there on that state none."""
    try:
        value = float(said.get("value", "")) * _UNITS[(said.get("unit") or "").strip().lower()]
    except (ValueError, KeyError):
        return
    if not 0.0 < value < 200.0:
        return
    numbers = {key.number for key in signal.lanes}
    for at, section in enumerate(signal.road.sections):
        for lane in section.lanes:
            key = LaneKey(signal.road.name, at, lane.number)
            is_ahead = section.end > signal.s if signal.road.is_forward(lane) else section.start < signal.s
            if (
                key in places
                and lane.number in numbers
                and is_ahead
                and math.isnan(roads.lanes[places[key]].speed_limit)
            ):
                roads.lanes[places[key]].speed_limit = value


def _crosswalks(root: Element, by_name: Mapping[str, Road], move: tuple[float, float], notes: Notes) -> list[Lane]:
    """Crosswalks by their outlines; other objects are counted."""
    found: list[Lane] = []
    n_others = 0
    for element in root.iterfind("road"):
        road = by_name.get(element.get("id", ""))
        for one in element.iterfind("objects/object"):
            outline = _outline(road, one) if road is not None and one.get("type") == "crosswalk" else _NO_OUTLINE
            made = crosswalk(f"crosswalk {one.get('id', '')}", outline + move)
            if made is None:
                n_others += 1
            else:
                found.append(made)
    if n_others:
        notes.leave_out("objects", "", n_others)
    return found


def _outline(road: Road, element: Element) -> Floats:
    """Corners of an object [m], shape (corners, 2); none if they are not known."""
    try:
        s, t = number_of(element, "s"), number_of(element, "t", 0.0)
        corners = [*element.iterfind("outline/cornerRoad"), *element.iterfind("outlines/outline/cornerRoad")]
        if corners:
            at = np.array([(number_of(one, "s"), number_of(one, "t")) for one in corners])
            x, y, heading = road.line.at(at[:, 0])
            return np.column_stack((x - np.sin(heading) * at[:, 1], y + np.cos(heading) * at[:, 1]))
        corners = [*element.iterfind("outline/cornerLocal"), *element.iterfind("outlines/outline/cornerLocal")]
        local = np.array([(number_of(one, "u"), number_of(one, "v")) for one in corners]).reshape(-1, 2)
        if not corners:
            half = 0.5 * np.array([number_of(element, "length", 0.0), number_of(element, "width", 0.0)])
            local = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) * half
            if not half.min() > 0.0:
                return _NO_OUTLINE
    except UnusableError:
        return _NO_OUTLINE
    east, north, along = (float(one[0]) for one in road.line.at(np.array([s])))
    yaw = along + number_or(element, "hdg", 0.0)
    cos, sin = math.cos(yaw), math.sin(yaw)
    origin = np.array([east - math.sin(along) * t, north + math.cos(along) * t])
    turned: Floats = local @ np.array([(cos, sin), (-sin, cos)]) + origin
    return turned
