"""Many worlds with one learner each: a native `gymnasium.vector.VectorEnv`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.vector.utils import batch_space

from interdrive.envs.actions import put
from interdrive.envs.engine import Drives, Engine, checked_count, checked_seed, public
from interdrive.envs.settings import setup_of
from interdrive.envs.single import no_rendering, only_one
from interdrive.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Names of the modes for the core.
_MODES = {"NEXT_STEP": "next_step", "SAME_STEP": "same_step", "DISABLED": "disabled"}


def _mode(given: Any) -> tuple[str, Any]:  # noqa: ANN401 - a word or a member of gymnasium's enumeration
    """The name of an autoreset mode, and what it is in gymnasium, if this version has modes.

    Raises:
        InputError: There is no such mode, or this version of gymnasium does not have it.
    """
    name = str(getattr(given, "name", given)).upper()
    if name not in _MODES:
        raise InputError("autoreset_mode", f"{given} is not one of {', '.join(_MODES)}")
    modes = getattr(gymnasium.vector, "AutoresetMode", None)
    if modes is None and name != "NEXT_STEP":
        raise InputError(f"autoreset_mode {name} needs gymnasium 1.1; {gymnasium.__version__} is installed")
    return name, None if modes is None else modes[name]


class DriveVectorEnv(Drives, gymnasium.vector.VectorEnv[Any, Any, Any]):
    """Many worlds with one learner each, in one native call; world i equals a `DriveEnv` with seed + i.

    Args:
        num_envs: Number of worlds.
        autoreset_mode: When worlds begin anew, as in gymnasium.
        render_mode: None.
        sampler: Draws the scenarios.
        **settings: As for `DriveEnv`.

    Raises:
        InputError: The input cannot be used; one line states why.
    """

    def __init__(
        self,
        num_envs: int = 1,
        autoreset_mode: Any = "NEXT_STEP",  # noqa: ANN401
        render_mode: str | None = None,
        sampler: Any = None,  # noqa: ANN401
        **settings: Any,  # noqa: ANN401
    ) -> None:
        no_rendering(render_mode)
        setup = setup_of(settings, learners=1)
        only_one(setup.learners, "DriveVectorEnv")
        num_envs = checked_count("num_envs", num_envs)
        name, mode = _mode(autoreset_mode)
        self._mode = name
        self.metadata = {"render_modes": [], "autoreset_mode": mode}
        self.render_mode = None
        self.num_envs = num_envs
        same = name == "SAME_STEP"
        self._engine = Engine(setup, num_worlds=num_envs, autoreset=_MODES[name], keep_final=same, sampler=sampler)
        self._views = self._engine.views
        self.single_observation_space = self._engine.observation_space
        self.single_action_space = self._engine.kind.space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begins an episode in all worlds, or in those of `options["reset_mask"]`.

        Args:
            seed: World i has seed + i, or the i-th of a list; None: goes on with the numbers of the last seed.
            options: {"reset_mask": array of (num_envs,) bool}.

        Returns:
            Observations and an empty info.

        Raises:
            InputError: A seed is not a whole number from 0 on, or the mask does not fit.
        """
        if options is not None and not isinstance(options, dict):
            raise InputError("options", f'{{"reset_mask": array}} expected, not {options!r}')
        seeds: list[int | None]
        if isinstance(seed, list | tuple):
            seeds = [checked_seed(one) for one in seed]
        else:
            first = checked_seed(seed)
            seeds = [None if first is None else first + i for i in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise InputError("seed", f"{len(seeds)} given for {self.num_envs} worlds")
        mask: NDArray[np.bool_] | None = (options or {}).get("reset_mask")
        if mask is not None:
            mask = np.asarray(mask)
            if mask.dtype != np.bool_ or mask.shape != (self.num_envs,):
                raise InputError("reset_mask", f"{self.num_envs} booleans expected, one per world")
        for world in range(self.num_envs):
            if mask is None or mask[world]:
                self._engine.seed(world, seeds[world])
        self._engine.reset(mask)
        return self._views.of(slice(None)), {}

    def step(
        self,
        actions: Any,  # noqa: ANN401
    ) -> tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """One decision in all worlds.

        Args:
            actions: One row per world, in `action_space`.

        Returns:
            Observations, rewards, which episodes have ended, which were cut, and the infos of those as gymnasium has
            them.
        """
        buffers = self._engine.buffers
        put(buffers.actions, actions)
        self._engine.step()
        infos: dict[str, Any] = {}
        if buffers.terminals.any() or buffers.truncations.any():
            for info in self._engine.infos():
                row, told = info["row"], public(info)
                if self._mode == "SAME_STEP":
                    told = {"final_obs": self._views.last(row), "final_info": told}
                infos = self._add_info(infos, told, row)
        return (
            self._views.of(slice(None)),
            buffers.rewards.astype(np.float64),
            buffers.terminals.copy(),
            buffers.truncations.copy(),
            infos,
        )

    def close_extras(self, **kwargs: Any) -> None:  # noqa: ANN401
        """Has nothing to close; `kwargs` are not used."""
