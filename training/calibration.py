"""Spreads that hold what they promise, fitted where the network has not been trained."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import torch

from training.evaluate import NOMINAL, Modes, levels, modes_of, share_inside
from training.tail import Tail, together, with_tail

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from torch import Tensor

    from training.dataset import Rows
    from training.network import Answer


@dataclass(frozen=True)
class Calibration:
    """Factors of the standard deviations, the divisor of the logits, and the wide mode.

    Attributes:
        s: Factors of those along the path, per knot.
        d: The same across the path.
        evenness_s: Logarithm of a further factor of those along the path, of a vehicle: a constant, and what is
            multiplied with each feature of how even its past was.
        evenness_d: The same across the path.
        temperature: Divisor of the logits.
        tail: The wide mode; None is none.
    """

    s: tuple[float, ...]
    d: tuple[float, ...]
    evenness_s: tuple[float, ...]
    evenness_d: tuple[float, ...]
    temperature: float
    tail: Tail | None = None


_LOG_TAU = math.log(2.0 * math.pi)
#: Which modes are merged into one spread depends a little on the factors: the tail is fitted again after them.
_ROUNDS = 2
#: Probabilities of the wide mode that are tried; with a fifth and more planners would have to keep clear of it.
_SHARES = (0.06, 0.08, 0.1, 0.12, 0.14, 0.16, 0.18)
#: Knots at which regions are compared with what they promise; every third row is looked at.
_LOOKED_AT = (1, 3, 5)
_EVERY = 3
#: Larger temperatures would improve the likelihood of a few rows with probability for paths that no vehicle takes.
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
    """The answer with factors applied; the temperature is for those that do not stand, shape (b,)."""
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


def with_fitted_tail(
    calibration: Calibration, answers: Sequence[Answer], rows: Sequence[Rows], modes_max: int
) -> Calibration:
    """The calibration with a tail, and with smaller factors of the spreads, which need not hold the tail any more.

    Args:
        calibration: Without a tail.
        answers: What networks say at places that they were not trained on.
        rows: What was asked and true there.
        modes_max: Modes that the predictor keeps.
    """
    for _ in range(_ROUNDS):
        without = replace(calibration, tail=None)
        said = [
            modes_of(
                calibrated(answer, without, torch.from_numpy(there["agent"]), torch.from_numpy(there["standing"])),
                there,
                modes_max,
            )
            for answer, there in zip(answers, rows, strict=True)
        ]
        narrower, tail = fitted_tail(said, rows)
        s, d = (tuple(round(narrower * value, 4) for value in values) for values in (calibration.s, calibration.d))
        calibration = replace(calibration, s=s, d=d, tail=tail)
    return calibration


def fitted_tail(said: Sequence[Modes], rows: Sequence[Rows]) -> tuple[float, Tail]:
    """A factor on the spreads of the modes, and the tail.

    For vehicles that drive, of several probabilities the one whose regions come nearest to what they promise; factors,
    and the probability for vehicles that stand, whose spread is fixed, are those under which the true positions at all
    knots are most likely.

    Args:
        said: What networks say at places that they were not trained on, without a wide mode.
        rows: What was true there.
    """
    drives, stands = (
        [_Part.of(modes, there["standing"] == standing, there) for modes, there in zip(said, rows, strict=True)]
        for standing in (False, True)
    )
    (_, share_of_stands, factor_of_stands) = _fit(stands, narrows=False)
    found = []
    for share in _SHARES:
        narrower, _, factor = _fit(drives, share=share)
        tail = Tail((share, share_of_stands), (factor, factor_of_stands))
        found.append((_broken_promises(said, rows, narrower, tail), narrower, tail))
    _, narrower, tail = min(found, key=lambda entry: entry[0])
    return narrower, tail


def _broken_promises(said: Sequence[Modes], rows: Sequence[Rows], narrower: float, tail: Tail) -> float:
    """Sum of what regions of highest density hold too much or too little, of vehicles that drive, at 1, 2 and 3 s."""
    inside = {knot: [] for knot in _LOOKED_AT}
    for modes, there in zip(said, rows, strict=True):
        drives = np.flatnonzero(~there["standing"])[::_EVERY]
        here = {name: there[name][drives] for name in ("velocity", "future", "standing")}
        assert modes.covariance is not None, "spreads are needed"
        narrow = Modes(modes.probability[drives], modes.xy[drives], modes.covariance[drives] * narrower**2)
        full = with_tail(narrow, here["standing"], tail)
        for knot, found in inside.items():
            found.append(levels(full, here, knot))
    pooled = [np.concatenate(found) for found in inside.values()]
    return sum(abs(share_inside(found, q) - q) for found in pooled for q in NOMINAL)


def _fit(parts: Sequence[_Part], share: float | None = None, *, narrows: bool = True) -> tuple[float, float, float]:
    """Factor on the spreads of the others, probability (if it is not given) and factor of the wide mode."""
    values = torch.tensor([0.0, math.log(3.0), math.log(0.1 / 0.9)], dtype=torch.float64, requires_grad=True)
    optimizer = torch.optim.LBFGS([values], lr=0.5, max_iter=60, line_search_fn="strong_wolfe")
    total = sum(int(part.known.sum()) for part in parts)

    def now() -> tuple[Tensor, Tensor, Tensor]:
        one = torch.ones((), dtype=torch.float64)
        chosen = torch.sigmoid(values[2]) if share is None else share * one
        return values[0].exp() if narrows else one, chosen, values[1].exp()

    def closure() -> Tensor:
        optimizer.zero_grad()
        loss = -torch.stack([part.likelihood(*now()) for part in parts]).sum() / total
        loss.backward()
        return loss

    optimizer.step(closure)
    narrower, found, factor = (round(float(value.detach()), 4) for value in now())
    if not (0.2 < narrower < 5.0 and 0.001 < found < 0.5 and 1.0 <= factor < 50.0):
        raise ValueError(f"the tail did not converge: {narrower}, {found}, {factor}")
    return narrower, found, factor


@dataclass(frozen=True)
class _Part:
    """Logarithms of probabilities (n, m), squared distances and determinants that do not depend on the tail."""

    log_p: Tensor
    covariance: Tensor
    together: Tensor
    spread: Tensor
    apart: Tensor
    known: Tensor

    @classmethod
    def of(cls, modes: Modes, mask: NDArray[np.bool_], rows: Rows) -> _Part:
        """Of chosen rows; `spread` is what the modes' own covariances contribute to the second moments."""
        assert modes.covariance is not None, "spreads are needed"
        here = Modes(modes.probability[mask], modes.xy[mask], modes.covariance[mask])
        truth = rows["future"][mask].astype(np.float64)
        known = np.isfinite(truth).all(axis=-1)
        spread = (here.probability[:, :, None, None, None] * modes.covariance[mask]).sum(axis=1)
        arrays = (
            np.log(np.maximum(here.probability, 1e-30)), modes.covariance[mask], together(here), spread,
            np.nan_to_num(truth)[:, None] - here.xy, known,
        )  # fmt: skip
        return cls(*(torch.from_numpy(np.ascontiguousarray(values)) for values in arrays))

    def likelihood(self, narrower: Tensor, share: Tensor, factor: Tensor) -> Tensor:
        """Sum of the logarithms of the densities at the true positions."""
        narrow = self.covariance * narrower**2
        wide = (self.together + (narrower**2 - 1.0) * self.spread) * factor**2
        covariance = torch.cat([narrow, wide[:, None]], dim=1)
        apart = torch.cat([self.apart, self.apart[:, :1]], dim=1)
        log_p = torch.cat([self.log_p + torch.log1p(-share), share.log().expand(len(self.log_p), 1)], dim=1)
        xx, xy, yy = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
        determinant = xx * yy - xy**2
        x, y = apart[..., 0], apart[..., 1]
        energy = (yy * x**2 - 2.0 * xy * x * y + xx * y**2) / determinant
        density = log_p[..., None] - 0.5 * (energy + determinant.log()) - _LOG_TAU
        return (torch.logsumexp(density, dim=1) * self.known).sum()
