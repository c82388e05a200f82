"""Vehicles that drive along paths without touching each other: speed profiles, states, conflicts."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from curves import Floats, Path

DT = 0.1
#: Time step of the integration [s].
FINE = 0.005
#: Peak of braking and speeding up in a speed profile over the distance [m/s²].
ACCELERATION = 2.0

SIZES = {
    "car": ((4.2, 1.78), (4.5, 1.82), (4.7, 1.85), (4.9, 1.92)),
    "truck": ((9.2, 2.5), (11.5, 2.55)),
    "bus": ((12.0, 2.55),),
    "motorcycle": ((2.2, 0.85),),
}


@dataclass(frozen=True)
class Vehicle:
    """A vehicle and its states at every `DT`, from time step 0 until it leaves the map.

    Attributes:
        kind: As in CommonRoad. length: [m]. width: [m].
        x: Centre [m], shape (steps,). y: [m]. heading: [rad]. speed: [m/s].
    """

    kind: str
    length: float
    width: float
    x: Floats
    y: Floats
    heading: Floats
    speed: Floats


def smooth(share: Floats) -> Floats:
    """From 0 to 1 with flat ends."""
    share = np.clip(share, 0.0, 1.0)
    return share**2 * (3.0 - 2.0 * share)


def speed_over_time(knots: list[tuple[float, float]]) -> Callable[[Floats], Floats]:
    """Speed [m/s] over time [s] through (time, speed) knots, flat at each."""

    def speed(time: Floats) -> Floats:
        value = np.full_like(time, knots[0][1])
        for (t0, v0), (t1, v1) in itertools.pairwise(knots):
            value = np.where(time >= t0, v0 + (v1 - v0) * smooth((time - t0) / (t1 - t0)), value)
        return value

    return speed


def distance_over_time(knots: list[tuple[float, float]], duration: float) -> Floats:
    """Distance [m] at every `FINE` of a speed profile over time."""
    time = np.arange(0.0, duration + 0.5 * FINE, FINE)
    speed = speed_over_time(knots)(time)
    return np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * FINE)))


def distance_through_zone(
    start: float, speeds: tuple[float, float, float], zone: tuple[float, float], duration: float
) -> Floats:
    """Arc length [m] at every `FINE` of a vehicle that has another speed in a part of its path.

    Args:
        start: Where it starts [m].
        speeds: Before, in and after the zone [m/s].
        zone: That part, from and to [m].
        duration: [s].
    """
    before, within, after = speeds
    farthest = start + duration * max(speeds) + 1.0
    s = np.linspace(start, farthest, round((farthest - start) / 0.01) + 1)
    squared = np.full_like(s, within**2)
    for fast, away in ((before, zone[0] - s), (after, s - zone[1])):
        # The squared speed changes smoothly over the distance, so the acceleration has no jumps.
        ramp = max(1.5 * abs(fast**2 - within**2) / (2.0 * ACCELERATION), 1e-6)
        squared += (fast**2 - within**2) * smooth(away / ramp)
    pace = 1.0 / np.sqrt(squared)
    time = np.concatenate(([0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]) * np.diff(s))))
    return np.interp(np.arange(0.0, duration + 0.5 * FINE, FINE), time, s)


def drive(path: Path, s: Floats, size: tuple[str, float, float], left: Floats | None = None) -> Vehicle:
    """A vehicle on a path.

    Args:
        path: The path.
        s: Arc length at every `FINE` [m]; the states end where the path does.
        size: Kind, length and width [m].
        left: Distance to the left of the path at every `FINE` [m]; None for 0.

    Returns:
        The vehicle; its heading is the direction of motion, that of the path where it stands.
    """
    points, heading = path.at(s, 0.0 if left is None else left)
    velocity = np.gradient(points, FINE, axis=0)
    speed = np.hypot(*velocity.T)
    if left is not None:
        heading = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    stride = round(DT / FINE)
    inside = s[::stride] < path.length - 0.5 * size[1]
    steps = slice(0, len(s), stride)
    n = len(inside) if inside.all() else int(np.argmin(inside))
    return Vehicle(*size, *(column[steps][:n] for column in (points[:, 0], points[:, 1], heading, speed)))


def conflict(first: Vehicle, second: Vehicle, along: float, aside: float) -> bool:
    """Whether two footprints, each grown by margins ahead and aside [m], overlap at any common time step."""
    n = min(len(first.x), len(second.x))
    # Most are far apart all the time.
    reach = sum(0.5 * np.hypot(v.length + 2.0 * along, v.width + 2.0 * aside) for v in (first, second))
    if np.hypot(first.x[:n] - second.x[:n], first.y[:n] - second.y[:n]).min(initial=np.inf) > reach:
        return False
    corners = [_corners(vehicle, n, along, aside) for vehicle in (first, second)]
    apart = np.zeros(n, dtype=np.bool_)
    for vehicle in (first, second):
        for angle in (vehicle.heading[:n], vehicle.heading[:n] + 0.5 * np.pi):
            axis = np.column_stack((np.cos(angle), np.sin(angle)))[:, None, :]
            (low0, high0), (low1, high1) = (
                (p.min(axis=1), p.max(axis=1)) for p in [(c * axis).sum(-1) for c in corners]
            )
            apart |= (high0 < low1) | (high1 < low0)
    return bool((~apart).any())


def _corners(vehicle: Vehicle, n: int, along: float, aside: float) -> Floats:
    """Shape (n, 4, 2)."""
    cos, sin = np.cos(vehicle.heading[:n]), np.sin(vehicle.heading[:n])
    forward = np.column_stack((cos, sin)) * (0.5 * vehicle.length + along)
    left = np.column_stack((-sin, cos)) * (0.5 * vehicle.width + aside)
    middle = np.column_stack((vehicle.x[:n], vehicle.y[:n]))
    return np.stack([middle + a * forward + b * left for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))], axis=1)


def free(candidate: Vehicle, others: list[Vehicle], along: float, aside: float = 0.3) -> bool:
    """Whether a vehicle keeps half of `along` and `aside` on each side clear of all others [m]."""
    return not any(conflict(candidate, other, 0.5 * along, aside) for other in others)


def first_free(candidates: list[Vehicle], others: list[Vehicle], along: float, aside: float = 0.3) -> Vehicle:
    """The first candidate that is free of all others; one must be."""
    for candidate in candidates:
        if free(candidate, others, along, aside):
            return candidate
    raise ValueError(f"none of {len(candidates)} candidates is free of conflicts")
