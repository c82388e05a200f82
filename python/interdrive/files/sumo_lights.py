"""Traffic lights that SUMO and a scenario share: SUMO shows those of the file, the scenario has the others of SUMO."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from interdrive.files.sources.control import cycle_of
from interdrive.files.sources.model import Light
from interdrive.files.sources.notes import Notes
from interdrive.files.sources.sumo_control import lights_of
from interdrive.scenario import StopLine, TrafficLight

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from xml.etree.ElementTree import Element

    from interdrive.array_types import Floats
    from interdrive.scenario import Lanelets, Scenario

#: A lane of SUMO is the lanelet whose ends are this near to its own [m] and have nearly its directions [rad].
_NEAR, _TURNED = 3.0, 0.5
#: Letters of SUMO for a link that yields to others while its light is green.
_YIELDING = "go"


@dataclass(frozen=True)
class _Link:
    """A way across a junction that has a light in SUMO: its place in the state, and from and onto which lanelets."""

    name: str
    index: int
    lanelet: int
    following: int
    yields: bool


def with_lights(scenario: Scenario, net: Element, begin: float) -> Scenario:
    """The scenario with the lights of SUMO at lanelets where it has none, and with those that SUMO is told to show.

    Args:
        scenario: One with `sumo`.
        net: SUMO's net.
        begin: SUMO's time at time step 0 [s].
    """
    assert scenario.sumo is not None
    notes = Notes()
    places = _places(net, scenario.lanelets, scenario.sumo.offset)
    links = list(_links(net, places))
    lit = {line.lanelet_id: line for line in scenario.stop_lines if any(ids for _, ids in line.light_ids)}
    told = [
        (link.name, link.index, ids, link.yields)
        for link in links
        if link.lanelet in lit and (ids := _ids(lit[link.lanelet], link.following))
    ]
    made: dict[int, list[Light]] = defaultdict(list)
    for light in lights_of(net, places, notes):
        if light.lane not in lit:
            made[light.lane].append(light)
    numbers = itertools.count(_largest_id(scenario) + 1)
    lights, lines = [], []
    for lanelet, found in sorted(made.items()):
        ways: dict[int, tuple[int, ...]] = {}
        for light in found:
            phases, offset = cycle_of(light, (scenario.dt, begin), notes)
            new = TrafficLight(next(numbers), phases, offset)
            lights.append(new)
            ways.setdefault(light.ways[0], (new.id,))
        lines.append(StopLine(lanelet, _end(scenario.lanelets, lanelet), tuple(ways.items()), is_stated=False))
    said = list(notes.lines())
    if lines:
        said.append(f"the traffic lights of SUMO's net at {len(lines)} lanelets are obeyed by agents, too")
    if told:
        said.append(f"SUMO shows the traffic lights of the file for {len(told)} ways across junctions")
    return replace(
        scenario,
        notes=(*scenario.notes, *said),
        traffic_lights=(*scenario.traffic_lights, *lights),
        stop_lines=tuple(sorted((*_without(scenario, lines), *lines), key=lambda line: line.lanelet_id)),
        sumo=replace(scenario.sumo, lights=tuple(told)),
    )


def _links(net: Element, places: Mapping[str, int]) -> Iterator[_Link]:
    """Connections with a light between lanes that are lanelets."""
    letters: dict[str, list[str]] = defaultdict(list)
    for logic in net.iterfind("tlLogic"):
        letters[logic.get("id", "")] += [phase.get("state", "") for phase in logic.iterfind("phase")]
    for connection in net.iterfind("connection"):
        name, index = connection.get("tl"), connection.get("linkIndex", "")
        start = places.get(f"{connection.get('from')}_{connection.get('fromLane')}")
        way = places.get(connection.get("via") or f"{connection.get('to')}_{connection.get('toLane')}")
        if name is not None and index.isdecimal() and len(index) < 6 and start is not None and way is not None:
            at = int(index)
            yields = any(state[at : at + 1] in _YIELDING for state in letters[name] if len(state) > at)
            yield _Link(name, at, start, way, yields)


def _places(net: Element, lanelets: Lanelets, offset: tuple[float, float]) -> dict[str, int]:
    """Lanelets by the names of SUMO's lanes: the nearest ones by both of their ends."""
    ends = np.array([[_middle(lanelets, row, 0), _middle(lanelets, row, -1)] for row in range(len(lanelets.ids))])
    turned = np.array([_headings(left, right) for left, right in zip(lanelets.left, lanelets.right, strict=True)])
    found = {}
    for lane in net.iterfind("edge/lane"):
        try:
            shape = np.array(
                [[float(part) for part in point.split(",")[:2]] for point in lane.get("shape", "").split()]
            )
        except ValueError:
            continue
        if shape.ndim != 2 or shape.shape[0] < 2 or not len(ends):
            continue
        shape = shape - np.array(offset)
        apart = np.hypot(*np.moveaxis(ends - shape[[0, -1]], 2, 0)).max(axis=1)
        heading = [math.atan2(*(b - a)[::-1]) for a, b in (shape[:2], shape[-2:])]
        away = np.abs(np.remainder(turned - heading + math.pi, math.tau) - math.pi).max(axis=1)
        apart[away > _TURNED] = math.inf
        nearest = int(apart.argmin())
        if apart[nearest] <= _NEAR:
            found[lane.get("id", "")] = int(lanelets.ids[nearest])
    return found


def _middle(lanelets: Lanelets, row: int, place: int) -> Floats:
    middle: Floats = 0.5 * (lanelets.left[row][place] + lanelets.right[row][place])
    return middle


def _headings(left: Floats, right: Floats) -> list[float]:
    middle = 0.5 * (left + right)
    return [math.atan2(*(b - a)[::-1]) for a, b in (middle[:2], middle[-2:])]


def _end(lanelets: Lanelets, number: int) -> Floats:
    row = int(np.searchsorted(lanelets.ids, number))
    return np.array([lanelets.left[row][-1], lanelets.right[row][-1]])


def _ids(line: StopLine, following: int) -> tuple[int, ...]:
    """The lights that count on the way onto a lanelet; on any way, if the line does not know it."""
    ways = dict(line.light_ids)
    return ways.get(following) or next((ids for ids in ways.values() if ids), ())


def _without(scenario: Scenario, lines: list[StopLine]) -> list[StopLine]:
    """Stop lines of the file but those that others stand in for."""
    new = {line.lanelet_id for line in lines}
    return [line for line in scenario.stop_lines if line.lanelet_id not in new]


def _largest_id(scenario: Scenario) -> int:
    taken = [*scenario.lanelets.ids.tolist(), *scenario.obstacles.ids.tolist()]
    taken += [light.id for light in scenario.traffic_lights]
    taken += [number for one in scenario.incomings for number in (one.id, one.intersection_id)]
    return max([*taken, *(problem.id for problem in scenario.planning_problems)], default=0)
