"""Any subset of the agents learns together: a `pettingzoo.ParallelEnv`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.envs.actions import put
from interdrive.envs.engine import Engine, public
from interdrive.envs.recording import RecordedDrives
from interdrive.envs.settings import setup_of
from interdrive.envs.single import no_rendering
from interdrive.envs.spaces import observation_space
from interdrive.errors import InputError, MissingExtraError

try:
    from pettingzoo import ParallelEnv
except ImportError as error:
    raise MissingExtraError('interdrive.envs needs pettingzoo: pip install "interdrive[rl]"') from error

if TYPE_CHECKING:
    import gymnasium
    from numpy.typing import NDArray


class ParallelDriveEnv(RecordedDrives, ParallelEnv):  # type: ignore[misc]
    """Several vehicles learn together; `possible_agents` are agent_0, agent_1, ... by ascending CommonRoad id.

    Attributes:
        possible_agents: Names of the most agents that learn at once.
        agents: Names of the driving agents. Agents whose vehicles enter later join at that step.
        agent_ids: CommonRoad ids of all learners of this episode by name, including learners that enter later. They are
            not in the infos of a reset: if there are any, TorchRL takes nothing but numbers.

    Args:
        render_mode: None.
        sampler: Draws the scenarios.
        **settings: As for `DriveEnv`; `learners` may be any number, "all" (the default) or ids of one scenario.

    Raises:
        InputError: The input cannot be used; one line states why.
    """

    metadata = {"name": "interdrive", "is_parallelizable": True, "render_modes": []}  # noqa: RUF012

    def __init__(self, render_mode: str | None = None, sampler: Any = None, **settings: Any) -> None:  # noqa: ANN401
        no_rendering(render_mode)
        setup = setup_of(settings, learners="all")
        self.render_mode = None
        self._engine = Engine(setup, num_worlds=1, autoreset="disabled", sampler=sampler)
        self._views = self._engine.views
        self.possible_agents = [f"agent_{i}" for i in range(self._engine.slots)]
        self._row = {name: row for row, name in enumerate(self.possible_agents)}
        self.agents: list[str] = []
        self.agent_ids: dict[str, int] = {}
        space = self._engine.kind.space
        # One object per agent: sampling from one does not change the samples of another.
        self._action_spaces = {name: type(space)(**_arguments(space)) for name in self.possible_agents}
        self._observation_spaces = {
            name: observation_space(setup.settings.observation, self._engine.observed) for name in self.possible_agents
        }

    @property
    def observation_spaces(self) -> dict[str, gymnasium.Space[Any]]:
        """Spaces of observations by agent."""
        return self._observation_spaces

    @property
    def action_spaces(self) -> dict[str, gymnasium.Space[Any]]:
        """Spaces of actions by agent."""
        return self._action_spaces

    def observation_space(self, agent: str) -> gymnasium.Space[Any]:
        """Space of the observations of an agent, the same object at each call."""
        return self._observation_spaces[agent]

    def action_space(self, agent: str) -> gymnasium.Space[Any]:
        """Space of the actions of an agent, the same object at each call."""
        return self._action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Begins an episode.

        Args:
            seed: Of scenario, first step and learners; None: goes on with the numbers of the last seed.
            options: Not used.

        Returns:
            Observations and empty infos by agent.
        """
        self._engine.seed(0, seed)
        self._engine.reset()
        buffers = self._engine.buffers
        self.agents = [name for name, row in self._row.items() if buffers.masks[row]]
        ids = buffers.agent_ids
        self.agent_ids = {name: int(ids[row]) for name, row in self._row.items() if ids[row] >= 0}
        return self._observed(self.agents), {name: {} for name in self.agents}

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """One decision of all agents.

        Args:
            actions: By name of the agent, one for each in `agents`; those of agents that have ended or have not entered
                yet are ignored.

        Returns:
            Observations, rewards, terminations, truncations and infos by agent. Agents that end in this step are in
            them, then they leave `agents`. Agents that enter are in them with the observation of their first state and
            reward 0. If no agent is left and others are still to enter, the step lasts until the next one enters.

        Raises:
            InputError: There was no `reset`, an agent has no action, or a name or an action does not fit.
        """
        buffers = self._engine.buffers
        if not self.agents:
            raise InputError("step: reset first")
        if not isinstance(actions, Mapping):
            raise InputError("actions", f"one by name of each agent expected, not {actions!r}")
        for name in actions:
            if name not in self._row:
                raise InputError("actions", f'"{name}" is not one of the {len(self._row)} possible agents')
        for name in self.agents:
            if name not in actions:
                raise InputError("actions", f'there is none for "{name}"')
            put(buffers.actions[self._row[name], ...], actions[name])
        self._engine.step()
        told = [name for name, row in self._row.items() if buffers.masks[row] or name in self.agents]
        infos: dict[str, dict[str, Any]] = {name: {} for name in told}
        for info in self._engine.infos():
            infos[self.possible_agents[info["row"]]] = public(info)
        rows = [(name, self._row[name]) for name in told]
        self.agents = [name for name, row in rows if buffers.masks[row]]
        return (
            self._observed(told),
            {name: float(buffers.rewards[row]) for name, row in rows},
            {name: bool(buffers.terminals[row]) for name, row in rows},
            {name: bool(buffers.truncations[row]) for name, row in rows},
            infos,
        )

    def state(self) -> NDArray[np.float32]:
        """All observed numbers in the order of `possible_agents`, without pictures; zeros where none drives."""
        masks = self._engine.buffers.masks
        whole: NDArray[np.float32] = np.where(masks[:, None], self._engine.buffers.observations, 0.0).ravel()
        return whole

    def _observed(self, names: list[str]) -> dict[str, Any]:
        return {name: self._views.of(self._row[name]) for name in names}


def _arguments(space: Any) -> dict[str, Any]:  # noqa: ANN401 - a box or a discrete space
    if hasattr(space, "n"):
        return {"n": int(space.n)}
    return {"low": space.low, "high": space.high, "dtype": space.dtype}


def parallel_env(**settings: Any) -> ParallelDriveEnv:  # noqa: ANN401 - settings of many types
    """A `ParallelDriveEnv` with these `settings`, by the name that PettingZoo's environments have."""
    return ParallelDriveEnv(**settings)
