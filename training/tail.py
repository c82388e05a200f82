"""The wide mode: errors have heavier tails than the modes of the network say, at unseen places above all.

With it every mixture is a contaminated normal distribution (Tukey, "A survey of sampling from contaminated
distributions", 1960): most of the probability in narrow modes, a little in one that is several times as wide.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from training.evaluate import Modes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Tail:
    """The wide modes of vehicles that drive and of those that stand.

    Attributes:
        probability: Of the wide mode; the others share the rest.
        factor: On the standard deviation of all the others together, around the most probable one.
    """

    probability: tuple[float, float]
    factor: tuple[float, float]


def with_tail(modes: Modes, standing: NDArray[np.bool_], tail: Tail) -> Modes:
    """The modes with the wide one behind them, as the core adds it.

    Args:
        modes: Most probable first.
        standing: Which vehicles stand, shape (n,).
        tail: Their wide modes.
    """
    share = np.asarray(tail.probability)[standing.astype(int)][:, None]
    factor = np.asarray(tail.factor)[standing.astype(int)][:, None, None, None, None]
    assert modes.covariance is not None, "spreads are needed"
    xy, covariance = modes.xy[:, :1], together(modes)[:, None] * factor**2
    return Modes(
        np.concatenate([modes.probability * (1.0 - share), share], axis=1),
        np.concatenate([modes.xy, xy], axis=1),
        np.concatenate([modes.covariance, covariance], axis=1),
    )


def together(modes: Modes) -> Floats:
    """Second moments of all modes around the most probable one, shape (n, knots, 2, 2)."""
    apart = modes.xy - modes.xy[:, :1]
    moments = modes.covariance + apart[..., :, None] * apart[..., None, :]
    return np.asarray((modes.probability[:, :, None, None, None] * moments).sum(axis=1))
