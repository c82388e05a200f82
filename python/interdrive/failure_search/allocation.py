"""Which agent, and which points, each run of a search takes: rounds that rest on whole rounds before them.

Failures sit in few pairs, and within a pair the criticality is flat over wide areas. So the first round visits all
pairs alike, and each later one splits its runs: some are drawn uniformly, which keeps an unbiased rate; some go to the
pairs that came nearest to a failure; the others are neighbours of the most critical points (levels).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias, get_args

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from typing import Any

    from interdrive.array_types import Floats

#: How the budget of a search is spent.
Method: TypeAlias = Literal["levels", "uniform"]
METHODS: tuple[str, ...] = get_args(Method)
#: Where the point of a run comes from.
SOURCES = ("uniform", "pairs", "levels")

#: Runs of a round, whose points are chosen before any of them is driven.
ROUND = 32
#: The first round visits every pair so often: enough for this many runs, but within these bounds.
_FIRST_RUNS, _SWEEPS = 64, (2, 8)
#: What five runs in a row are.
_TURNS = ("uniform", "levels", "pairs", "levels", "pairs")
#: With fewer pairs than this, a third of them is no choice.
_PAIRS_MIN = 6
#: The most critical share of all points, whose neighbours are driven; how far these are away, per coordinate.
_CRITICAL_SHARE, _STEP = 0.1, 0.15
#: Share of the coordinates of a neighbour that differ, and of those that choose among kinds.
_MOVED, _CHOSEN_ANEW = 0.5, 0.1
#: So many failures of one signature are kept; after so many its points are no longer what neighbours are taken of.
KEPT_MAX, _CLOSED_AFTER = 3, 10
#: Apart from the numbers of the runs, for the order of the pairs in the first round.
_ORDER = 2**32


@dataclass(frozen=True)
class Proposal:
    """What a run is to try.

    Attributes:
        index: Number of the run.
        source: One of `SOURCES`.
        pair: Place of the agent among the pairs.
        first: The point that is tried first; None: drawn.
        parent: Of which point neighbours are tried; None: points are drawn uniformly.
        choices: For each coordinate, whether it chooses among kinds.
    """

    index: int
    source: str
    pair: int
    first: tuple[float, ...] | None
    parent: tuple[float, ...] | None
    choices: tuple[bool, ...]

    def points(self, seed: int) -> Iterator[Floats]:
        """Points without end, of which the first one with a plausible world is driven."""
        random = np.random.default_rng([seed, self.index, 1])
        if self.first is not None:
            yield np.array(self.first)
        while True:
            if self.parent is None:
                yield random.random(len(self.choices))
            else:
                yield _neighbour(np.array(self.parent), np.array(self.choices), random)


@dataclass(frozen=True)
class Allocation:
    """The rule of a search; its choices depend on these values and on the rows of earlier rounds alone.

    Attributes:
        n_pairs: Number of pairs.
        choices: For each coordinate of a point, whether it chooses among kinds.
        seed: Of the search.
        method: How the budget is spent.
    """

    n_pairs: int
    choices: tuple[bool, ...]
    seed: int
    method: Method = "levels"

    @property
    def sweeps(self) -> int:
        """How often the first round visits every pair."""
        least, most = _SWEEPS
        return min(max(math.ceil(_FIRST_RUNS / self.n_pairs), least), most)

    def bounds(self, index: int) -> tuple[int, int]:
        """First run of the round that a run is in, and of the next round."""
        n_first = self.sweeps * self.n_pairs
        if index < n_first:
            return 0, n_first
        first = index - (index - n_first) % ROUND
        return first, first + ROUND

    def proposals(self, index: int, rows: Sequence[Mapping[str, Any]]) -> list[Proposal]:
        """What the runs from a number on try, up to the end of their round.

        Args:
            index: The first of them.
            rows: Of all earlier runs, in order: `pair`, `point`, `criticality` (None: nothing was driven) and
                `signature` of each.
        """
        first, end = self.bounds(index)
        if first == 0:
            return self._first_round()[index:]
        critical, near = self._known(rows[:first])
        return [self._later(number, first, critical, near) for number in range(index, end)]

    def _first_round(self) -> list[Proposal]:
        """Sweeps over all pairs, so that any number of runs is a fair sample; a Latin hypercube within each pair."""
        random = np.random.default_rng([self.seed, _ORDER])
        order = random.permutation(self.n_pairs).tolist()
        strata = [
            np.stack([random.permutation(self.sweeps) for _ in self.choices], axis=1) for _ in range(self.n_pairs)
        ]
        found = []
        for index in range(self.sweeps * self.n_pairs):
            sweep, place = divmod(index, self.n_pairs)
            pair = order[place]
            inside = np.random.default_rng([self.seed, index, 0]).random(len(self.choices))
            point = tuple(((strata[pair][sweep] + inside) / self.sweeps).tolist())
            found.append(Proposal(index, "uniform", pair, point, None, self.choices))
        return found

    def _known(self, rows: Sequence[Mapping[str, Any]]) -> tuple[list[Mapping[str, Any]], list[int]]:
        """The most critical runs before a round, and the pairs that came nearest to a failure; without closed ones."""
        failed: dict[str, int] = {}
        for row in rows:
            failed[row["signature"]] = failed.get(row["signature"], 0) + bool(row["signature"])
        open_rows = [row for row in rows if row["criticality"] is not None and failed[row["signature"]] < _CLOSED_AFTER]
        open_rows.sort(key=lambda row: (row["criticality"], row["index"]))
        least: dict[int, float] = {}
        for row in open_rows:
            least.setdefault(row["pair"], row["criticality"])
        near = sorted(least, key=lambda pair: (least[pair], pair))[: math.ceil(self.n_pairs / 3)]
        return open_rows[: math.ceil(_CRITICAL_SHARE * len(rows))], near

    def _later(self, index: int, first: int, critical: Sequence[Mapping[str, Any]], near: Sequence[int]) -> Proposal:
        random = np.random.default_rng([self.seed, index, 0])
        source = _TURNS[(index - first) % len(_TURNS)] if self.method == "levels" and critical else "uniform"
        if source == "pairs" and self.n_pairs < _PAIRS_MIN:
            source = "levels"
        if source == "levels":
            row = critical[int(random.integers(len(critical)))]
            return Proposal(index, source, row["pair"], None, tuple(row["point"]), self.choices)
        pair = near[int(random.integers(len(near)))] if source == "pairs" else int(random.integers(self.n_pairs))
        return Proposal(index, source, pair, None, None, self.choices)


def _neighbour(parent: Floats, is_choice: np.ndarray, random: np.random.Generator) -> Floats:
    """A point near another one, reflected at the bounds; coordinates that choose among kinds are drawn anew or kept."""
    n = len(parent)
    step = _STEP * random.standard_normal(n) * (random.random(n) < _MOVED)
    moved = np.abs(parent + step)
    near = np.clip(np.where(moved > 1.0, 2.0 - moved, moved), 0.0, 1.0)
    anew = np.where(random.random(n) < _CHOSEN_ANEW, random.random(n), parent)
    point: Floats = np.where(is_choice, anew, near)
    return point
