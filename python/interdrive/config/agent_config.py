"""The planner, settings, view and rules of each agent, resolved and as plain values.

run.json stores the plain values; passed back, they reproduce the run.
"""

from __future__ import annotations

import operator
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from interdrive import _core
from interdrive.config.binding import Setting, bind, flatten
from interdrive.config.plugins import Choice, read_choice
from interdrive.config.specs import PlannerSpec, PredictorSpec, Resolved, resolved_planner, resolved_predictor
from interdrive.errors import InputError
from interdrive.native_settings import RulesSettings, ViewSettings
from interdrive.planners import RECORDED_PATH
from interdrive.scenario import KINDS
from interdrive.scenario.native import core_shape

if TYPE_CHECKING:
    from interdrive.config.schema import SimulationSettings
    from interdrive.run import RunSettings
    from interdrive.scenario.agents import Agent

T = TypeVar("T")
Record = TypeVar("Record", ViewSettings, RulesSettings)

_DEFAULT = "default"

_ByAgent: TypeAlias = Mapping[int, T] | Mapping[str, T] | Mapping[int | str, T]

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
    """

    planner: Resolved
    view: ViewSettings
    rules: RulesSettings
    v2x: bool | None = None


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
    )


@dataclass(frozen=True)
class RunConfig:
    """Planners and predictor of a run, before its agents are known.

    Attributes:
        settings: Settings of the run, including those of a native planner or predictor shared by all agents.
        planner: Planner of all agents, or the user's mapping of planners.
        predictor: Predictor of all agents.
    """

    settings: SimulationSettings
    planner: Resolved | Mapping[Any, Any]
    predictor: Resolved


def run_config(settings: SimulationSettings, planner: PlannersSpec, predictor: PredictorSpec) -> RunConfig:
    """Resolves the choices for all agents; their settings move to where `--set` puts them.

    Raises:
        InputError: A planner, predictor or setting does not exist or cannot be used.
    """
    for_all: Resolved | Mapping[Any, Any]
    if isinstance(planner, Mapping) and _is_per_agent(planner):
        for_all = planner
    else:
        choice, view, rules, equipped = _parts(read_choice(planner, "planner"))
        if equipped is not None:
            raise InputError("v2x", "is a choice of one agent; for all agents set v2x.penetration")
        settings = replace(
            settings, view=_record("view", settings.view, view), rules=_record("rules", settings.rules, rules)
        )
        for_all = resolved_planner(choice, settings.planner)
        settings = replace(settings, planner=_with(settings.planner, for_all))
    expected = resolved_predictor(predictor, settings.predictor)
    return RunConfig(replace(settings, predictor=_with(settings.predictor, expected)), for_all, expected)


def _with(settings: Any, resolved: Resolved) -> Any:  # noqa: ANN401 - PlannerSettings or PredictorSettings
    """The settings with the record of a native planner or predictor."""
    name = resolved.native
    return replace(settings, **{name: resolved.source}) if name is not None and hasattr(settings, name) else settings


def agent_configs(
    config: RunConfig,
    views: ViewsSpec,
    rules: RulesSpec,
    v2x: V2xSpec,
    agents: Sequence[Agent],
    recorded: Container[int],
) -> tuple[dict[int, AgentConfig], list[str]]:
    """Planner, view and rules of every agent.

    A choice for an agent takes nothing from "default" unless it names no planner: then the agent has the default
    planner with the settings of its own choice on top. An agent without a recording is driven by `frenet` where the
    planner of all agents replays recordings.

    Args:
        config: Planners and predictor of the run.
        views: Views by agent id.
        rules: Rules of the road by agent id, or of "default".
        v2x: Whether agents have V2X, by agent id, or of "default".
        agents: The agents.
        recorded: Ids of the participants that have a recording.

    Returns:
        Planner and view by agent id, and one line per agent that did not get the planner of all agents.

    Raises:
        InputError: An id is not that of an agent, a choice cannot be used, or a setting does not exist.
    """
    settings, looks, obeyed = config.settings, _by_id(views, agents, "a view"), _by_id(rules, agents, "rules")
    equipped = _by_id(v2x, agents, "V2X")
    wanted = {} if isinstance(config.planner, Resolved) else _by_id(config.planner, agents, "a planner")
    default, default_view, default_rules, default_v2x = _parts(read_choice(wanted.get(_DEFAULT, "frenet"), "planner"))
    for_default = (
        config.planner if isinstance(config.planner, Resolved) else resolved_planner(default, settings.planner)
    )
    found: dict[int, AgentConfig] = {}
    notes = []
    for agent in agents:
        try:
            planner, own_view, own_rules, own_v2x = for_default, default_view, default_rules, default_v2x
            if agent.id in wanted:
                own = read_choice(wanted[agent.id], "planner")
                is_default = own.chosen is None
                own, own_view, own_rules, own_v2x = _parts(own)
                if is_default:
                    own = Choice(default.chosen, {**default.settings, **own.settings})
                    own_view, own_rules = {**default_view, **own_view}, {**default_rules, **own_rules}
                    own_v2x = default_v2x if own_v2x is None else own_v2x
                planner = resolved_planner(own, settings.planner)
            elif planner.native in RECORDED_PATH and agent.id not in recorded:
                notes.append(f"agent {agent.id} has no recording for planner {planner.name}: frenet drives it")
                planner = resolved_planner("frenet", settings.planner)
            view = _record("view", settings.view, looks.get(agent.id, looks.get(_DEFAULT, {})))
            kept = _record("rules", settings.rules, obeyed.get(agent.id, obeyed.get(_DEFAULT, {})))
            has_v2x = equipped.get(agent.id, equipped.get(_DEFAULT)) if own_v2x is None else own_v2x
            found[agent.id] = AgentConfig(
                planner, _record("view", view, own_view), _record("rules", kept, own_rules), _truth(has_v2x)
            )
        except InputError as error:
            raise error.within(f"agent {agent.id}") from error
    return found, notes


def stored(agents: Mapping[int, AgentConfig], predictor: Resolved, settings: SimulationSettings) -> RunSettings:
    """Planners, views, rules and predictor as plain values, and whether they reproduce the run ("repeatable")."""
    plain = {agent: config.planner.plain(settings.planner) for agent, config in agents.items()}
    values = [value for value, _ in plain.values()]
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


def modules_named(planner: PlannersSpec, predictor: PredictorSpec) -> tuple[str, ...]:
    """The specifications that name code as `module:object`; resolving them imports and runs it."""
    several = isinstance(planner, Mapping) and _is_per_agent(planner)
    choices = list(planner.values()) if several and isinstance(planner, Mapping) else [planner]
    read = [*(read_choice(choice, "planner") for choice in choices), read_choice(predictor, "predictor")]
    return tuple(sorted({str(one.chosen) for one in read if isinstance(one.chosen, str) and ":" in one.chosen}))


def _is_per_agent(planner: Mapping[Any, Any]) -> bool:
    """Whether this is a mapping from agents to choices, rather than a choice that is a mapping."""
    return all(not isinstance(key, str) or key == _DEFAULT or key.lstrip("-").isdigit() for key in planner)


def _by_id(given: object, agents: Sequence[Agent], what: str) -> dict[object, object]:
    """The mapping with the agents' own ids as keys; the id of a planning problem stands for that of its agent."""
    if not isinstance(given, Mapping):
        raise InputError(f"{what} per agent must be a mapping from agent ids, not {given!r}")
    own = {name: agent.id for agent in agents for name in agent.names} | {agent.id: agent.id for agent in agents}
    found: dict[object, object] = {}
    for key, value in given.items():
        try:
            agent = key if key == _DEFAULT else own.get(int(key) if isinstance(key, str) else operator.index(key))
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


def _parts(choice: Choice) -> tuple[Choice, dict[str, object], dict[str, object], object]:
    """The choice alone (`frenet` if it names no planner), settings of its view, its rules, and whether it has V2X."""
    settings = choice.settings
    view, rules = (
        {name.removeprefix(prefix): value for name, value in settings.items() if name.startswith(prefix)}
        for prefix in ("view.", "rules.")
    )
    own = {
        name: value for name, value in settings.items() if not name.startswith(("view.", "rules.")) and name != "v2x"
    }
    return Choice("frenet" if choice.chosen is None else choice.chosen, own), view, rules, settings.get("v2x")


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
        return bind(base, given)
    except InputError as error:
        raise InputError(f"{name}.{error.location}", error.message) from None
