"""Weights of networks as named float32 arrays: safetensors files, checked before use."""

from __future__ import annotations

import hashlib
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import safetensors
import safetensors.numpy

from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

#: Environment variable that names the folder for downloads of interdrive.
CACHE_VARIABLE = "INTERDRIVE_CACHE"


@dataclass(frozen=True)
class Weights:
    """The parameters of a network.

    Attributes:
        tensors: Read-only float32 arrays, C order, by name; all values are finite.
        metadata: Texts by name, as the file states them.
    """

    tensors: dict[str, NDArray[np.float32]]
    metadata: dict[str, str]


def cache_folder() -> Path:
    """The user's folder for downloads of interdrive; it need not exist.

    `INTERDRIVE_CACHE` if set, else `interdrive` in `XDG_CACHE_HOME`, else `~/.cache/interdrive`.
    """
    chosen = os.environ.get(CACHE_VARIABLE)
    if chosen:
        return Path(chosen).expanduser()
    # The XDG specification says that relative paths are ignored.
    desktop = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser()
    return (desktop if desktop.is_absolute() else Path("~/.cache").expanduser()) / "interdrive"


def digest(tensors: Mapping[str, NDArray[np.float32]]) -> str:
    """SHA-256 (hexadecimal) of names, shapes and values; independent of their arrangement in the file."""
    found = hashlib.sha256()
    for name in sorted(tensors):
        values = np.ascontiguousarray(tensors[name], dtype="<f4")
        found.update(f"{name} {list(values.shape)}\n".encode())
        found.update(values.tobytes())
    return found.hexdigest()


def read_weights(path: Path, shapes: Mapping[str, tuple[int, ...]] | None = None, sha256: str | None = None) -> Weights:
    """The tensors of a safetensors file.

    Args:
        path: The file.
        shapes: The expected tensors with their shapes, no more and no less; None: any.
        sha256: Expected `digest`; None: not compared.

    Raises:
        InputError: The file is missing, truncated or not a safetensors file, a tensor is missing, unknown or of another
            shape or type, a value is not finite, or the digest differs. The message names the file.
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
    if shapes is not None:
        _check_names(path, tensors, shapes)
    for name, values in tensors.items():
        _check(path, name, values, None if shapes is None else shapes[name])
        values.setflags(write=False)
    if sha256 is not None and digest(tensors) != sha256:
        raise InputError(f"weights {path}: the values are not those expected (SHA-256 {digest(tensors)})")
    return Weights(tensors, metadata)


def write_weights(path: Path, tensors: Mapping[str, NDArray[np.float32]], metadata: Mapping[str, str]) -> None:
    """Writes a safetensors file, under a temporary name first, so that it is never incomplete.

    Raises:
        InputError: The file or its folder cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        os.close(handle)
        unfinished = Path(name)
        try:
            arrays = {key: np.ascontiguousarray(values, dtype=np.float32) for key, values in tensors.items()}
            unfinished.write_bytes(safetensors.numpy.save(arrays, dict(metadata)))
            unfinished.chmod(0o644)
            unfinished.replace(path)
        finally:
            unfinished.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"weights {path}: cannot be written ({error.strerror or error})") from error


def _check_names(path: Path, tensors: Mapping[str, object], shapes: Mapping[str, object]) -> None:
    for name in shapes:
        if name not in tensors:
            raise InputError(f"weights {path}: tensor {name} is missing")
    for name in tensors:
        if name not in shapes:
            raise InputError(f"weights {path}: unknown tensor {name}")


def _check(path: Path, name: str, values: NDArray[np.float32], shape: tuple[int, ...] | None) -> None:
    if values.dtype != np.float32:
        raise InputError(f"weights {path}: tensor {name} has type {values.dtype}, float32 is expected")
    if shape is not None and values.shape != tuple(shape):
        raise InputError(f"weights {path}: tensor {name} has shape {values.shape}, {tuple(shape)} is expected")
    if not np.isfinite(values).all():
        raise InputError(f"weights {path}: tensor {name} has values that are not finite numbers")
