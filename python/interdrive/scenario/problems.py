"""Planning problems put on a map: from a lane to a lane, which may be named as the source of the map names it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError
from interdrive.scenario.agent_settings import AgentSettings, GoalSettings
from interdrive.scenario.agents import select
from interdrive.scenario.limits import LARGEST_GOAL_TIME_STEP
from interdrive.scenario.model import GoalState, InitialState, PlanningProblem
from interdrive.scenario.native import core_road
from interdrive.scenario.shape import Shape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Floats
    from interdrive.native_settings import RoadSettings
    from interdrive.scenario.model import Lanelets, Scenario

#: Where vehicles start that are told no place: so far into their lane [m], or in the middle of a shorter one.
_START = 5.0
#: Speed where no limit is stated [m/s], as in a town.
_SPEED = 13.9
#: A goal may be reached in so many times the time at the limit, and so much later [s].
_TIME_FACTOR, _TIME_SPARE = 2.0, 20.0


@dataclass(frozen=True)
class Trip:
    """From where to where a vehicle is to drive.

    Attributes:
        start: Lane in which it starts: a lanelet id, or the name in the source of the map.
        goal: Lane in which its goal is.
        s: Arc length of the start along the middle of that lane [m]; None: 5 m, or the middle of a shorter lane.
    """

    start: str
    goal: str
    s: float | None = None


def lanelet_named(scenario: Scenario, text: str) -> int:
    """Id of the lanelet that a text names: its id, or what the source of the map calls it.

    "id=12" is an id only, "name=12" a name only.

    Raises:
        InputError: There is none, or the id of one is the name of another.
    """
    ids = scenario.lanelets.ids.tolist()
    keys = scenario.source.keys if scenario.source is not None else ()
    kind, equals, rest = text.partition("=")
    word = rest if equals and kind in ("id", "name") else text
    by_id = {number for number in ids if str(number) == word} if not (equals and kind == "name") else set()
    by_name = (
        {number for number, key in zip(ids, keys, strict=False) if key == word}
        if not (equals and kind == "id")
        else set()
    )
    found = by_id | by_name
    if len(found) == 1:
        return int(found.pop())
    if found:
        numbers = ", ".join(map(str, sorted(found)))
        raise InputError(f"{text}: the lanelets {numbers} have that id or name; write id={word} or name={word}")
    some = ", ".join(map(str, ids[:8])) + (", ..." if len(ids) > 8 else "")
    named = f"; names such as {', '.join(keys[:3])}" if keys else ""
    raise InputError(f"{text}: no lane has that id or name; there are the lanelets {some}{named}")


def with_problems(
    scenario: Scenario,
    trips: Sequence[Trip],
    *,
    road_settings: RoadSettings,
    first_id: int,
    velocity: float | None = None,
    seconds: float | None = None,
) -> tuple[Scenario, list[float]]:
    """The scenario with one more planning problem per trip.

    A vehicle starts on the middle of its lane, along it, at the first time step; its goal is its lane.

    Args:
        scenario: A map, with or without traffic.
        trips: From where to where.
        road_settings: How the roads are read.
        first_id: Id of the first problem; the others count on.
        velocity: At the start [m/s]; None: the limit of the lane, or 13.9 m/s.
        seconds: Time within which the goal must be reached [s]; None: twice that of the way at the limit, and 20 s.

    Returns:
        The scenario, and the length of each way [m].

    Raises:
        InputError: A lane does not exist, the start lies beyond its end, or no way leads to the goal.
    """
    problems = []
    for number, trip in enumerate(trips, start=first_id):
        start, goal = lanelet_named(scenario, trip.start), lanelet_named(scenario, trip.goal)
        pose = _pose(scenario.lanelets, start, trip)
        speed = velocity if velocity is not None else _limit(scenario.lanelets, start)
        state = InitialState(0, *pose, speed, 0.0, 0.0)
        problems.append(
            (trip, PlanningProblem(number, state, (_goal(scenario.lanelets, goal, LARGEST_GOAL_TIME_STEP),)))
        )
    road = core_road(scenario, road_settings)
    done, lengths = [], []
    for trip, problem in problems:
        alone = replace(scenario, planning_problems=(problem,))
        try:
            agents, _ = select(
                alone,
                road,
                [problem.id],
                agent_settings=AgentSettings(),
                goal_settings=GoalSettings(),
                max_steps=LARGEST_GOAL_TIME_STEP,
                seed=0,
            )
        except InputError as error:
            raise InputError(f"from {trip.start} to {trip.goal}: {error.message}") from None
        path = agents[0].route.reference_path
        way = _length(path)
        entry = agents[0].route.goal_entry_s
        start_s = agents[0].route.start_s
        length = (entry if math.isfinite(entry) else way) - start_s
        lengths.append(length)
        speed = _limit(scenario.lanelets, lanelet_named(scenario, trip.start))
        allowed = seconds if seconds is not None else _TIME_FACTOR * max(length, 0.0) / speed + _TIME_SPARE
        area = replace(problem.goal[0], time_step=(0, math.ceil(allowed / scenario.dt)))
        done.append(replace(problem, goal=(area,)))
    both = sorted((*scenario.planning_problems, *done), key=lambda one: one.id)
    return replace(scenario, planning_problems=tuple(both)), lengths


def _row(lanelets: Lanelets, number: int) -> int:
    return int(np.searchsorted(lanelets.ids, number))


def _limit(lanelets: Lanelets, number: int) -> float:
    stated = float(lanelets.speed_limit[_row(lanelets, number)])
    return stated if math.isfinite(stated) and stated > 0.0 else _SPEED


def _length(line: Floats) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def _pose(lanelets: Lanelets, number: int, trip: Trip) -> tuple[float, float, float]:
    """Position [m] and heading [rad] on the middle of a lanelet."""
    row = _row(lanelets, number)
    middle = 0.5 * (lanelets.left[row] + lanelets.right[row])
    steps = np.diff(middle, axis=0)
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*steps.T))])
    length = float(at[-1])
    s = min(_START, 0.5 * length) if trip.s is None else trip.s
    if not 0.0 <= s <= length:
        raise InputError(f"from {trip.start}: {s:g} m is not on the lane, which is {length:.1f} m long")
    piece = int(np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(steps) - 1))
    x, y = (float(np.interp(s, at, middle[:, axis])) for axis in (0, 1))
    return x, y, float(np.arctan2(steps[piece, 1], steps[piece, 0]))


def _goal(lanelets: Lanelets, number: int, last: int) -> GoalState:
    row = _row(lanelets, number)
    outline = np.concatenate([lanelets.left[row], lanelets.right[row][::-1]])
    return GoalState(areas=(Shape("polygon", vertices=outline),), lanelet_ids=(number,), time_step=(0, last))
