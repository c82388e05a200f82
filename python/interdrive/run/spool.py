"""States of a run on disk, from which any stretch of time is read again: memory for what has left is given back."""

from __future__ import annotations

import hashlib
import os
import tempfile
from array import array
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.scenario import STATE_FIELDS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from interdrive.array_types import Floats, Ints
    from interdrive.run.arrays import States

_BYTES = 8
#: Numbers that say where a stretch is: participant, first time step, number of time steps, position in the file of the
#: first number, distance to that of the next field [B].
_WORDS = 5


class Spool:
    """States in a file without a name, which is gone with the process. Only where they are is held."""

    def __init__(self, folder: Path) -> None:
        """Begins without states.

        Args:
            folder: Where the file is.

        Raises:
            OSError: No file can be written there.
        """
        self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115 - closed by `close`
        self._index = array("q")
        self._size = 0

    def close(self) -> None:
        """Gives the file back."""
        self._file.close()

    def add(self, states: States) -> None:
        """Adds states of the time steps that follow those before.

        Raises:
            OSError: They cannot be written.
        """
        counts = states.valid.sum(axis=1)
        total = int(counts.sum())
        begin = np.concatenate([[0], np.cumsum(counts)])
        for row, number in enumerate(states.participant_id.tolist()):
            columns = np.flatnonzero(states.valid[row])
            breaks = np.flatnonzero(np.diff(columns) != 1) + 1
            for part in np.split(np.arange(len(columns)), breaks):
                if len(part):
                    place = self._size + _BYTES * (int(begin[row]) + int(part[0]))
                    first = states.first_time_step + int(columns[part[0]])
                    self._index.extend((number, first, len(part), place, _BYTES * total))
        for name in STATE_FIELDS:
            self._file.write(np.ascontiguousarray(getattr(states, name)[states.valid]).tobytes())
        self._file.flush()
        self._size += len(STATE_FIELDS) * _BYTES * total

    def spans(self) -> tuple[Ints, Ints, Ints]:
        """Ids of all participants that were there, ascending, and the first and last time step of each."""
        index = self._stretches
        ids, row = np.unique(index[:, 0], return_inverse=True)
        first = np.full(len(ids), np.iinfo(np.int64).max)
        last = np.full(len(ids), np.iinfo(np.int64).min)
        np.minimum.at(first, row, index[:, 1])
        np.maximum.at(last, row, index[:, 1] + index[:, 2] - 1)
        return ids, first, last

    def window(self, participants: States, first: int, last: int) -> States:
        """States of participants from one time step to another; nan while they are not there.

        Args:
            participants: The participants, without states.
            first: First time step.
            last: Last time step, included.
        """
        shape = len(participants.participant_id), last - first + 1
        fields: dict[str, Any] = {name: np.full(shape, np.nan) for name in STATE_FIELDS}
        valid = np.zeros(shape, dtype=np.bool_)
        index = self._stretches
        wanted = np.isin(index[:, 0], participants.participant_id)
        wanted &= (index[:, 1] <= last) & (index[:, 1] + index[:, 2] > first)
        for number, begin, length, place, stride in index[wanted].tolist():
            row = int(np.searchsorted(participants.participant_id, number))
            skipped = max(0, first - begin)
            n = min(begin + length, last + 1) - begin - skipped
            span = slice(begin + skipped - first, begin + skipped - first + n)
            valid[row, span] = True
            for k, name in enumerate(STATE_FIELDS):
                fields[name][row, span] = self._read(place + k * stride + _BYTES * skipped, n)
        return replace(participants, first_time_step=first, valid=valid, **fields)

    def mean_speeds(self, ids: Ints, first: float, last: float) -> Floats:
        """Mean speed of participants over the time steps of a stretch [m/s]; nan where one was not there."""
        total, count = np.zeros(len(ids)), np.zeros(len(ids))
        order = np.argsort(ids)
        k = STATE_FIELDS.index("velocity")
        for number, begin, length, place, stride in self._stretches.tolist():
            at = int(np.searchsorted(ids, number, sorter=order))
            if at == len(ids) or ids[order[at]] != number:
                continue
            steps = np.arange(begin, begin + length)
            counts = (steps >= first) & (steps <= last)
            total[order[at]] += self._read(place + k * stride, length)[counts].sum()
            count[order[at]] += counts.sum()
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    def digest(self, participant_id: Ints, first: int, n_steps: int) -> str:
        """What `interdrive.run.assemble.digest` says of all states.

        Args:
            participant_id: Ids of all participants, ascending.
            first: First time step of the run.
            n_steps: Number of time steps.
        """
        total = hashlib.sha256(np.ascontiguousarray(participant_id).tobytes())
        index = self._stretches
        index = index[np.argsort(index[:, 0], kind="stable")]
        begin = np.searchsorted(index[:, 0], participant_id, side="left")
        end = np.searchsorted(index[:, 0], participant_id, side="right")
        for row in self._rows(index, begin, end, None, np.zeros(n_steps, dtype=np.bool_), first):
            total.update(row)
        for k in range(len(STATE_FIELDS)):
            for row in self._rows(index, begin, end, k, np.zeros(n_steps), first):
                total.update(row)
        return total.hexdigest()

    def _rows(
        self,
        index: Ints,
        begin: Ints,
        end: Ints,
        k: int | None,
        row: NDArray[Any],
        first: int,
    ) -> Iterator[bytes]:
        """The bytes of one field, or of the mask for None, for each participant."""
        for a, b in zip(begin.tolist(), end.tolist(), strict=True):
            row[:] = 0
            for _, start, length, place, stride in index[a:b].tolist():
                span = slice(start - first, start - first + length)
                row[span] = True if k is None else _clean(self._read(place + k * stride, length))
            yield row.tobytes()

    @property
    def _stretches(self) -> Ints:
        """Where all stretches are, shape (stretches, _WORDS)."""
        return np.array(self._index, dtype=np.int64).reshape(-1, _WORDS)

    def _read(self, place: int, n: int) -> Floats:
        return np.frombuffer(os.pread(self._file.fileno(), _BYTES * n, place))


def _clean(values: Floats) -> Floats:
    return np.where(np.isnan(values), 0.0, values)
