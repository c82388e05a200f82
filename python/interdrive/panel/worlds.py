"""A run's world again: with another driver in the place of one agent, or without that agent and its recording."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.config.agent_config import modules_named
from interdrive.config.binding import bind, flatten
from interdrive.config.schema import CollisionSettings, SimulationSettings
from interdrive.errors import InputError
from interdrive.native_settings import RulesSettings
from interdrive.planners import NATIVE
from interdrive.simulation import simulate

if TYPE_CHECKING:
    from interdrive.config.specs import PlannerSpec
    from interdrive.runs import Run
    from interdrive.scenario import Obstacles, Scenario


@dataclass(frozen=True)
class World:
    """All that repeats a run but for one agent.

    Attributes:
        scenario: As simulated.
        agent_id: The agent in whose place others drive.
        own: Its planner as the run names it; None if nothing can repeat it.
        own_rules: Rules that it obeys where they differ from those of all; None otherwise.
        others: Planners of all other agents, by id.
        present: Participants of the run.
        options: Other arguments of `interdrive.simulate`.
        rules: Rules that single other agents obey, by id.
    """

    scenario: Scenario
    agent_id: int
    own: Any
    own_rules: Any
    others: Mapping[int, Any]
    present: frozenset[int]
    options: Mapping[str, Any]
    rules: Mapping[int, Any]

    @classmethod
    def of(cls, run: Run, agent_id: int, *, trust: bool = False, threads: int | None = 1) -> World:
        """The world of an agent of a run.

        Args:
            run: The run; its scenario is the simulated one.
            agent_id: The agent.
            trust: Import planners and predictors that the run names as module:object.
            threads: Number of planning threads; results do not depend on it.

        Raises:
            InputError: The run does not say how to repeat it.
        """
        wanted: Mapping[str, Any] = run.settings
        try:
            planner, predictor = wanted["planner"], wanted["predictor"]
            settings = bind(SimulationSettings(), wanted["settings"])
            seed = wanted["seed"]
        except (KeyError, TypeError, ValueError) as cause:
            raise InputError(f"score: the run does not say how to repeat it ({cause!r})") from None
        own = run.outcomes.agent_id.tolist()
        others: dict[int, Any] = {number: _choice(planner, number) for number in own if number != agent_id}
        code = modules_named(others, predictor)
        if code and not trust:
            named = ", ".join(code)
            raise InputError(f"score: repeating this run imports code outside interdrive ({named}); --trust allows it")
        names = dict(zip(own, run.outcomes.planner, strict=True))
        if not wanted.get("repeatable", True):
            unknown = [number for number, choice in others.items() if not _is_named(choice, names[number])]
            if unknown:
                raise InputError(f"score: agent {unknown[0]} had a Python object as planner, which nothing can repeat")
        chosen: Any = _choice(planner, agent_id)
        is_own = wanted.get("repeatable", True) or _is_named(chosen, names[agent_id])
        return cls(
            scenario=run.scenario,
            agent_id=agent_id,
            own=chosen if is_own and (trust or not modules_named({agent_id: chosen}, predictor)) else None,
            own_rules=wanted.get("rules", {}).get(str(agent_id)),
            others=others,
            present=frozenset(run.states.participant_id.tolist()),
            options={
                "predictor": predictor,
                "settings": replace(
                    settings, record=type(settings.record)(), collision=CollisionSettings("hitter_leaves")
                ),
                "seed": seed,
                "threads": threads,
                "views": _but(wanted.get("views", {}), agent_id),
                "v2x": _but(wanted.get("v2x", {}), agent_id),
            },
            rules=_but(wanted.get("rules", {}), agent_id),
        )

    @property
    def reacts(self) -> bool:
        """Another participant drives and does not just replay."""
        return any(not _is_replay(choice) for choice in self.others.values())

    @property
    def is_closed(self) -> bool:
        """Only a file of a scenario and interdrive decide what happens in it: no code and no other file of the user."""
        given = [self.others, self.options, self.rules, flatten(self.options["settings"])]
        is_code = modules_named(dict(self.others), self.options["predictor"])
        return bool(self.scenario.sha256) and not is_code and not any(map(_is_file, _texts(given)))

    def content(self) -> dict[str, Any]:
        """All that decides what happens but for the drivers in the agent's place, in plain values."""
        options = {name: value for name, value in self.options.items() if name != "threads"}
        return {
            "scenario": [self.scenario.sha256, _hash(self.scenario)],
            "agent": self.agent_id,
            "others": {str(number): choice for number, choice in self.others.items()},
            "present": sorted(self.present),
            "rules": {str(number): rules for number, rules in self.rules.items()},
            **{**options, "settings": flatten(options["settings"])},
        }

    def driven_by(self, planner: PlannerSpec, rules: RulesSettings | None = None) -> Run:
        """The same run with a `planner` in the place of the agent, which obeys `rules` (None: all)."""
        return simulate(
            self.scenario,
            agents=[self.agent_id, *self.others],
            planner={**self.others, self.agent_id: planner},
            rules={**self.rules, self.agent_id: rules or RulesSettings()},
            **self.options,
        )

    def driven_on(self) -> Run | None:
        """The same run, in which the agent drives on after it was hit; None if nothing can repeat its planner."""
        if self.own is None:
            return None
        rules = dict(self.rules) if self.own_rules is None else {**self.rules, self.agent_id: self.own_rules}
        return simulate(
            self.scenario,
            agents=[self.agent_id, *self.others],
            planner={**self.others, self.agent_id: self.own},
            rules=rules,
            **self.options,
        )

    def without_agent(self) -> Run:
        """The same run without the agent and its recording.

        Raises:
            InputError: There is no other agent.
        """
        obstacles = self.scenario.obstacles
        stays = np.array(
            [number != self.agent_id and number in self.present for number in obstacles.ids.tolist()], dtype=np.bool_
        )
        problems = tuple(one for one in self.scenario.planning_problems if one.id != self.agent_id)
        scenario = replace(self.scenario, obstacles=_rows(obstacles, stays), planning_problems=problems)
        return simulate(
            scenario, agents=list(self.others), planner=dict(self.others), rules=dict(self.rules), **self.options
        )


