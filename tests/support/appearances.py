"""Whether vehicles appear right ahead of others, in the states of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from interdrive.run import States

#: Braking with which who drives behind stops in time [m/s²], and the gap that is left [m].
BRAKING, GAP = 4.0, 2.0
#: Who appears is ahead of another one if it is at most so far beside its way [m], and turned by at most this [rad].
BESIDE, TURN = 1.5, 0.3


class Appearance(NamedTuple):
    """A vehicle that appears ahead of another one, and the gap between them [m], with that which should be."""

    time_step: int
    appears: int
    behind: int
    gap: float
    needed: float


def along_and_aside(states, one, other, at):
    """How far a vehicle is ahead of another one and beside it [m], in its frame, and how it is turned [rad]."""
    dx, dy = states.x[other, at] - states.x[one, at], states.y[other, at] - states.y[one, at]
    cos, sin = np.cos(states.orientation[one, at]), np.sin(states.orientation[one, at])
    turn = np.mod(states.orientation[other, at] - states.orientation[one, at] + np.pi, 2.0 * np.pi) - np.pi
    along = dx * cos + dy * sin
    # On an arc the way bends aside by half the angle.
    return along, dy * cos - dx * sin - 0.5 * along * turn, turn


def too_near(states: States) -> list[Appearance]:
    """Vehicles that appear nearer ahead of another one than v²/8 + 2 m, from which v it cannot brake with 4 m/s²."""
    found = []
    for row, there in enumerate(states.valid):
        first = int(there.argmax())
        if not there.any() or first == 0:
            continue
        for behind in np.flatnonzero(states.valid[:, first] & states.valid[:, first - 1]).tolist():
            along, aside, turn = along_and_aside(states, behind, row, first)
            gap = along - 0.5 * (states.length[row] + states.length[behind])
            needed = max(0.0, states.velocity[behind, first]) ** 2 / (2.0 * BRAKING) + GAP
            if along > 0.0 and gap < needed and abs(aside) < BESIDE and abs(turn) < TURN:
                ids = states.participant_id
                found.append(Appearance(first, int(ids[row]), int(ids[behind]), float(gap), float(needed)))
    return found
