"""Many worlds with the arrays that they write: what all environments are made of."""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import deepcopy
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from interdrive import _core
from interdrive.config.specs import read_predictor
from interdrive.envs.actions import action_kind
from interdrive.envs.history import Episode, History
from interdrive.envs.sampling import Sampler, Uniform
from interdrive.envs.settings import DECISION_SECONDS
from interdrive.envs.spaces import Views, observation_space
from interdrive.envs.stages import most_learners, stages_of
from interdrive.errors import InputError
from interdrive.predictors import native_predictor
from interdrive.run.assemble import OUTCOME_NAMES
from interdrive.scenario.native import MEMORY_SHARE, free_memory

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.random import Generator
    from numpy.typing import NDArray

    from interdrive.envs.settings import Setup
    from interdrive.envs.stages import Stage

    Info = dict[str, Any]

#: Most worlds of an environment, and most rows of a world.
COUNT_MAX = 1_000_000
#: Seeds of drivers and of generated traffic are below this.
_SEEDS = 2**32
#: Memory that a world needs per participant, of which states and plans are kept [bytes]; 6.5 kB measured in `town`.
_PARTICIPANT_SIZE = 8_000
#: And per generated vehicle, of this episode and of the next one, with their ways [bytes].
_GENERATED_SIZE = 40_000


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


def checked_count(name: str, count: Any) -> int:  # noqa: ANN401 - whatever the user gives
    """A number of worlds or rows.

    Raises:
        InputError: It is no whole number, or none from 1 to `COUNT_MAX`.
    """
    if isinstance(count, bool) or not isinstance(count, int | np.integer):
        raise InputError(name, f"must be a whole number, is {count!r}")
    if not 1 <= count <= COUNT_MAX:
        raise InputError(name, f"must be at least 1 and at most {COUNT_MAX}, not {count}")
    return int(count)


def _require_memory(n_worlds: int, slots: int, n_observations: int, pictures: bool, stages: Sequence[Stage]) -> None:
    """Refuses worlds that would fill the memory.

    Raises:
        InputError: They need more than `MEMORY_SHARE` of what is free.
    """
    most = max(
        (len(stage.scenario.obstacles.ids) + len(stage.agents)) * _PARTICIPANT_SIZE
        + stage.n_generated * _GENERATED_SIZE
        for stage in stages
    )
    row = 4 * n_observations + (math.prod(_core.RASTER) if pictures else 0)
    needed, free = n_worlds * (most + 2 * slots * row), free_memory()
    if needed > MEMORY_SHARE * free:
        raise InputError(
            f"{n_worlds} worlds with {slots} rows each need about {needed / 2**30:.1f} GiB; "
            f"{free / 2**30:.1f} GiB are free"
        )


