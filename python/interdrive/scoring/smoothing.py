"""Quadratic Savitzky-Golay filters: values and derivatives of the parabola that fits a window best."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive.array_types import Floats


@cache
def _matrix(window: int, derivative: int) -> Floats:
    """Row i: what the values of a window are multiplied by for its position i, per step; shape (window, window)."""
    steps = np.arange(window, dtype=np.float64) - (window - 1) // 2
    powers = np.stack([np.ones(window), steps, steps**2], axis=1)
    fit = np.linalg.solve(powers.T @ powers, powers.T)  # values of a window -> coefficients of the parabola
    zeros, ones = np.zeros(window), np.ones(window)
    at = (powers, np.stack([zeros, ones, 2.0 * steps], axis=1), np.stack([zeros, zeros, 2.0 * ones], axis=1))[
        derivative
    ]
    matrix: Floats = at @ fit
    return matrix


def smoothed(values: Floats, window: int, dt: float, derivative: int = 0) -> Floats:
    """A derivative of the filtered values; the ends follow the parabola of the first and last window.

    Args:
        values: Shape (n,), n at least 3.
        window: Odd; the largest odd number up to n if there are fewer values.
        dt: Time between values [s].
        derivative: 0, 1 or 2.
    """
    n = len(values)
    window = min(window, n if n % 2 else n - 1)
    half, matrix = window // 2, _matrix(window, derivative)
    found = np.empty(n)
    found[half : n - half] = np.convolve(values, matrix[half][::-1], mode="valid")
    found[:half] = matrix[:half] @ values[:window]
    found[n - half :] = matrix[half + 1 :] @ values[n - window :]
    scaled: Floats = found / dt**derivative
    return scaled
