"""Agents before their routes are known: of planning problems, and of recorded vehicles with goals from recordings."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.scenario.inspection import DRIVABLE_KINDS, candidates
from interdrive.scenario.known_goals import (
    Temperament,
    arrival,
    desired_speed,
    headway_at,
    onwards,
    track_of,
)
from interdrive.scenario.model import KINDS, GoalState, InitialState
from interdrive.scenario.shape import Shape

if TYPE_CHECKING:
    from collections.abc import Callable

    from interdrive.array_types import Floats
    from interdrive.scenario.agent_settings import AgentSettings, GoalSettings
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
class Proposal:
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


def proposals_of(
    scenario: Scenario,
    road: _core.RoadNetwork,
    agent_settings: AgentSettings,
    goal_settings: GoalSettings,
    max_steps: int,
    temperament: Callable[[int, str], Temperament],
) -> tuple[list[Proposal], dict[int, str], list[str]]:
    """All vehicles that can be agents, why others cannot, by id, and notes on what was joined or left out.

    Args:
        scenario: The scenario.
        road: Its lanelets.
        agent_settings: Which vehicles count, and from when on they plan.
        goal_settings: How goals follow from recordings.
        max_steps: Vehicles that start later than this time step are left out.
        temperament: How fast an agent, by id and kind, wants to be where its goal has no time.
    """
    notes: list[str] = []
    reasons: dict[int, str] = {}
    proposals: list[Proposal] = []
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
) -> tuple[Proposal, str]:
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
    found = Proposal(
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


def _from_recording(
    scenario: Scenario,
    road: _core.RoadNetwork,
    obstacle_id: int,
    settings: GoalSettings,
    begin: int,
    temperament: Callable[[int, str], Temperament],
) -> Proposal | None:
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
    usual = Proposal(
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
