"""Evolution strategy with covariance matrix adaptation (CMA-ES), which asks for points and is told their values.

Hansen, "The CMA Evolution Strategy: A Tutorial", 2016, arXiv 1604.00772; the constants are those of its table 1.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive.array_types import Floats


class Evolution:
    """A search for the least value of a function; it depends on its arguments and on what it is told alone."""

    def __init__(self, mean: Floats, step: float, size: int, seed: int) -> None:
        """Begins.

        Args:
            mean: Where it begins.
            step: Standard deviation of the first points around it.
            size: Points of a generation.
            seed: Of all that is drawn.
        """
        n, half = len(mean), size // 2
        weights = math.log((size + 1) / 2) - np.log(np.arange(1, half + 1))
        self._mean, self._step, self._size, self._half = mean.copy(), step, size, half
        self._weights = weights / weights.sum()
        self._effective = 1.0 / float((self._weights**2).sum())
        effective = self._effective
        self._path_rate = (4 + effective / n) / (n + 4 + 2 * effective / n)
        self._step_rate = (effective + 2) / (n + effective + 5)
        self._one_rate = 2 / ((n + 1.3) ** 2 + effective)
        self._rank_rate = min(1 - self._one_rate, 2 * (effective - 2 + 1 / effective) / ((n + 2) ** 2 + effective))
        self._damping = 1 + 2 * max(0.0, math.sqrt((effective - 1) / (n + 1)) - 1) + self._step_rate
        self._expected = math.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n * n))
        self._covariance, self._path, self._step_path = np.eye(n), np.zeros(n), np.zeros(n)
        self._random, self._generation = np.random.default_rng(seed), 0

    def ask(self) -> Floats:
        """The points of a generation, shape (size, n)."""
        self._values, self._axes = np.linalg.eigh(self._covariance)
        self._values = np.sqrt(np.maximum(self._values, 1e-20))
        drawn = self._random.standard_normal((self._size, len(self._mean)))
        points: Floats = self._mean + self._step * (drawn * self._values) @ self._axes.T
        self._points = points
        return points

    def tell(self, objectives: Floats) -> None:
        """Learns from the values at these points, shape (size,)."""
        n, effective = len(self._mean), self._effective
        order = np.argsort(objectives, kind="stable")[: self._half]
        steps = (self._points[order] - self._mean) / self._step
        move = self._weights @ steps
        self._mean = self._mean + self._step * move
        self._generation += 1
        white = self._axes @ ((self._axes.T @ move) / self._values)
        rate = self._step_rate
        self._step_path = (1 - rate) * self._step_path + math.sqrt(rate * (2 - rate) * effective) * white
        length = float(np.linalg.norm(self._step_path))
        decay = math.sqrt(1 - (1 - rate) ** (2 * self._generation))
        moves = length / decay < (1.4 + 2 / (n + 1)) * self._expected
        rate = self._path_rate
        self._path = (1 - rate) * self._path + moves * math.sqrt(rate * (2 - rate) * effective) * move
        lost = 0.0 if moves else self._one_rate * rate * (2 - rate)
        self._covariance = (
            (1 - self._one_rate - self._rank_rate + lost) * self._covariance
            + self._one_rate * np.outer(self._path, self._path)
            + self._rank_rate * (steps.T * self._weights) @ steps
        )
        self._step *= math.exp(min(1.0, self._step_rate / self._damping * (length / self._expected - 1)))
