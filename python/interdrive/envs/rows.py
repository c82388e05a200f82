"""Worlds times slots as rows of arrays: shared policies, self-play, the fastest way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.envs.actions import put
from interdrive.envs.engine import Drives, Engine, checked_count, public
from interdrive.envs.settings import setup_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive.array_types import Bools
    from interdrive.envs.sampling import Sampler


class Rows(Drives):
    """Many worlds as rows, row = world * slots + slot, in arrays that are written in place.

    A world begins anew in the call in which its last learner ends: its rows then show the new episode, and the flags
    tell of the end.

    Args:
        num_worlds: Number of worlds.
        slots: Rows of each; if a scenario has more learners, they are drawn. None: as many as the largest scenario has.
        seed: Of the first reset; world i has seed + i.
        buf: Arrays by name that are written instead of new ones.
        keep_final: Keep the last observations of learners that end.
        sampler: Draws the scenarios.
        **settings: As for `DriveEnv`; `learners` is "all" unless given.

    Attributes:
        actions: (rows, numbers) float32 or (rows,) int32; to be filled.
        observations: (rows, numbers) float32; zero in rows that have ended, have not entered yet, or are not used.
            Copy them before you change them: what you write into such a row may stay until the next reset.
        rewards: (rows,) float32.
        terminals: (rows,) bool; the learner has ended in this call.
        truncations: (rows,) bool; it was cut in this call.
        masks: (rows,) bool; the next action of the row counts.
        outcomes: (rows,) int8; codes, -1 in unused rows and before the vehicle enters.
        agent_ids: (rows,) int64; -1 in unused rows.
        components: (rows, terms) float32; amounts of the reward.
        raster: (rows, 4, 96, 96) uint8, with `observation.raster`; zero where `observations` are.
        final_observations: As `observations`, with `keep_final`.
        final_raster: As `raster`, with `keep_final`.

    Raises:
        InputError: The input cannot be used; one line states why.
    """

    actions: NDArray[Any]
    observations: NDArray[np.float32]
    rewards: NDArray[np.float32]
    terminals: Bools
    truncations: Bools
    masks: Bools
    outcomes: NDArray[np.int8]
    agent_ids: NDArray[np.int64]
    components: NDArray[np.float32]
    raster: NDArray[np.uint8]
    final_observations: NDArray[np.float32]
    final_raster: NDArray[np.uint8]

    def __init__(
        self,
        num_worlds: int = 1,
        slots: int | None = None,
        seed: int = 0,
        buf: Mapping[str, Any] | None = None,
        keep_final: bool = False,
        sampler: Sampler | None = None,
        **settings: Any,  # noqa: ANN401
    ) -> None:
        num_worlds = checked_count("num_worlds", num_worlds)
        setup = setup_of(settings, learners="all")
        self._engine = Engine(
            setup,
            num_worlds=num_worlds,
            autoreset="same_step",
            slots=slots,
            buf=buf,
            keep_final=keep_final,
            sampler=sampler,
        )
        self._seed = seed
        self.slots = self._engine.slots
        self.num_worlds = num_worlds
        self.num_agents = self._engine.rows
        self.single_observation_space = self._engine.observation_space
        self.single_action_space = self._engine.kind.space
        for name, array in self._engine.buffers.arrays.items():
            setattr(self, name, array)

    def reset(self, seed: int | None = None) -> NDArray[np.float32]:
        """Begins an episode in all worlds.

        Args:
            seed: World i has seed + i; None: that of the constructor.

        Returns:
            `observations`.
        """
        first = self._seed if seed is None else seed
        for world in range(self.num_worlds):
            self._engine.seed(world, first + world)
        self._engine.reset()
        return self.observations

    def step(self, actions: NDArray[Any] | None = None) -> NDArray[np.float32]:
        """One decision of all learners.

        Args:
            actions: As `self.actions`; None: that array has been filled.

        Returns:
            `observations`; everything else is in the arrays.
        """
        if actions is not None and actions is not self.actions:
            put(self.actions, actions)
        self._engine.step()
        return self.observations

    def infos(self) -> list[dict[str, Any]]:
        """What is known about the learners that have ended in the last call, with their `row`."""
        return [{**public(info), "row": info["row"]} for info in self._engine.infos()]

    def close(self) -> None:
        """Has nothing to close."""
