"""Free flow: the least time in which a way can be driven lawfully on an empty road."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Floats

#: Spacing of the grid [m].
SPACING = 0.5
#: How a lawful driver accelerates and brakes [m/s²], and the least mean speed between two places [m/s]. Published
#: scores rest on them, so the braking does not follow `_core.EXPECTED_DECELERATION`.
ACCELERATION, DECELERATION, SPEED_MIN = 2.0, 3.0, 0.05
#: Lateral acceleration in curves [m/s²].
LATERAL_ACCELERATION = 4.0
#: Straighter paths count as this straight [1/m].
_CURVATURE_MIN = 1e-6
#: Limits count up to this distance along the path where none is stated [m].
STATED_WITHIN = 50.0


@dataclass(frozen=True)
class Stop:
    """A place at which a lawful driver may have to stop.

    Attributes:
        way: Where it would stand, counted from the start [m].
        closed: When the light there is not green, from and until [s since the start].
        duration: How long a vehicle has to stand there [s]; 0 without a stop sign.
    """

    way: float
    closed: tuple[tuple[float, float], ...] = field(default=())
    duration: float = 0.0


def speed_caps(curvature: Floats, limit: Floats, lateral_acceleration: float, velocity_max: float) -> Floats:
    """Largest lawful speeds [m/s] for curvatures [1/m], limits [m/s], and the bounds of a vehicle."""
    bends = np.sqrt(lateral_acceleration / np.maximum(np.abs(curvature), _CURVATURE_MIN))
    caps: Floats = np.minimum(np.minimum(bends, limit), velocity_max)
    return caps


def stated_limits(limit: Floats, otherwise: float) -> Floats:
    """Limits on the grid; where none is stated (not finite) the nearest one within 50 m, else one speed [m/s]."""
    known = np.flatnonzero(np.isfinite(limit))
    if not len(known):
        return np.full_like(limit, otherwise)
    places = np.arange(len(limit))
    after = np.searchsorted(known, places).clip(max=len(known) - 1)
    before = (after - 1).clip(min=0)
    is_after = np.abs(known[after] - places) < np.abs(known[before] - places)
    nearest = np.where(is_after, known[after], known[before])
    is_near = np.abs(nearest - places) * SPACING <= STATED_WITHIN
    filled: Floats = np.where(is_near, limit[nearest], otherwise)
    return filled


def free_flow_times(caps: Floats, velocity: float, stops: Sequence[Stop] = ()) -> Floats:
    """Times [s] at which a lawful driver is at the places of the grid, from the first one at a speed [m/s] on.

    Args:
        caps: Largest lawful speed at each place [m/s].
        velocity: Speed at the start [m/s].
        stops: Places with lights and stop signs, in their order.
    """
    start, clock, speed, times = 0, 0.0, velocity, [np.zeros(1)]
    for stop in (*stops, None):
        last = len(caps) - 1 if stop is None else min(int(stop.way / SPACING + 1e-9), len(caps) - 1)
        if last < start:
            continue
        way = caps[start : last + 1]
        if stop is None:
            times.append(_driven(way, speed, stands=False)[0] + clock)
            break
        if stop.duration > 0.0:
            passed, _ = _driven(way, speed, stands=True)
            passed, speed = passed + clock, 0.0
            clock = (passed[-1] if len(passed) else clock) + stop.duration
        else:
            passed, after = _driven(way, speed, stands=False)
            passed = passed + clock
            opens = _opens(stop, passed[-1] if len(passed) else clock)
            if opens is None:
                speed, clock = after, passed[-1] if len(passed) else clock
            else:
                passed = _driven(way, speed, stands=True)[0] + clock
                arrival = passed[-1] if len(passed) else clock
                opens = _opens(stop, arrival)
                speed, clock = 0.0, arrival if opens is None else opens
        if len(passed):
            passed[-1] = clock
        times.append(passed)
        start = last
    return np.concatenate(times)


def _opens(stop: Stop, time: float) -> float | None:
    """When a light opens that is closed at a time [s]; None if it is open."""
    return next((until for since, until in stop.closed if since <= time < until), None)


def _driven(caps: Floats, velocity: float, *, stands: bool) -> tuple[Floats, float]:
    """Times since the first place at all later ones [s], and the speed at the last one [m/s]."""
    up, down = 2.0 * ACCELERATION * SPACING, 2.0 * DECELERATION * SPACING
    n = len(caps)
    k = np.arange(n, dtype=np.float64)
    squares = caps**2
    if stands:
        squares[-1] = 0.0
    # From which each lower speed ahead can be reached.
    below = np.minimum.accumulate((squares + down * k)[::-1])[::-1] - down * k
    braking = np.maximum(velocity**2 - down * k, 0.0)
    fits = np.flatnonzero(below[1:] >= braking[1:])
    reached = int(fits[0]) + 1 if len(fits) else n
    driven = braking
    if reached < n:
        first = min(below[reached], driven[reached - 1] + up)
        later = below[reached:].copy()
        later[0] = first
        driven[reached:] = np.minimum.accumulate(later - up * k[reached:]) + up * k[reached:]
    speeds = np.sqrt(np.maximum(driven, 0.0))
    speeds[0] = velocity
    steps = SPACING / np.maximum(0.5 * (speeds[1:] + speeds[:-1]), SPEED_MIN)
    return np.cumsum(steps), float(speeds[-1])


def time_at(times: Floats, way: float) -> float:
    """Free-flow time at a way [m], linear between places of the grid; nan without any."""
    if not len(times):
        return math.nan
    return float(np.interp(way, np.arange(len(times)) * SPACING, times))
