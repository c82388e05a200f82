"""What starts a run: scenario, road, agents with their planners and views, generated traffic."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

from interdrive import _core
from interdrive.config.agent_config import AgentConfig, agent_configs, run_config, stored, temperament
from interdrive.config.binding import flatten
from interdrive.config.schema import RecordingSettings, SimulationSettings, settings_of, with_start, with_traffic
from interdrive.config.specs import Resolved, read_predictor
from interdrive.errors import InputError
from interdrive.files import open_scenario
from interdrive.scenario import Scenario, SourceOptions
from interdrive.scenario.agents import Agent, normalized, select
from interdrive.scenario.native import core_road, core_scenario
from interdrive.traffic import Generated, TrafficMaker, entered_at, map_alone

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence, Set

    from interdrive.config.agent_config import PlannersSpec, RulesSpec, V2xSpec, ViewsSpec
    from interdrive.config.schema import SettingsSpec, TrafficSpec
    from interdrive.config.specs import PredictorSpec
    from interdrive.files import ScenarioSpec
    from interdrive.run import RunSettings
    from interdrive.run.assemble import FirstState


@dataclass(frozen=True)
class Preparation:
    """What a run is made of; none of it changes while the run is stepped.

    Attributes:
        scenario: The scenario; without its vehicles if only its map is wanted.
        settings: All settings.
        seed: Of the choice of agents and of generated traffic.
        road: The core's road network.
        core_scenario: The core's scenario.
        agents_wanted: The choice of agents.
        agents: The agents by ids, generated ones among them.
        traffic: Generated traffic.
        configs: Planner, view and rules by agent.
        predictor: Of all agents.
        usual_planner: The planner of agents for whom none is stated.
        notes: What users should know about scenario and agents, one line each.
        steps_without_agents: Time steps of a run that has none.
    """

    scenario: Scenario
    settings: SimulationSettings
    seed: int
    road: _core.RoadNetwork
    core_scenario: _core.Scenario
    agents_wanted: str | int | list[int]
    agents: list[Agent]
    traffic: Generated
    configs: Mapping[int, AgentConfig]
    predictor: Resolved
    usual_planner: Resolved
    notes: tuple[str, ...]
    steps_without_agents: int

    @cached_property
    def planner_names(self) -> dict[int, str]:
        """Names of planners by agent."""
        return {agent.id: self.configs[agent.id].planner.name for agent in self.agents}

    @cached_property
    def areas(self) -> Mapping[str, Any]:
        """Ground that several ways share, as `_core.Scenario.junctions` tells."""
        return self.core_scenario.junctions()

    @cached_property
    def waiting(self) -> list[int]:
        """Ids of the agents that may enter later than stated: generated ones; with `step.entry_wait` others, too."""
        waits = self.settings.step.entry_wait > 0.0
        return [a.id for a in self.agents if a.origin == "generated" or (waits and not a.replays_before)]

    @property
    def stated(self) -> dict[int, AgentConfig]:
        """The configs of agents that are not generated."""
        return {i: config for i, config in self.configs.items() if i not in self.traffic.drivers}

    def as_entered(self, firsts: Mapping[int, FirstState], wanted: Set[int] | None = None) -> list[Agent]:
        """The agents; those that have waited with the time and the speed at which they entered.

        Args:
            firsts: When and how those that may have waited (`waiting`) were there for the first time.
            wanted: Ids; None: all agents.
        """
        return [
            entered_at(agent, *firsts[agent.id]) if agent.id in firsts else agent
            for agent in self.agents
            if wanted is None or agent.id in wanted
        ]

    def repeatable_settings(self, threads: int) -> RunSettings:
        """All that is needed to repeat the run, as plain values."""
        return {
            "agents": self.agents_wanted,
            **stored(self.stated, self.predictor, self.settings, self.usual_planner),
            "seed": self.seed,
            "threads": threads,
            "settings": flatten(self.settings),
        }


def prepared(
    scenario: ScenarioSpec,
    *,
    agents: str | int | Sequence[int],
    planner: PlannersSpec,
    predictor: PredictorSpec,
    views: ViewsSpec | None,
    rules: RulesSpec | None,
    v2x: V2xSpec | None,
    settings: SettingsSpec | None,
    traffic: TrafficSpec | None,
    start: int | None,
    seed: int,
    reachable: Callable[[Scenario, SimulationSettings], list[int]],
    on_setup: Callable[[str, int, int], None],
) -> Preparation:
    """Opens the scenario, and chooses and makes its agents.

    The arguments are those of `Simulation`; `reachable` finds the agents where these are to be "reachable".

    Raises:
        InputError: The input cannot be used; one line states why.
    """
    if not 0 <= seed < 2**64:
        raise InputError(f"the seed must be from 0 to 2^64 - 1, is {seed}")
    config = run_config(with_start(with_traffic(settings_of(settings), traffic), start), planner)
    predictor_config = read_predictor(predictor, config.settings.predictor)
    recording, of_files = config.settings.recording, config.settings.source
    opened = open_scenario(scenario, raw=recording.raw, start=recording.start, source=of_files)
    if opened.source is not None:
        of_files = SourceOptions.read(dict(opened.source.options))
    own = replace(config.settings, recording=RecordingSettings(raw=opened.raw, start=opened.start), source=of_files)
    wanted = normalized(agents)
    if own.traffic.is_on and opened.sumo is not None:
        raise InputError(f"{opened.name}: SUMO makes its traffic; leave out --traffic")
    if own.traffic.is_on and wanted == 0:
        opened = map_alone(opened)
    road = core_road(opened, own.road)
    native = core_scenario(opened, road)
    notes: list[str] = []
    chosen: list[Agent] = []
    if _has_own_agents(opened, own, wanted):
        chosen, notes = select(
            opened,
            road,
            reachable(opened, own) if wanted == "reachable" else wanted,
            agent_settings=own.agents,
            goal_settings=own.goal,
            max_steps=own.step.steps_at_most(opened),
            seed=seed,
            temperament=temperament(config, seed),
        )
    made = Generated()
    if own.traffic.is_on:
        maker = TrafficMaker(opened, road, own.traffic, own.step)
        made = maker.made(seed, chosen, on_vehicle=partial(on_setup, "making traffic"))
    everybody = sorted([*chosen, *made.agents], key=lambda agent: agent.id)
    steps_without_agents = 0 if everybody else own.step.steps_without_agents(opened, own.traffic)
    if not everybody and not steps_without_agents:
        raise InputError(f"{opened.name}: has no traffic; without agents nothing happens")
    recorded = set(opened.obstacles.ids.tolist())
    configs, more = agent_configs(config, views or {}, rules or {}, v2x or {}, everybody, recorded, seed, made.drivers)
    return Preparation(
        scenario=opened,
        settings=own,
        seed=seed,
        road=road,
        core_scenario=native,
        agents_wanted=wanted,
        agents=everybody,
        traffic=made,
        configs=configs,
        predictor=predictor_config,
        usual_planner=config.default.planner,
        notes=(*opened.notes, *notes, *more),
        steps_without_agents=steps_without_agents,
    )


def _has_own_agents(scenario: Scenario, settings: SimulationSettings, wanted: str | int | list[int]) -> bool:
    """Whether the file can have agents, and they are wanted."""
    has_any = bool(scenario.planning_problems) or not scenario.obstacles.is_static.all()
    is_alone = settings.traffic.is_on and wanted == "all"
    return wanted != 0 and (has_any or not is_alone)
