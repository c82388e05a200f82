"""Weights of networks as named float32 arrays: safetensors files, checked before use."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import safetensors

from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray


@dataclass(frozen=True)
class Weights:
    """The parameters of a network.

    Attributes:
        tensors: Read-only float32 arrays, C order, by name; all values are finite.
        metadata: Texts by name, as the file states them.
    """

    tensors: dict[str, NDArray[np.float32]]
    metadata: dict[str, str]


def digest(tensors: Mapping[str, NDArray[np.float32]]) -> str:
    """SHA-256 (hexadecimal) of names, shapes and values; independent of their arrangement in the file."""
    found = hashlib.sha256()
    for name in sorted(tensors):
        values = np.ascontiguousarray(tensors[name], dtype="<f4")
        found.update(f"{name} {list(values.shape)}\n".encode())
        found.update(values.tobytes())
    return found.hexdigest()


def write_weights(path: Path, tensors: Mapping[str, NDArray[np.float32]], metadata: Mapping[str, str]) -> None:
    """Writes a safetensors file."""
    from safetensors.numpy import save_file  # noqa: PLC0415 - only writing needs it

    save_file(dict(tensors), path, metadata=dict(metadata))


def read_weights(path: Path) -> Weights:
    """The tensors of a safetensors file.

    Raises:
        InputError: The file is missing, truncated or not a safetensors file, a tensor is of another type, or a value is
            not finite. The message names the file.
    """
    if not path.is_file():
        raise InputError(f"weights {path}: no such file")
    try:
        with safetensors.safe_open(path, framework="np") as file:
            metadata = dict(file.metadata() or {})
            tensors = {name: np.array(file.get_tensor(name), order="C") for name in file.keys()}  # noqa: SIM118
    # Types that numpy does not have come as attribute errors.
    except (safetensors.SafetensorError, OSError, TypeError, ValueError, AttributeError, KeyError) as error:
        raise InputError(f"weights {path}: damaged or not a safetensors file ({error})") from error
    for name, values in tensors.items():
        if values.dtype != np.float32:
            raise InputError(f"weights {path}: tensor {name} has type {values.dtype}, float32 is expected")
        if not np.isfinite(values).all():
            raise InputError(f"weights {path}: tensor {name} has values that are not finite numbers")
        values.setflags(write=False)
    return Weights(tensors, metadata)
