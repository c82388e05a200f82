"""Observation spaces, and observations as they are handed out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from interdrive import _core

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from interdrive.native_settings import ObservationSettings


def observation_space(settings: ObservationSettings, planner: Sequence[str] = ()) -> gymnasium.Space[Any]:
    """The space of one observation; `planner` names what is observed of the learner's planner."""
    blocks = _core.observation_blocks(settings, list(planner))
    if settings.form == "flat":
        n = sum(max(rows, 1) * columns for _, rows, columns in blocks)
        return _box((n,))
    return gymnasium.spaces.Dict(
        {name: _box((rows, columns) if rows else (columns,)) for name, rows, columns in blocks}
    )


def _box(shape: tuple[int, ...]) -> gymnasium.spaces.Box:
    return gymnasium.spaces.Box(-1.0, 1.0, shape, np.float32)


class Views:
    """Observations as views of an array of rows."""

    def __init__(self, settings: ObservationSettings, planner: Sequence[str] = ()) -> None:
        """For these settings, and what is observed of the learner's planner."""
        self._flat = settings.form == "flat"
        self._parts: list[tuple[str, slice, tuple[int, ...]]] = []
        first = 0
        for name, rows, columns in _core.observation_blocks(settings, list(planner)):
            n = max(rows, 1) * columns
            self._parts.append((name, slice(first, first + n), (rows, columns) if rows else (columns,)))
            first += n

    def of(self, rows: NDArray[np.float32], *, copy: bool) -> Any:  # noqa: ANN401 - an array or a dict of them
        """Of an array (numbers,) or (rows, numbers)."""
        if self._flat:
            return rows.copy() if copy else rows
        cut = {name: rows[..., part].reshape(rows.shape[:-1] + shape) for name, part, shape in self._parts}
        return {name: one.copy() for name, one in cut.items()} if copy else cut
