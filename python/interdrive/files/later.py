"""A scenario that begins at a later time step of its recording."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError
from interdrive.files.motion import Track, completed
from interdrive.recordings import part_of, with_own_overlaps
from interdrive.scenario import STATE_FIELDS

if TYPE_CHECKING:
    from interdrive.scenario import GoalState, Obstacles, PlanningProblem, Scenario

#: Columns that a file leaves out where they were derived.
_NOT_WRITTEN = ("acceleration", "yaw_rate")


def later(scenario: Scenario, start: int) -> Scenario:
    """The scenario from a time step on, as if its file had been cut there; that step is 0 then.

    Planning problems that begin earlier are left out, the others keep their times.

    Args:
        scenario: As its file has it.
        start: The time step, above 0.

    Raises:
        InputError: It has no such time step or is cut already, or SUMO drives its traffic.
    """
    last = scenario.obstacles.n_steps - 1
    if scenario.sumo is not None:
        raise InputError("recording.start", f"{scenario.name}: SUMO makes its traffic, so no recording can begin later")
    if scenario.start:
        raise InputError("recording.start", f"{scenario.name} begins at time step {scenario.start}, not at {start}")
    if start >= last:
        raise InputError("recording.start", f"{scenario.name} has time steps 0 to {last}: none follows {start}")
    problems = [one for one in scenario.planning_problems if one.initial_state.time_step >= start]
    notes = [f"begins at time step {start} of the recording, which is 0 here; its last one is {last - start}"]
    if left_out := [str(one.id) for one in scenario.planning_problems if one not in problems]:
        notes.append(f"planning problems that begin earlier are left out: {', '.join(left_out)}")
    part = with_own_overlaps(part_of(scenario, start, last + 1))
    return replace(
        part,
        obstacles=_as_written(part.obstacles, scenario.dt),
        planning_problems=tuple(_earlier(one, start) for one in problems),
        notes=(*part.notes, *notes),
        start=start,
    )


def _as_written(obstacles: Obstacles, dt: float) -> Obstacles:
    """As a file would say it: what was not stated is derived from the states that are left, no zero has a sign."""
    tables = {name: getattr(obstacles, name) + 0.0 for name in STATE_FIELDS}
    derived = [tuple(name for name in names if name in _NOT_WRITTEN) for names in obstacles.derived]
    for row, names in enumerate(derived):
        if not names:
            continue
        steps = np.flatnonzero(obstacles.valid[row])
        values = np.column_stack([tables[name][row, steps] for name in STATE_FIELDS])
        values[:, [STATE_FIELDS.index(name) for name in names]] = np.nan
        for name, column in zip(STATE_FIELDS, completed(Track(steps, values), dt).values.T, strict=True):
            tables[name][row, steps] = column
    return replace(obstacles, **tables, derived=tuple(derived))


def _earlier(problem: PlanningProblem, steps: int) -> PlanningProblem:
    state = replace(problem.initial_state, time_step=problem.initial_state.time_step - steps)
    return replace(problem, initial_state=state, goal=tuple(_goal_earlier(one, steps) for one in problem.goal))


def _goal_earlier(goal: GoalState, steps: int) -> GoalState:
    first, last = goal.time_step
    return replace(goal, time_step=(max(first - steps, 0), last - steps))
