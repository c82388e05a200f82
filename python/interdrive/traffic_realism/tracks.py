"""Participants over time on a grid of 0.2 s, recorded or simulated, and what is measured on them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.traffic_realism.estimators import smooth

if TYPE_CHECKING:
    from interdrive import _core
    from interdrive.array_types import Bools, Floats, Ints

#: Time between points of the grid [s].
GRID = 0.2
#: A leader is at most so far beside the way, of the sum of both widths, ...
_LEADER_WIDTHS = 0.4
#: ... heads elsewhere by at most this [rad], and is nearer than this [m].
_LEADER_ANGLE, _LEADER_DISTANCE = 0.6, 100.0
#: Time headways count above this speed [m/s], up to this time [s].
_HEADWAY_SPEED, HEADWAY_MAX = 1.0, 5.0
#: A lane is below a vehicle that heads along it within this angle [rad].
_LANE_ANGLE = np.radians(60.0)
#: An offset that jumps by more than this [m], to more than that [m], is a change to the next lane.
_JUMP, _JUMP_TO = 1.5, 0.6


@dataclass(frozen=True)
class Tracks:
    """Participants over time.

    Attributes:
        ids: Of the participants, ascending, shape (n,).
        length: Of the footprints [m], shape (n,).
        width: The same [m].
        x: Centres [m], shape (n, points); nan where absent.
        y: The same [m].
        heading: [rad].
        speed: Along the heading [m/s].
    """

    ids: Ints
    length: Floats
    width: Floats
    x: Floats
    y: Floats
    heading: Floats
    speed: Floats

    def rows(self, ids: Ints) -> Ints:
        """Rows of participants."""
        found: Ints = np.searchsorted(self.ids, ids)
        return found

    def stacked(self, rows: Ints) -> Floats:
        """x, y, heading and speed of some rows, shape (4, rows, points)."""
        return np.stack([table[rows] for table in (self.x, self.y, self.heading, self.speed)])

    def at(self, point: int) -> Tracks:
        """One point of all participants."""
        tables = (table[:, point : point + 1] for table in (self.x, self.y, self.heading, self.speed))
        return Tracks(self.ids, self.length, self.width, *tables)

    def replaced(self, rows: Ints, values: Floats) -> Tracks:
        """The same with other motions of some rows, as from `stacked`; nan leaves a value as it is."""
        tables = [table.copy() for table in (self.x, self.y, self.heading, self.speed)]
        for table, given in zip(tables, values, strict=True):
            table[rows] = np.where(np.isfinite(given), given, table[rows])
        return Tracks(self.ids, self.length, self.width, *tables)


@dataclass(frozen=True)
class Kinematics:
    """What is measured on the tracks of some vehicles; arrays have shape (vehicles, points), nan where unknown.

    Attributes:
        speed: Smooth speed [m/s].
        acceleration: Along the way [m/s²].
        jerk: The same [m/s³].
        yaw_rate: [rad/s].
        gap: From the front to the rear of the leader [m].
        closing: Speed minus that of the leader [m/s].
        headway: Time gap to the leader [s], at most 5.
        offset: From the middle of the lane, to the left [m].
        lateral_speed: [m/s].
        changes: Whether the lane changes at this point.
        lag: Where it does, the gap to the rear of the vehicle, from the front of the one behind it in its new lane [m];
            nan elsewhere, and if there is none.
        way: Length of the step to this point [m].
    """

    speed: Floats
    acceleration: Floats
    jerk: Floats
    yaw_rate: Floats
    gap: Floats
    closing: Floats
    headway: Floats
    offset: Floats
    lateral_speed: Floats
    changes: Bools
    lag: Floats
    way: Floats


def kinematics(tracks: Tracks, ids: Ints, road: _core.RoadNetwork) -> Kinematics:
    """Measures vehicles among all participants.

    Args:
        tracks: All participants.
        ids: Of the vehicles.
        road: For lanes.
    """
    rows = tracks.rows(ids)
    x, y, heading, _ = tracks.stacked(rows)
    turns = np.diff(heading, axis=1)
    turns = np.arctan2(np.sin(turns), np.cos(turns))
    middle = heading[:, :-1] + 0.5 * turns
    way = np.diff(x, axis=1) * np.cos(middle) + np.diff(y, axis=1) * np.sin(middle)
    s, theta = _summed(way), _summed(turns)
    speed = smooth(s, GRID, 7, 2, 1)
    gap, closing = leaders(tracks, rows)
    raw_speed = tracks.speed[rows]
    with np.errstate(divide="ignore", invalid="ignore"):
        headway = np.where(raw_speed > _HEADWAY_SPEED, np.minimum(gap / raw_speed, HEADWAY_MAX), np.nan)
    offset, straight, changes = _offsets(x, y, heading, road)
    return Kinematics(
        speed=speed,
        acceleration=smooth(s, GRID, 9, 2, 2),
        jerk=smooth(s, GRID, 13, 3, 3),
        yaw_rate=smooth(theta, GRID, 7, 2, 1),
        gap=gap,
        closing=closing,
        headway=headway,
        offset=offset,
        lateral_speed=smooth(straight, GRID, 7, 2, 1),
        changes=changes,
        lag=_lag_gaps(tracks, rows, offset, changes),
        way=np.concatenate((np.full((len(rows), 1), np.nan), way), axis=1),
    )


def _summed(steps: Floats) -> Floats:
    """Sums from the first point on; nan before the first step and after the first gap."""
    known = np.isfinite(steps)
    sums = np.cumsum(np.where(known, steps, 0.0), axis=1)
    sums = np.concatenate((np.zeros((len(steps), 1)), sums), axis=1)
    ends = np.zeros(sums.shape, dtype=np.bool_)
    ends[:, 1:] |= known
    ends[:, :-1] |= known
    return np.where(ends, sums, np.nan)


def leaders(tracks: Tracks, rows: Ints) -> tuple[Floats, Floats]:
    """Gap [m] and closing speed [m/s] of vehicles to the vehicle ahead of them in their way; nan without a leader."""
    shape = (len(rows), tracks.x.shape[1])
    gap, closing = np.full(shape, np.nan), np.full(shape, np.nan)
    widths = _LEADER_WIDTHS * (tracks.width[rows, None] + tracks.width)
    lengths = 0.5 * (tracks.length[rows, None] + tracks.length)
    for point in range(shape[1]):
        x, y, heading, speed = (table[:, point] for table in (tracks.x, tracks.y, tracks.heading, tracks.speed))
        dx, dy = x - x[rows, None], y - y[rows, None]
        cos, sin = np.cos(heading[rows, None]), np.sin(heading[rows, None])
        along, across = dx * cos + dy * sin, dy * cos - dx * sin
        turn = heading - heading[rows, None]
        turn = np.arctan2(np.sin(turn), np.cos(turn))
        with np.errstate(invalid="ignore"):
            # On an arc the way bends aside by half the angle.
            leads = (np.abs(across - 0.5 * along * turn) < widths) & (np.abs(turn) < _LEADER_ANGLE)
            leads &= (along > 0.0) & (np.hypot(dx, dy) < _LEADER_DISTANCE)
        distance = np.where(leads, along - lengths, np.inf)
        nearest = distance.argmin(axis=1) if distance.shape[1] else np.zeros(len(rows), dtype=np.int64)
        found = np.isfinite(distance[np.arange(len(rows)), nearest])
        gap[found, point] = distance[np.arange(len(rows)), nearest][found]
        closing[found, point] = (speed[rows] - speed[nearest])[found]
    return gap, closing


def _lag_gaps(tracks: Tracks, rows: Ints, offset: Floats, changes: Bools) -> Floats:
    """Gaps behind vehicles that change lanes [m]: of whoever follows them as if they were in its middle."""
    found = np.full(changes.shape, np.nan)
    for vehicle, point in zip(*np.nonzero(changes), strict=True):
        x, y, heading, _ = tracks.stacked(np.arange(len(tracks.ids)))[:, :, point]
        row = rows[vehicle]
        turn = heading - heading[row]
        turn = np.arctan2(np.sin(turn), np.cos(turn))
        dx, dy = x - x[row], y - y[row]
        along = dx * np.cos(heading[row]) + dy * np.sin(heading[row])
        across = dy * np.cos(heading[row]) - dx * np.sin(heading[row])
        with np.errstate(invalid="ignore"):
            beside = across + offset[vehicle, point] - 0.5 * along * turn
            follows = np.abs(beside) < _LEADER_WIDTHS * (tracks.width + tracks.width[row])
            follows &= (np.abs(turn) < _LEADER_ANGLE) & (along < 0.0) & (np.hypot(dx, dy) < _LEADER_DISTANCE)
        if follows.any():
            gaps = -along - 0.5 * (tracks.length + tracks.length[row])
            found[vehicle, point] = gaps[follows].min()
    return found


def _offsets(x: Floats, y: Floats, heading: Floats, road: _core.RoadNetwork) -> tuple[Floats, Floats, Bools]:
    """Offsets from the middle of the lane [m], the same without jumps at lane changes, and where lanes change."""
    flat = np.full(x.size, np.nan)
    there = np.flatnonzero(np.isfinite(x.ravel()))
    px, py, angle = (np.ascontiguousarray(table.ravel()[there]) for table in (x, y, heading))
    pose, _, _, d = road.lanes_below(px, py, angle, float(_LANE_ANGLE))
    order = np.lexsort((np.abs(d), pose))
    first = order[np.unique(pose[order], return_index=True)[1]] if len(order) else order
    flat[there[pose[first]]] = d[first]
    offset: Floats = flat.reshape(x.shape)
    with np.errstate(invalid="ignore"):
        jump = np.diff(offset, axis=1)
        changed = np.abs(jump) > _JUMP
        # In the step in which the lane changes, a vehicle moves aside as in the step before.
        before = np.concatenate((np.zeros((len(x), 1)), jump[:, :-1]), axis=1)
        before = np.where(np.abs(before) < _JUMP, before, 0.0)
        straight = offset.copy()
        straight[:, 1:] -= np.cumsum(np.where(changed, jump - before, 0.0), axis=1)
        counted = changed & (np.abs(offset[:, 1:]) > _JUMP_TO)
    return offset, straight, np.concatenate((np.zeros((len(x), 1), dtype=np.bool_), counted), axis=1)
