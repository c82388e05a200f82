"""Both borders of a lane, which sources give unequally many points, with points beside each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive.array_types import Floats

#: Both borders get points at relative lengths that are at least this far apart.
_SAME_SHARE = 1e-4


def paired(left: Floats, right: Floats) -> tuple[Floats, Floats]:
    """Both borders with points at the same shares of their lengths, among them all points of both.

    Args:
        left: [m], shape (points, 2), at least two points, no two equal ones in a row.
        right: The same.
    """
    shares = [_shares(border) for border in (left, right)]
    wanted = np.unique(np.round(np.concatenate(shares), 9))
    kept = [0.0]
    for share in wanted[1:-1].tolist():
        if share - kept[-1] > _SAME_SHARE and 1.0 - share > _SAME_SHARE:
            kept.append(share)
    at = np.array([*kept, 1.0])
    first, second = (
        np.column_stack([np.interp(at, share, column) for column in border.T])
        for border, share in zip((left, right), shares, strict=True)
    )
    return first, second


def _shares(border: Floats) -> Floats:
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(border, axis=0).T))))
    shares: Floats = along / along[-1]
    shares[-1] = 1.0
    return shares
