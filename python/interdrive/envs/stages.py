"""Scenarios ready to be played: read once, shared by all worlds."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive import _core
from interdrive.batches.plan import scenario_files
from interdrive.config.agent_config import agent_configs, core_agent, drawn_planners
from interdrive.envs.actions import FrenetWeights
from interdrive.envs.history import Episode
from interdrive.envs.traffic import read_traffic
from interdrive.errors import InputError
from interdrive.files import open_scenario, shipped_scenario, shipped_scenarios
from interdrive.planners import Rollout, native_planner
from interdrive.prediction_evaluation.split import read_split
from interdrive.scenario import Scenario
from interdrive.scenario.agents import select
from interdrive.scenario.native import core_road, core_scenario
from interdrive.traffic import Generated, TrafficMaker, without_recorded_traffic

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.config.agent_config import AgentConfig, RunConfig
    from interdrive.config.specs import Resolved
    from interdrive.envs.settings import EnvSettings, Setup
    from interdrive.scenario.agents import Agent

#: So much of the recording is left where an episode may begin [s].
REST = 3.0


@dataclass(frozen=True)
class Start:
    """Where episodes of a scenario may begin.

    Attributes:
        time_step: First time step.
        eligible: Positions of the vehicles that can learn: vehicles that drive then, and planning problems that begin
            later.
        later: Positions of recorded vehicles that enter later; they learn only if they are named.
    """

    time_step: int
    eligible: tuple[int, ...]
    later: tuple[int, ...]


@dataclass(frozen=True)
class Stage:
    """A scenario with everything that is worked out once.

    Attributes:
        scenario: The scenario.
        road: Its roads.
        agents: Vehicles that can learn, sorted by id.
        configs: Planner, view and rules by id, for agents that do not learn.
        core: The core's handle.
        recorded: The core's handle of the scenario.
        starts: Where episodes may begin.
        config: Planners of agents that do not learn.
        reverse: Traffic may back out.
        has_drivers: Agents that do not learn draw drivers, anew for every episode.
        maker: Makes generated traffic, anew for every episode; None without it.
        n_generated: About so many generated vehicles an episode has.
    """

    scenario: Scenario
    road: _core.RoadNetwork
    agents: tuple[Agent, ...]
    configs: Mapping[int, AgentConfig]
    core: _core.Stage
    recorded: _core.Scenario
    starts: tuple[Start, ...]
    config: RunConfig
    reverse: bool
    has_drivers: bool
    maker: TrafficMaker | None = None
    n_generated: int = 0

    @property
    def needs_seed(self) -> bool:
        """Whether episodes differ by their seed."""
        return self.has_drivers or self.maker is not None

    def traffic(self, episode: Episode) -> tuple[Generated, dict[int, AgentConfig]]:
        """The generated traffic of an episode, and its planners, views and rules by id."""
        if self.maker is None:
            return Generated(), {}
        driving = {agent.id for agent in self.agents if self.configs[agent.id].planner.native != "recorded"}
        driving |= {self.agents[place].id for place in episode.learners}
        others = [agent for agent in self.agents if agent.id in driving]
        made = self.maker.made(episode.seed, others, episode.time_step)
        recorded = set(self.scenario.obstacles.ids.tolist())
        own = agent_configs(self.config, {}, {}, {}, made.agents, recorded, episode.seed, made.drivers)[0]
        return made, own

    def generated(self, episode: Episode) -> list[_core.Agent]:
        """The generated vehicles of an episode."""
        made, own = self.traffic(episode)
        planners = {agent.id: _native(own[agent.id].planner, reverse=self.reverse) for agent in made.agents}
        return [core_agent(agent, own[agent.id], planners[agent.id]) for agent in made.agents]

    def drawn(self, seed: int) -> list[tuple[int, _core.Planner]]:
        """Planners of the agents that draw drivers, with their positions, for the seed of an episode."""
        if not self.has_drivers:
            return []
        own = drawn_planners(self.config, self.agents, set(self.scenario.obstacles.ids.tolist()), seed)
        rows = ((place, own[agent.id]) for place, agent in enumerate(self.agents) if agent.id in own)
        return [(place, _native(planner, reverse=self.reverse)) for place, planner in rows]


def stages_of(setup: Setup) -> list[Stage]:
    """The scenarios of an environment in which enough agents can learn.

    Raises:
        InputError: No scenario, no part, or no learners; one line that says why.
    """
    scenarios = _scenarios(setup)
    wanted = setup.learners
    if not isinstance(wanted, str | int) and len(scenarios) != 1:
        raise InputError("learners", f"ids need exactly one scenario, {len(scenarios)} given")
    config, is_alone = read_traffic(setup.traffic, setup.settings.simulation)
    if is_alone:
        scenarios = [without_recorded_traffic(scenario) for scenario in scenarios]
    found = [_stage(scenario, setup, config) for scenario in scenarios]
    if not isinstance(wanted, str | int):
        return [_with_ids(found[0], list(wanted))]
    least = wanted if isinstance(wanted, int) else 1
    most = max(found, key=_largest)
    if _largest(most) < least:
        what = f"{least} vehicles" if least > 1 else "a vehicle"
        why = "; generated traffic leaves only planning problems: see traffic" if is_alone else ""
        raise InputError(
            "learners",
            f"no scenario has {what} that can learn; the most is {_largest(most)} ({most.scenario.name}){why}",
        )
    fit = [_with_at_least(stage, least) for stage in found if _largest(stage) >= least]
    if len(fit) < len(found):
        warnings.warn(
            f"{len(found) - len(fit)} of {len(found)} scenarios have fewer than {least} learners", stacklevel=4
        )
    return fit


def most_learners(stages: Iterable[Stage]) -> int:
    """Largest number of vehicles that can learn at once."""
    return max(_largest(stage) for stage in stages)


def _largest(stage: Stage) -> int:
    return max((len(start.eligible) for start in stage.starts), default=0)


def _with_at_least(stage: Stage, least: int) -> Stage:
    return _with_starts(stage, [start for start in stage.starts if len(start.eligible) >= least])


def _with_starts(stage: Stage, starts: Sequence[Start]) -> Stage:
    return replace(stage, starts=tuple(starts))


def _with_ids(stage: Stage, ids: list[int]) -> Stage:
    """The stage with episodes in which exactly these learn."""
    own = {name: position for position, agent in enumerate(stage.agents) for name in (*agent.names, agent.id)}
    for agent in ids:
        if agent not in own:
            raise InputError("learners", f"{agent} cannot be an agent of {stage.scenario.name}")
    places = tuple(sorted({own[agent] for agent in ids}))
    together = [start for start in stage.starts if set(places) <= set(start.eligible)]
    starts = together or [start for start in stage.starts if set(places) <= {*start.eligible, *start.later}]
    if not starts:
        there = {place for start in stage.starts for place in (*start.eligible, *start.later)}
        missing = [agent for agent in ids if own[agent] not in there] or ids
        said, who = ", ".join(map(str, missing)), "it drives" if len(missing) == 1 else "all of them drive"
        raise InputError(
            "learners", f"{said}: no first step of {stage.scenario.name} from which on {who} for {REST:g} s"
        )
    return _with_starts(stage, [Start(start.time_step, places, ()) for start in starts])


def _scenarios(setup: Setup) -> list[Scenario]:
    given = setup.scenarios
    if not isinstance(given, str | Path | Scenario | Sequence):
        raise InputError("scenarios", f"files, folders, names or scenarios expected, not {given!r}")
    listed = [given] if isinstance(given, str | Path | Scenario) else list(given)
    for one in listed:
        if not isinstance(one, str | Path | Scenario):
            raise InputError("scenarios", f"files, folders, names or scenarios expected, not {one!r}")
    ready = [one for one in listed if isinstance(one, Scenario)]
    named: list[str | Path] = [one for one in listed if not isinstance(one, Scenario)]
    paths: list[Path] = []
    for one in named:
        if str(one) in shipped_scenarios() and not Path(one).exists():
            paths.append(shipped_scenario(str(one)))
            continue
        try:
            paths += [Path(file.path) for file in scenario_files([one])[0]]
        except InputError as error:
            raise InputError("scenarios", f"none found in {one} ({error.message})") from None
    if not ready and not paths:
        raise InputError("scenarios", "none given")
    n = len(ready) + len(paths)
    settings = setup.settings
    paths = [path for path in paths if _belongs(path, settings)]
    ready = [one for one in ready if _belongs(Path(one.name), settings)]
    if not ready and not paths:
        raise InputError("part", f'none of {n} scenarios belongs to "{settings.part}"')
    recording = settings.simulation.recording
    return [*ready, *(open_scenario(path, raw=recording.raw, start=recording.start) for path in paths)]


def _belongs(path: Path, settings: EnvSettings) -> bool:
    """Whether a scenario is of the wanted part: by the file of places, or by the name up to its last "-"."""
    if settings.part == "all":
        return True
    if settings.split is not None:
        place = read_split(settings.split).place_of(path)
        part = "none" if place is None else place.part
        return part == "validation" if settings.part == "test" else part not in ("validation", "none")
    name = path.stem.rpartition("-")[0] or path.stem
    number = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big")
    return (number < settings.test_share * 2**64) == (settings.part == "test")


def _stage(scenario: Scenario, setup: Setup, config: RunConfig) -> Stage:
    simulation = config.settings
    if scenario.sumo is not None:
        raise InputError("scenarios", f"{scenario.name}: SUMO drives its traffic, which environments do not have")
    steps = (setup.settings.decision_seconds or scenario.dt) / scenario.dt
    if abs(steps - round(steps)) > 1e-6 or round(steps) < 1:
        raise InputError(
            "decision_seconds",
            f"{setup.settings.decision_seconds:g} is not a multiple of dt = {scenario.dt:g} ({scenario.name})",
        )
    road = core_road(scenario, simulation.road)
    recorded = core_scenario(scenario, road)
    try:
        agents, _ = select(
            scenario,
            road,
            "all",
            agent_settings=simulation.agents,
            goal_settings=simulation.goal,
            max_steps=simulation.step.steps_at_most(scenario),
            seed=0,
        )
    except InputError:
        agents = []
    configs = _configs(scenario, config, agents)
    handles, planners = [], []
    for agent in agents:
        own = configs[agent.id]
        native = _native(own.planner, reverse=setup.settings.reverse)
        planners.append(None if own.planner.native == "recorded" else native)
        handles.append(core_agent(agent, own, None))
    actions = setup.actions
    learning = native_planner(actions.planner) if isinstance(actions, FrenetWeights) else None
    core = _core.Stage(recorded, handles, planners, learning)
    starts = tuple(_starts(core, scenario, agents, setup.settings))
    has_drivers = bool(drawn_planners(config, agents, set(scenario.obstacles.ids.tolist()), 0))
    stage = Stage(
        scenario,
        road,
        tuple(agents),
        configs,
        core,
        recorded,
        starts,
        config,
        reverse=setup.settings.reverse,
        has_drivers=has_drivers,
    )
    return _with_traffic(stage) if simulation.traffic.is_on and starts else stage


def _with_traffic(stage: Stage) -> Stage:
    """The stage with generated traffic, of which some is made to see whether that works."""
    settings = stage.config.settings
    # Episodes end after as many steps as runs whose agents want to drive for ever.
    most = _core.steps_at_most(settings.step, stage.scenario.obstacles.n_steps, [(0, 10**9)])
    step = replace(settings.step, max_steps=most)
    made = replace(stage, maker=TrafficMaker(stage.scenario, stage.road, settings.traffic, step))
    first = stage.starts[0]
    return replace(made, n_generated=len(made.generated(Episode(0, first.time_step, first.eligible[:1]))))


def _native(chosen: Resolved, *, reverse: bool) -> _core.Planner:
    planner = chosen.make()
    if isinstance(planner, Rollout) and not reverse:
        planner = replace(planner, reverse=False)
    native = native_planner(planner)
    if native is None:
        raise InputError("traffic", f"{chosen.name} is not a native planner")
    return native


def _configs(scenario: Scenario, config: RunConfig, agents: list[Agent]) -> dict[int, AgentConfig]:
    try:
        chosen = agent_configs(config, {}, {}, {}, agents, {agent.id for agent in agents})[0]
        driven = agent_configs(config, {}, {}, {}, agents, set(scenario.obstacles.ids.tolist()))[0]
        # What has no recording to replay is there only if it learns.
        return {i: chosen[i] if chosen[i].planner.native == "recorded" else driven[i] for i in chosen}
    except InputError as error:
        raise error.within("traffic") from None


def _starts(core: _core.Stage, scenario: Scenario, agents: list[Agent], settings: EnvSettings) -> Iterable[Start]:
    is_random = settings.start == "random"
    rest = round(REST / scenario.dt) if is_random else 0
    last = max(0, scenario.obstacles.n_steps - 1 - rest) if is_random else 0
    found = [_start(core, agents, time_step, rest) for time_step in range(last + 1)]
    if not any(start.eligible for start in found) and agents and not is_random:
        # If no learner drives at first: with the first that comes.
        found = [_start(core, agents, min(agent.initial_state.time_step for agent in agents), rest)]
    return (start for start in found if start.eligible or start.later)


def _start(core: _core.Stage, agents: list[Agent], time_step: int, rest: int) -> Start:
    entering = core.later(time_step, rest)
    problems = [place for place in entering if agents[place].origin != "recorded"]
    recorded = [place for place in entering if agents[place].origin == "recorded"]
    return Start(time_step, tuple(sorted([*core.eligible(time_step, rest), *problems])), tuple(recorded))
