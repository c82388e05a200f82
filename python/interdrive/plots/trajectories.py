"""How motion looks: tracks driven, and plans."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive.array_types import Floats
    from interdrive.run import Plans, RunRecord


def track(run: RunRecord, row: int, columns: slice = slice(None)) -> Floats:
    """Positions [m] of a participant while it is present, shape (points, 2).

    Args:
        run: What happened.
        row: Of the states.
        columns: Time steps to look at.
    """
    states = run.states
    points: Floats = np.stack([states.x[row, columns], states.y[row, columns]], axis=1)
    return points[states.valid[row, columns]]


def plan_points(plans: Plans, index: int) -> Floats:
    """Positions [m] of a plan, shape (points, 2)."""
    points: Floats = np.stack([plans.x[index], plans.y[index]], axis=1)
    return points[np.isfinite(points).all(axis=1)]
