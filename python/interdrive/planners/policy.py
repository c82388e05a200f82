"""Policies from files: safetensors with the weights of a network, and what it observes and does as metadata."""

from __future__ import annotations

import hashlib
import json
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from interdrive import _core
from interdrive.errors import InputError
from interdrive.native_settings import Kinematic, ObservationSettings
from interdrive.storage.names import path_of
from interdrive.storage.reading import parsed_json

if TYPE_CHECKING:
    from interdrive.storage.weights import Weights

T = TypeVar("T", ObservationSettings, Kinematic)

#: Largest number of choices of an action in a file.
_CHOICES_MAX = 10_000

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
    path = path_of(file).resolve()
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
        observation = _record(ObservationSettings, _told(told, "observation"), "observation")
        name, record, numbers = _actions(_told(told, "actions"))
        actions = (name, _record(Kinematic, record, "actions"), numbers)
        _check_layout(told, observation)
        return _core.Planner.policy(_layers(found), told.get("activation", "none"), actions, observation)
    except InputError as error:
        raise error.within(str(path)) from None


def _check_layout(metadata: dict[str, str], observation: ObservationSettings) -> None:
    if metadata.get("layout") != layout_hash(observation):
        raise InputError("its observation differs from that of this version; train it again")


def _told(metadata: dict[str, str], name: str) -> Any:  # noqa: ANN401 - any JSON value
    """One entry of the metadata, which is JSON in a text."""
    if name not in metadata:
        raise InputError(f"metadata {name}", "is missing")
    try:
        return parsed_json(metadata[name])
    except ValueError as error:
        raise InputError(f"metadata {name}", f"cannot be read as JSON: {error}") from None


def _actions(told: Any) -> tuple[str, Any, tuple[int, ...]]:  # noqa: ANN401 - any JSON value
    """Name of the actions, their record, and numbers of choices."""
    if not isinstance(told, list) or len(told) != 3 or not isinstance(told[0], str) or not isinstance(told[2], list):
        raise InputError("metadata actions", "expected a name, a table and a list of numbers")
    for number in told[2]:
        if type(number) is not int or not 0 <= number <= _CHOICES_MAX:
            raise InputError("metadata actions", f"expected numbers from 0 to {_CHOICES_MAX}, not {number}")
    return told[0], told[1], tuple(told[2])


def _record(kind: type[T], told: Any, name: str) -> T:  # noqa: ANN401 - any JSON value
    """A record of settings from a table of its fields."""
    if not isinstance(told, dict):
        raise InputError(f"metadata {name}", "expected a table of settings")
    unknown = [field for field in told if field not in kind.__annotations__]
    if unknown:
        raise InputError(f"metadata {name}", f"this version has no setting {unknown[0]}")
    try:
        return kind(**told)
    except InputError as error:
        raise error.within(f"metadata {name}") from None


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
