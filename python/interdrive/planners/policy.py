"""Policies from files: safetensors with the weights of a network, and what it observes and does as metadata."""

from __future__ import annotations

import hashlib
import json
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interdrive import _core
from interdrive.errors import InputError
from interdrive.native_settings import Kinematic, ObservationSettings

if TYPE_CHECKING:
    from interdrive.storage.weights import Weights

#: Version of the file; raised when it changes.
FORMAT = 1


def layout_hash(observation: ObservationSettings) -> str:
    """SHA-256 of the layout of an observation: a policy observes what it was trained on, or is refused."""
    return hashlib.sha256(json.dumps(_core.observation_layout(observation)).encode()).hexdigest()


def policy_planner(file: str) -> _core.Planner:
    """The planner with the policy of a file.

    Raises:
        InputError: The file is missing or damaged, or was made for something else; the message names it.
    """
    if not file:
        raise InputError("file", "must be given: policy,file=FILE")
    path = Path(file).expanduser().resolve()
    try:
        status = path.stat()
    except OSError as error:
        raise InputError(f"{file}: no such file") from error
    return _planner(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=8)
def _planner(path: Path, _changed: int, _size: int) -> _core.Planner:
    from interdrive.storage.weights import read_weights  # noqa: PLC0415 - loaded for networks only

    found = read_weights(path)
    told = found.metadata
    if told.get("format") != str(FORMAT):
        raise InputError(f"{path}: format {told.get('format', 'unknown')}, this version reads {FORMAT}")
    try:
        observation = ObservationSettings(**json.loads(told["observation"]))
        name, record, numbers = json.loads(told["actions"])
        actions = (str(name), Kinematic(**record), tuple(int(number) for number in numbers))
        activation = told["activation"]
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: its metadata cannot be read ({error})") from error
    if told.get("layout") != layout_hash(observation):
        raise InputError(f"{path}: it observes something else than this version; train it again")
    try:
        return _core.Planner.policy(_layers(found), activation, actions, observation)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _layers(found: Weights) -> list[tuple[str, Any, Any]]:
    n = sum(name.startswith("hidden.") and name.endswith(".weight") for name in found.tensors)
    names = [*(f"hidden.{i}" for i in range(n)), "action"]
    layers = []
    for name in names:
        weight, bias = (found.tensors.get(f"{name}.{part}") for part in ("weight", "bias"))
        if weight is None or bias is None or weight.ndim != 2 or bias.ndim != 1:
            raise InputError(f"{name}.weight and {name}.bias must be a matrix and a vector")
        layers.append((f"{name}.weight", weight, bias))
    return layers
