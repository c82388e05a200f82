"""How motion looks: tracks driven, plans, predictions with ellipses that are the stronger the more probable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive.plots.view import Floats
    from interdrive.run import Plans, RunRecord

#: Opacity of the least probable mode.
_FAINTEST = 0.15


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


def ellipse_rings(means: Floats, covariance: Floats, mass: float) -> Floats:
    """Outlines [m] of the ellipses that hold a probability mass of normal distributions.

    Args:
        means: Shape (..., 2) [m].
        covariance: Shape (..., 2, 2) [m²].
        mass: Between 0 and 1.

    Returns:
        Shape (ellipses, 24, 2), in the order of the means, without means that are not numbers.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    means, covariance = means.reshape(-1, 2), covariance.reshape(-1, 2, 2)
    finite = np.isfinite(means).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2))
    values, vectors = np.linalg.eigh(covariance[finite])
    axes = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    rings: Floats = means[finite][:, None] + np.sqrt(-2.0 * np.log1p(-mass)) * (axes @ circle).transpose(0, 2, 1)
    return rings


def strength(probability: Floats) -> Floats:
    """How strongly a mode is drawn, between 0 and 1: by its probability, but never invisible."""
    strong: Floats = _FAINTEST + (1.0 - _FAINTEST) * np.clip(probability, 0.0, 1.0)
    return strong
