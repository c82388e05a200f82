"""Weights as a safetensors file, and a fixture that pins what the network says."""

from __future__ import annotations

import hashlib
import json
import struct
from dataclasses import astuple
from typing import TYPE_CHECKING

import numpy as np
import torch

from interdrive import _core
from interdrive.storage.weights import digest
from training.evaluate import MERGING
from training.network import DEAD_ZONE, tensors_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from training.calibration import Calibration
    from training.dataset import Rows
    from training.network import Network

#: Rows of the fixture.
FIXTURE_ROWS = 12


def digest_of(files: Sequence[Path]) -> str:
    """One SHA-256 for a list of files: over their names and the SHA-256 of their contents."""
    total = hashlib.sha256()
    for path in files:
        total.update(f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return total.hexdigest()


def write_safetensors(path: Path, tensors: Mapping[str, NDArray[np.float32]], metadata: Mapping[str, str]) -> None:
    """Writes float32 tensors in the safetensors format (header of JSON, then the numbers, little-endian)."""
    header: dict[str, object] = {"__metadata__": dict(sorted(metadata.items()))}
    blocks, at = [], 0
    for name in sorted(tensors):
        block = np.ascontiguousarray(tensors[name], "<f4").tobytes()
        header[name] = {"dtype": "F32", "shape": list(tensors[name].shape), "data_offsets": [at, at + len(block)]}
        blocks.append(block)
        at += len(block)
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    unfinished = path.with_suffix(".part")
    unfinished.write_bytes(struct.pack("<Q", len(text)) + text + b"".join(blocks))
    unfinished.rename(path)


def write_weights(path: Path, network: Network, calibration: Calibration, metadata: Mapping[str, str]) -> None:
    """The file that the predictor reads."""
    tensors = tensors_of(network)
    tensors |= {
        "calibration.s": np.asarray(calibration.s, np.float32),
        "calibration.d": np.asarray(calibration.d, np.float32),
        "calibration.evenness_s": np.asarray(calibration.evenness_s, np.float32),
        "calibration.evenness_d": np.asarray(calibration.evenness_d, np.float32),
        "calibration.temperature": np.asarray([calibration.temperature], np.float32),
        "decode.dead_zone": np.asarray(DEAD_ZONE, np.float32),
        "decode.merging": np.asarray(astuple(MERGING), np.float32),
    }
    if calibration.tail is not None:
        pairs = zip(calibration.tail.probability, calibration.tail.factor, strict=True)
        tensors["decode.tail"] = np.asarray([value for pair in pairs for value in pair], np.float32)
    sizes = network.sizes
    described = {
        "feature_version": str(_core.NEURAL["version"]),
        "sizes": f"agent {sizes.agent}, neighbour {sizes.neighbour}, path {sizes.path}, head {sizes.head}",
    }
    write_safetensors(path, tensors, {**described, **metadata, "sha256": digest(tensors)})


def write_fixture(path: Path, network: Network, rows: Rows) -> None:
    """Features of a few rows and what the network says to them, for a test of the forward pass without torch.

    Rows are spread evenly over the given ones; what is not there is zero, as the core makes it.
    """
    chosen = np.linspace(0, len(rows["id"]) - 1, FIXTURE_ROWS).astype(int)
    inputs = {name: rows[name][chosen] for name in ("agent", "neighbours", "paths", "path_valid")}
    with torch.no_grad():
        raw = network(*(torch.from_numpy(values) for values in inputs.values())).numpy()
    unfinished = path.with_suffix(".part.npz")
    np.savez_compressed(unfinished, raw=raw, **inputs)
    unfinished.rename(path)
