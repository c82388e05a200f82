"""Trained networks as files: calibration and evaluation can be made anew without training."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import torch

from training.network import Network, Sizes

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    Lines = list[dict[str, object]]


def save(path: Path, network: Network, made: Mapping[str, object], lines: Lines) -> None:
    """Writes a network.

    Args:
        path: Of the file.
        network: What is kept.
        made: With what it was trained.
        lines: What the training said, one entry per epoch.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".part")
    kept = {"made": dict(made), "sizes": asdict(network.sizes), "state": network.state_dict(), "lines": lines}
    torch.save(kept, unfinished)
    unfinished.rename(path)


def load(path: Path, made: Mapping[str, object]) -> tuple[Network, Lines]:
    """The network of a file, and what its training said.

    Raises:
        ValueError: It was trained with something else than is stated.
    """
    kept = torch.load(path, weights_only=True)
    if kept["made"] != made:
        raise ValueError(f"{path}: trained on other files or in another way; name another folder or delete it")
    network = Network(Sizes(**kept["sizes"]))
    network.load_state_dict(kept["state"])
    network.eval()
    return network, kept["lines"]
