"""Lines on the road that must not be crossed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.run.violations.drives import Drives, Row, stretches
from interdrive.scenario import KINDS
from interdrive.scenario.control import CLOSED

if TYPE_CHECKING:
    from interdrive.array_types import Bools, Floats
    from interdrive.run.violations.ways import TakenLanelet, Ways
    from interdrive.scenario import Lanelets

#: Wheels may be beyond a line by this [m].
ACROSS = 0.2
_OPPOSITE = {"left": "right", "right": "left"}


def has_closed_markings(lanelets: Lanelets) -> bool:
    """Some lanelet is bounded by a line that must not be crossed."""
    return any(is_closed(lanelets, row, side) for row in range(len(lanelets.ids)) for side in CLOSED)


def is_closed(lanelets: Lanelets, row: int, side: str) -> bool:
    """The line on a side must not be crossed from this lanelet."""
    markings = lanelets.left_marking if side == "left" else lanelets.right_marking
    return bool(markings) and markings[row] in CLOSED[side]


def solid_lines(drives: Drives, ways: Ways, lanelets: Lanelets, road: _core.RoadNetwork) -> list[Row]:
    """Vehicles whose wheels crossed a line that must not be crossed from the lanelet on which they were."""
    rows = []
    place = {number: row for row, number in enumerate(lanelets.ids.tolist())}
    for k in drives.judged:
        across = np.zeros(drives.valid.shape[1], dtype=np.bool_)
        corners = _wheels(drives, k)
        for way in ways.taken[k]:
            row = place[way.lanelet]
            for side in CLOSED:
                other = _beside(lanelets, row, side)
                from_here = is_closed(lanelets, row, side)
                from_there = other >= 0 and is_closed(lanelets, other, _OPPOSITE[side])
                if len(way.columns) and (from_here or from_there):
                    beyond = _beyond(corners[:, way.columns], lanelets, row, side)
                    came = _came(beyond, way, ways.taken[k], int(lanelets.ids[other]) if other >= 0 else -1)
                    across[way.columns] |= beyond & np.where(came, from_there, from_here)
        for first, last in stretches(across):
            value = float(np.abs(drives.velocity[k, first : last + 1]).sum() * drives.dt)
            rows.append(drives.row(k, "solid_line", (first, last), value, road=road))
    return rows


def _wheels(drives: Drives, k: int) -> Floats:
    """Corners of the rectangle between the axles [m], shape (4, columns, 2)."""
    vehicle = _core.Vehicle(KINDS.index(drives.kinds[k]), float(drives.length[k]), float(drives.width[k]))
    rear, half = -vehicle.rear_axle_to_center, 0.5 * vehicle.width
    heading = drives.orientation[k]
    ahead, aside = np.stack([np.cos(heading), np.sin(heading)], 1), np.stack([-np.sin(heading), np.cos(heading)], 1)
    center = np.stack([drives.x[k], drives.y[k]], axis=1)
    axles = [center + along * ahead for along in (rear, rear + vehicle.wheelbase)]
    return np.stack([axle + across * aside for axle in axles for across in (half, -half)])


def _beyond(points: Floats, lanelets: Lanelets, row: int, side: str) -> Bools:
    """Where one of the points, shape (points, columns, 2), is beyond a bound of a lanelet and beside it."""
    bound = (lanelets.left if side == "left" else lanelets.right)[row]
    sign = 1.0 if side == "left" else -1.0
    start, along = bound[:-1], np.diff(bound, axis=0)
    length = np.maximum(np.hypot(*along.T), 1e-9)
    unit = along / length[:, None]
    relative = points[..., None, :] - start
    foot = np.clip(np.einsum("pcsd,sd->pcs", relative, unit), 0.0, length)
    delta = relative - foot[..., None] * unit
    distance = np.hypot(delta[..., 0], delta[..., 1])
    nearest = distance.argmin(axis=-1)[..., None]
    taken = [np.take_along_axis(table, nearest, -1)[..., 0] for table in (distance, foot)]
    outside = sign * (unit[:, 0] * relative[..., 1] - unit[:, 1] * relative[..., 0])
    place = nearest[..., 0]
    is_end = ((place == 0) & (taken[1] <= 0.0)) | ((place == len(length) - 1) & (taken[1] >= length[-1]))
    found = (np.take_along_axis(outside, nearest, -1)[..., 0] > 0.0) & (taken[0] > ACROSS) & ~is_end
    result: Bools = found.any(axis=0)
    return result


def _beside(lanelets: Lanelets, row: int, side: str) -> int:
    """Row of the neighbour on a side, whatever its direction; -1 for none."""
    number = int((lanelets.adjacent_left if side == "left" else lanelets.adjacent_right)[row])
    place = int(np.searchsorted(lanelets.ids, number))
    return place if place < len(lanelets.ids) and lanelets.ids[place] == number else -1


def _came(beyond: Bools, way: TakenLanelet, taken: list[TakenLanelet], beside: int) -> Bools:
    """The first columns on a lanelet, while the vehicle is still coming across the line from the lanelet beside it."""
    came = np.zeros_like(beyond)
    if any(one.lanelet == beside and way.columns[0] - 1 in one.columns for one in taken):
        came[: len(beyond) if beyond.all() else int(np.argmin(beyond))] = True
    return came
