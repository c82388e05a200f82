"""Headings that are off by one angle: positions were moved to a local frame, headings were not."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from interdrive.array_types import Floats
    from interdrive.scenario import GoalState, Obstacles, PlanningProblem, Scenario

#: Vehicles that move where they head. Motorcycles lean and swerve, bicycles more so.
_MOTOR_VEHICLES = frozenset(("car", "truck", "bus", "taxi", "priority_vehicle"))
#: Steps that are longer than this [m] have a direction.
_STEP_LENGTH = 1.0
#: Smaller offsets [rad] are left alone.
_OFFSET_MIN = np.radians(0.5)
#: A constant offset varies less than this between its quartiles [rad].
_RANGE_MAX = np.radians(0.5)
#: Fewer steps say nothing about a recording.
_SAMPLES_MIN = 200


@dataclass(frozen=True)
class HeadingOffset:
    """By how much vehicles move in other directions than they head.

    Attributes:
        median: Direction of a step minus mean heading of its ends (plus half a turn if it is driven backwards), median
            over all steps [rad]; nan without any.
        spread: Interquartile range of the same [rad].
        n_samples: Number of steps longer than 1 m of motor vehicles.
    """

    median: float
    spread: float
    n_samples: int

    @property
    def is_constant(self) -> bool:
        """Whether it is one angle by which all headings are off, rather than noise or drift."""
        return self.n_samples >= _SAMPLES_MIN and abs(self.median) > _OFFSET_MIN and self.spread < _RANGE_MAX


def heading_offset(recordings: Iterable[Obstacles]) -> HeadingOffset:
    """The heading offset of one recording, or of several together.

    Args:
        recordings: Recorded traffic. Headings that were derived from the motion do not count.
    """
    found = np.concatenate([np.empty(0), *(_offsets(one) for one in recordings)])
    if not found.size:
        return HeadingOffset(float("nan"), float("nan"), 0)
    first, median, third = np.percentile(found, (25.0, 50.0, 75.0)).tolist()
    if third - first > np.pi:
        # Angles near half a turn lie at both ends of the range.
        middle = float(np.angle(np.exp(1j * found).mean()))
        first, median, third = (middle + np.percentile(_wrapped(found - middle), (25.0, 50.0, 75.0))).tolist()
        median = float(_wrapped(np.array([median]))[0]) if abs(median) > np.pi else median
    return HeadingOffset(median, third - first, len(found))


def turned(scenario: Scenario, offset: HeadingOffset) -> Scenario:
    """The scenario with all stated headings turned by an offset: those of obstacles, starts and goals.

    Args:
        scenario: As the file has it.
        offset: By how much.

    Returns:
        The scenario; `notes` says what was done.
    """
    obstacles, angle = scenario.obstacles, offset.median
    orientation = obstacles.orientation.copy()
    stated = ~obstacles.is_static & _states_heading(obstacles)
    orientation[stated] = _wrapped(orientation[stated] + angle)
    note = (
        f"headings turned by {np.degrees(angle):.2f} degrees, in which vehicles move "
        f"({offset.n_samples} steps, interquartile range {np.degrees(offset.spread):.2f} degrees)"
    )
    return replace(
        scenario,
        obstacles=replace(obstacles, orientation=orientation),
        planning_problems=tuple(_turned_problem(problem, angle) for problem in scenario.planning_problems),
        notes=(*scenario.notes, note),
        turned=angle,
    )


def _offsets(obstacles: Obstacles) -> Floats:
    """Direction minus heading of each long enough step [rad]."""
    moves = np.array([kind in _MOTOR_VEHICLES for kind in obstacles.kinds], dtype=np.bool_)
    rows = np.flatnonzero(moves & ~obstacles.is_static & _states_heading(obstacles))
    heading = obstacles.orientation[rows]
    x, y = np.diff(obstacles.x[rows], axis=1), np.diff(obstacles.y[rows], axis=1)
    middle = heading[:, :-1] + 0.5 * _wrapped(np.diff(heading, axis=1))
    speed = obstacles.velocity[rows]
    middle += np.where(speed[:, :-1] + speed[:, 1:] < 0.0, np.pi, 0.0)
    found: Floats = _wrapped(np.arctan2(y, x) - middle)[np.hypot(x, y) > _STEP_LENGTH]
    return found


def _states_heading(obstacles: Obstacles) -> NDArray[np.bool_]:
    if not obstacles.derived:
        return np.ones(len(obstacles.ids), dtype=np.bool_)
    return np.array(["orientation" not in names for names in obstacles.derived], dtype=np.bool_)


def _turned_problem(problem: PlanningProblem, angle: float) -> PlanningProblem:
    start = problem.initial_state
    orientation = float(_wrapped(np.array(start.orientation + angle)))
    goal = tuple(_turned_goal(state, angle) for state in problem.goal)
    return replace(problem, initial_state=replace(start, orientation=orientation), goal=goal)


def _turned_goal(goal: GoalState, angle: float) -> GoalState:
    if goal.orientation is None:
        return goal
    first, last = goal.orientation
    return replace(goal, orientation=(first + angle, last + angle))


def _wrapped(angle: Floats) -> Floats:
    """Angles wrapped to [-pi, pi]; those in this range are unchanged, bit for bit."""
    return np.where(np.abs(angle) > np.pi, np.arctan2(np.sin(angle), np.cos(angle)), angle)
