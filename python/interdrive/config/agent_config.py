"""The planner, settings, view and rules of each agent, resolved and as plain values.

run.json stores the plain values; passed back, they reproduce the run.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, cast

from interdrive import _core
from interdrive.config.binding import Setting, bind, flatten
from interdrive.config.drivers import SETTINGS, TEMPERAMENT
from interdrive.config.plugins import DEFAULT_PLANNER, read_choice
from interdrive.config.specs import (
    DEFAULT,
    AgentChoice,
    PlannerSpec,
    PredictorSpec,
    Resolved,
    is_per_agent,
    read_planner,
)
from interdrive.errors import InputError
from interdrive.native_settings import RulesSettings, ViewSettings
from interdrive.planners import RECORDED_PATH, RECORDS
from interdrive.scenario import KINDS
from interdrive.scenario.known_goals import Temperament
from interdrive.scenario.native import core_shape

if TYPE_CHECKING:
    from interdrive.config.schema import SimulationSettings
    from interdrive.run import RunSettings
    from interdrive.scenario.agents import Agent
    from interdrive.traffic import Driver

T = TypeVar("T")
Record = TypeVar("Record", ViewSettings, RulesSettings)

_ByAgent: TypeAlias = Mapping[int, T] | Mapping[str, T] | Mapping[int | str, T]

#: These planners come to bends faster than they want to be there, so generated vehicles want less lateral acceleration
#: [m/s²] than their default, unless they have settings of their own: what people have in turns.
_SLOW_IN_BENDS, _LATERAL = ("idm", "idm_mobil"), 2.0

#: The planner of all agents, or planners by agent id ("default": of all others).
PlannersSpec: TypeAlias = PlannerSpec | _ByAgent[PlannerSpec]

#: Views by agent id ("default": of all others), as `ViewSettings` or as a mapping of the fields that differ.
ViewsSpec: TypeAlias = _ByAgent[ViewSettings | Mapping[str, Setting]]

#: Whether agents have V2X, by agent id ("default": all others); others as drawn by `v2x.penetration`.
V2xSpec: TypeAlias = _ByAgent[bool]

#: Rules of the road by agent id ("default": of all others), as `RulesSettings` or the fields that differ.
RulesSpec: TypeAlias = _ByAgent[RulesSettings | Mapping[str, Setting]]


@dataclass(frozen=True)
class AgentConfig:
    """Planner, view and rules of one agent.

    Attributes:
        planner: Its planner.
        view: Its view settings.
        rules: The rules of the road that it obeys.
        v2x: Whether it has V2X; None: as drawn by `v2x.penetration`.
        driver: How fast it wants to be where its goal has no time, by name; what is missing is as usual. Of a planner
            in Python all that its driver has.
    """

    planner: Resolved
    view: ViewSettings
    rules: RulesSettings
    v2x: bool | None = None
    driver: Mapping[str, float] = field(default_factory=dict)


def core_agent(agent: Agent, config: AgentConfig, planner: _core.Planner | None) -> _core.Agent:
    """The core's handle for an agent; without a native planner its plans come from outside the core."""
    state = agent.initial_state
    return _core.Agent(
        agent.id,
        KINDS.index(agent.kind),
        core_shape(agent.shape),
        agent.vehicle,
        (state.x, state.y, state.orientation, state.velocity, state.acceleration, state.yaw_rate),
        state.time_step,
        agent.native_goal,
        agent.route,
        planner,
        config.view,
        config.rules,
        config.v2x,
        agent.replays_before,
        agent.queue,
    )


@dataclass(frozen=True)
class RunConfig:
    """What agents of a run have, read before they are known.

    Attributes:
        settings: Settings of the run.
        default: What agents without a choice of their own have.
        own: Choices of single agents, by their ids as given.
        traffic: The planners of generated traffic, in the order of `TrafficSettings.planners`.
    """

    settings: SimulationSettings
    default: AgentChoice
    own: Mapping[object, AgentChoice]
    traffic: tuple[AgentChoice, ...] = ()


