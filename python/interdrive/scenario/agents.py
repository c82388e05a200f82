"""Agents: planning problems of the file, and recorded vehicles with a goal derived from their recording."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, get_args

import numpy as np

from interdrive import _core
from interdrive.errors import InputError, check_between
from interdrive.scenario.inspection import DRIVABLE_KINDS, candidates
from interdrive.scenario.known_goals import (
    Information,
    MapEnds,
    Temperament,
    arrival,
    desired_speed,
    headway_at,
    onwards,
    route_length,
    track_of,
)
from interdrive.scenario.limits import LARGEST_VELOCITY
from interdrive.scenario.model import KINDS, GoalState, InitialState
from interdrive.scenario.native import core_shape
from interdrive.scenario.shape import Shape

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from interdrive.array_types import Floats
    from interdrive.scenario.model import PlanningProblem, Scenario

#: CommonRoad vehicle type of a planning problem's vehicle without other wishes: BMW 320i.
_USUAL_TYPE = 2

#: The types that are trucks; others are cars.
_TRUCKS = (4,)

#: A planning problem and a recorded vehicle are one if they are nearer than this [m], and, where the vehicle enters
#: later, differ by less than this in speed [m/s] and heading [rad].
_SAME_PLACE, _SAME_SPEED, _SAME_HEADING = 1.0, 0.5, 0.2

#: Recordings may leave out steps for this time [s] while a vehicle is there.
_GAP = 1.0


@dataclass(frozen=True)
class AgentSettings:
    """Which recorded vehicles can become agents, and what planning problems drive.

    Attributes:
        min_displacement: Smallest distance that a vehicle must get away from its start.
        vehicle_type: CommonRoad vehicle type of planning problems: 1 (Ford Escort), 2 (BMW 320i), 3 (VW Vanagon), 4
            (truck). 0: the recorded vehicle at their start, otherwise type 2.
        plan_from: From when on recorded vehicles plan, counted from the first time step; until then they replay.
            Vehicles that enter later plan from then on, vehicles that have left by then only replay. What planning
            problems drive starts as they state.
    """

    min_displacement: Annotated[float, "m"] = 10.0
    vehicle_type: int = 0
    plan_from: Annotated[float, "s"] = 0.0

    def __post_init__(self) -> None:
        """Checks the ranges."""
        check_between("vehicle_type", self.vehicle_type, 0, 4)
        if not 0.0 <= self.plan_from <= 1e5:
            raise InputError("plan_from", f"must be at least 0 and at most 100000, not {self.plan_from}")


@dataclass(frozen=True)
class GoalSettings:
    """Goals derived from recordings: the section of lane around the last recorded state.

    Attributes:
        length_before: Length of the section before the last recorded position.
        length_after: Length of the section after the last recorded position.
        time_early: How much earlier than recorded the agent may arrive; inf: at any time.
        time_late: How much later than recorded the agent may arrive without being late.
        velocity_tolerance: Allowed difference from the last recorded speed.
        limit_share: Largest share of the local speed limit that a goal may demand, whatever `rules.speed_factor` and
            the recorded speed; inf: no bound.
        orientation_tolerance: Allowed difference from the direction of the lane.
        information: What an agent knows of its recording. timed: where it ends, when and how fast. place: where it
            ends. route: the recorded lanelets. turns: the recorded turns at forks, but no lane changes. Without the
            time it wants to be as fast as the traffic around its start, and drives until the recording is over.
    """

    length_before: Annotated[float, "m"] = 5.0
    length_after: Annotated[float, "m"] = 5.0
    time_early: Annotated[float, "s"] = math.inf
    time_late: Annotated[float, "s"] = 1.0
    velocity_tolerance: Annotated[float, "m/s"] = 5.0
    limit_share: float = 0.9
    orientation_tolerance: Annotated[float, "rad"] = 0.5
    information: Information = "timed"

    def __post_init__(self) -> None:
        """Checks the ranges."""
        if self.information not in get_args(Information):
            raise InputError(
                "information", f"must be one of {', '.join(get_args(Information))}, not {self.information!r}"
            )
        for name in ("length_before", "length_after", "time_early", "time_late"):
            if not getattr(self, name) >= 0:
                raise InputError(name, f"must not be negative, is {getattr(self, name)}")
        for name in ("length_before", "length_after", "time_late"):
            if not getattr(self, name) <= 1e5:
                raise InputError(name, f"must be at most 100000, not {getattr(self, name)}")
        for name in ("velocity_tolerance", "limit_share", "orientation_tolerance"):
            if not getattr(self, name) > 0:
                raise InputError(name, f"must be positive, is {getattr(self, name)}")


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


@dataclass(frozen=True)
class _Proposal:
    """An agent before its route is known."""

    id: int
    names: tuple[int, ...]  # ids that select it
    origin: str
    kind: str
    shape: Shape
    initial_state: InitialState
    goal: tuple[GoalState, ...]
    velocity_max: float
    vehicle_type: int = 0  # 0: limits that fit the footprint
    past: tuple[tuple[float, float], ...] = ()  # recorded speeds and headings right before the start
    track: Floats | None = None  # the route follows it; None: the route leads to the goal
    keeps_lane: bool = False
    speed: float = 0.0  # desired on a free road, where no time is known
    headway: float = math.nan


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
    proposals, reasons, notes = _proposals(
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
    proposals, reasons, _ = _proposals(scenario, road, agent_settings, goal_settings, max_steps, _usual_temperament)
    able = []
    ends = MapEnds(scenario, road)
    for proposal in proposals:
        try:
            _build(proposal, road, scenario, ends)
            able.append(proposal.id)
        except InputError as error:
            reasons[proposal.id] = error.message
    return sorted(able), dict(sorted(reasons.items()))


def _order(proposals: list[_Proposal], seed: int) -> list[_Proposal]:
    """Planning problems first, then recorded vehicles in an order that depends on the seed."""
    problems = [p for p in proposals if p.origin == "planning problem"]
    recorded = [p for p in proposals if p.origin == "recorded"]
    order = np.random.default_rng(seed).permutation(len(recorded))
    return problems + [recorded[i] for i in order]


def _choose(
    proposals: list[_Proposal], reasons: dict[int, str], agents: str | int | Sequence[int], seed: int
) -> list[_Proposal]:
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
            raise InputError(f"the number of agents must be at least 1, not {agents}")
        if agents > len(proposals):
            why = f"; {agents} is no agent: {reasons[agents]}" if agents in reasons else ""
            raise InputError(f"{agents} agents requested, but only {len(proposals)} vehicles can be agents{why}")
        return _order(proposals, seed)[:agents]
    chosen: list[_Proposal] = []
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


def _proposals(
    scenario: Scenario,
    road: _core.RoadNetwork,
    agent_settings: AgentSettings,
    goal_settings: GoalSettings,
    max_steps: int,
    temperament: Callable[[int, str], Temperament],
) -> tuple[list[_Proposal], dict[int, str], list[str]]:
    notes: list[str] = []
    reasons: dict[int, str] = {}
    proposals: list[_Proposal] = []
    obstacles = scenario.obstacles
    taken = {int(i) for i in obstacles.ids} | {problem.id for problem in scenario.planning_problems}
    driven = _driven(scenario)
    for problem in scenario.planning_problems:
        if not problem.goal:
            reasons[problem.id] = "its planning problem has no goal"
            notes.append(f"planning problem {problem.id} has no goal and is left out")
            continue
        proposal, note = _from_problem(scenario, problem, driven.get(problem.id), taken, agent_settings.vehicle_type)
        taken.add(proposal.id)
        if note:
            notes.append(note)
        proposals.append(proposal)
    found = candidates(scenario, min_displacement=agent_settings.min_displacement)
    for obstacle_id, accepted, reason in zip(found.ids.tolist(), found.accepted.tolist(), found.reasons, strict=True):
        if any(obstacle_id == p.id for p in proposals):
            continue
        if accepted:
            begin = round(agent_settings.plan_from / scenario.dt)
            planned = _from_recording(scenario, road, obstacle_id, goal_settings, begin, temperament)
            if planned is None:
                reasons[obstacle_id] = f"has left by agents.plan_from ({agent_settings.plan_from:g} s)"
            else:
                proposals.append(planned)
        else:
            reasons[obstacle_id] = reason
    late = [p for p in proposals if p.initial_state.time_step >= max_steps]
    for proposal in late:
        reasons[proposal.id] = (
            f"starts at time step {proposal.initial_state.time_step}, but runs end after {max_steps} (step.max_steps)"
        )
        notes.append(f"agent {proposal.id}: {reasons[proposal.id]}; it is left out")
    return [p for p in proposals if p not in late], reasons, notes


def _driven(scenario: Scenario) -> dict[int, tuple[int, str]]:
    """By planning problem the row of the recorded vehicle that it drives, if it has one, and where both are one.

    A vehicle belongs to one problem: first to a problem that starts where it is at that time, then to a problem that
    states what it has at its first time step, at about that time. Files that are cut or converted put problems to time
    step 0, whenever their vehicle enters: there the time says nothing. The best match counts.
    """
    problems = [problem for problem in scenario.planning_problems if problem.goal]
    found: dict[int, tuple[int, str]] = {}
    matches = [match for problem in problems for match in _present(scenario, problem)]
    if not scenario.raw:
        matches += [match for problem in problems for match in _entering(scenario, problem)]
    for *_, number, row, where in sorted(matches):
        if number not in found and row not in {taken for taken, _ in found.values()}:
            found[number] = row, where
    return found


def _present(scenario: Scenario, problem: PlanningProblem) -> list[tuple[int, float, int, int, str]]:
    """Recorded vehicles that are where a problem starts, at that time: rank, distance, problem, row, where."""
    state, obstacles = problem.initial_state, scenario.obstacles
    x, y = (_at_time(table, obstacles.valid, state.time_step, scenario.dt) for table in (obstacles.x, obstacles.y))
    distance = np.hypot(x - state.x, y - state.y)
    same = np.flatnonzero(~obstacles.is_static & (distance < _SAME_PLACE))
    return [(0, float(distance[row]), problem.id, row, "is") for row in same.tolist()]


def _entering(scenario: Scenario, problem: PlanningProblem) -> list[tuple[int, float, int, int, str]]:
    """Recorded vehicles that enter after a problem starts, in its state: rank, difference, problem, row, where."""
    state, obstacles = problem.initial_state, scenario.obstacles
    # Many vehicles enter by one lane in nearly one state: who enters much later than a stated time is another one.
    latest = state.time_step + max(1, round(_GAP / scenario.dt)) if state.time_step > 0 else obstacles.n_steps
    rows = np.arange(len(obstacles.ids))
    first = obstacles.valid.argmax(axis=1) if len(rows) else rows

    distance = np.hypot(obstacles.x[rows, first] - state.x, obstacles.y[rows, first] - state.y)
    speed = np.abs(obstacles.velocity[rows, first] - state.velocity)
    turn = obstacles.orientation[rows, first] - state.orientation
    turn = np.abs(np.arctan2(np.sin(turn), np.cos(turn)))
    drivable = np.array([kind in DRIVABLE_KINDS for kind in obstacles.kinds], dtype=np.bool_)
    same = drivable & ~obstacles.is_static & obstacles.valid.any(axis=1)
    same &= (first > state.time_step) & (first <= latest)
    same &= (distance < _SAME_PLACE) & (speed < _SAME_SPEED) & (turn < _SAME_HEADING)
    difference = distance / _SAME_PLACE + speed / _SAME_SPEED + turn / _SAME_HEADING
    return [
        (1, float(difference[row]), problem.id, row, f"enters at time step {first[row]}")
        for row in np.flatnonzero(same).tolist()
    ]


def _at_time(table: np.ndarray, valid: np.ndarray, time_step: int, dt: float) -> np.ndarray:
    """A column of a table; between recorded steps that are near each other, on the straight line; nan where absent."""
    n_steps = table.shape[1]
    if not 0 <= time_step < n_steps:
        return np.full(len(table), np.nan)
    values = table[:, time_step].copy()
    reach = max(1, round(_GAP / dt))
    for row in np.flatnonzero(~valid[:, time_step]).tolist():
        near = slice(max(0, time_step - reach), time_step + reach + 1)
        steps = np.flatnonzero(valid[row, near]) + near.start
        if steps.size and steps[0] < time_step < steps[-1]:
            values[row] = np.interp(time_step, steps, table[row, steps])
    return values


def _from_problem(
    scenario: Scenario, problem: PlanningProblem, driven: tuple[int, str] | None, taken: set[int], vehicle_type: int
) -> tuple[_Proposal, str]:
    """The agent of a planning problem; if it drives a recorded vehicle, the agent takes its place."""
    state, obstacles = problem.initial_state, scenario.obstacles
    size = _core.Vehicle.of_type(vehicle_type or _USUAL_TYPE)
    shape = Shape("rectangle", length=size.length, width=size.width)
    own_type = vehicle_type or _USUAL_TYPE
    kind, agent_id, note = "truck" if own_type in _TRUCKS else "car", problem.id, ""
    names: tuple[int, ...] = (problem.id,)
    past: tuple[tuple[float, float], ...] = ()
    if driven is not None:
        row, where = driven
        agent_id = int(obstacles.ids[row])
        names = (problem.id, agent_id)
        if not vehicle_type:
            own_type, kind, shape = 0, obstacles.kinds[row], obstacles.shapes[row]
        past = _past(scenario, row, state.time_step)
        note = f"planning problem {problem.id} starts where recorded vehicle {agent_id} {where}: they are one agent"
    elif problem.id in {int(i) for i in obstacles.ids}:
        agent_id = max(taken) + 1
        note = f"planning problem {problem.id} has the id of an obstacle elsewhere: its agent is {agent_id}"
        names = (agent_id,)
    found = _Proposal(
        agent_id, names, "planning problem", kind, shape, state, problem.goal, state.velocity, own_type, past
    )
    return found, note


def _past(scenario: Scenario, row: int, time_step: int) -> tuple[tuple[float, float], ...]:
    """Recorded speeds [m/s] and headings [rad] right before a time step, oldest first, without a gap."""
    obstacles = scenario.obstacles
    if not 0 < time_step <= obstacles.n_steps:
        return ()
    absent = np.flatnonzero(~obstacles.valid[row, :time_step])
    steps = slice(int(absent[-1]) + 1 if absent.size else 0, time_step)
    values = zip(obstacles.velocity[row, steps].tolist(), obstacles.orientation[row, steps].tolist(), strict=True)
    return tuple(values)


def _usual_temperament(_agent: int, _kind: str) -> Temperament:
    return Temperament()


def _from_recording(
    scenario: Scenario,
    road: _core.RoadNetwork,
    obstacle_id: int,
    settings: GoalSettings,
    begin: int,
    temperament: Callable[[int, str], Temperament],
) -> _Proposal | None:
    """The agent of a recorded vehicle that plans from a time step on; None if it has left by then."""
    obstacles = scenario.obstacles
    row = int(np.searchsorted(obstacles.ids, obstacle_id))
    steps = np.flatnonzero(obstacles.valid[row])
    steps = steps[steps >= begin]
    if len(steps) < 2:
        return None
    first, last = int(steps[0]), int(steps[-1])
    # Accelerations of recordings are often smoothed, and so know what comes.
    is_past_only = begin > 0 or settings.information != "timed"

    def value(table: np.ndarray, column: int) -> float:
        return float(table[row, column])

    def stated(name: str) -> float:
        """A first value; nan if it was derived from what the vehicle does later."""
        derived = bool(obstacles.derived) and name in obstacles.derived[row]
        return math.nan if derived or is_past_only else value(getattr(obstacles, name), first)

    initial = InitialState(
        time_step=first,
        x=value(obstacles.x, first),
        y=value(obstacles.y, first),
        orientation=value(obstacles.orientation, first),
        velocity=value(obstacles.velocity, first),
        acceleration=stated("acceleration"),
        yaw_rate=stated("yaw_rate"),
    )
    x, y = value(obstacles.x, last), value(obstacles.y, last)
    orientation, velocity = value(obstacles.orientation, last), value(obstacles.velocity, last)
    kind = obstacles.kinds[row]
    areas, lane_orientation = _goal_areas(road, x, y, orientation, kind, settings)
    usual = _Proposal(
        id=obstacle_id,
        names=(obstacle_id,),
        origin="recorded",
        kind=kind,
        shape=obstacles.shapes[row],
        initial_state=initial,
        goal=(),
        velocity_max=float(np.nanmax(np.abs(obstacles.velocity[row]))),
        past=_past(scenario, row, first) if is_past_only else (),
        headway=headway_at(scenario, row, first),
    )
    if settings.information != "timed":
        limit = float(road.lane_rules(*(np.array([v]) for v in (initial.x, initial.y, initial.orientation)))[0][0])
        limit = math.inf if math.isnan(limit) else limit
        speed = desired_speed(scenario, row, first, limit, temperament(obstacle_id, kind))
        end = obstacles.n_steps - 1
        knows_place = settings.information != "turns"
        places = (arrival(areas, first, end),) if knows_place else ()
        return replace(
            usual,
            goal=(onwards(speed, first, end), *places),
            track=None if settings.information == "place" else track_of(scenario, row, first),
            keeps_lane=settings.information == "turns",
            speed=speed,
            velocity_max=max(speed, float(initial.velocity)),
        )
    early = settings.time_early / scenario.dt
    limit = float(road.lane_rules(np.array([x]), np.array([y]), np.array([orientation]))[0][0])
    allowed = math.inf if math.isnan(limit) else settings.limit_share * limit
    goal = GoalState(
        areas=areas,
        lanelet_ids=(),
        time_step=(
            first + 1 if math.isinf(early) else max(first + 1, last - round(early)),
            last + round(settings.time_late / scenario.dt),
        ),
        velocity=_goal_speeds(velocity, settings.velocity_tolerance, allowed),
        orientation=(
            lane_orientation - settings.orientation_tolerance,
            lane_orientation + settings.orientation_tolerance,
        ),
    )
    return replace(usual, goal=(goal,))


def _goal_speeds(velocity: float, tolerance: float, allowed: float) -> tuple[float, float]:
    """Speeds around that at the end of a recording [m/s]; only a vehicle that reverses there may arrive so."""
    least = min(velocity - tolerance, allowed)
    least = least if velocity < -_core.JUDGED_STANDSTILL_SPEED else max(0.0, least)
    return least, max(least, velocity + tolerance)


def _goal_areas(
    road: _core.RoadNetwork, x: float, y: float, orientation: float, kind: str, settings: GoalSettings
) -> tuple[tuple[Shape, ...], float]:
    """The section of lane around a pose, and the lane's direction there; off the lanelets a rectangle.

    Lanelets that are no lane for the kind of vehicle count only where there is no lane.
    """
    found = road.matching(x, y, orientation, 1.0, math.pi / 2)
    found.sort(key=lambda match: not road.admits(match[0], KINDS.index(kind)))
    if found:
        lanelet, s, _, heading_error = found[0]
        polygons = road.lane_stretch(lanelet, s, settings.length_before, settings.length_after)
        if polygons:
            shapes = tuple(Shape("polygon", vertices=np.asarray(polygon)) for polygon in polygons)
            return shapes, orientation - heading_error
    length = settings.length_before + settings.length_after
    ahead = 0.5 * (settings.length_after - settings.length_before)
    center = (x + ahead * math.cos(orientation), y + ahead * math.sin(orientation))
    return (Shape("rectangle", length=length, width=4.0, center=center, orientation=orientation),), orientation


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


def _build(proposal: _Proposal, road: _core.RoadNetwork, scenario: Scenario, ends: MapEnds) -> Agent:
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


def _leaving_map(proposal: _Proposal, ends: MapEnds, route: _core.Route) -> _Proposal:
    """The same, done where its route leads out of the map."""
    length = core_shape(proposal.shape).extent[0]
    areas = ends.areas_anywhere(route.lanelet_ids[-1], length, proposal.speed, KINDS.index(proposal.kind))
    if not areas:
        return proposal
    first, last = proposal.initial_state.time_step, proposal.goal[0].time_step[0]
    return replace(proposal, goal=(*proposal.goal, arrival(areas, first, last)))


def _vehicle(proposal: _Proposal, velocity_max: float | None = None) -> _core.Vehicle:
    """Of a type, or with limits that fit the footprint; a top speed replaces its own."""
    if proposal.vehicle_type:
        return _core.Vehicle.of_type(proposal.vehicle_type, velocity_max=velocity_max)
    length, width = core_shape(proposal.shape).extent
    return _core.Vehicle(KINDS.index(proposal.kind), length, width, velocity_max=velocity_max)
