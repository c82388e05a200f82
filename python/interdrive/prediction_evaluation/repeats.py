"""Recordings that several files show: tracks that were there before are found by their positions.

Files of one recording often overlap: other time steps, ids and vehicles, but the same positions. Each counts once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.prediction_evaluation.measures import HORIZONS, step_of

if TYPE_CHECKING:
    from interdrive.array_types import Bools, Ints
    from interdrive.scenario import Obstacles

#: Positions that agree to this are the same [m].
SAME = 1e-3


class KnownTracks:
    """Tracks of the files read.

    Two tracks are one if there is a shift in time with which they agree wherever both are known, and if they have a
    second in which they move in common. A vehicle that stands all the time was there before if another one stood at the
    same place for at least as long.
    """

    def __init__(self) -> None:
        """Nothing is known."""
        self._tracks: list[tuple[Ints, Bools]] = []
        # Time between steps, and positions at the beginning and end of a second -> track and time step.
        self._moving: dict[tuple[float, bytes], tuple[int, int]] = {}
        # The same, and a position -> number of time steps at which a vehicle stands there.
        self._standing: dict[tuple[float, bytes], int] = {}

    def repeated(self, obstacles: Obstacles, dt: float) -> Bools:
        """Which states earlier files have, too, with the second that follows; from now on these tracks are known.

        Args:
            obstacles: Those of a file.
            dt: Time between its steps [s].

        Returns:
            Shape (obstacles, steps).
        """
        position = np.stack([obstacles.x, obstacles.y], axis=-1)
        valid: Bools = np.all(np.isfinite(position), axis=-1)
        grid = np.rint(np.where(valid[..., None], position, 0.0) / SAME).astype(np.int64)
        second = step_of(HORIZONS[0], dt) + 1
        found = np.zeros(valid.shape, dtype=np.bool_)
        complete = np.zeros(valid.shape, dtype=np.bool_)
        if valid.shape[1] > second:
            complete[:, :-second] = _windows(valid, second).all(axis=-1)
        for row in range(len(grid)):
            found[row] = self._repeated(grid[row], valid[row], complete[row], second, dt) & complete[row]
        for row in range(len(grid)):
            self._remember(grid[row], valid[row], complete[row], second, dt)
        return found

    def _repeated(self, track: Ints, valid: Bools, complete: Bools, second: int, dt: float) -> Bools:
        moving = _moving(track, complete, second)
        if not len(moving):
            known = self._standing.get((dt, track[valid][0].tobytes()), 0) if valid.any() else 0
            return np.full(len(track), known >= valid.sum() and _stands(track[valid]))
        found = np.zeros(len(track), dtype=np.bool_)
        shifts = dict.fromkeys(
            (hit[0], hit[1] - step)
            for step in moving
            if (hit := self._moving.get((dt, track[[step, step + second]].tobytes()))) is not None
        )
        for number, shift in shifts:
            other, is_there = self._tracks[number]
            steps = np.arange(len(track)) + shift
            inside = (steps >= 0) & (steps < len(other))
            both = np.zeros(len(track), dtype=np.bool_)
            both[inside] = valid[inside] & is_there[steps[inside]]
            if (track[both] == other[steps[both]]).all():
                ends = np.append(both, np.zeros(second, dtype=np.bool_))
                found |= _windows(ends, second).all(axis=-1)
        return found

    def _remember(self, track: Ints, valid: Bools, complete: Bools, second: int, dt: float) -> None:
        moving = _moving(track, complete, second)
        for step in moving:
            self._moving.setdefault((dt, track[[step, step + second]].tobytes()), (len(self._tracks), step))
        if len(moving):
            self._tracks.append((track, valid))
        elif valid.any() and _stands(track[valid]):
            key = (dt, track[valid][0].tobytes())
            self._standing[key] = max(self._standing.get(key, 0), int(valid.sum()))


def _windows(values: Bools, second: int) -> Any:  # noqa: ANN401 - array
    """Every stretch of a second, its first and its last step included."""
    return np.lib.stride_tricks.sliding_window_view(values, second + 1, axis=-1)


def _moving(track: Ints, complete: Bools, second: int) -> list[int]:
    """Time steps at which a second begins that is known and in which the vehicle moves."""
    steps = np.flatnonzero(complete)
    moves: Bools = np.any(track[steps + second] != track[steps], axis=1)
    return [int(step) for step in steps[moves]]


def _stands(positions: Ints) -> bool:
    return bool((positions == positions[0]).all())
