"""Which scenario comes next."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

if TYPE_CHECKING:
    from numpy.random import Generator


@runtime_checkable
class Sampler(Protocol):
    """Contract of an object that draws scenarios; worlds call its methods one after the other."""

    def begin(self, n: int) -> None:
        """Called once, with the number `n` of scenarios."""

    def draw(self, rng: Generator) -> int:
        """Position of the next scenario, from 0 to n - 1.

        Args:
            rng: Generator of the world; the only source of random numbers.
        """

    def ended(self, index: int, outcomes: Sequence[str], components: Sequence[Mapping[str, float]]) -> None:
        """Called when learners have ended in a step.

        Args:
            index: Position of their scenario.
            outcomes: One per learner.
            components: Parts of their rewards by name, one mapping per learner.
        """


class Uniform:
    """Every scenario is equally likely."""

    def begin(self, n: int) -> None:
        """Called once, with the number `n` of scenarios."""
        self._n = n

    def draw(self, rng: Generator) -> int:
        """Position of the next scenario, drawn with `rng`."""
        return int(rng.integers(self._n))

    def ended(self, index: int, outcomes: Sequence[str], components: Sequence[Mapping[str, float]]) -> None:
        """Ignores `index`, `outcomes` and `components`: all scenarios stay equally likely."""


class Hardest:
    """Half uniform, half by the share of learners that failed in the last 20 endings in a scenario.

    With it, a world of many is not equal to a single environment: what it draws depends on the others.
    """

    MEMORY = 20

    def begin(self, n: int) -> None:
        """Called once, with the number `n` of scenarios."""
        self._failures: list[deque[float]] = [deque([1.0], maxlen=self.MEMORY) for _ in range(n)]

    def draw(self, rng: Generator) -> int:
        """Position of the next scenario, drawn with `rng`."""
        n = len(self._failures)
        shares = np.array([sum(failures) / len(failures) for failures in self._failures])
        total = float(shares.sum())
        chance = np.full(n, 1.0 / n) if total == 0 else 0.5 / n + 0.5 * shares / total
        return int(min(np.searchsorted(np.cumsum(chance), rng.random() * chance.sum(), side="right"), n - 1))

    def ended(self, index: int, outcomes: Sequence[str], components: Sequence[Mapping[str, float]]) -> None:
        """Remembers the share of failures among `outcomes` in scenario `index`; `components` do not count."""
        if outcomes:
            self._failures[index].append(sum(one != "goal_reached" for one in outcomes) / len(outcomes))
