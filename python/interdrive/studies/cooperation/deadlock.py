"""Deadlocks: agents that stand in a circle, each of them because of the next one."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive.run import RunRecord, States

#: Below this speed an agent stands [m/s]; for so long it counts [s]; so far ahead it looks for a cause [m].
_STANDING, _DURATION, _REACH = 0.3, 10.0, 8.0
#: Points of an outline are this far apart at most [m].
_SPACING = 0.5


def deadlocks(run: RunRecord) -> tuple[tuple[int, ...], ...]:
    """Circles of agents that stand for 10 s, each with the next one as the first vehicle within 8 m ahead of it.

    Args:
        run: The run.

    Returns:
        Ids of the agents of each circle, ascending, every circle once.
    """
    states, dt = run.states, run.scenario.dt
    window = round(_DURATION / dt)
    rows: list[int] = np.flatnonzero(states.is_agent).tolist()
    found: set[tuple[int, ...]] = set()
    for step in range(window, states.n_steps, max(1, round(1.0 / dt))):
        past = slice(step - window, step + 1)
        still = [
            row for row in rows if states.valid[row, past].all() and (abs(states.velocity[row, past]) < _STANDING).all()
        ]
        cause = {row: _first_ahead(states, row, step) for row in still}
        for begin in still:
            chain = [begin]
            while (after := cause.get(chain[-1])) is not None and after in cause and after not in chain:
                chain.append(after)
            if after is not None and after == begin:
                found.add(tuple(sorted(states.participant_id[chain].tolist())))
    return tuple(sorted(found))


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
