"""Training of one network."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from training.augment import Augmentation, augmented
from training.loss import Weights, loss
from training.network import Network, Sizes, decode

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from training.dataset import Rows
    from training.network import Answer
    from training.split import Place

#: What the network reads and what it is compared with.
FIELDS = ("agent", "neighbours", "paths", "path_valid", "velocity", "offset", "slope", "settling", "target")


@dataclass(frozen=True)
class Course:
    """How a network is trained.

    Attributes:
        epochs: Number of passes.
        rows: Rows drawn per pass.
        batch: Rows per step.
        rate: Largest step size of Adam.
        decay: Decay of the weights (AdamW).
        averaging: The result is an exponential mean of the weights over the steps, which forget with this factor.
        seed: Of everything that is drawn.
        sizes: Of the network.
        weights: Of the parts of the loss.
        augmentation: Variation of the rows.
    """

    epochs: int = 20
    rows: int = 40_000
    batch: int = 256
    rate: float = 2e-3
    decay: float = 0.05
    averaging: float = 0.998
    seed: int = 1
    sizes: Sizes = field(default_factory=Sizes)
    weights: Weights = field(default_factory=Weights)
    augmentation: Augmentation = field(default_factory=Augmentation)


def shares(rows: Rows, places: tuple[Place, ...]) -> NDArray[np.float64]:
    """How often each row is drawn.

    Places count with the square root of their rows, kinds of traffic are balanced, standing vehicles count less.

    Returns:
        Probabilities, shape (rows,).
    """
    traffic = {place.name: place.traffic for place in places}
    of_traffic = {"recorded": 0.36, "simulated": 0.38, "invented": 0.03, "steady": 0.09, "driven": 0.14}
    share = np.where(rows["standing"], 0.2, 1.0)
    kind = np.where(rows["made"] == "", [traffic[name] for name in rows["place"]], rows["made"])
    mass = dict.fromkeys(of_traffic, 0.0)
    for name in sorted(set(rows["place"])):
        for of_kind in of_traffic:
            here = (rows["place"] == name) & (kind == of_kind)
            if here.any():
                total = float(share[here].sum())
                share[here] /= math.sqrt(total)
                mass[of_kind] += math.sqrt(total)
    for of_kind, wanted in of_traffic.items():
        if mass[of_kind] > 0:
            share[kind == of_kind] *= wanted / mass[of_kind]
    return np.asarray(share / share.sum())


def tensors(rows: Rows) -> dict[str, torch.Tensor]:
    """What training needs, as tensors."""
    return {name: torch.from_numpy(np.ascontiguousarray(rows[name])) for name in FIELDS}


def answer_to(network: Network, rows: Rows) -> Answer:
    """What a network says to rows."""
    network.eval()
    with torch.no_grad():
        data = tensors(rows)
        inputs = [data[name] for name in ("agent", "neighbours", "paths", "path_valid")]
        raw = torch.cat([network(*part) for part in zip(*(x.split(4096) for x in inputs), strict=True)])
        return decode(raw, data)


def fit(
    rows: Rows, places: tuple[Place, ...], course: Course, after_epoch: Callable[[int, float, Network], None]
) -> Network:
    """A network trained on rows.

    Args:
        rows: Of `training.dataset.gather`.
        places: For the shares of kinds of traffic.
        course: How.
        after_epoch: Called with the number of the epoch (from 1), its mean loss and the network.
    """
    generator = torch.Generator().manual_seed(course.seed)
    torch.manual_seed(course.seed)
    network = Network(course.sizes)
    data = tensors(rows)
    simulated = [place.name for place in places if place.traffic == "simulated"]
    data["steady"] = torch.from_numpy(rows["made"] == "steady")
    data["simulated"] = torch.from_numpy(np.isin(rows["place"], simulated) & (rows["made"] == ""))
    share = torch.from_numpy(shares(rows, places))
    mean = AveragedModel(network, multi_avg_fn=get_ema_multi_avg_fn(course.averaging))
    optimizer = torch.optim.AdamW(network.parameters(), lr=course.rate, weight_decay=course.decay)
    steps = course.rows // course.batch
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, course.rate, total_steps=steps * course.epochs, pct_start=0.1, final_div_factor=100.0
    )
    for epoch in range(1, course.epochs + 1):
        drawn = torch.multinomial(share, steps * course.batch, replacement=True, generator=generator)
        total = 0.0
        network.train()
        for chosen in drawn.view(steps, course.batch):
            batch = {name: values[chosen] for name, values in data.items()}
            batch = augmented(batch, course.augmentation, generator)
            raw = network(batch["agent"], batch["neighbours"], batch["paths"], batch["path_valid"])
            value = loss(decode(raw, batch), batch["target"], course.weights).mean()
            optimizer.zero_grad(set_to_none=True)
            value.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), 2.0)
            optimizer.step()
            schedule.step()
            mean.update_parameters(network)
            total += value.item()
        after_epoch(epoch, total / steps, mean.module)
    mean.module.eval()
    return mean.module
