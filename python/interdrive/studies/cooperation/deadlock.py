"""Deadlocks: agents that stand in a circle, each of them because of the next one."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from collections.abc import Set as AbstractSet

    from numpy.typing import NDArray

    from interdrive.run import RunRecord, States

#: Below this speed an agent stands [m/s]: the study's own measure, by which its published tables count.
STANDING_SPEED = 0.3
#: Least time that counts [s]; distance ahead within which a cause is sought [m].
_DURATION, _REACH = 10.0, 8.0
#: Points of an outline are this far apart at most [m].
_SPACING = 0.5


def deadlocks(run: RunRecord) -> tuple[tuple[int, ...], ...]:
    """Circles of agents that stand for 10 s, each because of the next one.

    The next one is the first vehicle within 8 m ahead of it, or one for which it holds (an agreement of the run).

    Args:
        run: The run.

    Returns:
        Ids of the agents of each circle, ascending, every circle once.
    """
    states, dt = run.states, run.scenario.dt
    window = round(_DURATION / dt)
    held = _held_for(run)
    rows: list[int] = np.flatnonzero(states.is_agent).tolist()
    found: set[tuple[int, ...]] = set()
    for step in range(window, states.n_steps, max(1, round(1.0 / dt))):
        past = slice(step - window, step + 1)
        still = [
            row
            for row in rows
            if states.valid[row, past].all() and (abs(states.velocity[row, past]) < STANDING_SPEED).all()
        ]
        causes = {row: set(still) & {_first_ahead(states, row, step), *held(row, step)} for row in still}
        found.update(tuple(sorted(states.participant_id[circle].tolist())) for circle in _circles(causes))
    return tuple(sorted(found))


def _held_for(run: RunRecord) -> Callable[[int, int], list[int]]:
    """The rows for which a row holds at a column of the states."""
    agreements, states = run.agreements, run.states
    if agreements is None:
        return lambda _row, _step: []
    row_of = {int(one): row for row, one in enumerate(states.participant_id)}
    stretches = zip(
        agreements.holding_id.tolist(),
        agreements.going_id.tolist(),
        (agreements.first_time_step - states.first_time_step).tolist(),
        (agreements.last_time_step - states.first_time_step).tolist(),
        strict=True,
    )
    known = [(row_of[a], row_of[b], first, last) for a, b, first, last in stretches if a in row_of and b in row_of]
    return lambda row, step: [going for holding, going, a, b in known if holding == row and a <= step <= b]


def _circles(causes: Mapping[int, AbstractSet[int]]) -> list[list[int]]:
    """For every row that is its own cause by way of others, the shortest such way."""
    found = []
    for begin in causes:
        before: dict[int, int] = {}
        reached = [begin]
        for row in reached:
            new = sorted(causes[row] - before.keys())
            before.update(dict.fromkeys(new, row))
            reached += [after for after in new if after != begin]
        if begin in before:
            circle = [begin]
            while (row := before[circle[-1]]) != begin:
                circle.append(row)
            found.append(circle)
    return found


def _first_ahead(states: States, row: int, step: int) -> int | None:
    """Row of the nearest participant whose footprint reaches into the agent's corridor straight ahead."""
    front, half_width = 0.5 * states.length[row], 0.5 * states.width[row]
    nearest, who = _REACH, None
    others: list[int] = np.flatnonzero(states.valid[:, step]).tolist()
    for other in others:
        if other == row:
            continue
        outline = _outline(states, other, step) - np.array([states.x[row, step], states.y[row, step]])
        cos, sin = np.cos(states.orientation[row, step]), np.sin(states.orientation[row, step])
        ahead, aside = outline @ np.array([cos, sin]) - front, outline @ np.array([-sin, cos])
        inside = (abs(aside) < half_width) & (ahead > -0.5)
        if inside.any() and ahead[inside].min() < nearest:
            nearest, who = float(ahead[inside].min()), other
    return who


def _outline(states: States, row: int, step: int) -> NDArray[np.float64]:
    """Points along the edge of a footprint's bounding box, world frame, shape (points, 2) [m]."""
    half = 0.5 * np.array([states.length[row], states.width[row]])
    corners = half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]])
    parts = []
    for begin, end in pairwise(corners):
        n = int(np.hypot(*(end - begin)) / _SPACING) + 2
        parts.append(begin + np.linspace(0.0, 1.0, n)[:, None] * (end - begin))
    cos, sin = np.cos(states.orientation[row, step]), np.sin(states.orientation[row, step])
    turn, center = np.array([[cos, sin], [-sin, cos]]), np.array([states.x[row, step], states.y[row, step]])
    outline: NDArray[np.float64] = np.concatenate(parts) @ turn + center
    return outline
