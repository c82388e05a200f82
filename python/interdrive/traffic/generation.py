"""Makes generated traffic: who enters by which lane when, and who is there from the beginning."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from interdrive import _core
from interdrive.errors import InputError
from interdrive.scenario.known_goals import MapEnds
from interdrive.scenario.limits import LARGEST_ID, MOST_STEPS
from interdrive.traffic.arrivals import Wish, due_times, vehicles
from interdrive.traffic.filling import filled
from interdrive.traffic.journeys import EntryRoutes, JourneyMaker
from interdrive.traffic.lanes import USUAL_LIMIT, LaneGraph

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from interdrive.native_settings import CoreStepSettings
    from interdrive.scenario.agents import Agent
    from interdrive.scenario.model import Scenario
    from interdrive.traffic.arrivals import Driver
    from interdrive.traffic.settings import TrafficSettings

S = TypeVar("S", bound="CoreStepSettings")


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
    """

    agents: tuple[Agent, ...] = ()
    drivers: Mapping[int, Driver] = field(default_factory=dict)
    lane_ids: tuple[int, ...] = ()
    due: tuple[float, ...] = ()
    exit_ids: tuple[int, ...] = ()
    lengths: tuple[float, ...] = ()

    def allowed(self, step: S, scenario: Scenario) -> S:
        """Settings of steps that leave the traffic its time, unless they state a largest number of steps."""
        ends = [agent.goal[0].time_step[1] - agent.initial_state.time_step for agent in self.agents]
        starts = [max(agent.initial_state.time_step, (agent.queue or (0, 0))[1]) for agent in self.agents]
        needed = max((start + int(step.grace_factor * end) for start, end in zip(starts, ends, strict=True)), default=0)
        most = _core.steps_at_most(step, scenario.obstacles.n_steps, [])
        return step if step.max_steps or needed <= most else replace(step, max_steps=min(needed, MOST_STEPS))


class TrafficMaker:
    """Makes traffic on a map, for any number of seeds."""

    def __init__(
        self, scenario: Scenario, road: _core.RoadNetwork, settings: TrafficSettings, step: CoreStepSettings
    ) -> None:
        """Reads the map.

        Args:
            scenario: With the map; nobody begins near its recorded vehicles.
            road: Its roads.
            settings: Of the traffic.
            step: Of the steps, which end after some time.

        Raises:
            InputError: Nothing can enter, a rate is given for a lanelet that is no entry, the warm-up leaves no time,
                or runs end before the traffic.
        """
        # Settings are bound one source after the other, so the two are compared where both are final.
        if settings.warm_up >= settings.duration:
            raise InputError(
                "traffic.warm_up",
                f"{settings.warm_up:g} s leave nothing of traffic.duration ({settings.duration:g} s) to count",
            )
        needed = math.ceil(settings.duration / scenario.dt)
        most = step.max_steps or MOST_STEPS
        if needed > most:
            raise InputError(
                "traffic.duration",
                f"{settings.duration:g} s are {needed} time steps, but runs end after {most}; set step.max_steps",
            )
        self._scenario, self._road, self._settings = scenario, road, settings
        self._ends = MapEnds(scenario, road)
        self._graph = LaneGraph(scenario.lanelets, road, self._ends)
        self._routes = EntryRoutes(road, self._graph, self._ends)
        self._rates = _rates(scenario, settings, self._graph)

    def made(
        self,
        seed: int,
        others: Sequence[Agent],
        first: int = 0,
        on_vehicle: Callable[[int, int], None] | None = None,
    ) -> Generated:
        """The traffic of a seed.

        Args:
            seed: Of the run.
            others: Agents of the file.
            first: The time step at which it begins.
            on_vehicle: Called after every vehicle with the number of those that are made, and of all.

        Raises:
            InputError: The map is too full, or no lane is long enough to be filled.
        """
        scenario, settings, graph = self._scenario, self._settings, self._graph
        wishes: list[Wish] = []
        density = settings.density
        if density is None:
            density = settings.rate / (3.6 * _usual_speed(graph))
        if density > 0.0:
            occupied = _occupied(scenario, others, first)
            wishes += filled(graph, settings, seed, density, occupied)
        n_filled = len(wishes)
        for lane, rate in self._rates.items():
            due = due_times(settings, seed, lane, rate)
            found = vehicles(settings, seed, lane, np.arange(len(due)))
            sizes = found.length.tolist(), found.width.tolist()
            rows = zip(due.tolist(), found.kinds, *sizes, found.drivers, strict=True)
            wishes += [Wish(lane, number, *row) for number, row in enumerate(rows)]
        wishes[n_filled:] = sorted(wishes[n_filled:], key=lambda wish: (wish.due, wish.lane, wish.number))
        base = _first_id(scenario, others)
        if not wishes and not self._rates:
            raise InputError("traffic", f"{scenario.name}: no lane is long enough to be filled")
        maker = JourneyMaker(scenario, self._road, settings, seed, graph, self._ends, self._routes, first)
        made = []
        for place, wish in enumerate(wishes):
            made.append(maker.made(wish, base + place, is_filled=place < n_filled))
            if on_vehicle is not None:
                on_vehicle(place + 1, len(wishes))
        begin = first * scenario.dt
        return Generated(
            agents=tuple(agent for agent, _ in made),
            drivers={agent.id: wish.driver for (agent, _), wish in zip(made, wishes, strict=True)},
            lane_ids=tuple(wish.lane for wish in wishes),
            due=tuple(math.nan if place < n_filled else begin + wish.due for place, wish in enumerate(wishes)),
            exit_ids=tuple(int(agent.route.lanelet_ids[-1]) for agent, _ in made),
            lengths=tuple(length for _, length in made),
        )


def map_alone(scenario: Scenario) -> Scenario:
    """The scenario without planning problems and recorded traffic; what never moves stays."""
    return replace(without_recorded_traffic(scenario), planning_problems=())


def without_recorded_traffic(scenario: Scenario) -> Scenario:
    """The scenario without recorded traffic; what never moves stays."""
    return replace(scenario, obstacles=scenario.obstacles.standing(), overlaps=())


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


def _occupied(scenario: Scenario, others: Sequence[Agent], first: int) -> list[tuple[float, float]]:
    """Where recorded vehicles and agents of the file are at a time step [m]."""
    obstacles, found = scenario.obstacles, []
    if first < obstacles.n_steps:
        there = obstacles.valid[:, first]
        found = list(zip(obstacles.x[there, first].tolist(), obstacles.y[there, first].tolist(), strict=True))
    starts = (agent.initial_state for agent in others)
    return [*found, *((start.x, start.y) for start in starts if start.time_step == first)]


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


def entered_at(agent: Agent, time_step: int, velocity: float, yaw_rate: float) -> Agent:
    """The agent as it has entered: later, and more slowly than it wanted; the time of its goal counts from then on."""
    waited = time_step - agent.initial_state.time_step
    if not waited and agent.queue is None:
        return agent
    # As the core does: the end of a recording does not wait.
    goal = tuple(
        replace(state, time_step=(state.time_step[0] + waited, state.time_step[1] + waited))
        if state.areas or agent.queue is not None
        else state
        for state in agent.goal
    )
    start = replace(agent.initial_state, time_step=time_step, velocity=velocity, yaw_rate=yaw_rate)
    return replace(agent, initial_state=start, goal=goal)
