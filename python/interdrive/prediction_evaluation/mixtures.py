"""Mixtures of normal distributions in the plane: densities, and regions of highest density.

Shapes: n samples, m modes, k time steps. Positions and means in metres, world frame.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive.array_types import Floats

#: Points that stand for one mode when the mass of a region is summed.
_POINTS = 256
#: Density evaluations at once; limits the memory.
_AT_ONCE = 4_000_000


def squared_distances(points: Floats, means: Floats, covariance: Floats) -> Floats:
    """Squared Mahalanobis distances, shape (...), of points and means (..., 2) with covariances (..., 2, 2)."""
    dx, dy = np.moveaxis(points - means, -1, 0)
    xx, xy, yy = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    distances: Floats = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy)
    return distances


def log_densities(points: Floats, means: Floats, covariance: Floats) -> Floats:
    """Logarithms of the normal densities [1/m²] at points, shapes as in `squared_distances`."""
    xx, xy, yy = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    logarithms: Floats = (
        -0.5 * squared_distances(points, means, covariance) - 0.5 * np.log(xx * yy - xy * xy) - np.log(2.0 * np.pi)
    )
    return logarithms


def log_sum(logarithms: Floats, weights: Floats, axis: int) -> Floats:
    """Logarithm of the weighted sum of exponentials along an axis; -inf where all weights are 0."""
    with np.errstate(divide="ignore"):
        terms = np.where(weights > 0, logarithms, -np.inf) + np.log(weights)
    peak = terms.max(axis=axis, keepdims=True)
    peak = np.where(np.isfinite(peak), peak, 0.0)
    with np.errstate(divide="ignore"):
        total: Floats = np.log(np.exp(terms - peak).sum(axis=axis)) + np.squeeze(peak, axis)
    return total


def ellipse_level(squared_distance: Floats) -> Floats:
    """Probability mass of the ellipse through a point of a normal distribution in the plane: 1 - exp(-d² / 2)."""
    level: Floats = -np.expm1(-0.5 * squared_distance)
    return level


def region_levels(points: Floats, weights: Floats, means: Floats, covariance: Floats) -> Floats:
    """Mass of the region of highest density on whose border each point lies.

    A point is inside the region of highest density with mass q exactly if its level is at most q (Hyndman, 1996). For
    one mode that region is the ellipse and the level is exact. Otherwise the mass is summed over a fixed set of 256
    points per mode (golden-angle spiral), so the same input gives the same level; its error is below 0.01.

    Args:
        points: Where, shape (n, 2).
        weights: Of the modes, shape (n, m), sum 1; 0: no mode.
        means: Shape (n, m, 2).
        covariance: Shape (n, m, 2, 2).

    Returns:
        Levels between 0 and 1, shape (n,).
    """
    n, n_modes = weights.shape
    main = weights.argmax(axis=1)
    rows = np.arange(n)
    levels = ellipse_level(squared_distances(points, means[rows, main], covariance[rows, main]))
    several = np.flatnonzero((weights > 0).sum(axis=1) > 1)
    at_once = max(1, _AT_ONCE // (n_modes * n_modes * _POINTS))
    for start in range(0, len(several), at_once):
        part = several[start : start + at_once]
        levels[part] = _summed_levels(points[part], weights[part], means[part], covariance[part])
    return levels


def _summed_levels(points: Floats, weights: Floats, means: Floats, covariance: Floats) -> Floats:
    there = log_sum(log_densities(points[:, None], means, covariance), weights, axis=1)
    # Equal shares of mass: radii at the middles of equal quantiles, angles that never line up.
    number = np.arange(_POINTS)
    radius, angle = np.sqrt(-2.0 * np.log1p(-(number + 0.5) / _POINTS)), number * np.pi * (3.0 - np.sqrt(5.0))
    spiral = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    xx, xy, yy = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    a = np.sqrt(xx)
    b = xy / a
    c = np.sqrt(yy - b * b)
    x = means[..., 0, None] + a[..., None] * spiral[:, 0]
    y = means[..., 1, None] + b[..., None] * spiral[:, 0] + c[..., None] * spiral[:, 1]
    cloud = np.stack([x, y], axis=-1)  # (n, m, points, 2)
    per_mode = log_densities(cloud[:, :, :, None], means[:, None, None], covariance[:, None, None])
    density = log_sum(per_mode, weights[:, None, None, :], axis=3)  # (n, m, points)
    denser = (density > there[:, None, None]).mean(axis=2)
    levels: Floats = (weights * denser).sum(axis=1)
    return levels
