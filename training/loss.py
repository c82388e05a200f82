"""What the network is trained for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch

from training.network import KNOTS

if TYPE_CHECKING:
    from torch import Tensor

    from training.network import Answer

_LOG_TAU = 1.8378770664093453
#: A mode worse than this [nats per knot] is as bad as any other: no single row rules a step.
_WORST = 40.0


@dataclass(frozen=True)
class Weights:
    """Parts of the loss.

    Attributes:
        whole: Likelihood of the whole trajectory under the mixture of trajectories.
        each: Likelihood of every knot under the mixture at that knot, which is what regions are made of.
        nearest: Distance of the mode that is nearest at the last known knot.
        expected: Distance of the modes, weighted with their probabilities.
    """

    whole: float = 0.5
    each: float = 1.0
    nearest: float = 0.05
    expected: float = 1.0


def loss(answer: Answer, target: Tensor, weights: Weights) -> Tensor:
    """Loss per row, shape (b,).

    Args:
        answer: Modes; b rows, P paths, M modes.
        target: True (s, d) on every path, shape (b, P, knots, 2); nan where unknown or not on the path.
        weights: Parts of the loss.
    """
    on_path = torch.isfinite(target).all(dim=-1)
    known = on_path.any(dim=1)
    n_known = known.sum(dim=1).clamp(min=1)
    true = target.nan_to_num(0.0)
    ds, dd = true[:, :, None, :, 0] - answer.s, true[:, :, None, :, 1] - answer.d
    energy = 0.5 * ((ds / answer.sigma_s) ** 2 + (dd / answer.sigma_d) ** 2)
    density = -energy - torch.log(answer.sigma_s) - torch.log(answer.sigma_d) - _LOG_TAU
    density = _soft_floor(density, -_WORST)
    density = torch.where(on_path[:, :, None], density, torch.full_like(density, -_WORST - 10.0))
    mask = known[:, None, None]
    whole = torch.logsumexp((answer.log_probability + (density * mask).sum(dim=-1)).flatten(1), dim=1) / n_known
    knot = torch.logsumexp((answer.log_probability[..., None] + density).flatten(1, 2), dim=1)
    each = (knot * known).sum(dim=1) / n_known
    distance = torch.sqrt(ds**2 + dd**2 + 0.01)
    distance = torch.where(on_path[:, :, None], distance, torch.full_like(distance, 20.0)) * mask
    # The end counts as much as the way there.
    late = KNOTS / KNOTS.mean() * mask
    mean_distance = (distance * late).sum(dim=-1) / late.sum(dim=-1).clamp(min=1e-6)
    expected = (answer.log_probability.exp() * mean_distance).sum(dim=(1, 2))
    none = torch.isneginf(answer.log_probability)
    nearest = mean_distance.masked_fill(none, torch.inf).flatten(1).amin(dim=1)
    return -weights.whole * whole - weights.each * each + weights.nearest * nearest + weights.expected * expected


def _soft_floor(x: Tensor, floor: float) -> Tensor:
    """The same above half the floor, below it approaching the floor; smooth."""
    half = floor / 2
    return torch.where(x > half, x, half + half * (1 - torch.exp((x.clamp(max=half) - half) / abs(half))))
