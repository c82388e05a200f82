"""Makes agents of generated vehicles: their ways through the map, their goals, how fast they begin."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.scenario.agents import Agent, native_goal
from interdrive.scenario.known_goals import MapEnds, arrival
from interdrive.scenario.model import KINDS, GoalState, InitialState
from interdrive.scenario.shape import Shape
from interdrive.traffic import draws
from interdrive.traffic.arrivals import ENTRY

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.scenario.model import Scenario
    from interdrive.traffic.arrivals import Wish
    from interdrive.traffic.lanes import LaneGraph
    from interdrive.traffic.settings import TrafficSettings

#: Lorries are no faster [m/s]: 90 km/h, Directive 92/6/EEC.
_TRUCK_SPEED = 25.0
#: Ways are no longer than this [m], and such a way ends in an area of this length [m].
_WAY_MAX, _AREA = 3000.0, 20.0
#: Length of the car whose route all share [m], and the largest number of routes that are kept.
_CAR, _ROUTES_MAX = 4.6, 256
#: Vehicles have this time [s] and so many times what the way takes on an empty road until their goal counts as late.
_TIME, _TIMES = 60.0, 2.0
#: Long vehicles take ways in whose bends their front sweeps no further beyond the lane [m], where there are such.
_SWEEP = 0.5
#: Vehicles enter so slowly that they can brake before bends and junctions with this [m/s²], ...
_BRAKING = 2.0
#: ... bends are driven with this lateral acceleration [m/s²], and count so far ahead [m].
_LATERAL, _AHEAD = 2.5, 150.0


class EntryRoutes:
    """Routes of vehicles that enter, worked out once per way: for a car as fast as the limits, whoever comes first."""

    def __init__(self, road: _core.RoadNetwork, graph: LaneGraph, ends: MapEnds) -> None:
        self._road, self._graph, self._ends = road, graph, ends
        self._known: dict[tuple[tuple[int, ...], int], _core.Route] = {}

    def along(self, lanes: tuple[int, ...], user: int) -> _core.Route:
        """The route along lanelets from the edge of the map on, for a kind of vehicle (a position in `KINDS`)."""
        known = self._known.get((lanes, user))
        if known is not None:
            return known
        if len(self._known) >= _ROUTES_MAX:
            self._known.clear()
        graph = self._graph
        speed = max(graph.limit(lane) for lane in lanes)
        goal = native_goal((arrival(_leaving(graph, self._ends, lanes[-1], _CAR, speed), 0, 2),), speed)
        route = _core.Route.through(self._road, *graph.place(lanes[0], ENTRY), speed, list(lanes), goal, user)
        self._known[lanes, user] = route
        return route


class JourneyMaker:
    """Makes agents of wishes."""

    def __init__(
        self,
        scenario: Scenario,
        road: _core.RoadNetwork,
        settings: TrafficSettings,
        seed: int,
        graph: LaneGraph,
        ends: MapEnds,
        routes: EntryRoutes,
        first: int,
    ) -> None:
        self._scenario, self._road, self._settings, self._seed = scenario, road, settings, seed
        self._graph, self._ends, self._routes, self._first = graph, ends, routes, first

    def made(self, wish: Wish, number: int, *, is_filled: bool) -> tuple[Agent, float]:
        """The agent, and the length of its way [m]."""
        graph, dt = self._graph, self._scenario.dt
        lanes, length = self._way(wish, is_filled=is_filled)
        factor = wish.driver.speed_factor
        top = _TRUCK_SPEED if wish.kind == "truck" else math.inf
        speed = min(top, factor * max(graph.limit(lane) for lane in lanes))
        x, y, orientation = graph.place(wish.lane, wish.s)
        user = KINDS.index(wish.kind)
        # The first time step at or after it is due.
        first = self._first + (0 if is_filled else math.ceil(wish.due / dt - 1e-9))
        last = first + math.ceil((_TIME + _TIMES * length / max(speed, 1.0)) / dt)
        goal = self._goal(wish, lanes, speed, first, last)
        core_goal = native_goal(goal, speed)
        if is_filled:
            route = _core.Route.through(self._road, x, y, orientation, speed, list(lanes), core_goal, user)
        else:
            route = self._routes.along(lanes, user)
        here = min(top, factor * graph.limit(wish.lane))
        velocity = min(here, wish.speed, self._slow_enough(route, lanes, wish))
        vehicle = _core.Vehicle(user, wish.length, wish.width)
        stated = (x, y, orientation, velocity, math.nan, math.nan)
        acceleration, yaw_rate = route.first_state(vehicle, stated, (), dt)
        agent = Agent(
            id=number,
            names=(number,),
            origin="generated",
            kind=wish.kind,
            shape=Shape("rectangle", length=wish.length, width=wish.width),
            initial_state=InitialState(first, x, y, orientation, velocity, acceleration, yaw_rate),
            goal=goal,
            vehicle=vehicle,
            route=route,
            native_goal=core_goal,
            queue=None
            if is_filled
            else (wish.lane, max(first, self._first + math.floor(self._settings.duration / dt))),
        )
        return agent, length

    def _way(self, wish: Wish, *, is_filled: bool) -> tuple[tuple[int, ...], float]:
        """The lanelets of a way, and its length from the start on [m]."""
        graph, forks = self._graph, 0
        size = _core.Vehicle(KINDS.index(wish.kind), wish.length, wish.width)
        reach = size.rear_axle_to_center + 0.5 * wish.length
        lanes = [wish.lane]
        length = graph.length[wish.lane] - wish.s
        most = _WAY_MAX if graph.to_exit else 1.2 * self._settings.duration * _fastest(graph) + _WAY_MAX
        while length < most:
            ways = graph.ways(lanes[-1])
            if not ways:
                break
            # Nobody drives around a roundabout twice.
            ways = [way for way in ways if not graph.leads_back(way[0], lanes)] or ways
            ways = [way for way in ways if graph.sweep(way[0], wish.width, reach) <= _SWEEP] or ways
            place = 0
            if len(ways) > 1:
                what = draws.FILL_FORK if is_filled else draws.FORK
                drawn = float(draws.uniform(self._seed, what, wish.lane, wish.number, forks)[0])
                place, forks = _taken(ways, self._settings.turn, drawn), forks + 1
            is_beside = ways[place][0] not in graph.after[lanes[-1]]
            lanes.append(ways[place][0])
            length += 0.0 if is_beside else graph.length[lanes[-1]]
        return tuple(lanes), length

    def _goal(self, wish: Wish, lanes: tuple[int, ...], speed: float, first: int, last: int) -> tuple[GoalState, ...]:
        """To leave the map, at any time up to `last`; on a ring to drive on until the end."""
        areas = _leaving(self._graph, self._ends, lanes[-1], wish.length, speed)
        if not areas:  # a ring: it drives until the end
            last = max(first + 1, self._first + round(self._settings.duration / self._scenario.dt))
            return (GoalState(areas=(), lanelet_ids=(), time_step=(last, last), velocity=(0.0, 2.0 * speed)),)
        return (arrival(areas, first, last),)

    def _slow_enough(self, route: _core.Route, lanes: tuple[int, ...], wish: Wish) -> float:
        """Speed from which bends and the first junction can be met with gentle braking [m/s]."""
        bends = np.abs(route.reference_curvature)
        spacing = route.length / max(1, len(bends) - 1)
        first = int(max(0.0, route.start_s) / spacing)
        bends = bends[first : first + int(_AHEAD / spacing)]
        ahead = spacing * np.arange(len(bends))
        least = np.sqrt(_LATERAL / np.maximum(bends, 1e-6) + 2.0 * _BRAKING * ahead).min(initial=math.inf)
        free = self._graph.length[wish.lane] - wish.s
        for lane in lanes[1:]:
            if not self._graph.is_clear(lane):
                return float(min(least, math.sqrt(2.0 * _BRAKING * max(0.0, free - 0.5 * wish.length))))
            if free > _AHEAD:
                break
            free += self._graph.length[lane]
        return float(least)


def _leaving(graph: LaneGraph, ends: MapEnds, lanelet: int, length: float, speed: float) -> tuple[Shape, ...]:
    """Where a vehicle of a length [m] and speed [m/s] leaves a way by its last lanelet; nowhere on a ring."""
    if lanelet in graph.exits:
        return ends.areas(lanelet, length, speed)
    return ends.last_stretch(lanelet, _AREA) if graph.to_exit else ()


def _fastest(graph: LaneGraph) -> float:
    return max(graph.limit(lanelet) for lanelet in graph.ids)


def _taken(ways: Sequence[tuple[int, int]], turn: tuple[float, float, float], drawn: float) -> int:
    """The way that a uniform number takes: its turn by the shares, ways of one turn alike."""
    counts = [sum(other == kind for _, other in ways) for kind in range(3)]
    weights = np.array([turn[kind] / counts[kind] for _, kind in ways])
    if not weights.sum() > 0.0:
        weights = np.ones(len(ways))
    bounds = np.cumsum(weights) / weights.sum()
    return min(int(np.searchsorted(bounds, drawn, side="right")), len(ways) - 1)
