"""The network of the predictor `neural` from its file of weights."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from interdrive import _core
from interdrive.errors import InputError
from interdrive.storage.names import path_of

#: The shipped weights.
SHIPPED = Path(__file__).with_name("neural.safetensors")


def network(weights: str = "") -> _core.NeuralNetwork:
    """The network with the weights of a file.

    Args:
        weights: A safetensors file as written by `training/`; "" for the shipped weights.

    Raises:
        InputError: The file is missing or damaged, was made for other features than those of this version of
            interdrive, or has a tensor that does not fit. The message names the file.
    """
    try:
        path = path_of(weights).resolve() if weights else SHIPPED
        status = path.stat()
    except (OSError, ValueError, RuntimeError) as error:  # no such user, circular links
        raise InputError(f"weights {weights or SHIPPED}: no such file") from error
    return _network(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=4)
def _network(path: Path, _changed: int, _size: int) -> _core.NeuralNetwork:
    from interdrive.storage.weights import digest, read_weights  # noqa: PLC0415 - loaded for networks only

    found = read_weights(path)
    version, known = found.metadata.get("feature_version", "none"), str(_core.NEURAL["version"])
    if version != known:
        raise InputError(
            f"weights {path}: made for features of version {version}, this interdrive computes version {known}; "
            "use weights trained with it"
        )
    stated = found.metadata.get("sha256")
    if stated is not None and digest(found.tensors) != stated:
        raise InputError(f"weights {path}: the values differ from the trained ones (SHA-256); download the file again")
    try:
        return _core.NeuralNetwork(found.tensors)
    except InputError as error:
        raise InputError(f"weights {path}: {error}") from error
