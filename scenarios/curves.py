"""Paths with continuous curvature: straights, quarter turns and lateral shifts, densely sampled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Distance between samples of a path [m].
SPACING = 0.05
#: Share of a turn in which its curvature grows (and, at the other end, shrinks).
RAMP = 0.35


@dataclass(frozen=True)
class Pose:
    """A point [m] and a direction [rad]."""

    x: float
    y: float
    heading: float

    def ahead(self, distance: float, left: float = 0.0) -> Pose:
        """The pose `distance` ahead and `left` to the left, same direction."""
        cos, sin = np.cos(self.heading), np.sin(self.heading)
        return Pose(self.x + distance * cos - left * sin, self.y + distance * sin + left * cos, self.heading)


@dataclass(frozen=True)
class Path:
    """Samples along a path: points [m], shape (samples, 2); direction [rad] and arc length [m], shape (samples,)."""

    points: Floats
    heading: Floats
    s: Floats

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(self.s[-1])

    @property
    def end(self) -> Pose:
        """Where it ends."""
        return Pose(*self.points[-1], self.heading[-1])

    def at(self, s: Floats, left: Floats | float = 0.0) -> tuple[Floats, Floats]:
        """Points `left` of the path and directions of the path at arc lengths, shape (len(s), 2) and (len(s),)."""
        heading = np.interp(s, self.s, np.unwrap(self.heading))
        middle = np.column_stack([np.interp(s, self.s, column) for column in self.points.T])
        normal = np.column_stack((-np.sin(heading), np.cos(heading)))
        return middle + np.broadcast_to(left, heading.shape)[:, None] * normal, heading


def straight(start: Pose, length: float) -> Path:
    """Straight ahead."""
    return of_curvature(start, np.zeros(samples(length)), length)


def of_curvature(start: Pose, curvature: Floats, length: float) -> Path:
    """The path of a given curvature [1/m], sampled evenly over its length."""
    step = length / (len(curvature) - 1)
    heading = start.heading + np.concatenate(([0.0], np.cumsum(0.5 * (curvature[1:] + curvature[:-1]) * step)))
    middle = 0.5 * (heading[1:] + heading[:-1])
    moves = step * np.column_stack((np.cos(middle), np.sin(middle)))
    points = np.array([start.x, start.y]) + np.concatenate((np.zeros((1, 2)), np.cumsum(moves, axis=0)))
    return Path(points, heading, np.linspace(0.0, length, len(curvature)))


def samples(length: float) -> int:
    """Number of samples of a path of that length."""
    return max(2, round(length / SPACING) + 1)


def quarter_turn(start: Pose, reach: float, *, left: bool) -> Path:
    """A turn by 90 degrees that ends `reach` ahead and `reach` to the side [m]."""
    grid = np.linspace(0.0, 1.0, 2001)
    shape = np.clip(np.minimum(grid, 1.0 - grid) / RAMP, 0.0, 1.0) / (1.0 - RAMP)
    angle = np.concatenate(([0.0], np.cumsum(0.5 * (shape[1:] + shape[:-1])) / 2000.0)) * 0.5 * np.pi
    length = reach / float(np.mean(np.cos(0.5 * (angle[1:] + angle[:-1]))))
    fine = np.interp(np.linspace(0.0, 1.0, samples(length)), grid, shape)
    return of_curvature(start, (1.0 if left else -1.0) * 0.5 * np.pi * fine / length, length)


def connection(start: Pose, end: Pose) -> Path:
    """From one pose to another straight ahead or to the side: straight, quarter turn, straight as they fit."""
    cos, sin = np.cos(start.heading), np.sin(start.heading)
    dx, dy = end.x - start.x, end.y - start.y
    ahead, left = dx * cos + dy * sin, dy * cos - dx * sin
    if abs(left) < 1e-6:
        return _ending_at(straight(start, ahead), end)
    reach = min(ahead, abs(left))
    parts = []
    if ahead - reach > 1e-6:
        parts.append(straight(start, ahead - reach))
    parts.append(quarter_turn(parts[-1].end if parts else start, reach, left=left > 0.0))
    if abs(left) - reach > 1e-6:
        parts.append(straight(parts[-1].end, abs(left) - reach))
    return _ending_at(joined(parts), end)


def shifted(start: Pose, length: float, left: float) -> Path:
    """A smooth change of lane: `length` ahead and `left` to the left, ends parallel (quintic in the distance)."""
    grid = np.linspace(0.0, 1.0, samples(length))
    offset = left * grid**3 * (10.0 - 15.0 * grid + 6.0 * grid**2)
    slope = left / length * 30.0 * grid**2 * (1.0 - grid) ** 2
    cos, sin = np.cos(start.heading), np.sin(start.heading)
    along = grid * length
    points = np.column_stack((start.x + along * cos - offset * sin, start.y + along * sin + offset * cos))
    return _from_points(points, start.heading + np.arctan(slope))


def joined(parts: list[Path]) -> Path:
    """Paths that continue each other as one."""
    points = np.concatenate([parts[0].points[:1], *(part.points[1:] for part in parts)])
    heading = np.unwrap(np.concatenate([parts[0].heading[:1], *(part.heading[1:] for part in parts)]))
    return _from_points(points, heading)


def _from_points(points: Floats, heading: Floats) -> Path:
    return Path(points, heading, np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T)))))


def _ending_at(path: Path, end: Pose) -> Path:
    """Removes what integration left of an error, far below a millimetre, so that lanelets meet exactly."""
    share = (path.s / path.length)[:, None]
    return Path(path.points + share * ((end.x, end.y) - path.points[-1]), path.heading, path.s)
