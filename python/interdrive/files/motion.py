"""Recorded states of one obstacle as columns, and the derivation of missing values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.scenario import STATE_FIELDS
from interdrive.scenario.limits import LARGEST_ACCELERATION, LARGEST_VELOCITY, LARGEST_YAW_RATE

if TYPE_CHECKING:
    from interdrive.array_types import Floats, Ints

#: Below this speed [m/s] the heading cannot be derived from the direction of motion.
_STANDING = _core.STANDSTILL_SPEED
#: Two states of one time step that are closer than this [m] count as one.
SAME_PLACE = 0.01


@dataclass
class Track:
    """States of one obstacle, sorted by time step, without repetition.

    Attributes:
        time_steps: Shape (states,).
        values: Columns as in `STATE_FIELDS`, nan where not stated, shape (states, 6).
        derived: Names of the columns with derived values.
        derived_first: Names of the columns whose first value is derived.
        contradicts: Whether a time step occurs twice, at places more than `SAME_PLACE` apart.
    """

    time_steps: Ints
    values: Floats
    derived: tuple[str, ...] = field(default=())
    derived_first: tuple[str, ...] = field(default=())
    contradicts: bool = False


def track(time_steps: Ints, values: Floats) -> Track:
    """Makes a track from states in any order: time steps, shape (states,), and columns, shape (states, 6).

    If a time step occurs twice (an initial state repeated in the trajectory), the first row counts, and its missing
    values are taken from the later one.
    """
    if np.all(np.diff(time_steps) > 0):  # the common case
        return Track(time_steps, values)
    by_step: dict[int, list[float]] = {}
    contradicts = False
    for time_step, row in zip(time_steps.tolist(), values.tolist(), strict=True):
        known = by_step.setdefault(time_step, list(row))
        contradicts |= np.hypot(row[0] - known[0], row[1] - known[1]) > SAME_PLACE
        for column, value in enumerate(row):
            if np.isnan(known[column]):
                known[column] = value
    steps = sorted(by_step)
    table = np.array([by_step[step] for step in steps], dtype=np.float64)
    return Track(np.array(steps, dtype=np.int64), table, contradicts=bool(contradicts))


def completed(recorded: Track, dt: float) -> Track:
    """The track with every missing value derived.

    The heading is derived from the direction of motion, or its opposite where the speed is negative (a standing vehicle
    keeps its heading; a vehicle that never moves gets 0), the speed from the motion along the heading, acceleration and
    yaw rate from their changes. Differences are central inside and one-sided at the ends. Missing values of a single
    state are 0. Headings are wrapped to [-pi, pi]. Derived values stay within the bounds for stated ones, however far a
    recording jumps.

    Args:
        recorded: At least one state; positions are complete.
        dt: Time between steps [s].

    Returns:
        A track without nan.
    """
    x, y, orientation, velocity, acceleration, yaw_rate = recorded.values.T.copy()
    time: Floats = recorded.time_steps.astype(np.float64) * dt
    missing = np.isnan(recorded.values)
    if missing[:, 2:4].any():
        x_dot, y_dot = _rate(x, time), _rate(y, time)
        if missing[:, 2].any():
            sign = np.where(velocity < 0.0, -1.0, 1.0)  # nan: forwards
            heading = _heading_of_motion(sign * x_dot, sign * y_dot)
            orientation = np.where(missing[:, 2], heading, orientation)
        along = x_dot * np.cos(orientation) + y_dot * np.sin(orientation)
        velocity = np.where(missing[:, 3], along.clip(-LARGEST_VELOCITY, LARGEST_VELOCITY), velocity)
    if missing[:, 4].any():
        rate = _rate(velocity, time).clip(-LARGEST_ACCELERATION, LARGEST_ACCELERATION)
        acceleration = np.where(missing[:, 4], rate, acceleration)
    if missing[:, 5].any():
        rate = _rate(np.unwrap(orientation), time).clip(-LARGEST_YAW_RATE, LARGEST_YAW_RATE)
        yaw_rate = np.where(missing[:, 5], rate, yaw_rate)
    orientation = wrapped(orientation)
    values = np.column_stack((x, y, orientation, velocity, acceleration, yaw_rate))
    derived = tuple(name for column, name in enumerate(STATE_FIELDS) if missing[:, column].any())
    derived_first = tuple(name for name in derived if missing[0, STATE_FIELDS.index(name)])
    return Track(recorded.time_steps, values, derived, derived_first)


def wrapped(angle: Floats) -> Floats:
    """Angles [rad] wrapped to [-pi, pi]; those already in this range are unchanged, bit for bit."""
    outside = np.abs(angle) > np.pi
    return np.where(outside, np.arctan2(np.sin(angle), np.cos(angle)), angle)


def _rate(values: Floats, time: Floats) -> Floats:
    return np.gradient(values, time) if len(values) > 1 else np.zeros_like(values)


def _heading_of_motion(x_dot: Floats, y_dot: Floats) -> Floats:
    moving = np.hypot(x_dot, y_dot) > _STANDING
    if not moving.any():
        return np.zeros_like(x_dot)
    heading = np.arctan2(y_dot, x_dot)
    last_moving = np.maximum.accumulate(np.where(moving, np.arange(len(moving)), -1))
    return heading[np.where(last_moving < 0, np.argmax(moving), last_moving)]
