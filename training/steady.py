"""Invented traffic at exactly constant speed along the lanes of a map.

Tools that synthesise scenarios make such vehicles, and so do planners on a free road; recorded and simulated vehicles
are never that steady. A few rows of it teach the network that a vehicle with exactly steady motion continues exactly
so.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from interdrive.scenario import Obstacles, Shape

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive.scenario import Scenario

    Floats = NDArray[np.float64]

_DT = 0.1
_STEPS = 61
_VEHICLES = 8
_ATTEMPTS = 40
_SPEED_MIN = 0.5
_LATERAL_ACCELERATION = 3.5
#: Vehicles keep this distance of their centres [m].
_DISTANCE = 8.0


def steady_traffic(scenario: Scenario, speed_max: float, seed: int) -> Scenario:
    """The scenario's map with other vehicles: each follows lanes at a speed of its own.

    Args:
        scenario: Where the map comes from.
        speed_max: Largest speed [m/s].
        seed: Of places and speeds.
    """
    generator = np.random.default_rng(seed)
    tracks: list[tuple[Floats, float]] = []
    for _ in range(_ATTEMPTS):
        line = _lane(scenario, 1.2 * speed_max * _DT * _STEPS + 40.0, generator)
        start, draw = generator.random(), generator.random()
        if len(line) < 10 or len(tracks) == _VEHICLES:
            continue
        heading = np.unwrap(np.arctan2(*np.gradient(line, axis=0).T[::-1]))
        curvature = np.abs(np.gradient(heading))[5:-5].max(initial=1e-3)
        fastest = min(speed_max, float(np.sqrt(_LATERAL_ACCELERATION / max(curvature, 1e-3))))
        speed = _SPEED_MIN + draw * max(fastest - _SPEED_MIN, 0.0)
        s = start * 0.5 * (len(line) - 1) + speed * _DT * np.arange(_STEPS)
        knots = np.arange(len(line))
        table = np.stack([np.interp(s, knots, column, right=np.nan) for column in (*line.T, heading)], axis=-1)
        gaps = [np.linalg.norm(table[:, :2] - other[:, :2], axis=1) for other, _ in tracks]
        if all(np.nanmin(gap, initial=np.inf) > _DISTANCE for gap in gaps):
            tracks.append((table, speed))
    return replace(scenario, dt=_DT, obstacles=_obstacles(tracks))


def _lane(scenario: Scenario, length: float, generator: np.random.Generator) -> Floats:
    """Points at a distance of about 1 m along lanes that follow each other, smoothed."""
    lanelets = scenario.lanelets
    index = {int(i): k for k, i in enumerate(lanelets.ids)}
    k = int(generator.integers(len(index)))
    pieces, total = [], 0.0
    for _ in range(30):
        center = (lanelets.left[k][:, :2] + lanelets.right[k][:, :2]) / 2
        pieces.append(center if not pieces else center[1:])
        total += float(np.linalg.norm(np.diff(center, axis=0), axis=1).sum())
        following = [index[i] for i in lanelets.successors[k] if i in index]
        if total > length or not following:
            break
        k = following[int(generator.integers(len(following)))]
    line = np.concatenate(pieces)
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    line = line[np.concatenate([[True], steps > 1e-3])]
    if len(line) < 2:
        return line
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    even = np.arange(0.0, min(s[-1], length), 1.0)
    line = np.stack([np.interp(even, s, column) for column in line.T], axis=-1)
    if len(line) > 10:
        padded = np.pad(line, ((2, 2), (0, 0)), mode="reflect", reflect_type="odd")
        line = np.stack([np.convolve(column, np.full(5, 0.2), mode="valid") for column in padded.T], axis=-1)
    return line


def _obstacles(tracks: list[tuple[Floats, float]]) -> Obstacles:
    n = len(tracks)
    tables = np.stack([table for table, _ in tracks]) if tracks else np.empty((0, _STEPS, 3))
    valid = np.isfinite(tables).all(axis=2)
    speed = np.where(valid, np.array([speed for _, speed in tracks]).reshape(n, 1), np.nan)
    return Obstacles(
        ids=np.arange(1, n + 1),
        kinds=("car",) * n,
        shapes=(Shape("rectangle", length=4.6, width=1.9),) * n,
        is_static=np.zeros(n, bool),
        x=np.where(valid, tables[..., 0], np.nan),
        y=np.where(valid, tables[..., 1], np.nan),
        orientation=np.where(valid, tables[..., 2], np.nan),
        velocity=speed,
        acceleration=np.where(valid, 0.0, np.nan),
        yaw_rate=np.where(valid, 0.0, np.nan),
        valid=valid,
    )
