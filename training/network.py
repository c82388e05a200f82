"""The network and its answers in path coordinates, as torch computes them; the core computes the same in Rust."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch import nn

from interdrive import _core

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray
    from torch import Tensor

#: Seconds from now of the numbers that the network answers.
KNOTS = torch.tensor(_core.NEURAL["knots"], dtype=torch.float32)
N_KNOTS = len(KNOTS)
#: Ways to drive along each path.
N_MODES = 2
#: Smallest standard deviation at a knot before calibration [m].
SIGMA_FLOOR = 0.05
#: Bounds of the logarithm of the growth of a standard deviation with time [log m/s].
LOG_RATE = (-5.0, 2.0)
#: Changes of speed and rates of offset [m/s] that are smaller than this are none: exactly steady driving can be said.
DEAD_ZONE = (0.2, 0.05)
_PER_MODE = 1 + 4 * N_KNOTS


@dataclass(frozen=True)
class Sizes:
    """Widths of the hidden layers, and the share of encodings that are blanked in training."""

    agent: int = 64
    neighbour: int = 32
    path: int = 64
    head: int = 64
    dropout: float = 0.0


@dataclass(frozen=True)
class Answer:
    """Modes on every path; b rows, P paths, M modes.

    Attributes:
        log_probability: Shape (b, P, M); -inf where there is no path.
        s: Arc length from now at the knots [m], shape (b, P, M, knots).
        d: Offset from the path [m], the same shape.
        sigma_s: Standard deviation along the path [m], the same shape.
        sigma_d: Standard deviation across the path [m], the same shape.
    """

    log_probability: Tensor
    s: Tensor
    d: Tensor
    sigma_s: Tensor
    sigma_d: Tensor


class Network(nn.Module):
    """Vehicle, neighbours and paths are each encoded alone; paths see each other through a maximum."""

    def __init__(self, sizes: Sizes) -> None:
        super().__init__()
        n_agent, n_neighbour, n_path = (len(_core.NEURAL[name]) for name in ("agent", "neighbours", "paths"))
        known = n_path + sizes.agent + sizes.neighbour
        self.agent = nn.ModuleList([nn.Linear(n_agent, sizes.agent), nn.Linear(sizes.agent, sizes.agent)])
        self.neighbour = nn.ModuleList(
            [nn.Linear(n_neighbour, sizes.neighbour), nn.Linear(sizes.neighbour, sizes.neighbour)]
        )
        self.path = nn.ModuleList([nn.Linear(known, sizes.path), nn.Linear(sizes.path, sizes.path)])
        self.head = nn.ModuleList([nn.Linear(2 * sizes.path, sizes.head), nn.Linear(sizes.head, N_MODES * _PER_MODE)])
        self.sizes = sizes
        self.dropout = nn.Dropout(sizes.dropout)
        with torch.no_grad():
            # Starts near constant velocity with a spread of about 0.6 m/s along and 0.2 m/s across.
            last = self.head[1]
            last.weight.mul_(0.1)
            bias = torch.zeros(N_MODES, _PER_MODE)
            bias[:, 1:].view(N_MODES, N_KNOTS, 4)[..., 2:] = torch.tensor([-0.5, -1.6])
            bias[1, 1:].view(N_KNOTS, 4)[:, 0] = -0.5
            last.bias.copy_(bias.flatten())

    def forward(self, agent: Tensor, neighbours: Tensor, paths: Tensor, path_valid: Tensor) -> Tensor:
        """Raw numbers, shape (b, P, M * 25), 0 without path: per mode a logit and, per knot, r, e and two spreads."""
        h_a = self.dropout(_both(self.agent, agent))
        present = neighbours[..., -1:] > 0
        h_n = (_both(self.neighbour, neighbours) * present).amax(dim=1)
        # Only the paths that are there: about half of the slots are empty.
        row, slot = torch.nonzero(path_valid, as_tuple=True)
        z = _both(self.path, torch.cat([paths[row, slot], h_a[row], h_n[row]], dim=-1))
        z = self.dropout(z)
        per_row = z.new_zeros(*path_valid.shape, z.shape[-1]).index_put((row, slot), z)
        c = per_row.amax(dim=1)
        y = self.head[1](torch.relu(self.head[0](torch.cat([z, c[row]], dim=-1))))
        return y.new_zeros(*path_valid.shape, y.shape[-1]).index_put((row, slot), y)


def tensors_of(network: Network) -> dict[str, NDArray[np.float32]]:
    """Weights by name."""
    return {name: values.detach().numpy() for name, values in network.state_dict().items()}


def network_of(tensors: Mapping[str, NDArray[np.float32]], sizes: Mapping[str, float]) -> Network:
    """The network with these weights, ready to be asked."""
    network = Network(Sizes(**sizes))
    network.load_state_dict({name: torch.from_numpy(values.copy()) for name, values in tensors.items()})
    network.eval()
    return network


def _both(layers: nn.ModuleList, x: Tensor) -> Tensor:
    return torch.relu(layers[1](torch.relu(layers[0](x))))


def decode(raw: Tensor, rows: Mapping[str, Tensor]) -> Answer:
    """Modes from raw numbers.

    Args:
        raw: What the network says, shape (b, P, M * 25).
        rows: `path_valid` and `offset`, `slope`, `settling` of shape (b, P), `velocity` of shape (b,).
    """
    b, n_paths = raw.shape[:2]
    modes = raw.view(b, n_paths, N_MODES, _PER_MODE)
    logit, numbers = modes[..., 0], modes[..., 1:].view(b, n_paths, N_MODES, N_KNOTS, 4)
    logit = logit.masked_fill(~rows["path_valid"][..., None], -torch.inf)
    log_probability = torch.log_softmax(logit.flatten(1), dim=1).view_as(logit)
    speed = rows["velocity"][:, None, None, None]
    r, e = (nn.functional.softshrink(numbers[..., i], DEAD_ZONE[i]) for i in (0, 1))
    s = torch.cummax((speed * KNOTS + KNOTS * r).clamp(min=0.0), dim=-1).values
    length = rows["settling"].nan_to_num(1.0)[:, :, None, None]
    u = (s / length).clamp(0.0, 1.0)
    offset, slope = (rows[name].nan_to_num(0.0)[:, :, None, None] for name in ("offset", "slope"))
    rest = (1 - u) ** 2
    d = (1 + 2 * u) * rest * offset + length * u * rest * slope + KNOTS * e
    low, high = LOG_RATE
    sigma = SIGMA_FLOOR + KNOTS[:, None] * numbers[..., 2:].clamp(low, high).exp()
    return Answer(log_probability, s, d, sigma[..., 0], sigma[..., 1])
