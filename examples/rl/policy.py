"""A policy in numpy: two networks, their gradients, and what moves them."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive import envs

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.random import Generator
    from numpy.typing import NDArray

    Floats = NDArray[np.float32]

WIDTH, LOG_STD = 128, -1.6
#: Observations that hardly change are not blown up.
SPREAD_MIN = 0.05
#: Half of the logarithm of a circle: of the density of a normal distribution.
HALF_LOG_TAU = 0.9189385332046727


def orthogonal(rng: Generator, inputs: int, outputs: int, gain: float) -> Floats:
    """A matrix whose shorter sides are at right angles and `gain` long."""
    q, r = np.linalg.qr(rng.standard_normal((max(inputs, outputs), min(inputs, outputs))))
    q *= np.sign(np.diag(r))
    return (gain * (q if inputs >= outputs else q.T)).astype(np.float32)


@dataclass
class Pass:
    """What the layers said of some inputs: (inputs, 2 WIDTH) and twice (2, inputs, WIDTH); means and values."""

    x: Floats
    first: Floats
    second: Floats
    mean: Floats
    value: Floats


class Policy:
    """A mean action with a free spread, and a value, each from a network of its own with two hidden layers of tanh.

    The two first layers are one matrix. All parameters are parts of one vector, as are their gradients. Observations
    are divided by their spread, which is far below 1 for most of them: 80 m are 1 there, so what matters at a junction
    is a tenth.
    """

    def __init__(self, observations: int, actions: int, rng: Generator) -> None:
        """Last layers begin near zero, that of actions nearer."""
        n = observations
        self.shapes = {
            "first": (n, 2 * WIDTH),
            "first_bias": (2 * WIDTH,),
            "second": (2, WIDTH, WIDTH),
            "second_bias": (2, 1, WIDTH),
            "mean": (WIDTH, actions),
            "mean_bias": (actions,),
            "value": (WIDTH, 1),
            "value_bias": (1,),
            "log_std": (actions,),
        }
        self.parameters = np.zeros(sum(int(np.prod(shape)) for shape in self.shapes.values()), np.float32)
        own = self.parts(self.parameters)
        for network in range(2):
            own["first"][:, network * WIDTH : (network + 1) * WIDTH] = orthogonal(rng, n, WIDTH, 2**0.5)
            own["second"][network] = orthogonal(rng, WIDTH, WIDTH, 2**0.5)
        own["mean"][:] = orthogonal(rng, WIDTH, actions, 0.01)
        own["value"][:] = orthogonal(rng, WIDTH, 1, 1.0)
        own["log_std"][:] = LOG_STD
        self.center, self.spread, self.seen = np.zeros(n, np.float32), np.ones(n, np.float32), 0

    def parts(self, vector: Floats) -> dict[str, Floats]:
        """Its parts by name, as views."""
        found, at = {}, 0
        for name, shape in self.shapes.items():
            size = int(np.prod(shape))
            found[name] = vector[at : at + size].reshape(shape)
            at += size
        return found

    def copy(self) -> Policy:
        """One that stays as it is now."""
        return deepcopy(self)

    def inputs(self, observations: Floats) -> Floats:
        """What the networks are told of observations."""
        x = observations - self.center
        x *= 1.0 / np.maximum(self.spread, SPREAD_MIN)
        return x

    def forward(self, x: Floats) -> Pass:
        """Means and values."""
        own = self.parts(self.parameters)
        first = x @ own["first"]
        first += own["first_bias"]
        np.tanh(first, out=first)
        second = np.matmul(first.reshape(-1, 2, WIDTH).swapaxes(0, 1), own["second"])
        second += own["second_bias"]
        np.tanh(second, out=second)
        mean = second[0] @ own["mean"] + own["mean_bias"]
        return Pass(x, first, second, mean, second[1] @ own["value"][:, 0] + own["value_bias"])

    def backward(self, done: Pass, d_mean: Floats, d_value: Floats, gradient: Floats) -> None:
        """Writes the gradient, all but that of the spread, of a loss by its derivatives: (n, actions) and (n,)."""
        own, of = self.parts(self.parameters), self.parts(gradient)
        np.matmul(done.second[0].T, d_mean, out=of["mean"])
        np.matmul(done.second[1].T, d_value[:, None], out=of["value"])
        of["mean_bias"][:], of["value_bias"][:] = d_mean.sum(0), d_value.sum()
        d_second = np.empty_like(done.second)
        np.matmul(d_mean, own["mean"].T, out=d_second[0])
        np.multiply(d_value[:, None], own["value"][:, 0], out=d_second[1])
        d_second *= 1.0 - done.second**2
        first = done.first.reshape(-1, 2, WIDTH).swapaxes(0, 1)
        np.matmul(first.swapaxes(1, 2), d_second, out=of["second"])
        of["second_bias"][:] = d_second.sum(1, keepdims=True)
        d_first = np.empty_like(done.first)
        for network in range(2):
            columns = slice(network * WIDTH, (network + 1) * WIDTH)
            d_first[:, columns] = d_second[network] @ own["second"][network].T
        d_first *= 1.0 - done.first**2
        np.matmul(done.x.T, d_first, out=of["first"])
        of["first_bias"][:] = d_first.sum(0)

    def watched(self, x: Floats) -> tuple[int, Floats, Floats]:
        """Number, mean and spread of observations, from what `inputs` made of them."""
        n, scale, off = len(x), np.maximum(self.spread, SPREAD_MIN), x.mean(0)
        variance = np.einsum("ij,ij->j", x, x) / np.float32(n) - off**2
        return n, self.center + scale * off, scale * np.sqrt(np.maximum(variance, 0.0))

    def watch(self, n: int, center: Floats, spread: Floats) -> None:
        """Counts so many more observations into their mean and spread."""
        share = np.float32(n / (self.seen + n))
        off = center - self.center
        variance = (1 - share) * self.spread**2 + share * spread**2 + share * (1 - share) * off**2
        self.spread = np.sqrt(variance) if self.seen else spread
        self.center = self.center + share * off
        self.seen += n

    def log_probability(self, off: Floats) -> Floats:
        """Of actions so many spreads from the means."""
        log_std = self.parts(self.parameters)["log_std"]
        return (-0.5 * off**2 - log_std - np.float32(HALF_LOG_TAU)).sum(1)

    def export(self, path: Path) -> None:
        """A file for `--planner policy,file=FILE`, which needs neither the value nor what was watched."""
        own = self.parts(self.parameters)
        # The scale of observations becomes a part of the first layer.
        weight = own["first"][:, :WIDTH].T / np.maximum(self.spread, SPREAD_MIN)
        kept = {
            "hidden.0.weight": weight,
            "hidden.0.bias": own["first_bias"][:WIDTH] - weight @ self.center,
            "hidden.1.weight": own["second"][0].T,
            "hidden.1.bias": own["second_bias"][0, 0],
            "action.weight": own["mean"].T,
            "action.bias": own["mean_bias"],
        }
        envs.export_policy(path, {name: np.ascontiguousarray(part) for name, part in kept.items()})


class Adam:
    """Moves a vector against its gradient (Kingma and Ba, arXiv 1412.6980)."""

    def __init__(self, n: int) -> None:
        """Of so many numbers."""
        self.mean, self.square, self.steps = np.zeros(n, np.float32), np.zeros(n, np.float32), 0

    def move(self, vector: Floats, gradient: Floats, rate: float, norm_max: float) -> None:
        """One step; a longer gradient is shortened, in place."""
        gradient *= min(1.0, norm_max / (float(np.linalg.norm(gradient)) + 1e-6))
        self.steps += 1
        self.mean += 0.1 * (gradient - self.mean)
        self.square *= 0.999
        gradient *= gradient
        self.square += 0.001 * gradient
        deviation = np.sqrt(self.square)
        deviation *= 1.0 / (1.0 - 0.999**self.steps) ** 0.5
        deviation += 1e-5
        np.divide(self.mean, deviation, out=deviation)
        deviation *= rate / (1.0 - 0.9**self.steps)
        vector -= deviation
