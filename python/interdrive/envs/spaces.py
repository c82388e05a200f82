"""Observation spaces, and observations as they are handed out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from interdrive import _core

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from interdrive.native_settings import ObservationSettings


def observation_space(settings: ObservationSettings, planner: Sequence[str] = ()) -> gymnasium.Space[Any]:
    """The space of one observation; `planner` names what is observed of the learner's planner.

    A box; or, with a picture or as a dictionary, boxes by name: `vector` or the names of the blocks, and `raster`.
    """
    blocks = _core.observation_blocks(settings, list(planner))
    n = sum(max(rows, 1) * columns for _, rows, columns in blocks)
    if settings.form == "flat" and not settings.raster:
        return _box((n,))
    boxes: dict[str, gymnasium.Space[Any]] = {
        name: _box((rows, columns) if rows else (columns,)) for name, rows, columns in blocks
    }
    if settings.form == "flat":
        boxes = {"vector": _box((n,))}
    if settings.raster:
        boxes["raster"] = gymnasium.spaces.Box(0, 255, _core.RASTER, np.uint8)
    return gymnasium.spaces.Dict(boxes)


def _box(shape: tuple[int, ...]) -> gymnasium.spaces.Box:
    return gymnasium.spaces.Box(-1.0, 1.0, shape, np.float32)


class Views:
    """Observations as views of the arrays that the core writes, or copies of them."""

    def __init__(
        self,
        settings: ObservationSettings,
        arrays: Mapping[str, NDArray[Any]],
        planner: Sequence[str] = (),
        *,
        copy: bool,
    ) -> None:
        """For these settings, of these arrays, and with what is observed of the learner's planner."""
        self._arrays, self._copy, self._raster = arrays, copy, settings.raster
        self._flat = settings.form == "flat"
        self._parts: list[tuple[str, slice, tuple[int, ...]]] = []
        first = 0
        for name, rows, columns in _core.observation_blocks(settings, list(planner)):
            n = max(rows, 1) * columns
            self._parts.append((name, slice(first, first + n), (rows, columns) if rows else (columns,)))
            first += n

    def of(self, rows: int | slice, *, copy: bool | None = None) -> Any:  # noqa: ANN401 - an array or a dict of them
        """Of a row, or of several; `copy` replaces the setting."""
        return self._handed(rows, "", copy=self._copy if copy is None else copy)

    def last(self, row: int) -> Any:  # noqa: ANN401 - an array or a dict of them
        """The last one of a learner that has ended in this call, a copy."""
        return self._handed(row, "final_", copy=True)

    def _handed(self, rows: int | slice, prefix: str, *, copy: bool) -> Any:  # noqa: ANN401
        vectors = self._arrays[f"{prefix}observations"][rows]
        if self._flat and not self._raster:
            return vectors.copy() if copy else vectors
        found = {"vector": vectors}
        if not self._flat:
            found = {name: vectors[..., part].reshape(vectors.shape[:-1] + shape) for name, part, shape in self._parts}
        if self._raster:
            found["raster"] = self._arrays[f"{prefix}raster"][rows]
        return {name: one.copy() for name, one in found.items()} if copy else found