def run_config(settings: SimulationSettings, planner: PlannersSpec) -> RunConfig:
    """Reads the planners of a run; view and rules chosen for all agents become settings of the run.

    A choice for an agent takes nothing from "default" unless it names no planner: then the agent has the default
    planner with the settings of its own choice on top.

    Raises:
        InputError: A planner or setting does not exist or cannot be used.
    """
    own: dict[object, AgentChoice] = {}
    if is_per_agent(planner):
        default = read_planner(planner.get(DEFAULT, DEFAULT_PLANNER), settings.planner)
        same: dict[str, AgentChoice] = {}  # most agents have what others have
        for agent, spec in planner.items():
            if agent == DEFAULT:
                continue
            known = same.get(spec) if isinstance(spec, str) else None
            try:
                own[agent] = known or read_planner(spec, settings.planner, default)
            except InputError as error:
                raise error.within(f"agent {agent}") from error
            if isinstance(spec, str):
                same[spec] = own[agent]
    else:
        default = read_planner(cast("PlannerSpec", planner), settings.planner)
        if default.v2x is not None:
            raise InputError("v2x", "applies to a single agent; for all agents set v2x.penetration")
        view, rules = _record("view", settings.view, default.view), _record("rules", settings.rules, default.rules)
        settings = replace(settings, view=view, rules=rules)
        default = AgentChoice(default.planner, drivers=default.drivers, driver=default.driver)
    return RunConfig(settings, default, own, _traffic_planners(settings))


def _traffic_planners(settings: SimulationSettings) -> tuple[AgentChoice, ...]:
    if not settings.traffic.is_on:
        return ()
    found = []
    for name, _ in settings.traffic.planners:
        head, colon, share = name.partition(":")
        if colon and head in RECORDS:
            raise InputError("traffic.planner", f"{share!r} is no share of {head}; write a number, such as {head}:0.3")
        if name == "policy":
            raise InputError("traffic.planner", "policy has no file; set traffic.planner=policy,file=FILE")
        try:
            choice = read_planner(name, settings.planner)
        except InputError as error:
            raise error.within("traffic.planner") from None
        if choice.planner.native in RECORDED_PATH:
            raise InputError("traffic.planner", f"{name} follows recordings, and generated vehicles have none")
        found.append(choice)
    return tuple(found)


def agent_configs(
    config: RunConfig,
    views: ViewsSpec,
    rules: RulesSpec,
    v2x: V2xSpec,
    agents: Sequence[Agent],
    recorded: Container[int],
    seed: int = 0,
    drivers: Mapping[int, Driver] | None = None,
) -> tuple[dict[int, AgentConfig], list[str]]:
    """Planner, view and rules of every agent.

    An agent without a recording is driven by `rollout` where the planner of all agents replays recordings.

    Args:
        config: Planners of the run.
        views: Views by agent id.
        rules: Rules of the road by agent id, or of "default".
        v2x: Whether agents have V2X, by agent id, or of "default".
        agents: The agents.
        recorded: Ids of the participants that have a recording.
        seed: Of what drivers draw.
        drivers: Who drives generated vehicles, by agent id; no choice for single agents applies to them.

    Returns:
        Planner and view by agent id, and one line per agent that did not get the planner of all agents.

    Raises:
        InputError: An id is not that of an agent, a choice cannot be used, or a setting does not exist.
    """
    chosen = [agent for agent in agents if agent.id not in (drivers or {})]
    settings, looks, obeyed = config.settings, _by_id(views, chosen, "a view"), _by_id(rules, chosen, "rules")
    equipped, own = _by_id(v2x, chosen, "V2X"), _by_id(config.own, chosen, "a planner")
    found: dict[int, AgentConfig] = {}
    notes = []
    for agent in agents:
        generated = (drivers or {}).get(agent.id)
        if generated is not None:
            choice, wanted = _of_driver(config, generated), ""
        else:
            choice, wanted = _choice(config, own, agent, recorded)
        if wanted:
            notes.append(f"agent {agent.id} has no recording for planner {wanted}: {DEFAULT_PLANNER} drives it")
        try:
            view = _record("view", settings.view, looks.get(agent.id, looks.get(DEFAULT, {})))
            kept = _record("rules", settings.rules, obeyed.get(agent.id, obeyed.get(DEFAULT, {})))
            has_v2x = equipped.get(agent.id, equipped.get(DEFAULT)) if choice.v2x is None else choice.v2x
            view, kept = _record("view", view, choice.view), _record("rules", kept, choice.rules)
            planner = choice.planner if choice.drivers is None else _drawn(choice, agent, seed)
            driver = _driver(choice, agent.id, agent.kind, seed, agent.headway)
            found[agent.id] = AgentConfig(planner, view, kept, _truth(has_v2x), driver)
        except InputError as error:
            raise error.within(f"agent {agent.id}") from error
    return found, notes


