"""A round of a search: runs whose points are chosen are driven, and their failures made small."""

from __future__ import annotations

import itertools
import math
import time
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from interdrive.batches.pool import Task
from interdrive.errors import InputError, InterdriveError
from interdrive.failure_search.keeping import Kept, unshrunk, work
from interdrive.failure_search.trials import Trial

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from interdrive.batches.pool import End
    from interdrive.failure_search.allocation import Proposal
    from interdrive.failure_search.backends import Backend
    from interdrive.failure_search.disturbances import Pair
    from interdrive.failure_search.record import Record


@dataclass(frozen=True)
class Limits:
    """When a search ends, and when it makes nothing smaller, by the clock that all machines have [s since 1970]."""

    runs: float
    deadline: float
    failures: float
    shrinking: float

    @classmethod
    def of(cls, runs: int | None, minutes: float, stop_after: int | None, *, shrink: bool) -> Limits:
        """The limits of a search that begins now, from its arguments.

        Raises:
            InputError: One of them is not positive.
        """
        for name, value in (("runs", runs), ("minutes", minutes), ("stop_after", stop_after)):
            if value is not None and not value > 0:
                raise InputError(f"{name}: must be positive, is {value}")
        usual = 300 if math.isinf(minutes) else math.inf
        deadline = time.time() + 60.0 * minutes
        return cls(usual if runs is None else runs, deadline, stop_after or math.inf, deadline if shrink else 0.0)


class Round:
    """Runs whose points are chosen: which are driven next, and which failures are made small."""

    def __init__(self, record: Record, backend: Backend, proposals: Sequence[Proposal], limits: Limits) -> None:
        """A round of a search that is recorded, by processes that do tasks."""
        self._record, self._backend, self._proposals, self._limits = record, backend, proposals, limits
        self._given = self._decided = 0
        self._rows: dict[int, dict[str, Any]] = {}  # by place in the round
        self._to_keep: deque[tuple[int, Trial]] = deque()
        self._kept: dict[int, tuple[Kept | None, str]] = {}  # what is kept, and how
        self._lost: set[int] = set()  # failures whose process was lost while they were made small

    def rows(self) -> Iterator[dict[str, Any]]:
        """The rows of the runs, in order, as they become known."""
        while self._to_keep or self._has_more:
            for end in self._backend.run(work, self._take):
                self._note(end)
                yield from self._told()

    def left(self, spare: Backend) -> Iterator[dict[str, Any]]:
        """The rows that are known when the search is interrupted; their failures are kept as they are."""
        known = itertools.takewhile(lambda place: place in self._rows, itertools.count(self._next))
        places = [place for place in known if place < self._decided]
        trials = iter([(place, unshrunk(self._trial(place))) for place in places if place not in self._kept])
        for end in spare.run(work, lambda _: task_of(next(trials, None))):
            self._note(end)
        yield from self._told()

    @property
    def _next(self) -> int:
        """The place in the round of the next row of the search."""
        return len(self._record.folder.rows) - self._proposals[0].index

    def _told(self) -> Iterator[dict[str, Any]]:
        while (place := self._next) in self._kept:
            yield self._record.kept(self._rows[place], *self._kept[place])

    @property
    def _has_more(self) -> bool:
        return self._given < len(self._proposals) and time.time() < self._limits.deadline

    def _take(self, _group: str) -> Task[tuple[int, Trial]] | None:
        """The next task: failures are made small before others are looked for."""
        if self._to_keep:
            return task_of(self._to_keep.popleft())
        if not self._has_more:
            return None
        place = self._given
        self._given += 1
        proposal = self._proposals[place]
        return task_of((place, Trial(self._record.setup, self._record.pairs[proposal.pair], proposal)))

    def _trial(self, place: int) -> Trial:
        """Making the failure of a run small, and keeping it."""
        row = self._rows[place]
        pair = self._record.pairs[row["pair"]]
        return Trial(self._record.setup, pair, None, tuple(row["point"]), row["signature"], self._limits.shrinking)

    def _note(self, end: End[tuple[int, Trial]]) -> None:
        """Notes how a task ended, and which failures are new."""
        place, trial = end.task.payload
        value = value_of(end, trial.pair)
        if isinstance(value, InterdriveError) and not end.lost:
            raise value
        if trial.failing is not None:
            self._note_kept(place, trial, value)
            return
        self._rows[place] = self._record.row(self._proposals[place], value)
        while self._decided in self._rows:
            if self._record.is_to_be_kept(self._rows[self._decided]):
                self._to_keep.append((self._decided, self._trial(self._decided)))
            else:
                self._kept[self._decided] = None, ""
            self._decided += 1

    def _note_kept(self, place: int, trial: Trial, value: Kept | InterdriveError | None) -> None:
        """Notes a failure that is kept; one whose process is lost while it is made small is kept as it is."""
        if not isinstance(value, InterdriveError):
            is_small = value is not None and value.failure.is_small
            self._kept[place] = value, "yes" if is_small else "lost" if place in self._lost else "ended"
        elif place in self._lost:
            self._kept[place] = None, ""
        else:
            self._lost.add(place)
            self._to_keep.append((place, unshrunk(trial)))


def task_of(payload: tuple[int, Trial] | None) -> Task[tuple[int, Trial]] | None:
    """A numbered trial as a task; None: there is none."""
    return None if payload is None else Task(payload, payload[1].pair.path)


def value_of(end: End[Any], pair: Pair) -> Any:  # noqa: ANN401 - what a task returned
    """What a task returned, or why its process was lost."""
    if end.lost:
        return InterdriveError(f"{pair.scenario}, agent {pair.agent_id}: a run is lost: {end.why}")
    return end.value
