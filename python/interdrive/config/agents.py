"""Who plans for which agent, with which settings and which view: what the user wrote, as plain values.

The plain values are what run.json stores; given back, they make the same run.
"""

from __future__ import annotations

import json
import operator
from collections.abc import Mapping
from dataclasses import dataclass, is_dataclass, replace
from typing import TYPE_CHECKING, Any

from interdrive.config.binding import bind, flatten
from interdrive.config.plugins import Choice, find, read_choice
from interdrive.config.specs import planner_name, resolve_planner, resolve_predictor
from interdrive.errors import InputError, InterdriveError
from interdrive.planners import native_name as native_planner_name
from interdrive.planners import native_record
from interdrive.predictors import native_name as native_predictor_name

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.config.schema import SimulationSettings, ViewSettings
    from interdrive.scenario.agents import Agent

_DEFAULT = "default"


@dataclass(frozen=True)
class AgentChoice:
    """What drives one agent.

    Attributes:
        planner: Its planner; a native one by name and settings.
        view: What it sees.
    """

    planner: Choice
    view: ViewSettings


def named(
    settings: SimulationSettings, planner: object, predictor: object
) -> tuple[SimulationSettings, object, Choice]:
    """Settings that hold for all move to where `--set` puts them, so that names say the rest.

    Args:
        settings: Of the run.
        planner: One choice for all agents, or a mapping from agent ids and "default" to choices.
        predictor: One choice.

    Returns:
        The settings with those of a native planner or predictor that all have; the planner, and the predictor.
    """
    if not _is_per_agent(planner):
        choice = read_choice(planner, "planner")
        view, own = _split(choice)
        settings = replace(settings, view=_view(settings.view, view))
        choice = Choice(choice.chosen if choice.chosen is not None else "frenet", own)
        record: Any = resolve_planner(choice, settings.planner)
        name = native_planner_name(record)
        if name is not None and hasattr(settings.planner, name):
            of_planner: dict[str, Any] = {name: record}
            settings = replace(settings, planner=replace(settings.planner, **of_planner))
        planner = _converted(choice, record) if name is None else Choice(name)
    expected = read_choice(predictor, "predictor")
    record = resolve_predictor(expected, settings.predictor)
    name = native_predictor_name(record)
    if name is not None and hasattr(settings.predictor, name):
        of_predictor: dict[str, Any] = {name: record}
        settings = replace(settings, predictor=replace(settings.predictor, **of_predictor))
    expected = _converted(expected, record) if name is None else Choice(name)
    return settings, planner, expected


def per_agent(
    planner: object,
    views: Mapping[Any, object],
    agents: Sequence[Agent],
    settings: SimulationSettings,
) -> dict[int, AgentChoice]:
    """Planner and view of every agent, checked.

    An agent that is named takes nothing from "default", unless its choice names no planner: then it has that one, with
    its own settings on top.

    Args:
        planner: One choice, or a mapping from agent ids and "default" to choices.
        views: From agent ids and "default" to `ViewSettings` or mappings of their fields.
        agents: Who drives.
        settings: Of the run.

    Raises:
        InputError: Somebody is named who is no agent, a choice that cannot be used, or a setting that does not exist.
    """
    wanted = _by_id(planner if _is_per_agent(planner) else {_DEFAULT: planner}, agents, "a planner")
    looks = _by_id(views, agents, "a view")
    default = read_choice(wanted.get(_DEFAULT, "frenet"), "planner")
    if default.chosen is None:
        default = Choice("frenet", default.settings)
    # One choice for all has been checked and converted; what it makes may be expensive.
    for_default = default if isinstance(planner, Choice) else _checked(default, settings)
    chosen: dict[int, AgentChoice] = {}
    for agent in agents:
        try:
            choice = for_default
            if agent.id in wanted:
                own = read_choice(wanted[agent.id], "planner")
                if own.chosen is None:
                    own = Choice(default.chosen, {**default.settings, **own.settings})
                choice = _checked(own, settings)
            view = _view(settings.view, looks.get(agent.id, looks.get(_DEFAULT, {})))
            in_choice, own_settings = _split(choice)
            chosen[agent.id] = AgentChoice(Choice(choice.chosen, own_settings), _view(view, in_choice))
        except InputError as error:
            raise InputError(f"agent {agent.id}: {error}") from error
    return chosen


def stored(chosen: Mapping[int, AgentChoice], predictor: Choice, settings: SimulationSettings) -> dict[str, Any]:
    """Planners, views and predictor as plain values, and whether they make the same run again ("repeatable")."""
    plain = {agent: _plain(choice.planner, "planner") for agent, choice in chosen.items()}
    values = [value for value, _ in plain.values()]
    expected, repeatable = _plain(predictor, "predictor")
    return {
        "planner": values[0]
        if all(value == values[0] for value in values)
        else {str(agent): value for agent, (value, _) in plain.items()},
        "views": {str(agent): flatten(choice.view) for agent, choice in chosen.items() if choice.view != settings.view},
        "predictor": expected,
        "repeatable": repeatable and all(known for _, known in plain.values()),
    }


