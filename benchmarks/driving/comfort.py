"""How smoothly a vehicle is driven: its hardest braking, acceleration across and jerk, over half a second each."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive.run import States
    from interdrive.scenario import Obstacles

    Floats = NDArray[np.float64]

#: First states are noisy, so this time after them does not count [s].
SKIPPED = 1.5
#: Changes of speed and heading are taken over this time [s].
SPAN = 0.5
#: Braking and acceleration across that people hardly ever exceed [m/s²], measured on recordings: it does not follow
#: what agents expect of others.
COMFORTABLE = 3.0


class Extremes(NamedTuple):
    """Largest values of a drive; nan if less than about a second of it counts.

    Attributes:
        brake: Deceleration [m/s²]; below 0 if the vehicle only accelerates.
        across: Mean speed times change of heading [m/s²].
        jerk: Change of the acceleration from one span to the next [m/s³].
    """

    brake: float
    across: float
    jerk: float


#: Of no drive.
UNKNOWN = Extremes(float("nan"), float("nan"), float("nan"))


def extremes(table: States | Obstacles, row: int, dt: float) -> Extremes:
    """Of one vehicle."""
    there, span, skipped = table.valid[row], max(1, round(SPAN / dt)), round(SKIPPED / dt)
    speed = table.velocity[row, there][skipped:]
    heading = np.unwrap(table.orientation[row, there])[skipped:]
    if len(speed) <= 2 * span + 1:
        return UNKNOWN
    seconds = span * dt
    acceleration = (speed[span:] - speed[:-span]) / seconds
    across = 0.5 * (speed[span:] + speed[:-span]) * (heading[span:] - heading[:-span]) / seconds
    jerk = np.diff(acceleration[::span]) / seconds
    # A vehicle that starts to reverse does not brake.
    gain = (np.abs(speed[span:]) - np.abs(speed[:-span])) / seconds
    return Extremes(float(-gain.min()), float(np.abs(across).max()), float(np.abs(jerk).max(initial=0.0)))
