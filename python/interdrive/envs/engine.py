"""Many worlds with the arrays that they write: what all environments are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from interdrive import _core
from interdrive.config.specs import resolved_predictor
from interdrive.envs.actions import action_kind
from interdrive.envs.sampling import Uniform
from interdrive.envs.spaces import Views, observation_space
from interdrive.envs.stages import most_learners, stages_of
from interdrive.errors import InputError
from interdrive.predictors import native_predictor
from interdrive.run.assemble import OUTCOME_NAMES

if TYPE_CHECKING:
    from numpy.random import Generator
    from numpy.typing import NDArray

    from interdrive.envs.sampling import Sampler
    from interdrive.envs.settings import Setup

    Info = dict[str, Any]


@dataclass(frozen=True)
class Episode:
    """An episode that was drawn.

    Attributes:
        stage: Position of its scenario.
        time_step: Its first time step.
        learners: Positions of its learners.
    """

    stage: int
    time_step: int
    learners: tuple[int, ...]


def checked_seed(seed: Any) -> int | None:  # noqa: ANN401 - whatever the user gives
    """The seed, or None.

    Raises:
        InputError: It is no whole number, or negative.
    """
    if seed is None:
        return None
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer):
        raise InputError(f"seed must be a whole number, is {seed!r}")
    if seed < 0:
        raise InputError(f"seed must not be negative, is {seed}")
    return int(seed)


class Buffers:
    """Arrays that the core writes, one row per learner; `given` replaces those of the same names."""

    def __init__(
        self,
        rows: int,
        n: int,
        actions: NDArray[Any],
        given: Mapping[str, Any],
        *,
        has_raster: bool,
        keep_final: bool,
    ) -> None:
        """Makes those that are not given."""
        pictures = (rows, *_core.RASTER)
        made: dict[str, NDArray[Any]] = {
            "actions": actions,
            "observations": np.zeros((rows, n), dtype=np.float32),
            "rewards": np.zeros(rows, np.float32),
            "terminals": np.zeros(rows, np.bool_),
            "truncations": np.zeros(rows, np.bool_),
            "masks": np.zeros(rows, np.bool_),
            "outcomes": np.full(rows, -1, np.int8),
            "agent_ids": np.full(rows, -1, np.int64),
            "components": np.zeros((rows, len(_core.REWARDS)), np.float32),
        }
        if has_raster:
            made["raster"] = np.zeros(pictures, np.uint8)
        if keep_final:
            made["final_observations"] = np.zeros((rows, n), np.float32)
        if keep_final and has_raster:
            made["final_raster"] = np.zeros(pictures, np.uint8)
        for name in given:
            if name not in made:
                raise InputError(f"buf.{name}", f"there is no such array; there are {', '.join(made)}")
        self.arrays = {**made, **given}

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - arrays of several types
        """An array by its name."""
        try:
            return self.__dict__["arrays"][name]
        except KeyError:
            raise AttributeError(name) from None


class Engine:
    """Worlds, arrays and what is drawn for them."""

    def __init__(
        self,
        setup: Setup,
        *,
        num_worlds: int,
        autoreset: str,
        slots: int | None = None,
        buf: Mapping[str, Any] | None = None,
        keep_final: bool = False,
        sampler: Sampler | None = None,
    ) -> None:
        """Reads the scenarios and makes the worlds, without episodes."""
        self.setup = setup
        self.stages = stages_of(setup)
        self.kind = action_kind(setup.actions)
        settings = setup.settings
        simulation = settings.simulation
        most = most_learners(self.stages)
        wanted = setup.learners
        if not isinstance(wanted, str):
            most = wanted if isinstance(wanted, int) else len(self.stages[0].starts[0].eligible)
        self.slots = most if slots is None else slots
        if self.slots < 1:
            raise InputError("slots", f"must be at least 1, not {self.slots}")
        predictor = resolved_predictor(setup.predictor, simulation.predictor)
        native = native_predictor(predictor.make(), simulation.predictor, self.stages[0].recorded)
        if native is None or predictor.native == "ground_truth":
            raise InputError("predictor", f"{predictor.name} cannot be used here; use a native one")
        self.worlds = _core.Worlds(
            [stage.core for stage in self.stages],
            actions=(self.kind.name, self.kind.record, self.kind.numbers),
            observation=settings.observation,
            reward=settings.reward,
            step=simulation.step,
            predictor=native,
            horizon=simulation.predictor.horizon,
            decision_seconds=settings.decision_seconds,
            max_seconds=settings.max_seconds,
            time_limit_terminates=settings.time_limit == "termination",
            autoreset=autoreset,
            record=settings.record,
            threads=settings.threads,
            num_worlds=num_worlds,
            slots=self.slots,
        )
        self.num_worlds = num_worlds
        self.observed = self.worlds.observed
        self.rows = num_worlds * self.slots
        n = self.worlds.num_observations
        has_raster = settings.observation.raster
        actions = self.kind.array(self.rows)
        self.buffers = Buffers(self.rows, n, actions, buf or {}, has_raster=has_raster, keep_final=keep_final)
        self.observation_space = observation_space(settings.observation, self.observed)
        self.views = Views(settings.observation, self.buffers.arrays, self.observed, copy=settings.copy)
        self.worlds.bind(**self.buffers.arrays)
        self.sampler: Sampler = sampler or Uniform()
        self.sampler.begin(len(self.stages))
        self._reports = not isinstance(self.sampler, Uniform)
        self.rngs: list[Generator | None] = [None] * num_worlds
        self.episodes: list[Episode | None] = [None] * num_worlds
        self._queued: list[Episode | None] = [None] * num_worlds
        self._autoreset = autoreset

    def seed(self, world: int, seed: int | None) -> None:
        """Seeds the generator of a world; None: from the operating system if it has none yet.

        Raises:
            InputError: The seed is negative.
        """
        checked_seed(seed)
        if seed is not None or self.rngs[world] is None:
            self.rngs[world] = gymnasium.utils.seeding.np_random(seed)[0]
            self._queued[world] = None

    def reset(self, wanted: NDArray[np.bool_] | None = None) -> None:
        """Begins the next episode of the worlds for which it is true, or of all."""
        chosen = np.ones(self.num_worlds, np.bool_) if wanted is None else wanted
        for world in np.flatnonzero(chosen).tolist():
            if self._queued[world] is None:
                self._queue(world)
        self.worlds.reset(chosen.tolist())
        self._refill()

    def step(self) -> None:
        """One decision of all learners, as `buffers.actions` says."""
        self.worlds.step()
        if self._reports:
            self._report()
        self._refill()

    def _refill(self) -> None:
        """Queues an episode for every world that has begun the last one."""
        for world in self.worlds.hungry:
            if self._queued[world] is not None:
                self.episodes[world], self._queued[world] = self._queued[world], None
            if self._autoreset != "disabled" and self.rngs[world] is not None:
                self._queue(world)

    def _queue(self, world: int) -> None:
        rng = self.rngs[world]
        if rng is None:
            raise InputError("step: reset first")
        index = self.sampler.draw(rng)
        stage = self.stages[index]
        start = stage.starts[int(rng.integers(len(stage.starts)))]
        n = len(start.eligible)
        wanted = self.setup.learners
        number = min(self.slots, wanted if isinstance(wanted, int) else n)
        order = rng.permutation(n)
        learners = tuple(sorted(start.eligible[i] for i in order[:number].tolist()))
        self._queued[world] = Episode(index, start.time_step, learners)
        self.worlds.queue(world, index, start.time_step, list(learners))

    def _report(self) -> None:
        by_world: dict[int, list[Info]] = {}
        for info in self.infos():
            by_world.setdefault(info["row"] // self.slots, []).append(info)
        for infos in by_world.values():
            outcomes = [info["outcome"] for info in infos]
            self.sampler.ended(infos[0]["stage"], outcomes, [info["components"] for info in infos])

    def infos(self) -> list[Info]:
        """What is known about the learners that have ended in the last call, with `row` and `stage`."""
        found = []
        for (row, agent, stage, outcome, truncated, partner, off_road, speed), sums in self.worlds.ended():
            steps, seconds, distance, progress, total, components = sums
            name = OUTCOME_NAMES[outcome]
            found.append(
                {
                    "row": row,
                    "stage": stage,
                    "truncated": truncated,
                    "outcome": name,
                    "outcome_code": outcome,
                    "is_success": name == "goal_reached",
                    "agent_id": agent,
                    "scenario": self.stages[stage].scenario.name,
                    "seconds": seconds,
                    "steps": steps,
                    "distance": distance,
                    "progress": progress,
                    "return": total,
                    "components": dict(zip(_core.REWARDS, components, strict=True)),
                    "partner_id": partner,
                    "off_road": off_road,
                    "impact_speed": speed,
                }
            )
        return found

    def update(self, changes: Mapping[str, Any]) -> None:
        """Changes rewards or traffic from the next episode on.

        Raises:
            InputError: Another setting, or a value that does not fit.
        """
        for name in changes:
            if name not in {"traffic", "reward"} and not name.startswith("reward."):
                raise InputError(name, "cannot be changed; traffic and reward.* can")
        setup = self.setup.updated(changes)
        if "traffic" in changes:
            stages = stages_of(setup)
            self.worlds.set_stages([stage.core for stage in stages])
            self.stages = stages
        self.worlds.set_rewards(setup.settings.reward)
        self.setup = setup


def public(info: Info) -> Info:
    """The info for users."""
    return {name: value for name, value in info.items() if name not in ("row", "stage", "truncated")}