def modules_named(planner: object, predictor: object) -> tuple[str, ...]:
    """Which of these choices name code in a module, as `module:object`; resolving them would import and run it.

    Args:
        planner: One choice for all agents, or a mapping from agents to choices.
        predictor: One choice.
    """
    choices = list(planner.values()) if isinstance(planner, Mapping) and _is_per_agent(planner) else [planner]
    read = [*(read_choice(choice, "planner") for choice in choices), read_choice(predictor, "predictor")]
    return tuple(sorted({str(one.chosen) for one in read if isinstance(one.chosen, str) and ":" in one.chosen}))


def _is_per_agent(planner: object) -> bool:
    """A mapping from agents to choices, rather than a choice that is a table."""
    return isinstance(planner, Mapping) and all(
        not isinstance(key, str) or key == _DEFAULT or key.lstrip("-").isdigit() for key in planner
    )


def _by_id(given: object, agents: Sequence[Agent], what: str) -> dict[object, object]:
    """The same mapping by the agents' own ids; a planning problem's id may stand for its agent's."""
    if not isinstance(given, Mapping):
        raise InputError(f"{what} per agent must be a mapping from agent ids, not {given!r}")
    own = {name: agent.id for agent in agents for name in agent.names} | {agent.id: agent.id for agent in agents}
    found: dict[object, object] = {}
    for key, value in given.items():
        try:
            agent = key if key == _DEFAULT else own.get(int(key) if isinstance(key, str) else operator.index(key))
        except (TypeError, ValueError):
            raise InputError(f"{what} is given for {key!r}, which is no agent id") from None
        if agent is None:
            ids = [item.id for item in agents]
            among = ", ".join(map(str, ids[:12])) + (", ..." if len(ids) > 12 else "")
            raise InputError(
                f"agent {key}: {what} is given for it, but it is not an agent (agents are {among}); add it to --agents"
            )
        if agent in found:
            raise InputError(f"agent {agent}: {what} is given for it twice")
        found[agent] = value
    return found


def _split(choice: Choice) -> tuple[dict[str, object], dict[str, object]]:
    """Settings of the view, without "view.", and of the planner."""
    view = {name.removeprefix("view."): v for name, v in choice.settings.items() if name.startswith("view.")}
    return view, {name: v for name, v in choice.settings.items() if not name.startswith("view.")}


def _view(base: ViewSettings, given: object) -> ViewSettings:
    if isinstance(given, type(base)):
        return given
    if not isinstance(given, Mapping):
        raise InputError(f"a view must be ViewSettings or a mapping of its fields, not {given!r}")
    try:
        return bind(base, given)
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith("view.") else f"view.{text}") from None


def _checked(choice: Choice, settings: SimulationSettings) -> Choice:
    """The choice with converted settings; a native record by its name and what differs from the run's settings."""
    view, own = _split(choice)
    found: Any = resolve_planner(Choice(choice.chosen, own), settings.planner)
    name = native_planner_name(found)
    if name is not None:
        usual = flatten(native_record(name, settings.planner))
        own = {key: value for key, value in flatten(found).items() if value != usual[key]}
        return Choice(name, {**own, **{f"view.{key}": value for key, value in view.items()}})
    converted = _converted(Choice(choice.chosen, own), found).settings
    return Choice(choice.chosen, {**converted, **{f"view.{key}": value for key, value in view.items()}})


def _converted(choice: Choice, found: Any) -> Choice:  # noqa: ANN401 - a planner or predictor
    """The choice with its settings as values of the planner's or predictor's types."""
    values = flatten(found) if choice.settings else {}
    return Choice(choice.chosen, {name: values[name] for name in choice.settings})


def _plain(choice: Choice, what: str) -> tuple[Any, bool]:
    """A choice as a name or a table, and whether that makes the same again."""
    chosen, values, known = choice.chosen, dict(choice.settings), True
    if not isinstance(chosen, str):
        kind = chosen if isinstance(chosen, type) or hasattr(chosen, "__qualname__") else type(chosen)
        chosen, known = planner_name(chosen), _is_found(planner_name(chosen), kind, what)
        if kind is not choice.chosen:
            known = known and is_dataclass(kind)
            values = {**(flatten(choice.chosen) if is_dataclass(kind) else {}), **values}  # type: ignore[arg-type]
    try:
        json.dumps(values)
    except (TypeError, ValueError):
        values, known = {}, False
    return ({what: chosen, **values} if values else chosen), known


def _is_found(name: str, kind: object, what: str) -> bool:
    """Whether another process would find it by its name."""
    if name.startswith("__main__:") or "<" in name:
        return False
    try:
        return find(name, (), what) is kind
    except InterdriveError:
        return False
