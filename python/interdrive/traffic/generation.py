"""Makes the agents of generated traffic: who enters by which lane when, who is there from the beginning, their ways."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.errors import InputError
from interdrive.scenario.agents import Agent, native_goal
from interdrive.scenario.known_goals import arrival, map_end
from interdrive.scenario.limits import LARGEST_ID
from interdrive.scenario.model import KINDS, GoalState, InitialState
from interdrive.scenario.shape import Shape
from interdrive.traffic import draws
from interdrive.traffic.arrivals import Driver, due_times, vehicles
from interdrive.traffic.filling import filled
from interdrive.traffic.lanes import USUAL_LIMIT, LaneGraph

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.scenario.model import Scenario
    from interdrive.traffic.settings import TrafficSettings

#: Lorries are no faster [m/s]: 90 km/h, Directive 92/6/EEC.
_TRUCK_SPEED = 25.0
#: The centre of a vehicle that enters is so far into its lane [m]: half of the longest lorry, and a metre.
_ENTRY = 6.8
#: Ways are no longer than this [m], and such a way ends in an area of this length [m].
_WAY_MAX, _AREA = 3000.0, 20.0
#: Vehicles have this time [s] and so many times what the way takes on an empty road until their goal counts as late.
_TIME, _TIMES = 60.0, 2.0
#: Long vehicles take ways in whose bends their front sweeps no further beyond the lane [m], where there are such.
_SWEEP = 0.5
#: Vehicles enter so slowly that they can brake before bends and junctions with this [m/s²], ...
_BRAKING = 2.0
#: ... bends are driven with this lateral acceleration [m/s²], and count so far ahead [m].
_LATERAL, _AHEAD = 2.5, 150.0


@dataclass(frozen=True)
class Generated:
    """Generated traffic of a run; the lists have one entry per vehicle, sorted by id.

    Attributes:
        agents: Its vehicles.
        drivers: Who drives them, by id.
        lane_ids: The lanelet by which each enters, or in which it is at the first time step.
        due: When each wants to enter [s]; nan: it is there from the beginning.
        exit_ids: The last lanelet of each way.
        lengths: Of the ways [m].
        entries: All lanelets by which vehicles enter.
    """

    agents: tuple[Agent, ...] = ()
    drivers: Mapping[int, Driver] = field(default_factory=dict)
    lane_ids: tuple[int, ...] = ()
    due: tuple[float, ...] = ()
    exit_ids: tuple[int, ...] = ()
    lengths: tuple[float, ...] = ()
    entries: tuple[int, ...] = ()


@dataclass(frozen=True)
class _Wish:
    """A vehicle before it has a way: `s` is where its centre is in its lane [m], `speed` that there [m/s]."""

    lane: int
    number: int
    due: float
    kind: str
    length: float
    width: float
    driver: Driver
    s: float = _ENTRY
    speed: float = math.inf


def generated(
    scenario: Scenario, road: _core.RoadNetwork, settings: TrafficSettings, seed: int, others: Sequence[Agent]
) -> Generated:
    """The traffic that settings and seed make on a map.

    Args:
        scenario: With the map; nobody begins near its recorded vehicles.
        road: Its roads.
        settings: Of the traffic.
        seed: Of the run.
        others: Agents of the file.

    Raises:
        InputError: Nothing can enter, a rate is given for a lanelet that is no entry, the map is too full, or the
            warm-up leaves no time.
    """
    # Settings are bound one source after the other, so the two are compared where both are final.
    if settings.warm_up >= settings.duration:
        raise InputError(
            "traffic.warm_up",
            f"{settings.warm_up:g} s leave nothing of traffic.duration ({settings.duration:g} s) to count",
        )
    graph = LaneGraph(scenario.lanelets, road)
    rates = _rates(scenario, settings, graph)
    wishes: list[_Wish] = []
    density = settings.density
    if density is None:
        density = settings.rate / (3.6 * _usual_speed(graph))
    if density > 0.0:
        wishes += [_Wish(*one) for one in filled(graph, settings, seed, density, _occupied(scenario, others))]
    n_filled = len(wishes)
    for lane, rate in rates.items():
        due = due_times(settings, seed, lane, rate)
        found = vehicles(settings, seed, lane, np.arange(len(due)))
        rows = zip(due.tolist(), found.kinds, found.length.tolist(), found.width.tolist(), found.drivers, strict=True)
        wishes += [_Wish(lane, number, *row) for number, row in enumerate(rows)]
    wishes[n_filled:] = sorted(wishes[n_filled:], key=lambda wish: (wish.due, wish.lane, wish.number))
    base = _first_id(scenario, others)
    if not wishes and not rates:
        raise InputError("traffic", f"{scenario.name}: no lane is long enough to be filled")
    maker = _Maker(scenario, road, settings, seed, graph)
    made = [maker.made(wish, base + place, is_filled=place < n_filled) for place, wish in enumerate(wishes)]
    return Generated(
        agents=tuple(agent for agent, _ in made),
        drivers={agent.id: wish.driver for (agent, _), wish in zip(made, wishes, strict=True)},
        lane_ids=tuple(wish.lane for wish in wishes),
        due=tuple(math.nan if place < n_filled else wish.due for place, wish in enumerate(wishes)),
        exit_ids=tuple(int(agent.route.lanelet_ids[-1]) for agent, _ in made),
        lengths=tuple(length for _, length in made),
        entries=tuple(rates),
    )


def map_alone(scenario: Scenario) -> Scenario:
    """The scenario without planning problems and recorded traffic; what never moves stays."""
    return replace(scenario, obstacles=scenario.obstacles.standing(), planning_problems=(), overlaps=())


def _rates(scenario: Scenario, settings: TrafficSettings, graph: LaneGraph) -> dict[int, float]:
    """Rates of all entries that have one [1/h], by lanelet id."""
    own = settings.lane_rates
    if settings.rate <= 0.0 and not own:
        return {}
    if not graph.entries:
        raise InputError(
            "traffic.rate",
            f"{scenario.name}: no lane begins at the edge of the map and leads out of it; use traffic.density",
        )
    for lane in own:
        if lane not in graph.entries:
            known = ", ".join(map(str, graph.entries[:12])) + (", ..." if len(graph.entries) > 12 else "")
            raise InputError("traffic.rates", f"lanelet {lane} is no entry of {scenario.name}; entries are {known}")
    rates = {lane: own.get(lane, settings.rate) for lane in graph.entries}
    return {lane: rate for lane, rate in rates.items() if rate > 0.0}


def _usual_speed(graph: LaneGraph) -> float:
    """Mean limit of the lanes [m/s]."""
    return float(np.mean([graph.limit(lanelet) for lanelet in graph.ids])) if graph.ids else USUAL_LIMIT


def _occupied(scenario: Scenario, others: Sequence[Agent]) -> list[tuple[float, float]]:
    """Where recorded vehicles and agents of the file are at the first time step [m]."""
    obstacles = scenario.obstacles
    there = obstacles.valid[:, 0] if obstacles.n_steps else np.zeros(0, dtype=np.bool_)
    found = (
        list(zip(obstacles.x[there, 0].tolist(), obstacles.y[there, 0].tolist(), strict=True)) if there.any() else []
    )
    begin = ((agent.initial_state.x, agent.initial_state.y) for agent in others if agent.initial_state.time_step == 0)
    return [*found, *begin]


def _first_id(scenario: Scenario, others: Sequence[Agent]) -> int:
    """The next power of ten above all ids."""
    taken = [
        *scenario.obstacles.ids.tolist(),
        *scenario.lanelets.ids.tolist(),
        *(problem.id for problem in scenario.planning_problems),
        *(light.id for light in scenario.traffic_lights),
        *(agent.id for agent in others),
    ]
    first: int = 10 ** len(str(max(999, *taken)))
    if first > LARGEST_ID // 10:
        raise InputError("traffic", f"{scenario.name}: no ids are left above {max(taken)}")
    return first


class _Maker:
    """Makes agents of wishes; vehicles with the same way from the edge of the map share its path."""

    def __init__(
        self, scenario: Scenario, road: _core.RoadNetwork, settings: TrafficSettings, seed: int, graph: LaneGraph
    ) -> None:
        self._scenario, self._road, self._settings, self._seed = scenario, road, settings, seed
        self._graph = graph
        self._routes: dict[tuple[tuple[int, ...], int], _core.Route] = {}

    def made(self, wish: _Wish, number: int, *, is_filled: bool) -> tuple[Agent, float]:
        """The agent, and the length of its way [m]."""
        graph, dt = self._graph, self._scenario.dt
        lanes, length = self._way(wish, is_filled=is_filled)
        factor = wish.driver.speed_factor
        top = _TRUCK_SPEED if wish.kind == "truck" else math.inf
        speed = min(top, factor * max(graph.limit(lane) for lane in lanes))
        x, y, orientation = graph.place(wish.lane, wish.s)
        user = KINDS.index(wish.kind)
        # The first time step at or after it is due.
        first = 0 if is_filled else math.ceil(wish.due / dt - 1e-9)
        last = first + math.ceil((_TIME + _TIMES * length / max(speed, 1.0)) / dt)
        goal = self._goal(wish, lanes, speed, first, last)
        core_goal = native_goal(goal, speed)
        key = (lanes, user)
        route = None if is_filled else self._routes.get(key)
        if route is None:
            route = _core.Route.through(self._road, x, y, orientation, speed, list(lanes), core_goal, user)
        if not is_filled:
            self._routes[key] = route
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
            queue=None if is_filled else (wish.lane, max(first, math.floor(self._settings.duration / dt))),
        )
        return agent, length

    def _way(self, wish: _Wish, *, is_filled: bool) -> tuple[tuple[int, ...], float]:
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

    def _goal(self, wish: _Wish, lanes: tuple[int, ...], speed: float, first: int, last: int) -> tuple[GoalState, ...]:
        """To leave the map, at any time up to `last`; on a ring to drive on until the end."""
        if lanes[-1] in self._graph.exits:
            areas = map_end(self._scenario, self._road, lanes[-1], wish.length, speed)
        elif self._graph.to_exit:
            end = self._graph.length[lanes[-1]]
            found = self._road.lane_stretch(lanes[-1], end, min(_AREA, end), 0.0)
            areas = tuple(Shape("polygon", vertices=np.asarray(polygon)) for polygon in found)
        else:
            areas = ()
        if not areas:  # a ring: it drives until the end
            last = max(first + 1, round(self._settings.duration / self._scenario.dt))
            return (GoalState(areas=(), lanelet_ids=(), time_step=(last, last), velocity=(0.0, 2.0 * speed)),)
        return (arrival(areas, first, last),)

    def _slow_enough(self, route: _core.Route, lanes: tuple[int, ...], wish: _Wish) -> float:
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


def entered_at(agent: Agent, time_step: int, velocity: float, yaw_rate: float) -> Agent:
    """The agent as it has entered: later, and more slowly than it wanted; the time of its goal counts from then on."""
    waited = time_step - agent.initial_state.time_step
    goal = tuple(
        replace(state, time_step=(state.time_step[0] + waited, state.time_step[1] + waited)) for state in agent.goal
    )
    start = replace(agent.initial_state, time_step=time_step, velocity=velocity, yaw_rate=yaw_rate)
    return replace(agent, initial_state=start, goal=goal)
