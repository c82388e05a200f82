"""How near an agent came to its goal, in words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.run.phases import path_coordinates
from interdrive.scenario.native import core_shape

if TYPE_CHECKING:
    from interdrive.array_types import Ints
    from interdrive.run.record import AgentRecord, RunRecord
    from interdrive.scenario import GoalState

#: Distance between the points of a path at which its entry to the goal area is looked for [m].
_SPACING = 0.2

#: Beside its reference path by more than this, an agent is on another way [m].
_BESIDE = 10.0

#: Headings count as inside an interval within this [rad].
_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Approach:
    """How near an agent came to its goal: in words, whether they are about where it ended, and about the goal area."""

    words: str
    at_end: bool
    inside: bool = False


@dataclass(frozen=True)
class _Moment:
    """A state in the goal area: what was wrong, how much, and from which to which column of the visit it was that."""

    first: int
    last: int
    faults: tuple[str, ...]
    excess: float


def approach(run: RunRecord, agent: AgentRecord) -> Approach:
    """How near the agent came to its goal: which condition was not met in its area, or the distance that was left.

    Of several visits and alternatives, the visit that missed the fewest conditions by the least.

    Returns:
        For instance "in the goal area from 9.6 to 9.8 s, heading 36° off (29° allowed)", or "14.2 m before the goal
        area" at its end; "" if neither goal nor states are known.
    """
    moments = [moment for alternative in agent.goal for moment in _moments(run, agent, alternative)]
    if moments:
        best = min(moments, key=lambda moment: (len(moment.faults), moment.excess))
        first, last = (said_time(run, column + run.states.first_time_step) for column in (best.first, best.last))
        when = f"at {first} s" if first == last else f"from {first} to {last} s"
        place = "in the goal area " if agent.goal_areas else ""
        return Approach(", ".join((f"{place}{when}", *best.faults)), at_end=False, inside=True)
    row, columns = _present(run, agent)
    if not len(columns) or not agent.goal_areas:
        return Approach("", at_end=False)
    return _distance_left(run, agent, row, columns)


def _present(run: RunRecord, agent: AgentRecord) -> tuple[int, Ints]:
    row = int(np.searchsorted(run.states.participant_id, agent.id))
    # Its first state is given, not driven.
    columns: Ints = np.flatnonzero(run.states.valid[row])[1:]
    return row, columns


def inside(run: RunRecord, agent: AgentRecord, alternative: GoalState) -> Ints:
    """Columns of the states at which an agent was in the area of an alternative of its goal."""
    row, columns = _present(run, agent)
    area = _area(alternative)
    x, y = run.states.x[row], run.states.y[row]
    found: Ints = np.array([c for c in columns.tolist() if _contains(area, x[c], y[c])], dtype=np.int64)
    return found


def _area(alternative: GoalState) -> _core.Goal:
    return _core.Goal([([core_shape(area) for area in alternative.areas], (0, 1), None, None)])


def _contains(area: _core.Goal, x: float, y: float) -> bool:
    return area.is_met(float(x), float(y), 0.0, 0.0, 0)[0]


def _moments(run: RunRecord, agent: AgentRecord, alternative: GoalState) -> list[_Moment]:
    row = _present(run, agent)[0]
    columns = inside(run, agent, alternative)
    found = []
    for visit in np.split(columns, np.flatnonzero(np.diff(columns) > 1) + 1):
        missed = [(column, *_faults(run, row, column, alternative)) for column in visit.tolist()]
        # The first words of faults say which conditions they are about.
        for _, same in groupby(missed, lambda one: [fault.split()[0] for fault in one[1]]):
            states = list(same)
            found += [_Moment(states[0][0], states[-1][0], faults, excess) for _, faults, excess in states if faults]
    return found


def _faults(run: RunRecord, row: int, column: int, goal: GoalState) -> tuple[tuple[str, ...], float]:
    """Conditions that a state does not meet, in words, and by how much it misses them, as parts of what is allowed."""
    states, time_step = run.states, column + run.states.first_time_step
    faults, excess = [], 0.0
    if goal.orientation is not None:
        low, high = goal.orientation
        allowed = 0.5 * (high - low)
        turned = float(states.orientation[row, column]) - 0.5 * (low + high)
        off = abs(math.atan2(math.sin(turned), math.cos(turned)))
        if off > allowed + _TOLERANCE:
            faults.append(f"heading {_degrees(off, allowed)}")
            excess += (off - allowed) / math.pi
    if goal.velocity is not None:
        speed, (slowest, fastest) = float(states.velocity[row, column]), goal.velocity
        if not slowest <= speed <= fastest:
            most = speed > fastest
            bound = fastest if most else slowest
            faults.append(
                f"at {with_digits(speed, bound)} m/s (at {'most' if most else 'least'} {with_digits(bound, speed)} m/s)"
            )
            excess += abs(speed - bound) / max(abs(bound), 1.0)
    first, last = goal.time_step
    if time_step < first:
        faults.append(f"before its first admissible time {said_time(run, first)} s")
        excess += (first - time_step) / max(first, 1)
    elif time_step > last and not faults:  # being late alone does not make an agent miss its goal
        faults.append(f"after its last admissible time {said_time(run, last)} s")
        excess += (time_step - last) / max(last, 1)
    return tuple(faults), excess


def _degrees(off: float, allowed: float) -> str:
    digits = 0 if round(math.degrees(off)) > round(math.degrees(allowed)) else 1
    return f"{math.degrees(off):.{digits}f}° off ({math.degrees(allowed):.{digits}f}° allowed)"


def with_digits(value: float, other: float, fewest: int = 1) -> str:
    """A number with as many digits as tell it from another one, at least `fewest` and at most two more."""
    digits = next((n for n in (fewest, fewest + 1) if f"{value:.{n}f}" != f"{other:.{n}f}"), fewest + 2)
    return f"{value:.{digits}f}"


def _distance_left(run: RunRecord, agent: AgentRecord, row: int, columns: Ints) -> Approach:
    """Distance to the goal area along the reference path if it is ahead; otherwise how far off the agent passed it."""
    states, end = run.states, int(columns[-1])
    ahead = way_to_goal(agent, float(states.x[row, end]), float(states.y[row, end]))
    if math.isfinite(ahead):
        return Approach(f"{ahead:.1f} m before the goal area", at_end=True)
    areas = [core_shape(area) for area in agent.goal_areas]
    spot, here = _core.Shape.circle(1e-6), (0.0, 0.0, 0.0)
    distances = np.array(
        [
            min(area.distance(here, spot, (float(states.x[row, c]), float(states.y[row, c]), 0.0)) for area in areas)
            for c in columns.tolist()
        ]
    )
    nearest = int(distances.argmin())
    if nearest == len(columns) - 1:
        return Approach(f"{distances[-1]:.1f} m from the goal area", at_end=True)
    when = said_time(run, int(columns[nearest]) + states.first_time_step)
    return Approach(f"passed the goal area at a distance of {distances[nearest]:.1f} m at {when} s", at_end=False)


def way_to_goal(agent: AgentRecord, x: float, y: float) -> float:
    """Way along the reference path to the first point in a goal area [m]; inf if none is ahead, or it left the path."""
    path = agent.reference_path
    if len(path) < 2:
        return math.inf
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    here, beside, _ = (float(one[0]) for one in path_coordinates(path, np.array([[x, y]])))
    if beside > _BESIDE:
        return math.inf
    s = np.arange(here, length[-1], _SPACING)
    points = np.stack([np.interp(s, length, path[:, axis]) for axis in (0, 1)], axis=1)
    areas = [_area(alternative) for alternative in agent.goal if alternative.areas]
    for at, point in zip(s.tolist(), points.tolist(), strict=True):
        if any(_contains(area, *point) for area in areas):
            return float(at - here)
    return math.inf


def said_time(run: RunRecord, time_step: int) -> str:
    """A time step of a run in seconds, with as many digits as steps need."""
    return said_seconds(time_step, run.scenario.dt)


def said_seconds(time_step: int, dt: float) -> str:
    """A time step in seconds, with as many digits as steps of `dt` [s] need: the same text wherever it is told."""
    digits = next((n for n in (1, 2) if math.isclose(dt * 10**n, round(dt * 10**n), abs_tol=1e-6)), 3)
    return f"{time_step * dt:.{digits}f}"
