"""What was done to worlds since all of them began anew, so that another process can do it again."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from interdrive.errors import InputError

if TYPE_CHECKING:
    from numpy.random import Generator
    from numpy.typing import NDArray

#: What a note of a decision takes besides its numbers [bytes].
_EVENT_SIZE = 150
#: Actions beyond this are forgotten, and the environment cannot be pickled before its next reset [bytes].
_SIZE_MAX = 64 * 2**20


@dataclass(frozen=True)
class Episode:
    """An episode that was drawn.

    Attributes:
        stage: Position of its scenario.
        time_step: Its first time step.
        learners: Positions of its learners.
        seed: Of what drivers of others draw, and of generated traffic; 0 without both.
    """

    stage: int
    time_step: int
    learners: tuple[int, ...]
    seed: int = 0


class Repeatable(Protocol):
    """Worlds whose history can be repeated in other worlds."""

    setup: Any
    first_setup: Any
    rngs: list[Generator | None]
    sampler: Any
    queued: list[Episode | None]
    buffers: Any

    def put(self, world: int, episode: Episode | None) -> None:
        """Makes an episode the next one of a world."""

    def reset(self, wanted: NDArray[np.bool_] | None = None) -> None:
        """Begins the next episodes."""

    def step(self) -> None:
        """One decision of all learners."""

    def update(self, changes: dict[str, Any]) -> None:
        """Changes settings."""


@dataclass(frozen=True)
class _Reset:
    """A reset: of which worlds, and generators, drawn episodes and sampler as they were before."""

    chosen: NDArray[np.bool_]
    rngs: list[Generator | None]
    queued: list[Episode | None]
    sampler: Any


class History:
    """Resets, decisions and changes of settings, in their order."""

    def __init__(self) -> None:
        self._events: list[_Reset | NDArray[Any] | dict[str, Any]] = []
        self._size: int = 0

    def reset(self, engine: Repeatable, chosen: NDArray[np.bool_]) -> None:
        """Notes a reset that is about to happen; one of all worlds makes what was before it forgotten."""
        if chosen.all():
            self._events, self._size = [], 0
            engine.first_setup = engine.setup
        now = deepcopy((engine.rngs, engine.sampler))
        self._events.append(_Reset(chosen.copy(), now[0], list(engine.queued), now[1]))

    def step(self, actions: NDArray[Any]) -> None:
        """Notes a decision."""
        self._size += actions.nbytes + _EVENT_SIZE
        if self._size > _SIZE_MAX:
            self._events = []
        else:
            self._events.append(actions.copy())

    def update(self, changes: dict[str, Any]) -> None:
        """Notes a change of settings."""
        self._events.append(dict(changes))

    def copy(self) -> History:
        """The same history, which goes on by itself; its events never change."""
        other = History()
        other._events, other._size = list(self._events), self._size
        return other

    def check(self) -> None:
        """Refuses what cannot be repeated.

        Raises:
            InputError: Too many decisions were taken since the last reset of all worlds.
        """
        if self._size > _SIZE_MAX:
            raise InputError("too many steps without a reset to pickle the environment; reset it, or copy it")

    def repeat(self, engine: Repeatable) -> None:
        """Does all of it to worlds of the same settings."""
        for event in self._events:
            if isinstance(event, dict):
                engine.update(event)
            elif isinstance(event, np.ndarray):
                engine.buffers.actions[...] = event
                engine.step()
            else:
                engine.rngs[:], engine.sampler = deepcopy((event.rngs, event.sampler))
                for world, episode in enumerate(event.queued):
                    engine.put(world, episode)
                engine.reset(event.chosen)
