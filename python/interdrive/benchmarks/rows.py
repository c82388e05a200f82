"""Rows of a benchmark: a planner in one category or in all, and its score in each scenario."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive import _core
from interdrive.comparison.scores import planner_score
from interdrive.comparison.variants import ALL

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.benchmarks.sets import SetFile
    from interdrive.comparison.scores import PlannerScore

#: Traffic that replays its recording, and traffic that adjusts its speed; the number is that of the last.
NON_REACTIVE, REACTIVE = "recorded", "velocity_adjusting"

#: The planner that replays what humans drove.
_HUMAN = "recorded"


@dataclass(frozen=True)
class Row:
    """One planner in one category, or in all.

    Attributes:
        planner: Label. category: Of the roads, or "all".
        score: Among reacting traffic, 0 to 100. low: End of its interval over places. high: Other end.
        non_reactive: The same number among replayed traffic.
        reached: Agents that reached their goal in time, reacting traffic [%].
        at_fault: Collisions at fault per 100 agents, reacting traffic.
        ttc_critical: Share of time with a TTC under 2 s, reacting traffic [%].
        jerk: Root mean square, mean of agents, reacting traffic [m/s³].
        plan_ms: Wall time per plan, replayed traffic [ms].
        n_scenarios: Scenarios. n_agents: Agents.
        zeros: Agents with a score of 0 by reason, reacting traffic.
        version: Of interdrive that made it.
    """

    planner: str
    category: str
    score: float
    low: float
    high: float
    non_reactive: float
    reached: float
    at_fault: float
    ttc_critical: float
    jerk: float
    plan_ms: float
    n_scenarios: int
    n_agents: int
    zeros: Mapping[str, int]
    version: str


def planner_rows(rows: Mapping[str, Any], label: str, there: Sequence[SetFile]) -> list[Row]:
    """All categories together, then each of several."""
    categories = sorted({file.category for file in there})
    found = []
    for category in [ALL, *categories] if len(categories) > 1 else [ALL]:
        part = [file for file in there if category in (ALL, file.category)]
        found.append(_row(rows, label, category, part))
    return found


def scenario_scores(rows: Mapping[str, Any], label: str, there: Sequence[SetFile]) -> dict[str, dict[str, float]]:
    """100 times the mean score of the agents of each scenario, by its name and by traffic."""
    scores = _scores(rows, label, there)
    found: dict[str, dict[str, float]] = {}
    for file in there:
        for traffic, one in scores.items():
            if file.sha256 in one.by_scenario:
                found.setdefault(file.name, {})[traffic] = 100.0 * one.by_scenario[file.sha256]
    return found


def _mine(rows: Mapping[str, Any], label: str, traffic: str, part: Sequence[SetFile]) -> Any:  # noqa: ANN401 - truths
    """Runs of a planner, of agents that the set lists; runs that were lost do not name one."""
    agents = {file.sha256: {*file.agents} for file in part}
    scenario, number = rows["scenario_sha256"].astype(str), rows["agent_id"]
    listed = np.array(
        [name in agents and (math.isnan(who) or int(who) in agents[name])
         for name, who in zip(scenario.tolist(), number.tolist(), strict=True)], dtype=np.bool_
    )  # fmt: skip
    mine = (rows["planner"] == label) & (rows["traffic"] == traffic) & listed
    if label == _HUMAN:  # among replayed traffic another planner drives what no human drove
        mine &= (rows["under_test"] != 1) | (rows["agent_planner"].astype(str) == label)
    return mine


def _scores(rows: Mapping[str, Any], label: str, part: Sequence[SetFile]) -> dict[str, PlannerScore]:
    """The score among replayed and among reacting traffic; what traffic did in these runs does not count."""
    # What no human drove cannot be replayed: it says nothing about humans, and is not lost. Runs that fail still are.
    agents = {file.sha256: {(0, number) for number in file.agents if label != _HUMAN} for file in part}
    places = {file.sha256: file.place for file in part}
    return {
        traffic: planner_score(rows, _mine(rows, label, traffic, part), agents, places)
        for traffic in (NON_REACTIVE, REACTIVE)
    }


def _row(rows: Mapping[str, Any], label: str, category: str, part: Sequence[SetFile]) -> Row:
    scores = _scores(rows, label, part)
    reactive = scores[REACTIVE]

    def mean(name: str, traffic: str, scale: float) -> float:
        tested = _mine(rows, label, traffic, part) & (rows["under_test"] == 1)
        values = rows[name][tested].astype(np.float64)
        known = values[np.isfinite(values)]
        return scale * float(known.mean()) if len(known) else math.nan

    return Row(
        planner=label,
        category=category,
        score=reactive.score,
        low=reactive.low,
        high=reactive.high,
        non_reactive=scores[NON_REACTIVE].score,
        reached=reactive.reached,
        at_fault=reactive.at_fault,
        ttc_critical=mean("ttc_critical", REACTIVE, 100.0),
        jerk=mean("jerk_rms", REACTIVE, 1.0),
        plan_ms=mean("plan_seconds", NON_REACTIVE, 1000.0),
        n_scenarios=reactive.n_scenarios,
        n_agents=reactive.n_agents,
        zeros=reactive.zeros,
        version=_core.__version__,
    )


def plain(row: Row) -> dict[str, Any]:
    """A row for JSON, numbers that are absent as null."""
    return {
        name: None if isinstance(value, float) and math.isnan(value) else dict(value) if name == "zeros" else value
        for name, value in vars(row).items()
    }


def from_plain(row: Mapping[str, Any]) -> Row:
    """What `plain` made."""
    texts = ("planner", "category", "zeros", "version")
    values: dict[str, Any] = {
        name: math.nan if value is None and name not in texts else value for name, value in row.items()
    }
    return Row(**values)
