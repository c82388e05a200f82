"""One learner: a `gymnasium.Env`."""

from __future__ import annotations

from typing import Any

import gymnasium

from interdrive.envs.actions import put
from interdrive.envs.engine import Engine, checked_seed, public
from interdrive.envs.recording import RecordedDrives
from interdrive.envs.settings import setup_of
from interdrive.errors import InputError


def only_one(learners: object, name: str) -> None:
    """Refuses more than one learner.

    Raises:
        InputError: There are more.
    """
    n = learners if isinstance(learners, int | str) else len(learners) if isinstance(learners, list | tuple) else 1
    if n != 1:
        raise InputError("learners", f"{name} has one, {n} given; use parallel_env")


def no_rendering(render_mode: str | None) -> None:
    """Refuses to render.

    Raises:
        InputError: A mode is given.
    """
    if render_mode is not None:
        raise InputError("render_mode", f'"{render_mode}" is not offered; use run()')


class DriveEnv(RecordedDrives, gymnasium.Env[Any, Any]):
    """One vehicle learns; all others replay their recording or plan.

    An episode begins when the vehicle enters, where the others are by then.

    Args:
        render_mode: None; pictures come from `run()`.
        **settings: `scenarios`, `learners` (1 or a list of one id), `traffic`, `predictor`, `actions`, and the fields
            of `EnvSettings`; nested ones by dotted names, such as `**{"reward.collision": -2.0}`.

    Raises:
        InputError: The input cannot be used; one line states why.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - as gymnasium declares it

    def __init__(self, render_mode: str | None = None, **settings: Any) -> None:  # noqa: ANN401 - settings of many types
        no_rendering(render_mode)
        setup = setup_of(settings, learners=1)
        only_one(setup.learners, "DriveEnv")
        self.render_mode = None
        self._engine = Engine(setup, num_worlds=1, autoreset="disabled")
        self._views = self._engine.views
        self.observation_space = self._engine.observation_space
        self.action_space = self._engine.kind.space
        buffers = self._engine.buffers
        self._actions = buffers.actions
        self._rewards, self._ends, self._cuts = buffers.rewards, buffers.terminals, buffers.truncations

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins an episode.

        Args:
            seed: Of scenario, first step and learner; None: goes on with the numbers of the last seed.
            options: Not used.

        Returns:
            Observation and an empty info.
        """
        super().reset(seed=checked_seed(seed))
        self._engine.rngs[0] = self.np_random
        self._engine.reset()
        return self._views.of(0), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:  # noqa: ANN401 - an array or a number
        """Takes a decision.

        Args:
            action: In `action_space`: an array of numbers from -1 to 1, or the number of a choice.

        Returns:
            Observation, reward, whether the episode has ended, whether it was cut, and the info, empty until then.
        """
        put(self._actions[0, ...], action)  # a view even if an action is one number
        self._engine.step()
        observation = self._views.of(0)
        ended, cut = bool(self._ends[0]), bool(self._cuts[0])
        info = public(self._engine.infos()[0]) if ended or cut else {}
        return observation, float(self._rewards[0]), ended, cut, info
