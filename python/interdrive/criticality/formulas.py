"""The formulas on arrays. Arguments are broadcast against each other; results have the common shape.

An infinite headway means that no vehicle is ahead: no conflict. Where an argument is nan, so is the result.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from interdrive.array_types import Floats


def time_headway(headway: ArrayLike, velocity: ArrayLike) -> Floats:
    """Time headway, THW [s].

    Args:
        headway: Gap to the vehicle ahead along the path [m].
        velocity: Speed of the vehicle behind along the path [m/s].

    Returns:
        Headway over speed; 0 in contact, inf for a vehicle that stands or reverses.
    """
    return _each(_core.time_headway, headway, velocity)


def time_to_collision(headway: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike = 0.0) -> Floats:
    """Time to collision with constant accelerations, TTC [s].

    Args:
        headway: Gap to the vehicle ahead along the path [m].
        velocity: Speed of the vehicle ahead minus that of the one behind [m/s].
        acceleration: Acceleration of the vehicle ahead minus that of the one behind [m/s²].

    Returns:
        The smallest t >= 0 with `headway + velocity * t + acceleration * t² / 2 = 0`; inf if there is none.

    Source: Jansson, "Collision Avoidance Theory", 2005.
    """
    return _each(_core.time_to_collision, headway, velocity, acceleration)


def required_acceleration(
    headway: ArrayLike,
    follower: ArrayLike,
    leader: ArrayLike,
    leader_acceleration: ArrayLike = 0.0,
    *,
    leader_stops: bool = False,
) -> Floats:
    """Required longitudinal acceleration, a_long_req [m/s²]: at most 0; the brake threat number is its size over 11.5.

    Args:
        headway: Gap to the vehicle ahead along the path [m], positive.
        follower: Speed of the vehicle behind [m/s].
        leader: Speed of the vehicle ahead [m/s].
        leader_acceleration: Acceleration of the vehicle ahead, which lasts [m/s²].
        leader_stops: A braking vehicle ahead comes to rest and stays there.

    Returns:
        The largest constant acceleration, at most 0, with which the gap never closes.

    Raises:
        InputError: A headway is not positive: in contact no braking helps.

    Source: Jansson, "Collision Avoidance Theory", 2005; sign of the second term corrected.
    """
    gap = np.asarray(headway, dtype=np.float64)
    if (gap <= 0.0).any():
        raise InputError("required_acceleration: the headway must be positive; in contact no braking helps")
    return _each(
        lambda h, f, v, a: _core.required_acceleration(h, f, v, a, leader_stops),
        gap,
        follower,
        leader,
        leader_acceleration,
    )


def required_lateral_acceleration(
    time: ArrayLike, offset: ArrayLike, left: ArrayLike, right: ArrayLike | None = None
) -> Floats:
    """Required lateral acceleration, a_lat_req [m/s²]: at least 0; the steer threat number is its part of 8.

    Args:
        time: Time to collision [s].
        offset: Where the other vehicle will then be, sideways [m], left positive.
        left: How far away the centres must be for passing on its left [m].
        right: The same on its right; like `left` by default.

    Returns:
        The smaller one of the accelerations for passing on either side; 0 without a collision.

    Source: Jansson, "Collision Avoidance Theory", 2005.
    """
    return _each(_core.required_lateral_acceleration, time, offset, left, left if right is None else right)


def minimal_stopping_distance(velocity: ArrayLike, deceleration: ArrayLike = 11.5) -> Floats:
    """Minimal stopping distance, MSD [m], without reaction time.

    Args:
        velocity: Speed [m/s].
        deceleration: Available deceleration [m/s²], positive.

    Raises:
        InputError: The deceleration is not positive.

    Source: Allen, Shin, Cooper, "Analysis of traffic conflicts and collisions", 1978.
    """
    if (np.asarray(deceleration) <= 0.0).any():
        raise InputError("minimal_stopping_distance: the deceleration must be positive")
    return _each(_core.minimal_stopping_distance, velocity, deceleration)


def proportion_of_stopping_distance(remaining: ArrayLike, stopping: ArrayLike) -> Floats:
    """Proportion of stopping distance, PSD: remaining distance [m] over minimal stopping distance [m].

    0 where nothing remains, inf for a vehicle at rest. Below 1 it cannot stop any more.

    Source: Allen, Shin, Cooper, "Analysis of traffic conflicts and collisions", 1978.
    """
    return _each(_core.proportion_of_stopping_distance, remaining, stopping)


def exposure(ttc: ArrayLike, threshold: float = 2.0, dt: float = 0.1) -> tuple[float, float]:
    """Time exposed TTC [s] and time integrated TTC [s²] of a series.

    Args:
        ttc: Time to collision per time step [s], shape (time_steps,); nan is not exposed.
        threshold: Up to which a vehicle is exposed [s].
        dt: Time between steps [s].

    Raises:
        InputError: Not a series; a threshold or time between steps that is not positive.

    Source: Minderhoud, Bovy, "Extended time-to-collision measures for road traffic safety assessment", 2001.
    """
    series = np.ascontiguousarray(ttc, dtype=np.float64)
    if series.ndim != 1:
        raise InputError(f"exposure: shape {series.shape} given, (time_steps,) expected")
    for name, value in (("threshold", threshold), ("dt", dt)):
        if not 0.0 < value < np.inf:
            raise InputError(f"exposure: {name} must be positive, not {value}")
    return _core.exposure(series, threshold, dt)


def _each(formula: Callable[..., Floats], *arguments: ArrayLike) -> Floats:
    arrays = np.broadcast_arrays(*(np.asarray(argument, dtype=np.float64) for argument in arguments))
    return formula(*(np.ascontiguousarray(array).ravel() for array in arrays)).reshape(arrays[0].shape)
