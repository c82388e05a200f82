"""WALENET with random weights, for tests that need no download."""

from __future__ import annotations

import math

import numpy as np

from interdrive.predictors.models import WALENET


def invented_weights(seed: int = 3) -> dict[str, np.ndarray]:
    """Random weights of the right shapes, about as large as those of a trained network."""
    random = np.random.default_rng(seed)
    weights = {}
    for name, shape in WALENET.shapes.items():
        size = math.prod(shape[1:]) if len(shape) > 1 else 4
        weights[name] = random.normal(0.0, 1.0 / math.sqrt(size), shape).astype(np.float32)
    weights["sc_conv1.weight"] /= 100  # the picture has values up to 255
    weights["op.weight"][:2] *= 10  # means are metres
    return weights
