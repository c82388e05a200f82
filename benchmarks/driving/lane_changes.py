"""Lane changes of a drive: how long each takes, and for how long the agent has shown it by its blinkers before.

A vehicle changes lanes where its centre passes from one lanelet to the adjacent one of the same direction. The change
lasts while the vehicle moves aside without a break; those that the drive shows only in part are left out.
"""

from __future__ import annotations

from itertools import pairwise
from math import isfinite, radians
from statistics import quantiles
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from interdrive import _core
    from interdrive.run import Plans, States
    from interdrive.scenario import Lanelets, Obstacles

    Floats = NDArray[np.float64]

#: Lanelets count that lead within this angle of the heading [rad].
LANE_ANGLE = radians(60.0)
#: Where lanes join or part, lanelets lie upon each other: the middle of the new lane is further away than this [m].
JUMP = 1.5
#: A vehicle moves aside at more than this [m/s], over this time [s]: people waver by less in their lane.
ASIDE, SPAN = 0.15, 0.5


class Change(NamedTuple):
    """A lane change.

    Attributes:
        begin, end: Points between which the vehicle moves aside.
        seconds: Time in between [s].
        shown: For how long the side was shown before the begin [s]; nan where that is not known.
    """

    begin: int
    end: int
    seconds: float
    shown: float


class Lanes:
    """The lanes of a road, for looking up where vehicles are."""

    def __init__(self, road: _core.RoadNetwork, lanelets: Lanelets) -> None:
        """Of a road network and its lanelets."""
        self._road = road
        ids = lanelets.ids.tolist()
        sides = (
            (1, lanelets.adjacent_left, lanelets.adjacent_left_same_direction),
            (-1, lanelets.adjacent_right, lanelets.adjacent_right_same_direction),
        )
        self._side = {
            (own, beside): side
            for side, adjacent, same in sides
            for own, beside, is_same in zip(ids, adjacent.tolist(), same.tolist(), strict=True)
            if is_same
        }

    def below(self, table: States | Obstacles, row: int, there: NDArray[np.int64]) -> tuple[Floats, list[int]]:
        """Offsets from the middle of the nearest lane [m], nan beside the road, and its lanelets, 0 there."""
        places = (np.ascontiguousarray(values[row, there]) for values in (table.x, table.y, table.orientation))
        pose, lanelet, _, d = self._road.lanes_below(*places, LANE_ANGLE)
        offset, found = np.full(len(there), np.nan), np.zeros(len(there), dtype=np.int64)
        order = np.lexsort((np.abs(d), pose))
        first = order[np.unique(pose[order], return_index=True)[1]] if len(order) else order
        offset[pose[first]], found[pose[first]] = d[first], lanelet[first]
        return offset, found.tolist()

    def side(self, before: int, after: int) -> int:
        """On which side of a lanelet another one of the same direction is: 1 left, -1 right, 0 neither."""
        return self._side.get((before, after), 0)


def lane_changes(table: States | Obstacles, row: int, lanes: Lanes, dt: float) -> list[tuple[Change, int]]:
    """Lane changes of one vehicle in their order, without blinkers; each with its side: 1 left, -1 right."""
    there = np.flatnonzero(table.valid[row])
    span = max(1, round(SPAN / dt))
    if len(there) <= 2 * span:
        return []
    offset, lanelet = lanes.below(table, row, there)
    sides = np.array([lanes.side(before, after) for before, after in pairwise(lanelet)])
    jump = np.nan_to_num(np.diff(offset))
    crossings = np.flatnonzero((sides != 0) & (np.abs(jump) > JUMP))
    steps = np.where(np.abs(jump) > JUMP, 0.0, jump)
    aside = np.convolve(steps, np.ones(span) / (span * dt), mode="same")
    found = []
    for crossing in crossings.tolist():
        side = int(sides[crossing])
        moves = side * aside > ASIDE
        # What is offset from another lane hides the step in between.
        moves[max(crossing - 1, 0) : crossing + 2] = True
        begin, end = crossing, crossing
        while begin > 0 and moves[begin - 1]:
            begin -= 1
        while end < len(moves) and moves[end]:
            end += 1
        if begin > 0 and end < len(moves) and end - begin > span:
            ends = int(there[begin]), int(there[end])
            found.append((Change(*ends, (ends[1] - ends[0]) * dt, float("nan")), side))
    return found


def shown_lane_changes(states: States, row: int, plans: Plans, lanes: Lanes, dt: float) -> list[Change]:
    """Lane changes of an agent, with how long each was shown before it began."""
    own = plans.agent_id == states.participant_id[row]
    turn = dict(zip(plans.time_step[own].tolist(), plans.turn[own].tolist(), strict=True))
    found = []
    for change, side in lane_changes(states, row, lanes, dt):
        since = step = change.begin + states.first_time_step
        while turn.get(since - 1) == side:
            since -= 1
        found.append(change._replace(shown=(step - since) * dt))
    return found


def written(changes: Iterable[Change]) -> str:
    """As a cell of a table: seconds of each, and for how long it was shown before, such as "4.6/3.1 5.0/3.0"."""
    return " ".join(
        f"{change.seconds:.1f}" + (f"/{change.shown:.1f}" if isfinite(change.shown) else "") for change in changes
    )


def said(cells: Iterable[str]) -> str:
    """Number, median and 5 to 95 % of the seconds of lane changes, from such cells; and how many were shown for 3 s."""
    changes = [[float(part) for part in one.split("/")] for cell in cells for one in cell.split()]
    if len(changes) < 2:
        return f"{len(changes)}"
    cuts = quantiles([one[0] for one in changes], n=20, method="inclusive")
    text = f"{len(changes)}, median {cuts[9]:.1f} s, 5 to 95 % {cuts[0]:.1f} to {cuts[18]:.1f} s"
    shown = [one[1] for one in changes if len(one) > 1]
    return text + (f", {sum(one > 2.95 for one in shown)} of them shown for 3 s before" if shown else "")
