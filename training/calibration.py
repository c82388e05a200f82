"""Spreads that hold what they promise, fitted where the network has not been trained."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import torch

if TYPE_CHECKING:
    from collections.abc import Sequence

    from torch import Tensor

    from training.network import Answer


@dataclass(frozen=True)
class Calibration:
    """Factors of the standard deviations, and the divisor of the logits.

    Attributes:
        s: Factors of those along the path, per knot.
        d: The same across the path.
        evenness_s: Logarithm of a further factor of those along the path, of a vehicle: a constant, and what is
            multiplied with each feature of how even its past was.
        evenness_d: The same across the path.
        temperature: Divisor of the logits.
    """

    s: tuple[float, ...]
    d: tuple[float, ...]
    evenness_s: tuple[float, ...]
    evenness_d: tuple[float, ...]
    temperature: float


#: Larger temperatures would buy likelihood of a few rows with probability for ways that nobody takes.
_TEMPERATURE_MAX = 1.5


#: Features of how even the past was, the last ones of a vehicle.
N_EVENNESS = 8
#: Bound of the logarithm of the factor of a vehicle.
_LOG_SPREAD = 1.5
#: Those of `fitted` are kept small.
_PENALTY = 0.01


def _of_vehicle(agent: Tensor, weights: Tensor) -> Tensor:
    """Factor of each vehicle, shape (b,)."""
    return (weights[0] + agent[:, -N_EVENNESS:] @ weights[1:]).clamp(-_LOG_SPREAD, _LOG_SPREAD).exp()


def calibrated(answer: Answer, calibration: Calibration, agent: Tensor, standing: Tensor) -> Answer:
    """The answer with factors applied; the temperature is for those who do not stand, shape (b,)."""
    temperature = torch.where(standing, 1.0, calibration.temperature)[:, None, None]
    tempered = torch.log_softmax((answer.log_probability / temperature).flatten(1), dim=1)
    of_s, of_d = (
        _of_vehicle(agent, torch.tensor(weights)) for weights in (calibration.evenness_s, calibration.evenness_d)
    )
    return replace(
        answer,
        log_probability=tempered.view_as(answer.log_probability),
        sigma_s=answer.sigma_s * torch.tensor(calibration.s) * of_s[:, None, None, None],
        sigma_d=answer.sigma_d * torch.tensor(calibration.d) * of_d[:, None, None, None],
    )


def _likelihood(answer: Answer, agent: Tensor, target: Tensor, share: Tensor, factors: Tensor) -> Tensor:
    """Mean logarithm of the density at the knots.

    The factors are logarithms of those of s, of d and of the temperature, then the parts of the features of vehicles
    along and across.
    """
    n = target.shape[2]
    s, d, log_temperature = (
        factors[:n].exp(),
        factors[n : 2 * n].exp(),
        factors[2 * n].clamp(max=math.log(_TEMPERATURE_MAX)),
    )
    logits = answer.log_probability.clamp(min=-1e3)  # the derivative of an infinite one is nan
    log_p = torch.log_softmax((logits / log_temperature.exp()).flatten(1), dim=1)
    on_path = torch.isfinite(target).all(dim=-1)
    true = target.nan_to_num(0.0)
    of_s, of_d = (_of_vehicle(agent, weights) for weights in _with_constant(factors[2 * n + 1 :]))
    sigma_s = answer.sigma_s * s * of_s[:, None, None, None]
    sigma_d = answer.sigma_d * d * of_d[:, None, None, None]
    x = (true[:, :, None, :, 0] - answer.s) / sigma_s
    y = (true[:, :, None, :, 1] - answer.d) / sigma_d
    density = -0.5 * (x**2 + y**2) - torch.log(sigma_s) - torch.log(sigma_d)
    density = torch.where(on_path[:, :, None], density, torch.full_like(density, -200.0))
    knot = torch.logsumexp(log_p.view_as(answer.log_probability)[..., None] + density, dim=(1, 2)).clamp(min=-12.0)
    known = on_path.any(dim=1)
    return (share[:, None] * knot * known).sum() / (share[:, None] * known).sum()


def _with_constant(parts: Tensor) -> Tensor:
    """Two rows, along and across; the constant is in the factors per knot."""
    return torch.cat([parts.new_zeros(2, 1), parts.view(2, -1)], dim=1)


def fitted(
    answers: Sequence[Answer], agents: Sequence[Tensor], targets: Sequence[Tensor], shares: Sequence[Tensor]
) -> Calibration:
    """The factors under which the true positions are most likely.

    A temperature is fitted with them, so that spreads do not stand in for wrong probabilities, and left out of the
    result: planners keep clear of improbable modes, and made more probable these keep agents from their goals.

    Args:
        answers: What networks say at places that they were not trained on.
        agents: Features of the vehicles there.
        targets: True (s, d) there, shape (rows, P, knots, 2) each.
        shares: Weight of every row; 0 for those that stand, whose spread is fixed.
    """
    n = targets[0].shape[2]
    factors = torch.zeros(2 * n + 1 + 2 * N_EVENNESS, requires_grad=True)
    optimizer = torch.optim.LBFGS([factors], lr=0.5, max_iter=40, line_search_fn="strong_wolfe")

    def closure() -> Tensor:
        optimizer.zero_grad()
        parts = zip(answers, agents, targets, shares, strict=True)
        value = -torch.stack([_likelihood(a, f, t, w, factors) * w.sum() for a, f, t, w in parts]).sum()
        value = value + _PENALTY * (factors[2 * n + 1 :] ** 2).sum()
        value.backward()
        return value

    optimizer.step(closure)
    found = [round(value, 4) for value in factors.detach()[: 2 * n + 1].exp().tolist()]
    if not all(0.2 < value < 5.0 for value in found):
        raise ValueError(f"the calibration did not converge: {found}")
    evenness = [
        tuple(round(value, 4) for value in row) for row in _with_constant(factors.detach()[2 * n + 1 :]).tolist()
    ]
    return Calibration(tuple(found[:n]), tuple(found[n : 2 * n]), evenness[0], evenness[1], 1.0)
