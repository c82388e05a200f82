"""Stable-Baselines3: its vector environment, driven by the native one.

from stable_baselines3 import PPO
from interdrive.envs.sb3 import DriveVecEnv

PPO("MlpPolicy", DriveVecEnv(16, scenarios="t_junction")).learn(100_000)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.envs.actions import put
from interdrive.envs.engine import Drives, Engine, checked_count, public
from interdrive.envs.settings import setup_of
from interdrive.envs.single import only_one
from interdrive.errors import InputError, MissingExtraError

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise MissingExtraError("interdrive.envs.sb3 needs stable-baselines3: pip install stable-baselines3") from error

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from interdrive.envs.sampling import Sampler


class DriveVecEnv(Drives, VecEnv):  # type: ignore[misc]
    """Many worlds with one learner each, as Stable-Baselines3 takes them; world i equals a `DriveEnv` with seed + i.

    A world begins anew in the step in which its learner ends. The info of that world then has, besides what is in the
    info of a `DriveEnv`, `terminal_observation` and `TimeLimit.truncated`; all others are empty. Wrap it in a
    `VecMonitor` for the statistics that algorithms log.

    Args:
        num_envs: Number of worlds.
        sampler: Draws the scenarios.
        **settings: As for `DriveEnv`.

    Raises:
        InputError: The input cannot be used; one line states why.
    """

    def __init__(self, num_envs: int = 1, sampler: Sampler | None = None, **settings: Any) -> None:  # noqa: ANN401
        setup = setup_of(settings, learners=1)
        only_one(setup.learners, "DriveVecEnv")
        num_envs = checked_count("num_envs", num_envs)
        self._engine = Engine(setup, num_worlds=num_envs, autoreset="same_step", keep_final=True, sampler=sampler)
        self._views = self._engine.views
        # Asked for by the constructor of the base class.
        self.render_mode = None
        super().__init__(num_envs, self._engine.observation_space, self._engine.kind.space)

    def reset(self) -> Any:  # noqa: ANN401 - an array or a dict of them
        """Begins an episode in all worlds, with the seeds of `seed()` if that was called since the last reset.

        Returns:
            Observations.
        """
        for world, seed in enumerate(self._seeds):
            self._engine.seed(world, seed)
        self._engine.reset()
        self._reset_seeds()
        self._reset_options()
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        return self._views.of(slice(None), copy=True)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Takes the actions of the next step."""
        put(self._engine.buffers.actions, actions)

    def step_wait(self) -> tuple[Any, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """One decision in all worlds.

        Returns:
            Observations, rewards, whether the episodes are over, and infos.
        """
        self._engine.step()
        buffers = self._engine.buffers
        dones: NDArray[np.bool_] = buffers.terminals | buffers.truncations
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if dones.any():
            for info in self._engine.infos():
                row = info["row"]
                infos[row] = {
                    **public(info),
                    "terminal_observation": self._views.last(row),
                    "TimeLimit.truncated": bool(buffers.truncations[row]),
                }
        return self._views.of(slice(None), copy=True), buffers.rewards.copy(), dones, infos

    def close(self) -> None:
        """Has nothing to close."""

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """An attribute of this object, once per world."""
        value = getattr(self, attr_name)
        return [value for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:  # noqa: ANN401
        """Is refused: all worlds share their settings.

        Raises:
            InputError: Always.
        """
        raise InputError(attr_name, "cannot be set in single worlds; update() changes all of them")

    def env_method(
        self,
        method_name: str,
        *method_args: Any,  # noqa: ANN401
        indices: int | Iterable[int] | None = None,
        **method_kwargs: Any,  # noqa: ANN401
    ) -> list[Any]:
        """Calls a method of this object, which holds for all worlds, once.

        Raises:
            InputError: Only some worlds are meant.
        """
        if len(list(self._get_indices(indices))) != self.num_envs:
            raise InputError(method_name, "cannot be called for single worlds")
        value = getattr(self, method_name)(*method_args, **method_kwargs)
        return [value for _ in range(self.num_envs)]

    def env_is_wrapped(self, wrapper_class: type, indices: int | Iterable[int] | None = None) -> Sequence[bool]:
        """Worlds are not wrapped."""
        return [False for _ in self._get_indices(indices)]
