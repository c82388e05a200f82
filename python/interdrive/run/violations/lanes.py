"""Rules of the lanelets below a vehicle: their speed limit and their direction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.run.violations.drives import Drives, Row, stretches

if TYPE_CHECKING:
    from interdrive import _core
    from interdrive.run.violations.passing import Standing

#: A vehicle is speeding that is faster than the limit by more than this [m/s] for at least this long [s].
SPEED_MARGIN, SPEEDING_TIME = 0.5, 0.3
#: ... unless it has braked at least this hard since its first state [m/s²].
BRAKING = 1.0
#: It drives the wrong way if no lanelet below it leads within this angle of its heading [rad], for this long [s]: who
#: reverses keeps its heading.
WRONG_WAY, WRONG_WAY_TIME = np.radians(120.0), 1.0


def lane_rules(drives: Drives, road: _core.RoadNetwork, standing: Standing) -> list[Row]:
    """Speeding and driving the wrong way."""
    judged = np.zeros(drives.valid.shape, dtype=np.bool_)
    judged[drives.judged] = drives.valid[drives.judged]
    row, step = np.nonzero(judged)
    x, y, orientation = (getattr(drives, name)[row, step] for name in ("x", "y", "orientation"))
    limit, off = np.full(drives.valid.shape, np.nan), np.full(drives.valid.shape, np.nan)
    limit[row, step], off[row, step] = road.lane_rules(x, y, orientation)
    dt, rows = drives.dt, []
    excess = np.where(judged & np.isfinite(limit), np.abs(drives.velocity) - limit, -np.inf)
    for k in drives.judged:
        for first, last in stretches(excess[k] > SPEED_MARGIN, SPEEDING_TIME / dt):
            if not _brakes_from_the_start(drives, k, last):
                value = float(excess[k, first : last + 1].max())
                rows.append(drives.row(k, "speeding", (first, last), value, road=road))
        wrong = judged[k] & (off[k] > WRONG_WAY)
        if stretches(wrong, WRONG_WAY_TIME / dt):
            columns = np.flatnonzero(wrong)
            wrong[columns] = ~standing.is_passed(drives, k, columns)
        for first, last in stretches(wrong, WRONG_WAY_TIME / dt):
            value = float(np.abs(drives.velocity[k, first : last + 1]).sum() * dt)
            rows.append(drives.row(k, "wrong_way", (first, last), value, road=road))
    return rows


def _brakes_from_the_start(drives: Drives, k: int, last: int) -> bool:
    """The vehicle entered too fast and has braked ever since."""
    first = int(np.argmax(drives.valid[k]))
    braking = -np.sign(drives.velocity[k]) * drives.acceleration[k]
    return bool(last > first and np.all(braking[first + 1 : last + 1] >= BRAKING))
