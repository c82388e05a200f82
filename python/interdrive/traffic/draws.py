"""Random numbers that depend on what they are for, never on what was drawn before."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive.array_types import Floats, Ints

    _Words = NDArray[np.uint64]

#: What a number is drawn for: the second word, after the kind of draw of the core (`v2x/draw.rs`).
HEADWAY, FORK, KIND, LENGTH, WIDTH, SPEED, GAP, PLANNER, PLACE, FILL_FORK = range(10)
#: The first word of what is drawn for traffic.
_TRAFFIC = 3
_FIRST, _SECOND, _THIRD = (np.uint64(n) for n in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB))


def _mixed(z: _Words) -> _Words:
    """One round of splitmix64, as in the core."""
    z = z + _FIRST
    z = (z ^ (z >> np.uint64(30))) * _SECOND
    z = (z ^ (z >> np.uint64(27))) * _THIRD
    mixed: _Words = z ^ (z >> np.uint64(31))
    return mixed


@lru_cache(maxsize=1024)
def _word(word: int) -> _Words:
    return _mixed(np.array([word], dtype=np.int64).view(np.uint64))


@lru_cache(maxsize=1024)
def _begin(seed: int, what: int, lane: int) -> _Words:
    found = _mixed(np.array([seed], dtype=np.uint64))
    for word in (_TRAFFIC, what, lane):
        found = _mixed(found ^ _word(word))
    return found


def uniform(seed: int, what: int, lane: int, number: Ints | int, *more: int) -> Floats:
    """Numbers in [0, 1) that are determined by the arguments alone.

    Args:
        seed: Of the run.
        what: `HEADWAY` or another one.
        lane: Id of a lanelet.
        number: Which vehicles of the lane, shape (n,), or one.
        more: Further words.
    """
    numbers = np.atleast_1d(np.asarray(number, dtype=np.int64)).view(np.uint64)
    with np.errstate(over="ignore"):
        found = _mixed(_begin(seed, what, lane) ^ _mixed(numbers))
        for word in more:
            found = _mixed(found ^ _word(word))
    shares: Floats = (found >> np.uint64(11)).astype(np.float64) * 2.0**-53
    return shares


def normal(seed: int, what: int, lane: int, number: Ints | int, *more: int) -> Floats:
    """Standard normal numbers, of two uniform ones each (Box and Muller), cut at two standard deviations."""
    radius = np.sqrt(-2.0 * np.log1p(-uniform(seed, what, lane, number, *more, 0)))
    found: Floats = radius * np.cos(2.0 * np.pi * uniform(seed, what, lane, number, *more, 1))
    return np.clip(found, -2.0, 2.0)