def _of_driver(config: RunConfig, driver: Driver) -> AgentChoice:
    """The choice for a generated vehicle, with the time gap and the speeds of its driver."""
    choice = config.traffic[driver.planner]
    native = choice.planner.native or ""
    own: dict[str, float] = {}
    name = SETTINGS.get(native, {}).get("time_gap")
    if name is not None and driver.time_gap is not None:
        own[name] = driver.time_gap
    if native in _SLOW_IN_BENDS and choice.planner.source == RECORDS[native]():
        own["lateral_acceleration"] = _LATERAL
    if own:
        source = bind(cast("Any", choice.planner.source), own)
        choice = replace(choice, planner=replace(choice.planner, source=source))
    factor = config.settings.rules.speed_factor * driver.speed_factor
    return replace(choice, rules={"speed_factor": factor, **choice.rules})


def temperament(config: RunConfig, seed: int) -> Callable[[int, str], Temperament]:
    """How fast the drivers of recorded vehicles want to be, by id and kind.

    Args:
        config: Planners of the run.
        seed: Of what drivers draw.
    """
    own = {str(name): choice for name, choice in config.own.items()}

    def found(agent: int, kind: str) -> Temperament:
        known = _driver(own.get(str(agent), config.default), agent, kind, seed)
        return Temperament(**{name: known[name] for name in TEMPERAMENT if name in known})

    return found


def _driver(choice: AgentChoice, agent: int, kind: str, seed: int, headway: float = math.nan) -> dict[str, float]:
    """What a choice says of the driver, and for the rest what the agent draws beside the settings of its planner."""
    if choice.drivers is None:
        return dict(choice.driver)
    if choice.planner.native is None:
        return {**choice.drivers.values(seed, agent, kind, headway), **choice.driver}
    return {**choice.drivers.temperament(seed, agent, kind), **choice.driver}


def drawn_planners(
    config: RunConfig, agents: Sequence[Agent], recorded: Container[int], seed: int
) -> dict[int, Resolved]:
    """Planners of the agents that draw drivers, as `agent_configs` has them for a seed."""
    own = _by_id(config.own, agents, "a planner")
    if config.default.drivers is None and all(choice.drivers is None for choice in own.values()):
        return {}
    choices = ((agent, _choice(config, own, agent, recorded)[0]) for agent in agents)
    return {agent.id: _drawn(choice, agent, seed) for agent, choice in choices if choice.drivers is not None}


def _choice(
    config: RunConfig, own: Mapping[object, AgentChoice], agent: Agent, recorded: Container[int]
) -> tuple[AgentChoice, str]:
    """The choice for an agent, and the planner of all agents if it needs a recording that the agent does not have."""
    choice = own.get(agent.id, config.default)
    if agent.id in own or choice.planner.native not in RECORDED_PATH or agent.id in recorded:
        return choice, ""
    planner = read_planner(DEFAULT_PLANNER, config.settings.planner).planner
    return replace(choice, planner=planner), choice.planner.name


def _drawn(choice: AgentChoice, agent: Agent, seed: int) -> Resolved:
    """The planner of an agent with the settings that its driver has."""
    planner, drivers = choice.planner, choice.drivers
    if drivers is None or planner.native is None:
        return planner
    own = drivers.settings(planner.native, seed, agent.id, agent.kind, agent.headway)
    return replace(planner, source=bind(cast("Any", planner.source), {**planner.values, **own}))


