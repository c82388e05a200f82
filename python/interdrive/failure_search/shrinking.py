"""The smallest disturbance under which a run still fails in the same way."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from interdrive.array_types import Floats

#: Steps of the bisection of a coordinate.
_STEPS = 8


def shrunk(
    point: Floats, neutral: Floats, still_fails: Callable[[Floats], bool], choices: Sequence[bool] = ()
) -> Floats:
    """Moves coordinates back towards the undisturbed point, one by one.

    Args:
        point: It fails.
        neutral: The undisturbed point.
        still_fails: Whether another point fails in the same way.
        choices: For each coordinate, whether it chooses among kinds, so that there is nothing between two values; none
            does if it is empty.

    Returns:
        A point that fails; each of its coordinates is undisturbed, or found by bisection between what fails and what
        does not.
    """
    best = point.copy()
    for column in np.flatnonzero(best != neutral).tolist():
        tried = best.copy()
        tried[column] = neutral[column]
        if still_fails(tried):
            best = tried
            continue
        if len(choices) and choices[column]:
            continue
        safe = neutral[column]
        for _ in range(_STEPS):
            tried = best.copy()
            tried[column] = 0.5 * (safe + best[column])
            if still_fails(tried):
                best = tried
            else:
                safe = tried[column]
    return best
