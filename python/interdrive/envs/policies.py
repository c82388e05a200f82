"""Learned policies as files, for `--planner policy,file=FILE`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from interdrive.envs.actions import Actions, action_kind
from interdrive.errors import InputError
from interdrive.native_settings import Kinematic, ObservationSettings
from interdrive.planners.policy import FORMAT, layout_hash, policy_planner
from interdrive.storage.weights import write_weights

if TYPE_CHECKING:
    from numpy.typing import NDArray


def export_policy(
    path: str | Path,
    layers: Mapping[str, NDArray[np.float32]],
    *,
    actions: Actions | None = None,
    observation: ObservationSettings | None = None,
    activation: str = "tanh",
) -> None:
    """Writes a policy: hidden layers, then one for the action.

    Its clipped outputs are the action; for a grid of choices the largest one is chosen.

    Args:
        path: The file.
        layers: `hidden.0.weight` (outputs, inputs), `hidden.0.bias` (outputs,), ..., `action.weight`, `action.bias`.
        actions: What it was trained with; None: the defaults.
        observation: What it was trained with; None: the defaults.
        activation: "tanh" or "relu", after each hidden layer.

    Raises:
        InputError: The layers do not fit together, or to what is observed, or actions are not of the model.
    """
    kind = action_kind(actions or Kinematic())
    if not isinstance(kind.record, Kinematic):
        raise InputError("actions", "a policy used as a planner needs actions of the single-track model")
    observed = replace(observation or ObservationSettings(), form="flat")
    metadata = {
        "format": str(FORMAT),
        "kind": "layers",
        "activation": activation,
        "actions": json.dumps([kind.name, asdict(kind.record), list(kind.numbers)]),
        "observation": json.dumps(asdict(observed)),
        "layout": layout_hash(observed),
    }
    write_weights(Path(path), {name: np.ascontiguousarray(one, np.float32) for name, one in layers.items()}, metadata)
    policy_planner(str(path))
