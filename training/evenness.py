"""How even the past of vehicles was, from their features; the core computes the same (`predict/neural/features.rs`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core

if TYPE_CHECKING:
    from numpy.typing import NDArray

N_INSTANTS = 10
#: Instants of the windows of roughness and of unsteadiness, their units [m, m/s], what is added before the logarithm.
_ROUGH, _STEADY = (4, 6, 10), (5, 10)
_ROUGHNESS, _UNSTEADINESS, _LEAST = 0.01, 0.1, 0.1
_COLUMN = {entry[0]: column for column, entry in enumerate(_core.NEURAL["agent"])}
_SCALE = {entry[0]: entry[1] for entry in _core.NEURAL["agent"]}


def with_evenness(agent: NDArray[np.float32]) -> NDArray[np.float32]:
    """Features of vehicles, shape (vehicles, features), with those that tell how even their past was made anew from it.

    Roughness is the logarithm of the root mean square of third differences of past positions, unsteadiness that of the
    largest change of speed; both are 0 where too little is known.
    """
    past = agent[:, : 4 * N_INSTANTS].reshape(-1, N_INSTANTS, 4)
    n_known = np.cumprod(past[..., 3] > 0, axis=1).sum(axis=1)
    scale = np.array([_SCALE[f"{name}_0.2"] for name in ("past_x", "past_y", "past_velocity")])
    values = np.concatenate([np.zeros((len(agent), 1, 3)), past[..., :3] * scale], axis=1)
    third = values[:, :-3] - 3 * values[:, 1:-2] + 3 * values[:, 2:-1] - values[:, 3:]
    found = []
    for axis in (0, 1):
        for window in _ROUGH:
            n = n_known.clip(max=window)
            counted = np.arange(third.shape[1]) <= n[:, None] - 3
            mean = (third[..., axis] ** 2 * counted).sum(axis=1) / (n - 2).clip(min=1)
            found.append(np.where(n >= 3, np.log(np.sqrt(mean) / _ROUGHNESS + _LEAST), 0.0))
    for window in _STEADY:
        n = n_known.clip(max=window)
        counted = np.arange(N_INSTANTS) < n[:, None]
        largest = (np.abs(values[:, 1:, 2]) * counted).max(axis=1)
        found.append(np.where(n >= 1, np.log(largest / _UNSTEADINESS + _LEAST), 0.0))
    names = [f"roughness_{axis}_{end}" for axis in ("along", "across") for end in ("0.8", "1.2", "2.0")]
    names += ["unsteadiness_1.0", "unsteadiness_2.0"]
    agent = agent.copy()
    for name, values_of in zip(names, found, strict=True):
        agent[:, _COLUMN[name]] = values_of / _SCALE[name]
    return agent
