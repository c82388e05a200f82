"""Estimators on arrays of numbers: proper scores of samples, distances of distributions, smooth derivatives."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive.array_types import Bools, Floats


def energy_score(samples: Floats, truth: Floats) -> Floats:
    """E|X - y| - E|X - X'| / 2 of each item; of one sample its distance from the truth.

    Gneiting and Raftery, "Strictly Proper Scoring Rules, Prediction, and Estimation", Journal of the American
    Statistical Association 102, 2007, doi 10.1198/016214506000001437, section 4.3; X' is another sample than X.

    Args:
        samples: Shape (samples, items, dimensions).
        truth: Shape (items, dimensions).

    Returns:
        Shape (items,), in the unit of the samples; nan where a sample or the truth is nan.
    """
    n = len(samples)
    near = np.linalg.norm(samples - truth, axis=2).mean(axis=0)
    if n < 2:
        return np.asarray(near)
    apart = np.zeros(samples.shape[1])
    for shift in range(1, n):
        apart += np.linalg.norm(samples - np.roll(samples, shift, axis=0), axis=2).mean(axis=0)
    return np.asarray(near - 0.5 * apart / (n - 1))


def crps(samples: Floats, truth: Floats) -> Floats:
    """Continuous ranked probability score: the energy score in one dimension.

    Args:
        samples: Shape (samples, items).
        truth: Shape (items,).
    """
    return energy_score(samples[..., None], truth[..., None])


def wasserstein(one: Floats, other: Floats) -> float:
    """Area between two distribution functions, in the unit of the samples; nan without samples. nan is left out."""
    a, b = (np.sort(values[np.isfinite(values)]) for values in (one, other))
    if not (a.size and b.size):
        return float("nan")
    every = np.sort(np.concatenate((a, b)))
    below = [np.searchsorted(values, every[:-1], side="right") / len(values) for values in (a, b)]
    return float((np.abs(below[0] - below[1]) * np.diff(every)).sum())


def auc(scores: Floats, is_positive: Bools) -> float:
    """Probability that a positive has the higher score, ties counting half; nan without positives or negatives."""
    positives = int(is_positive.sum())
    negatives = len(is_positive) - positives
    if not (positives and negatives):
        return float("nan")
    _, place, counts = np.unique(scores, return_inverse=True, return_counts=True)
    ranks = np.cumsum(counts) - 0.5 * (counts - 1)
    above = ranks[place][is_positive].sum() - 0.5 * positives * (positives + 1)
    return float(above / (positives * negatives))


def smooth(values: Floats, dt: float, window: int, degree: int, derivative: int = 0) -> Floats:
    """Least-squares polynomials over a moving window, or their derivatives.

    Savitzky and Golay, "Smoothing and Differentiation of Data by Simplified Least Squares Procedures", Analytical
    Chemistry 36, 1964, doi 10.1021/ac60214a047.

    Args:
        values: Time is the last axis.
        dt: Time between values [s].
        window: Number of values of a polynomial; odd.
        degree: Of the polynomials.
        derivative: 0, 1, 2 or 3.

    Returns:
        The same shape; nan where the window is not full.
    """
    half = window // 2
    found = np.full(values.shape, np.nan)
    if values.shape[-1] < window:
        return found
    times = np.arange(-half, half + 1) * dt
    powers = np.vander(times, degree + 1, increasing=True)
    factor = float(np.prod(np.arange(1, derivative + 1)))
    weights = factor * np.linalg.pinv(powers)[derivative]
    found[..., half : values.shape[-1] - half] = np.lib.stride_tricks.sliding_window_view(values, window, -1) @ weights
    return found


def intervals(
    values: Floats, groups: Floats, *, samples: int = 1000, seed: int = 0, level: float = 0.95
) -> tuple[float, float]:
    """Interval of a mean over items whose groups are drawn with replacement; nan below two groups.

    Args:
        values: One per item; nan is left out.
        groups: Of each item.
        samples: Draws.
        seed: Of the draws.
        level: Coverage.
    """
    kept = np.isfinite(values)
    _, place = np.unique(groups[kept], return_inverse=True)
    if not kept.any() or place.max() < 1:
        return float("nan"), float("nan")
    sums, counts = np.bincount(place, values[kept]), np.bincount(place)
    drawn = np.random.default_rng(seed).integers(len(sums), size=(samples, len(sums)))
    means = sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1)
    tail = 50.0 * (1.0 - level)
    low, high = np.percentile(means, (tail, 100.0 - tail)).tolist()
    return low, high
