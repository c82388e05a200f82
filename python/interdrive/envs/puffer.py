"""The rows of many worlds as a `PufferEnv` of PufferLib 3."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.envs.rows import Rows
from interdrive.errors import InputError, MissingExtraError

try:
    from pufferlib import PufferEnv
except ImportError as error:
    raise MissingExtraError("interdrive.envs.puffer needs PufferLib: pip install pufferlib") from error

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive.envs.sampling import Sampler

#: PufferLib's arrays, which the core writes.
_SHARED = ("observations", "actions", "rewards", "terminals", "truncations", "masks")


class DrivePuffer(PufferEnv):  # type: ignore[misc]
    """Many worlds whose learners share a policy; the core writes into PufferLib's arrays.

    Args:
        num_worlds: Number of worlds.
        slots: Learners of each, as for `Rows`.
        buf: PufferLib's arrays; None: its own new ones.
        seed: Of the first reset; world i has seed + i.
        sampler: Draws the scenarios.
        **settings: As for `DriveEnv`; `learners` is "all" unless given.

    Attributes:
        num_agents: Number of rows.
        rows: The rows themselves, with components, outcomes and ids.

    Raises:
        InputError: The input cannot be used; one line states why.
    """

    def __init__(
        self,
        num_worlds: int = 1,
        slots: int | None = None,
        buf: Any = None,  # noqa: ANN401 - PufferLib's arrays
        seed: int = 0,
        sampler: Sampler | None = None,
        **settings: Any,  # noqa: ANN401
    ) -> None:
        given = None if buf is None else {name: buf[name] for name in _SHARED}
        self.rows = Rows(num_worlds, slots=slots, seed=seed, buf=given, sampler=sampler, **settings)
        if self.rows.single_observation_space.shape is None:
            raise InputError("observation", "PufferLib takes one array of numbers: form flat, without raster")
        # The base class asks for them.
        self.single_observation_space = self.rows.single_observation_space
        self.single_action_space = self.rows.single_action_space
        self.num_agents = self.rows.num_agents
        super().__init__({name: getattr(self.rows, name) for name in _SHARED})

    def reset(self, seed: int | None = None) -> tuple[NDArray[np.float32], list[dict[str, Any]]]:
        """Begins an episode in all worlds.

        Returns:
            Observations and an empty list of infos.
        """
        self.rows.reset(seed)
        return self.observations, []

    def step(
        self,
        actions: Any,  # noqa: ANN401 - an array
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_], list[dict[str, Any]]]:
        """One decision of all learners.

        Returns:
            Observations, rewards, terminals, truncations, and one info for each learner that has ended.
        """
        self.rows.step(np.asarray(actions).reshape(self.actions.shape))
        infos = self.rows.infos() if self.terminals.any() or self.truncations.any() else []
        return self.observations, self.rewards, self.terminals, self.truncations, infos

    def close(self) -> None:
        """Has nothing to close."""
