"""Pairs of points that are near each other, found by cells."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from interdrive.array_types import Floats, Ints

#: Pairs that are looked at together.
_MOST_PAIRS = 100_000
#: From a cell to itself and those around it.
_AROUND = tuple((i, j) for i in (-1, 0, 1) for j in (-1, 0, 1))


class Nearby:
    """Points among which near ones are looked for."""

    def __init__(self, points: Floats, radius: float) -> None:
        """Sorts points by cells.

        Args:
            points: [m], shape (points, 2), finite.
            radius: How far near ones are at most [m].
        """
        self._radius = radius
        self._low = points.min(axis=0) if len(points) else np.zeros(2)
        keys = self._key(self._cells(points))
        self._order = np.argsort(keys, kind="stable")
        self._keys = keys[self._order]

    def pairs(self, points: Floats) -> Iterator[tuple[Ints, Ints]]:
        """Every point together with all those that may be near it.

        Yields:
            Positions in `points` and in the points of this object, of equal lengths. A pair comes once; it may be
            farther apart than the radius, less than three times. Positions in `points` ascend from one to the next.
        """
        if not len(points) or not len(self._order):
            return
        cells = self._cells(points)
        keys = np.column_stack([self._key(cells + np.array(move)) for move in _AROUND])
        first = np.searchsorted(self._keys, keys, "left")
        counts = np.searchsorted(self._keys, keys, "right") - first
        total = np.cumsum(counts.sum(axis=1))
        begin = 0
        while begin < len(points):
            done = total[begin - 1] if begin else 0
            end = max(begin + 1, int(np.searchsorted(total, done + _MOST_PAIRS, "right")))
            yield self._expanded(begin, first[begin:end].ravel(), counts[begin:end].ravel())
            begin = end

    def _expanded(self, begin: int, first: Ints, counts: Ints) -> tuple[Ints, Ints]:
        row = np.repeat(np.arange(len(counts)), counts)
        within = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
        return begin + row // len(_AROUND), self._order[first[row] + within]

    def _cells(self, points: Floats) -> Ints:
        found: Ints = np.floor((points - self._low) / self._radius).clip(-(2.0**30), 2.0**30).astype(np.int64)
        return found

    @staticmethod
    def _key(cells: Ints) -> Ints:
        found: Ints = cells[:, 0] * 2**32 + cells[:, 1]
        return found
