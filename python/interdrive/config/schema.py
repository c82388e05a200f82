"""All settings of a run besides its agents and planners: views, steps of the world, extent of the road."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from interdrive import _core
from interdrive.config.binding import Setting, bind, flatten
from interdrive.config.plugins import read_choice
from interdrive.errors import InputError, check_between
from interdrive.native_settings import CoreStepSettings, RoadSettings, RulesSettings, V2xSettings, ViewSettings
from interdrive.planners import PlannerSettings
from interdrive.predictors import PredictorSettings
from interdrive.scenario import SourceOptions
from interdrive.scenario.agent_settings import AgentSettings, GoalSettings
from interdrive.scenario.limits import LARGEST_TIME_STEP, MOST_STEPS
from interdrive.sumo.settings import SumoSettings
from interdrive.traffic.settings import TrafficSettings

if TYPE_CHECKING:
    from interdrive.scenario import Scenario


@dataclass(frozen=True)
class StepSettings(CoreStepSettings):
    """Steps of the world.

    Attributes:
        planner_timeout_s: Time limit per plan of a planner in Python; inf: no limit. With a limit, outcomes depend on
            the speed of the machine.
        duration: How long a run without agents takes, at most 1000000 time steps. 0: until the recording or the
            scenario of SUMO ends. With generated traffic `traffic.duration` counts in its place. Between 0 and 100000.
    """

    planner_timeout_s: Annotated[float, "s"] = math.inf
    duration: Annotated[float, "s"] = 0.0

    def __post_init__(self) -> None:
        """Checks the ranges."""
        super().__post_init__()
        check_between("duration", self.duration, 0.0, 1e5)
        if not self.planner_timeout_s > 0:
            raise InputError("planner_timeout_s", f"must be positive (inf: no limit), not {self.planner_timeout_s}")

    def steps_at_most(self, scenario: Scenario) -> int:
        """Number of time steps after which a run of the scenario ends."""
        problems = [
            (problem.initial_state.time_step, max(goal.time_step[1] for goal in problem.goal))
            for problem in scenario.planning_problems
            if problem.goal
        ]
        return _core.steps_at_most(self, scenario.obstacles.n_steps, problems)

    def steps_without_agents(self, scenario: Scenario, traffic: TrafficSettings) -> int:
        """Number of time steps of a run that has no agents.

        Raises:
            InputError: There are too many.
        """
        seconds = traffic.duration if traffic.is_on else self.duration
        if seconds > 0.0:
            found = math.ceil(seconds / scenario.dt - 1e-9)
        elif scenario.sumo is not None:
            found = scenario.sumo.n_steps
        else:
            found = 0 if scenario.obstacles.is_static.all() else scenario.obstacles.n_steps - 1
        found = min(found, self.max_steps or found)
        if found > MOST_STEPS:
            stated = f"{seconds:g} s are" if seconds > 0.0 else f"{scenario.name} takes"
            most = MOST_STEPS * scenario.dt
            raise InputError(
                "step.duration", f"{stated} more than {MOST_STEPS} time steps; set it to at most {most:g} s"
            )
        return found


@dataclass(frozen=True)
class RecordSettings:
    """Records of a run besides states and plans.

    Attributes:
        views: Keep the visibility intervals (`Run.views`, views.parquet).
        predictions: Keep the predictions that agents planned with, at intervals of 0.5 s (`Run.predictions`,
            predictions.parquet).
        candidates: Number of sampled candidates to keep per plan (`Run.candidates`, candidates.parquet): the chosen
            one, then others by ascending cost; 0: none. All candidates are then evaluated, which takes long.
        candidate_spacing: Time between plans of an agent whose candidates are kept.
        violations: Keep violations of rules of the road (`Run.violations`, violations.parquet).
        orders: Keep the orders to wait before junctions and crosswalks (`Run.orders`, orders.parquet).
        messages: V2X messages to keep (`Run.messages`, messages.parquet): none, sent messages, or these and their links
            to receivers in range.
        profile: Measure every plan of every agent (`Run.profile`, profile.parquet).
    """

    views: bool = False
    predictions: bool = False
    candidates: int = 0
    candidate_spacing: Annotated[float, "s"] = 0.5
    violations: bool = True
    orders: bool = True
    messages: Literal["none", "sent", "links"] = "none"
    profile: bool = False

    def __post_init__(self) -> None:
        """Checks the ranges."""
        check_between("candidates", self.candidates, 0, 10_000)
        if not self.candidate_spacing >= 0:
            raise InputError("candidate_spacing", f"must not be negative, is {self.candidate_spacing}")


@dataclass(frozen=True)
class CollisionSettings:
    """What follows from contacts.

    Attributes:
        not_at_fault: What a contact with another vehicle does to an agent that is not at fault: `end` it, or
            `hitter_leaves`: the other vehicle leaves, and the agent drives on as if it were untouched (`Run.hits`,
            hits.parquet). Contacts with people and with what never moves end it anyway, and so do all contacts in
            environments for learning.
    """

    not_at_fault: Literal["end", "hitter_leaves"] = "end"


@dataclass(frozen=True)
class RecordingSettings:
    """How the recordings of a file are read.

    Attributes:
        raw: Read recordings without repairs: headings that are off by a constant angle are not turned, overlapping
            recordings collide, and a planning problem is not matched with a vehicle that enters later.
        start: Time step of the recording that is the first one of the run, as if the file had been cut there: agents
            are those that are there then or enter later. Time steps of the run begin at 0.
    """

    raw: bool = False
    start: int = 0

    def __post_init__(self) -> None:
        """Checks the range."""
        check_between("start", self.start, 0, LARGEST_TIME_STEP)


@dataclass(frozen=True)
class SimulationSettings:
    """All settings of a run; the dotted names are those of `--set` and of the configuration file.

    The page "Settings" of the documentation lists all of them with defaults and units.

    Attributes:
        recording: How recordings are read.
        source: How maps and recordings of other tools are read.
        agents: Which vehicles may become agents.
        goal: Goals of recorded vehicles.
        traffic: Generated traffic.
        sumo: Traffic by SUMO.
        planner: Native planners.
        predictor: Native predictors.
        view: What agents see.
        rules: Which rules of the road agents obey.
        v2x: Messages between agents.
        step: Order and end of a run.
        road: How leaving the road is judged.
        collision: What follows from contacts.
        record: What is recorded.
    """

    recording: RecordingSettings = field(default_factory=RecordingSettings)
    source: SourceOptions = field(default_factory=SourceOptions)
    agents: AgentSettings = field(default_factory=AgentSettings)
    goal: GoalSettings = field(default_factory=GoalSettings)
    traffic: TrafficSettings = field(default_factory=TrafficSettings)
    sumo: SumoSettings = field(default_factory=SumoSettings)
    planner: PlannerSettings = field(default_factory=PlannerSettings)
    predictor: PredictorSettings = field(default_factory=PredictorSettings)
    view: ViewSettings = field(default_factory=ViewSettings)
    rules: RulesSettings = field(default_factory=RulesSettings)
    v2x: V2xSettings = field(default_factory=V2xSettings)
    step: StepSettings = field(default_factory=StepSettings)
    road: RoadSettings = field(default_factory=RoadSettings)
    collision: CollisionSettings = field(default_factory=CollisionSettings)
    record: RecordSettings = field(default_factory=RecordSettings)


#: Settings of a run, or a mapping of dotted names that overrides defaults: `{"view.sensor_radius": 40.0}`.
SettingsSpec: TypeAlias = SimulationSettings | Mapping[str, Setting]


def settings_of(spec: SettingsSpec | None) -> SimulationSettings:
    """Settings as you wrote them; the defaults for None.

    Raises:
        InputError: A name that does not exist, or a value that does not fit; the location is the dotted name.
    """
    return spec if isinstance(spec, SimulationSettings) else bind(SimulationSettings(), spec or {})


def with_start(settings: SimulationSettings, start: int | None) -> SimulationSettings:
    """The settings of a run that begins at a time step of the recording; as they are for None.

    Raises:
        InputError: It is no time step.
    """
    return settings if start is None else bind(settings, {"recording.start": start})


#: Generated traffic: settings, a mapping of their names, or a text such as "rate=600,planner=idm:0.5+rollout:0.5" or
#: "idm,rate=600".
TrafficSpec: TypeAlias = TrafficSettings | Mapping[str, Setting] | str


def with_traffic(settings: SimulationSettings, traffic: TrafficSpec | None) -> SimulationSettings:
    """The settings with generated traffic; as they are for None.

    Raises:
        InputError: A name that does not exist, or a value that does not fit.
    """
    if traffic is None:
        return settings
    if isinstance(traffic, TrafficSettings):
        return replace(settings, traffic=traffic)
    values: dict[str, Any] = {}
    if isinstance(traffic, str):
        choice = read_choice(traffic, "traffic")
        values = {} if choice.chosen is None else {"planner": choice.chosen}
        values |= choice.settings
    elif isinstance(traffic, Mapping):
        values = dict(traffic)
    else:
        raise InputError(f"traffic must be TrafficSettings, a mapping of its fields or a text, not {traffic!r}")
    known = flatten(settings.traffic)
    try:
        bind(settings.traffic, {name: value for name, value in values.items() if name not in known})
    except InputError as error:
        raise error.within("traffic") from None
    found = bind(settings, {f"traffic.{name}": value for name, value in values.items()})
    if not found.traffic.is_on:
        raise InputError("traffic", "there is none: give a rate or a density, such as rate=600")
    return found