class Buffers:
    """Arrays that the core writes, one row per learner; `given` replaces those of the same names."""

    def __init__(
        self, rows: int, n: int, actions: NDArray[Any], given: Mapping[str, Any], *, has_raster: bool, keep_final: bool
    ) -> None:
        """Makes the arrays that are not given."""
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
        if not isinstance(given, Mapping):
            raise InputError("buf", f"arrays by name expected, not {type(given).__name__}")
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
    """Worlds, arrays and what is drawn for them.

    Copies, also in other processes, go on by themselves, to the same bits. `copy.deepcopy` copies the worlds as they
    are; a pickle holds what was done since the last reset of all worlds, which is done again when it is loaded.
    """

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
        self._made_with = {"num_worlds": num_worlds, "autoreset": autoreset, "slots": slots, "keep_final": keep_final}
        self.first_setup = setup
        self.history = History()
        self.stages = stages_of(setup)
        self.kind = action_kind(setup.actions)
        settings = setup.settings
        simulation = settings.simulation
        most = most_learners(self.stages)
        wanted = setup.learners
        if not isinstance(wanted, str):
            most = wanted if isinstance(wanted, int) else len(self.stages[0].starts[0].eligible)
        self.slots = most if slots is None else slots
        checked_count("slots", self.slots)
        if sampler is not None and not isinstance(sampler, Sampler):
            raise InputError("sampler", f"{type(sampler).__name__} has no begin, draw and ended")
        predictor = read_predictor(setup.predictor, simulation.predictor)
        native = native_predictor(predictor.make(), simulation.predictor, self.stages[0].recorded)
        if native is None or predictor.native == "ground_truth":
            raise InputError("predictor", f"{predictor.name} cannot be used here; use a native one")
        layout = _core.observation_blocks(settings.observation, [])
        n_observed = sum(max(rows, 1) * columns for _, rows, columns in layout)
        _require_memory(num_worlds, self.slots, n_observed, settings.observation.raster, self.stages)
        self.worlds = _core.Worlds(
            [stage.core for stage in self.stages],
            actions=(self.kind.name, self.kind.record, self.kind.numbers),
            observation=settings.observation,
            reward=settings.reward,
            step=simulation.step,
            predictor=native,
            horizon=simulation.predictor.horizon,
            decision_seconds=settings.decision_seconds or DECISION_SECONDS,
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
        self.buffers = Buffers(
            self.rows, n, actions, {} if buf is None else buf, has_raster=has_raster, keep_final=keep_final
        )
        self.observation_space = observation_space(settings.observation, self.observed)
        self.views = Views(settings.observation, self.buffers.arrays, self.observed, copy=settings.copy)
        self.worlds.bind(**self.buffers.arrays)
        self.sampler: Sampler = sampler or Uniform()
        self.sampler.begin(len(self.stages))
        self._reports = not isinstance(self.sampler, Uniform)
        self.rngs: list[Generator | None] = [None] * num_worlds
        self.episodes: list[Episode | None] = [None] * num_worlds
        self.queued: list[Episode | None] = [None] * num_worlds
        self._autoreset = autoreset

    def seed(self, world: int, seed: int | None) -> None:
        """Seeds the generator of a world; None: from the operating system if it has none yet.

        Raises:
            InputError: The seed is negative.
        """
        checked_seed(seed)
        if seed is not None or self.rngs[world] is None:
            self.rngs[world] = gymnasium.utils.seeding.np_random(seed)[0]
            self.queued[world] = None

    def reset(self, wanted: NDArray[np.bool_] | None = None) -> None:
        """Begins the next episode of the worlds for which it is true, or of all."""
        chosen = np.ones(self.num_worlds, np.bool_) if wanted is None else wanted
        self.history.reset(self, chosen)
        for world in np.flatnonzero(chosen).tolist():
            if self.queued[world] is None:
                self._queue(world)
        self.worlds.reset(chosen.tolist())
        self._refill()

    def step(self) -> None:
        """One decision of all learners, as `buffers.actions` says."""
        self.worlds.step()
        self.history.step(self.buffers.actions)
        if self._reports:
            self._report()
        self._refill()

    def _refill(self) -> None:
        """Queues an episode for every world that has begun the last one."""
        for world in self.worlds.hungry:
            if self.queued[world] is not None:
                self.episodes[world], self.queued[world] = self.queued[world], None
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
        # Without drivers and generated traffic nothing more is drawn.
        seed = int(rng.integers(_SEEDS)) if stage.needs_seed else 0
        self.put(world, Episode(index, start.time_step, learners, seed))

    def put(self, world: int, episode: Episode | None) -> None:
        """Makes an episode the next one of a world."""
        self.queued[world] = episode
        if episode is not None:
            stage = self.stages[episode.stage]
            own, generated = stage.drawn(episode.seed), stage.generated(episode)
            self.worlds.queue(world, episode.stage, episode.time_step, list(episode.learners), own, generated)

    def _redraw(self) -> None:
        """Gives queued episodes the planners of other traffic."""
        for world, episode in enumerate(self.queued):
            if episode is not None and episode.stage < len(self.stages):
                self.put(world, episode)

    def __deepcopy__(self, memo: dict[int, Any]) -> Engine:
        """A copy of worlds, arrays and generators; scenarios are shared, being read-only."""
        other = object.__new__(Engine)
        memo[id(self)] = other
        shared = {name: getattr(self, name) for name in ("setup", "stages", "_made_with", "first_setup")}
        memo[id(self.history)] = self.history.copy()
        worlds = self.worlds.copy()
        memo.update({id(value): value for value in shared.values()})
        memo[id(self.worlds)] = worlds
        for name, value in vars(self).items():
            setattr(other, name, deepcopy(value, memo))
        worlds.bind(**other.buffers.arrays)
        return other

    def __reduce__(self) -> tuple[Any, ...]:
        """What was done to it, and the arrays, which other objects may share."""
        self.history.check()
        parts = (self.first_setup, self._made_with, self.buffers.arrays, self.history)
        return _repeated, parts, {"rngs": self.rngs, "sampler": self.sampler}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Generators that other objects may share."""
        self.rngs, self.sampler = state["rngs"], state["sampler"]

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
            if [_ids(stage) for stage in stages] != [_ids(stage) for stage in self.stages]:
                raise InputError(
                    "traffic",
                    "recorded vehicles cannot come or go; make another environment, or keep them: recorded,...",
                )
            self.worlds.set_stages([stage.core for stage in stages])
            needed_seeds = any(stage.needs_seed for stage in self.stages)
            self.stages = stages
            if needed_seeds or any(stage.needs_seed for stage in stages):
                self._redraw()
        self.worlds.set_rewards(setup.settings.reward)
        self.setup = setup
        self.history.update(dict(changes))


def _ids(stage: Stage) -> list[int]:
    return [agent.id for agent in stage.agents]


def _repeated(setup: Setup, made_with: dict[str, Any], arrays: dict[str, NDArray[Any]], history: History) -> Engine:
    engine = Engine(setup, buf=arrays, **made_with)
    history.repeat(engine)
    return engine


def public(info: Info) -> Info:
    """The info for users."""
    return {name: value for name, value in info.items() if name not in ("row", "stage", "truncated")}


class Drives:
    """What every environment offers, however many worlds it has."""

    _engine: Engine

    def update(self, **changes: Any) -> None:  # noqa: ANN401 - settings of many types
        """Changes `traffic` or rewards from the next episode on; spaces never change.

        Args:
            **changes: `traffic` or `reward.NAME`, for instance `**{"reward.collision": -2.0}`.

        Raises:
            InputError: Another name, or a value that does not fit.
        """
        self._engine.update(changes)
