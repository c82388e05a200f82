"""Lateral positions in the frame of a path."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive.array_types import Floats


def lateral_offsets(path: Floats, points: Floats) -> Floats:
    """Signed distance of points to the nearest place of a path [m], positive to its left.

    Args:
        path: Vertices [m], shape (vertices, 2); repeated ones are ignored.
        points: Shape (points, 2) [m]; nan where absent.

    Returns:
        Shape (points,); nan where a point is absent or lies before the beginning or beyond the end of the path.
    """
    along = np.diff(path, axis=0)
    length = np.hypot(*along.T)
    start, along, length = path[:-1][length > 0.0], along[length > 0.0], length[length > 0.0]
    offsets = np.full(len(points), np.nan)
    if not len(length):
        return offsets
    along /= length[:, None]
    present = np.flatnonzero(np.isfinite(points).all(axis=1))
    delta = points[present, None] - start[None]
    s = (delta * along).sum(axis=2)
    foot = np.clip(s, 0.0, length)
    aside = along[:, 0] * delta[:, :, 1] - along[:, 1] * delta[:, :, 0]
    nearest = np.argmin(np.hypot(s - foot, aside), axis=1)
    row = np.arange(len(present))
    distance = np.hypot(s - foot, aside)[row, nearest]
    offset = np.copysign(distance, aside[row, nearest])
    outside = ((nearest == 0) & (s[row, 0] < 0.0)) | ((nearest == len(length) - 1) & (s[row, -1] > length[-1]))
    offsets[present] = np.where(outside, np.nan, offset)
    return offsets