def stored(
    agents: Mapping[int, AgentConfig],
    predictor: Resolved,
    settings: SimulationSettings,
    usual: Resolved | None = None,
) -> RunSettings:
    """Planners, views, rules and predictor as plain values, and whether they reproduce the run ("repeatable").

    Args:
        agents: Of the run, without generated vehicles: settings and seed make them.
        predictor: Of all agents.
        settings: Of the run.
        usual: The planner for all agents, for a run that has none but generated vehicles.
    """
    plain = {agent: _plain(config, settings) for agent, config in agents.items()}
    values = [value for value, _ in plain.values()]
    if not values and usual is not None:
        values = [usual.plain(settings.planner)[0]]
    expected, repeatable = predictor.plain(settings.predictor)
    equipped = {str(agent): config.v2x for agent, config in agents.items() if config.v2x is not None}
    return {
        "planner": values[0]
        if all(value == values[0] for value in values)
        else {str(agent): value for agent, (value, _) in plain.items()},
        "views": {str(agent): flatten(config.view) for agent, config in agents.items() if config.view != settings.view},
        "rules": {
            str(agent): flatten(config.rules) for agent, config in agents.items() if config.rules != settings.rules
        },
        **({"v2x": equipped} if equipped else {}),
        "predictor": expected,
        "repeatable": repeatable and all(known for _, known in plain.values()),
    }


def _plain(config: AgentConfig, settings: SimulationSettings) -> tuple[Any, bool]:
    """The planner of an agent with what its driver has besides, and whether this reproduces it."""
    planner, known = config.planner.plain(settings.planner)
    if not config.driver:
        return planner, known
    table = planner if isinstance(planner, Mapping) else {"planner": planner}
    return {**table, **{f"driver.{name}": value for name, value in config.driver.items()}}, known


def modules_named(planner: PlannersSpec, predictor: PredictorSpec) -> tuple[str, ...]:
    """The specifications that name code as `module:object`; resolving them imports and runs it."""
    choices: list[object] = list(planner.values()) if is_per_agent(planner) else [planner]
    read = [*(read_choice(choice, "planner") for choice in choices), read_choice(predictor, "predictor")]
    return tuple(sorted({str(one.chosen) for one in read if isinstance(one.chosen, str) and ":" in one.chosen}))


def _by_id(given: object, agents: Sequence[Agent], what: str) -> dict[object, Any]:
    """The mapping with the agents' own ids as keys; the id of a planning problem stands for that of its agent."""
    if not isinstance(given, Mapping):
        raise InputError(f"{what} per agent must be a mapping from agent ids, not {given!r}")
    own = {name: agent.id for agent in agents for name in agent.names} | {agent.id: agent.id for agent in agents}
    found: dict[object, Any] = {}
    for key, value in given.items():
        try:
            agent = key if key == DEFAULT else own.get(int(key) if isinstance(key, str) else operator.index(key))
        except (TypeError, ValueError):
            raise InputError(f"{what} is given for {key!r}, which is not an agent id") from None
        if agent is None:
            ids = [item.id for item in agents]
            among = ", ".join(map(str, ids[:12])) + (", ..." if len(ids) > 12 else "")
            raise InputError(
                f"agent {key}",
                f"{what} is given for it, but it is not an agent (agents are {among}); add it to --agents",
            )
        if agent in found:
            raise InputError(f"agent {agent}", f"{what} is given for it twice")
        found[agent] = value
    return found


def _truth(given: object) -> bool | None:
    """Whether an agent has V2X, as text or as a value."""
    known: dict[object, bool | None] = {None: None, True: True, False: False, "true": True, "false": False}
    text = given.strip().lower() if isinstance(given, str) else given
    if not isinstance(text, bool | str | None) or text not in known:
        raise InputError("v2x", f"expected true or false, not {given!r}")
    return known[text]


def _record(name: str, base: Record, given: object) -> Record:
    """The settings of a view or rules with what is given on top."""
    if isinstance(given, type(base)):
        return given
    if not isinstance(given, Mapping):
        what = "a view" if name == "view" else name
        raise InputError(f"{what} must be {type(base).__name__} or a mapping of its fields, not {given!r}")
    try:
        return bind(base, given) if given else base
    except InputError as error:
        raise InputError(f"{name}.{error.location}", error.message) from None
