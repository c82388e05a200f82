"""Trained networks as files: calibration and evaluation can be made anew without training. Needs no torch."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from safetensors import safe_open
from safetensors.numpy import save_file

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    Tensors = Mapping[str, NDArray[np.float32]]


@dataclass(frozen=True)
class TrainedNetwork:
    """What is kept of a network.

    Attributes:
        tensors: Weights by the names that torch gives them.
        sizes: Widths of its layers, see `training.network.Sizes`.
        lines: What the training said, one entry per epoch.
    """

    tensors: Tensors
    sizes: Mapping[str, float]
    lines: list[dict[str, object]]


def save(path: Path, network: TrainedNetwork, made: Mapping[str, object]) -> None:
    """Writes a network.

    Args:
        path: Of the file.
        network: What is kept.
        made: With what it was trained.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".part")
    said = {"made": made, "sizes": network.sizes, "lines": network.lines}
    tensors = {name: np.ascontiguousarray(values) for name, values in network.tensors.items()}
    save_file(tensors, unfinished, {name: json.dumps(value) for name, value in said.items()})
    unfinished.rename(path)


def load(path: Path, made: Mapping[str, object]) -> TrainedNetwork:
    """The network of a file.

    Raises:
        ValueError: It was trained with something else than is stated.
    """
    with safe_open(path, framework="np") as file:
        said = {name: json.loads(text) for name, text in (file.metadata() or {}).items()}
        if said["made"] != json.loads(json.dumps(made)):
            raise ValueError(f"{path}: trained on other files or in another way; name another folder or delete it")
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - it is no dictionary
    return TrainedNetwork(tensors, said["sizes"], said["lines"])
