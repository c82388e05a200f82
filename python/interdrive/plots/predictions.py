"""How predictions look: ellipses around means, and the stronger the more probable a mode is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive.plots.view import Floats

#: Colour of what is predicted.
PREDICTION = "#7a3b8f"
#: The least probable mode keeps so much of its strength.
_FAINTEST = 0.15


def ellipse_rings(means: Floats, covariance: Floats, mass: float) -> Floats:
    """Outlines [m] of the ellipses that hold a probability mass of normal distributions.

    Args:
        means: Shape (..., 2) [m].
        covariance: Shape (..., 2, 2) [m²].
        mass: Between 0 and 1.

    Returns:
        Shape (ellipses, 24, 2), in the order of the means; those that are not numbers are left out.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    means, covariance = means.reshape(-1, 2), covariance.reshape(-1, 2, 2)
    finite = np.isfinite(means).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2))
    values, vectors = np.linalg.eigh(covariance[finite])
    axes = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    rings: Floats = means[finite][:, None] + np.sqrt(-2.0 * np.log1p(-mass)) * (axes @ circle).transpose(0, 2, 1)
    return rings


def strength(probability: Floats) -> Floats:
    """How strongly a mode is drawn, between 0 and 1: by its probability, but never invisible."""
    strong: Floats = _FAINTEST + (1.0 - _FAINTEST) * np.clip(probability, 0.0, 1.0)
    return strong