def _texts(given: object) -> Iterator[str]:
    """All texts in nested values."""
    if isinstance(given, str):
        yield given
    elif isinstance(given, Mapping):
        for value in given.values():
            yield from _texts(value)
    elif isinstance(given, list | tuple):
        for value in given:
            yield from _texts(value)


def _is_file(text: str) -> bool:
    try:
        return text != "" and Path(text).expanduser().is_file()
    except (OSError, ValueError, RuntimeError):  # too long, no such user
        return False


def _hash(scenario: Scenario) -> str:
    """SHA-256 of roads and recordings, which may come from several files."""
    found = hashlib.sha256()
    for table in (scenario.lanelets, scenario.obstacles):
        for item in fields(table):
            value = getattr(table, item.name)
            for array in value if isinstance(value, tuple) else (value,):
                if isinstance(array, np.ndarray):
                    found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


def _choice(planner: object, agent_id: int) -> object:
    """What the settings of a run say of the planner of an agent."""
    if isinstance(planner, Mapping) and "planner" not in planner:
        return planner[str(agent_id)]
    return planner


def _is_replay(choice: object) -> bool:
    return (choice.get("planner") if isinstance(choice, Mapping) else choice) == "recorded"


def _is_named(choice: object, name: str) -> bool:
    """Whether a stored choice names a planner that interdrive knows, or code."""
    given = choice.get("planner") if isinstance(choice, Mapping) else choice
    return given in NATIVE or (isinstance(given, str) and ":" in given) or given == name


def _but(given: Mapping[str, Any], agent_id: int) -> dict[int, Any]:
    return {int(key): value for key, value in given.items() if int(key) != agent_id}


def _rows(obstacles: Obstacles, stays: np.ndarray[Any, np.dtype[np.bool_]]) -> Obstacles:
    """The obstacles that stay."""
    kept = np.flatnonzero(stays)
    values: dict[str, Any] = {}
    for item in fields(obstacles):
        value = getattr(obstacles, item.name)
        is_rows = len(value) == len(obstacles.ids)
        if isinstance(value, np.ndarray):
            values[item.name] = value[kept] if is_rows else value
        else:
            values[item.name] = tuple(value[k] for k in kept.tolist()) if is_rows else value
    return replace(obstacles, **values)
