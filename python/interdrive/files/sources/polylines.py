"""Polylines: points that differ, parallels, lengths."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive.array_types import Bools, Floats

#: Points nearer to each other than this are one [m].
SAME_POINT = 1e-3
#: A mitre is at most this many times as long as the offset is wide.
_LONGEST_MITRE = 2.0


def distinct(points: Floats) -> Bools:
    """Which points are not the one before, shape (points,); the last one counts before those that are equal to it."""
    keep = np.ones(len(points), dtype=np.bool_)
    if len(points) < 2 or np.hypot(*np.diff(points, axis=0).T).min() >= SAME_POINT:
        return keep
    last = 0
    for place in range(1, len(points)):
        keep[place] = np.hypot(*(points[place] - points[last])) >= SAME_POINT
        last = place if keep[place] else last
    if not keep[-1] and last > 0:
        keep[last], keep[-1] = False, True
    return keep


def length(points: Floats) -> float:
    """Length of a polyline [m]."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def offset(points: Floats, by: float, first: float | None = None, last: float | None = None) -> Floats:
    """The parallel of a polyline, to the left if `by` is positive [m], with mitred corners.

    Args:
        points: At least two, of which no two that follow each other are equal, shape (points, 2).
        by: Offset [m].
        first: Direction at the first point [rad]; None: that of the first piece.
        last: The same at the last point.
    """
    step = np.diff(points, axis=0)
    heading = np.arctan2(step[:, 1], step[:, 0])
    turn = np.remainder(np.diff(heading) + np.pi, 2.0 * np.pi) - np.pi
    at = np.concatenate(([heading[0] if first is None else first], heading[:-1] + 0.5 * turn))
    at = np.concatenate((at, [heading[-1] if last is None else last]))
    mitre = np.ones(len(points))
    mitre[1:-1] = 1.0 / np.maximum(np.cos(0.5 * turn), 1.0 / _LONGEST_MITRE)
    moved: Floats = points + (by * mitre)[:, None] * np.column_stack((-np.sin(at), np.cos(at)))
    return moved
