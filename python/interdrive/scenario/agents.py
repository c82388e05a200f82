"""Agents: which are chosen, and how they are built."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.errors import InputError
from interdrive.scenario.agent_settings import AgentSettings, GoalSettings
from interdrive.scenario.known_goals import (
    MapEnds,
    Temperament,
    arrival,
    route_length,
)
from interdrive.scenario.limits import LARGEST_VELOCITY
from interdrive.scenario.model import KINDS, GoalState, InitialState
from interdrive.scenario.native import core_shape
from interdrive.scenario.proposals import Proposal, proposals_of
from interdrive.scenario.shape import Shape

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from interdrive.scenario.model import Scenario


@dataclass(frozen=True)
class Agent:
    """A vehicle that is driven by a planner.

    Attributes:
        id: Unique among all participants.
        names: Ids that select it: its own, and that of its planning problem.
        origin: "planning problem", "recorded" or "generated".
        kind: One of `interdrive.scenario.KINDS`.
        shape: Footprint in the body frame.
        initial_state: As recorded or as the planning problem states it.
        goal: Alternatives.
        vehicle: Limits.
        route: Route and reference path.
        native_goal: The goal for the core.
        replays_before: It replays its recording until it starts.
        headway: Recorded time to the vehicle ahead where it starts [s]; nan: nobody is there, or it is slow.
        queue: Number of the queue in which it waits for a gap before it enters, and the last time step at which it may
            enter; None: it enters at its time.
    """

    id: int
    names: tuple[int, ...]
    origin: str
    kind: str
    shape: Shape
    initial_state: InitialState
    goal: tuple[GoalState, ...]
    vehicle: _core.Vehicle
    route: _core.Route
    native_goal: _core.Goal
    replays_before: bool = False
    headway: float = math.nan
    queue: tuple[int, int] | None = None


#: What chooses agents, for messages.
_CHOICES = "'all', 'reachable', 'problems', a number or ids"


def normalized(agents: object) -> str | int | list[int]:
    """The choice of agents as "all", "reachable", "problems", a number, or a list of ids.

    Raises:
        InputError: The choice is none of these.
    """
    if isinstance(agents, str):
        return agents
    try:
        return operator.index(agents)  # type: ignore[arg-type]
    except TypeError:
        pass
    try:
        return [operator.index(agent) for agent in agents]  # type: ignore[attr-defined]
    except TypeError:
        raise InputError(f"agents must be {_CHOICES}, not {agents!r}") from None


def select(
    scenario: Scenario,
    road: _core.RoadNetwork,
    agents: str | int | Sequence[int],
    *,
    agent_settings: AgentSettings,
    goal_settings: GoalSettings,
    max_steps: int,
    seed: int,
    temperament: Callable[[int, str], Temperament] | None = None,
) -> tuple[list[Agent], list[str]]:
    """Chooses and prepares the agents.

    Args:
        scenario: The scenario.
        road: Its road network.
        agents: "all" (planning problems and every recorded vehicle that can be one), "problems" (planning problems
            alone), a number (planning problems first, then recorded vehicles chosen with the seed), or ids. A number
            that is larger than the number of possible agents is the id of one.
        agent_settings: Which vehicles can be agents.
        goal_settings: How goals are derived.
        max_steps: Number of time steps after which the run ends; vehicles that start later cannot be agents.
        seed: For the choice of a number.
        temperament: Of the driver of a vehicle by id and kind; None: all are alike.

    Returns:
        The agents, sorted by id, and one line per vehicle that stays recorded although it may have been meant.

    Raises:
        InputError: Unknown id, an id that cannot be an agent, or no agent left.
        NoRouteError: An agent asked for by id has no route.
    """
    proposals, reasons, notes = proposals_of(
        scenario, road, agent_settings, goal_settings, max_steps, temperament or _usual_temperament
    )
    # Ids are large: what cannot be a number of agents is the id of one.
    if isinstance(agents, int) and agents > len(proposals) and any(agents in one.names for one in proposals):
        agents = [agents]
    explicit = not isinstance(agents, str | int)
    chosen = _choose(proposals, reasons, agents, seed)
    built: list[Agent] = []
    ends = MapEnds(scenario, road)
    waiting = list(chosen)
    while waiting:
        proposal = waiting.pop(0)
        try:
            built.append(_build(proposal, road, scenario, ends))
        except InputError as error:
            if explicit:
                raise
            notes.append(f"{error}; it replays its recording" if proposal.origin == "recorded" else str(error))
            if isinstance(agents, int):
                spare = [p for p in _order(proposals, seed) if p not in chosen]
                if spare:
                    chosen.append(spare[0])
                    waiting.append(spare[0])
    if not built and not scenario.planning_problems and scenario.sumo is not None:
        raise InputError(f"{scenario.name}: has no planning problems; with --agents 0 SUMO's vehicles drive alone")
    if not built and not scenario.planning_problems and not len(scenario.obstacles.ids):
        raise InputError(f"{scenario.name}: has no traffic; a map can be run once it has vehicles or planning problems")
    if not built:
        why = f" ({notes[-1]})" if notes else ""
        raise InputError(f"{scenario.name}: no vehicle can become an agent{why}; `interdrive check` lists the reasons")
    return sorted(built, key=lambda agent: agent.id), notes


def possible_agents(
    scenario: Scenario,
    road: _core.RoadNetwork,
    *,
    agent_settings: AgentSettings,
    goal_settings: GoalSettings,
    max_steps: int,
) -> tuple[list[int], dict[int, str]]:
    """Ids of possible agents, and by id the reasons why other vehicles cannot be agents.

    Args:
        scenario: The scenario.
        road: Its road network.
        agent_settings: Which vehicles can be agents.
        goal_settings: How goals are derived.
        max_steps: Number of time steps after which the run ends.
    """
    proposals, reasons, _ = proposals_of(scenario, road, agent_settings, goal_settings, max_steps, _usual_temperament)
    able = []
    ends = MapEnds(scenario, road)
    for proposal in proposals:
        try:
            _build(proposal, road, scenario, ends)
            able.append(proposal.id)
        except InputError as error:
            reasons[proposal.id] = error.message
    return sorted(able), dict(sorted(reasons.items()))


def _order(proposals: list[Proposal], seed: int) -> list[Proposal]:
    """Planning problems first, then recorded vehicles in an order that depends on the seed."""
    problems = [p for p in proposals if p.origin == "planning problem"]
    recorded = [p for p in proposals if p.origin == "recorded"]
    order = np.random.default_rng(seed).permutation(len(recorded))
    return problems + [recorded[i] for i in order]


def _choose(
    proposals: list[Proposal], reasons: dict[int, str], agents: str | int | Sequence[int], seed: int
) -> list[Proposal]:
    if isinstance(agents, str):
        if agents == "problems":
            return [proposal for proposal in proposals if proposal.origin == "planning problem"]
        if agents != "all":
            raise InputError(f"agents must be {_CHOICES}, not {agents!r}")
        return list(proposals)
    if not isinstance(agents, int) and not agents:
        raise InputError("agents: the list of ids is empty")
    if isinstance(agents, int):
        if agents < 1:
            raise InputError(
                f"the number of agents must be at least 1, or 0 with generated traffic alone, not {agents}"
            )
        if agents > len(proposals):
            why = f"; {agents} is no agent: {reasons[agents]}" if agents in reasons else ""
            raise InputError(f"{agents} agents requested, but only {len(proposals)} vehicles can be agents{why}")
        return _order(proposals, seed)[:agents]
    chosen: list[Proposal] = []
    for wanted in agents:
        found = next((p for p in proposals if wanted in p.names), None)
        if found is None:
            known = ", ".join(str(p.id) for p in proposals[:20]) or "none"
            why = reasons.get(int(wanted), "no such vehicle")
            more = ", ..." if len(proposals) > 20 else ""
            raise InputError(f"agent {wanted}", f"{why}; possible agents: {known}{more}")
        if found not in chosen:
            chosen.append(found)
    return chosen


def _usual_temperament(_agent: int, _kind: str) -> Temperament:
    return Temperament()


def native_goal(goal: tuple[GoalState, ...], pace: float | None = None) -> _core.Goal:
    """The goal for the core.

    Args:
        goal: Its alternatives.
        pace: Speed that the agent wants on its way, however much time it has [m/s]; None: what the time demands.
    """
    return _core.Goal(
        [
            (
                [core_shape(area) for area in alternative.areas],
                alternative.time_step,
                alternative.velocity,
                alternative.orientation,
            )
            for alternative in goal
        ],
        pace,
    )


def _build(proposal: Proposal, road: _core.RoadNetwork, scenario: Scenario, ends: MapEnds) -> Agent:
    state, dt = proposal.initial_state, scenario.dt
    start = (state.x, state.y, state.orientation, state.velocity)
    user = KINDS.index(proposal.kind)
    try:
        goal = native_goal(proposal.goal)
        if proposal.track is None:
            route = _core.Route.find(road, *start, goal, user)
        else:
            length, keeps_lane = route_length(proposal.speed), proposal.keeps_lane
            route = _core.Route.along(road, *start, proposal.track, keeps_lane=keeps_lane, length=length, user=user)
            proposal = _leaving_map(proposal, ends, route)
            goal = native_goal(proposal.goal)
    except InputError as error:
        raise error.within(f"agent {proposal.id}") from None
    vehicle = _vehicle(proposal)
    velocity_max = min(1.2 * proposal.velocity_max, LARGEST_VELOCITY)
    if velocity_max > vehicle.velocity_max:
        vehicle = _vehicle(proposal, velocity_max)
    values = (state.x, state.y, state.orientation, state.velocity, state.acceleration, state.yaw_rate)
    acceleration, yaw_rate = route.first_state(vehicle, values, proposal.past, dt)
    return Agent(
        id=proposal.id,
        names=tuple(sorted({proposal.id, *proposal.names})),
        origin=proposal.origin,
        kind=proposal.kind,
        shape=proposal.shape,
        initial_state=replace(state, acceleration=acceleration, yaw_rate=yaw_rate),
        goal=proposal.goal,
        vehicle=vehicle,
        route=route,
        native_goal=goal,
        replays_before=bool(proposal.past) and proposal.origin == "recorded",
        headway=proposal.headway,
    )


def _leaving_map(proposal: Proposal, ends: MapEnds, route: _core.Route) -> Proposal:
    """The same, done where its route leads out of the map."""
    length = core_shape(proposal.shape).extent[0]
    areas = ends.areas_anywhere(route.lanelet_ids[-1], length, proposal.speed, KINDS.index(proposal.kind))
    if not areas:
        return proposal
    first, last = proposal.initial_state.time_step, proposal.goal[0].time_step[0]
    return replace(proposal, goal=(*proposal.goal, arrival(areas, first, last)))


def _vehicle(proposal: Proposal, velocity_max: float | None = None) -> _core.Vehicle:
    """Of a type, or with limits that fit the footprint; a top speed replaces its own."""
    if proposal.vehicle_type:
        return _core.Vehicle.of_type(proposal.vehicle_type, velocity_max=velocity_max)
    length, width = core_shape(proposal.shape).extent
    return _core.Vehicle(KINDS.index(proposal.kind), length, width, velocity_max=velocity_max)
