"""The terms of one drive: speed limit, comfort, direction, time to contact straight on; what made them less than 1."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.run.goals import said_seconds, with_digits
from interdrive.scoring.smoothing import smoothed

if TYPE_CHECKING:
    from interdrive.array_types import Floats, Ints
    from interdrive.scoring.settings import ComfortBounds

#: Windows of the filters: of accelerations; of jerk, yaw rate and its change.
ACCELERATION_WINDOW, CHANGE_WINDOW = 7, 15
#: Fewer states have no comfort.
STATES_MIN = 3
#: Metres against the lane within a second up to which the direction is 1, and 1/2.
DIRECTION_FULL, DIRECTION_HALF = 2.0, 6.0
#: Less progress than this is none [m].
PROGRESS_UNIT = 2.0


@dataclass(frozen=True)
class Motion:
    """States of one drive in the window that is judged; arrays of shape (states,)."""

    time_step: Ints
    x: Floats
    y: Floats
    orientation: Floats
    velocity: Floats
    acceleration: Floats
    yaw_rate: Floats


@dataclass(frozen=True)
class Term:
    """A value from 0 to 1, nan where it cannot be told, and in words why it is less than 1."""

    value: float
    words: str = ""


def progress_term(driven: float, expected: float, what: str) -> Term:
    """Progress along the reference path against what was expected of it [m]."""
    if not math.isfinite(expected):
        return Term(math.nan)
    value = 0.0 if driven < -PROGRESS_UNIT else min(1.0, max(driven, PROGRESS_UNIT) / max(expected, PROGRESS_UNIT))
    return Term(value, "" if value == 1.0 else f"{driven:.1f} m, {what} {expected:.1f} m")


def speed_term(velocity: Floats, limit: Floats, dt: float, overspeed: float) -> Term:
    """How little and how shortly the speed limit was exceeded; nan without any limit."""
    known = np.isfinite(limit)
    if not known.any():
        return Term(math.nan)
    excess = np.maximum(np.abs(velocity[known]) - limit[known], 0.0)
    value = max(0.0, 1.0 - float(excess.sum()) * dt / (overspeed * float(known.sum()) * dt))
    if not (excess > 0.0).any():
        return Term(1.0)
    return Term(value, f"up to {excess.max():.1f} m/s too fast, {(excess > 0.0).sum() * dt:.1f} s in all")


def comfort_term(motion: Motion, dt: float, bounds: ComfortBounds) -> Term:
    """1 if all bounds hold, else 0, in words by the bound that is exceeded most; nan with fewer than 3 states."""
    if len(motion.x) < STATES_MIN:
        return Term(math.nan)
    heading = np.unwrap(motion.orientation)
    turning = np.where(np.isfinite(motion.yaw_rate), motion.yaw_rate, np.gradient(heading, dt))
    lateral = motion.velocity * turning
    size = np.hypot(motion.acceleration, lateral)
    # A vehicle that reverses speeds up with a negative acceleration, which is that of the step before the state.
    before = np.concatenate([motion.velocity[:1], motion.velocity[:-1]])
    reverses = before + motion.velocity < 0.0
    longitudinal = smoothed(np.where(reverses, -1.0, 1.0) * motion.acceleration, ACCELERATION_WINDOW, dt)
    checks = (
        ("acceleration", longitudinal, bounds.acceleration, "m/s²"),
        ("deceleration", -longitudinal, bounds.deceleration, "m/s²"),
        (
            "lateral acceleration",
            np.abs(smoothed(lateral, ACCELERATION_WINDOW, dt)),
            bounds.lateral_acceleration,
            "m/s²",
        ),
        ("yaw rate", np.abs(smoothed(heading, CHANGE_WINDOW, dt, 1)), bounds.yaw_rate, "rad/s"),
        ("yaw acceleration", np.abs(smoothed(heading, CHANGE_WINDOW, dt, 2)), bounds.yaw_acceleration, "rad/s²"),
        (
            "longitudinal jerk",
            np.abs(smoothed(motion.acceleration, CHANGE_WINDOW, dt, 1)),
            bounds.longitudinal_jerk,
            "m/s³",
        ),
        ("jerk", np.abs(smoothed(size, CHANGE_WINDOW, dt, 1)), bounds.jerk, "m/s³"),
    )
    name, values, bound, unit = max(checks, key=lambda check: float(check[1].max()) / check[2])
    worst = int(values.argmax())
    if not values[worst] > bound:
        return Term(1.0)
    when = said_seconds(int(motion.time_step[worst]), dt)
    value = with_digits(float(values[worst]), bound, fewest=2)
    return Term(0.0, f"{name} {value} {unit} at {when} s ({bound:g} allowed)")


def direction_term(motion: Motion, off: Floats, dt: float) -> Term:
    """1, 1/2 or 0 by the metres driven against the lane within any second.

    Args:
        motion: The drive.
        off: Least angle between the heading and a lanelet at the centre [rad]; nan where there is none.
        dt: Time between states [s].
    """
    way = np.abs(motion.velocity) * dt
    against = np.where(np.nan_to_num(off) > 0.5 * np.pi, way, 0.0)
    if not against.any():
        return Term(1.0)
    second = max(1, round(1.0 / dt))
    sums = np.cumsum(np.concatenate([np.zeros(second), against]))
    within = sums[second:] - sums[:-second]
    most = float(within.max())
    value = 1.0 if most < DIRECTION_FULL else 0.5 if most < DIRECTION_HALF else 0.0
    when = said_seconds(int(motion.time_step[int(within.argmax())]), dt)
    return Term(value, "" if value == 1.0 else f"{most:.1f} m against the lane within the second up to {when} s")


def ttc_term(times: Floats, partner: Ints, time_step: Ints, dt: float, bound: float) -> Term:
    """1 if the time to contact straight on stays above a bound, else 0; it looks along no lanes, as a TTC does."""
    if not len(times):
        return Term(math.nan)
    least = int(times.argmin())
    if times[least] > bound:
        return Term(1.0)
    when = said_seconds(int(time_step[least]), dt)
    return Term(0.0, f"{times[least]:.2f} s to a contact with {partner[least]} at {when} s")
