"""Whether a recording with other starts and speeds can have come about."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.scenario.inspection import lanelets_at

if TYPE_CHECKING:
    from interdrive.array_types import Floats
    from interdrive.scenario import Obstacles, Scenario

#: A follower may have to brake so hard for the vehicle ahead at its start [m/s²]; sideways distance of followers [m].
_BRAKING_MAX, _LANE = 4.0, 2.0
#: Pairs farther apart than this are not looked at [m]; for so long they are thought to drive straight on [s].
_REACH, _STRAIGHT = 80.0, 3.0
#: The times at which they may touch then [s].
_TIMES = np.arange(0.0, _STRAIGHT, 0.1).tolist()
#: Conflicts in words, with places for both vehicles and for how hard one of them has to brake [m/s²].
_WORDS = {
    "overlap": "{0} and {1} overlap at the start",
    "braking": "{0} or {1} has to brake with {2:.1f} m/s² at the start",
    "inevitable": f"{{0}} and {{1}} touch, whichever brakes with {_BRAKING_MAX:g} m/s² at the start",
}


def implausible(original: Scenario, changed: Scenario, moved: set[int]) -> str:
    """Why a disturbed world cannot have come about; "" if it can.

    A vehicle is off the road at its start; or, where this is not so in the recording, it overlaps another one then, one
    of both has to brake hard, or they touch straight on whichever brakes.
    """
    before, after = original.obstacles, changed.obstacles
    names = sorted(moved)
    rows = np.searchsorted(after.ids, names)
    starts = after.valid[rows].argmax(axis=1)
    lanelets = lanelets_at(changed.lanelets, after.x[rows, starts], after.y[rows, starts])
    left, found_on = np.count_nonzero(after.valid[rows], axis=1), np.count_nonzero(lanelets, axis=1)
    for who, n_states, is_on in zip(names, left.tolist(), found_on.tolist(), strict=True):
        if n_states < 2:
            return f"{who} has no way left"
        if not is_on:
            return f"{who} starts off every lanelet"
    sizes = _sizes(after)
    limits = (_REACH, _LANE, _BRAKING_MAX, _TIMES)
    for first in dict.fromkeys(starts.tolist()):
        together = rows[starts == first].tolist()
        found = _core.start_conflict(_states_at(before, first), _states_at(after, first), sizes, together, limits)
        if found is not None:
            row, other, kind, needed = found
            return _WORDS[kind].format(int(after.ids[row]), int(after.ids[other]), needed)
    return ""


def _states_at(obstacles: Obstacles, column: int) -> Floats:
    """Position [m], orientation [rad] and velocity [m/s] of everybody at a time step, nan where absent."""
    fields = (obstacles.x, obstacles.y, obstacles.orientation, obstacles.velocity)
    return np.stack([table[:, column] for table in fields], axis=1)


def _sizes(obstacles: Obstacles) -> Floats:
    """Length and width of every footprint [m]."""
    sizes = []
    for shape in obstacles.shapes:
        if len(shape.vertices):
            sizes.append(np.ptp(shape.vertices, axis=0))
        else:
            sizes.append((shape.length or 2.0 * shape.radius, shape.width or 2.0 * shape.radius))
    return np.array(sizes, dtype=np.float64)
