"""Scores of the planners of a batch: means of scenarios with intervals, and all zeros by reason."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.batches.plan import ALONE, TRAFFIC
from interdrive.batches.store import BatchFolder
from interdrive.comparison.intervals import mean_interval, mean_of_files
from interdrive.comparison.places import place_of
from interdrive.comparison.variants import rows_of, variants_of
from interdrive.errors import ResultsError
from interdrive.scoring import FAULT_KINDS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from interdrive.array_types import Bools, Ints

#: Why a score is 0, in the order in which it is looked for.
ZEROS = (
    *("lost", "planner_error", "infeasible", *FAULT_KINDS, "off_road"),
    *("direction", "red_light", "crosswalk", "right_of_way", "speed", "terms"),
)

#: Gates that can be 0 besides those that outcomes and faults tell.
_GATES = ("direction", "red_light", "crosswalk", "right_of_way", "speed")


@dataclass(frozen=True)
class PlannerScore:
    """The score of one planner in one kind of traffic.

    Attributes:
        variant: The planner, with whatever else distinguishes it.
        traffic: What the others do. agents: Agents under test.
        score: From 0 to 100: mean of the agents of each scenario, mean of the scenarios. low: End of its interval
            over places; nan with fewer than 5. high: Other end.
        score_1: The score of earlier releases.
        n_scenarios: Scenarios. n_agents: Agents, lost ones included.
        at_fault: Collisions at fault per 100 agents. at_fault_nuplan: By nuPlan's verdict.
        reached: Agents that reached their goal in time [%].
        zeros: Agents with a score of 0 by reason (`ZEROS`).
        by_scenario: Score of each scenario (SHA-256 of its content), from 0 to 1.
        n_left_out: Agents that another planner drove and this one cannot drive, and agents whose recordings overlap
            those of others; they have no row and are no zeros.
        n_common: Agents that all planners can drive.
        common: The score over those; nan without any.
        panel: Drivers that drove in the agents' places; "" if none did, and several texts with a semicolon if they
            differ.
        is_former: An earlier release scored: `score` is score_1.
    """

    variant: str
    traffic: str
    agents: str
    score: float
    low: float
    high: float
    score_1: float
    n_scenarios: int
    n_agents: int
    at_fault: float
    at_fault_nuplan: float
    reached: float
    zeros: Mapping[str, int]
    by_scenario: Mapping[str, float] = field(repr=False)
    n_left_out: int = 0
    n_common: int = 0
    common: float = float("nan")
    panel: str = ""
    is_former: bool = False


def batch_scores(folder: str | Path) -> list[PlannerScore]:
    """The scores of all planners of a batch, by traffic and choice of agents.

    An agent that another planner drove and that was lost here (its run crashed, or took too long) counts as 0. An
    agent that the planner cannot drive does not count.

    Raises:
        ResultsError: The folder is no batch, or holds no finished run.
    """
    rows = rows_of(BatchFolder.open(folder).table())
    if not len(rows["key"]) or not (rows["status"] == "finished").any():
        raise ResultsError(f"{folder}: no run of this batch has finished, there is nothing to score")
    rows["variant"] = variants_of(rows)
    is_former = bool(np.isnan(rows["score"].astype(np.float64)).all())
    if is_former:
        rows["score"] = rows["score_1"]
    settings = sorted(set(zip(rows["traffic"], rows["agents"], strict=True)), key=lambda s: (TRAFFIC.index(s[0]), s[1]))
    found = []
    for traffic, agents in settings:
        here = (rows["traffic"] == traffic) & (rows["agents"] == agents)
        expected, places = expected_agents(rows, here), scenario_places(rows)
        runs = {name: here & (rows["variant"] == name) for name in sorted(set(rows["variant"][here].tolist()))}
        own = {name: own_agents(rows, mine, expected) for name, mine in runs.items()}
        common = {name: set.intersection(*(agents[name] for agents in own.values())) for name in expected}
        for name, mine in runs.items():
            one = planner_score(rows, mine, own[name], places)
            shared = planner_score(rows, mine & among(rows, common), common) if any(common.values()) else None
            found.append(
                replace(
                    one,
                    n_left_out=sum(len(expected[key] - own[name][key]) for key in expected),
                    n_common=sum(map(len, common.values())),
                    common=shared.score if shared else float("nan"),
                    is_former=is_former,
                )
            )
    return found


def scenario_places(rows: Mapping[str, Any]) -> dict[str, str]:
    """The place of each scenario by its hash, as far as names tell."""
    names = zip(rows["scenario_sha256"].astype(str).tolist(), rows["scenario"].tolist(), strict=True)
    return {sha256: place_of(str(name)) or sha256 for sha256, name in names}


def own_agents(
    rows: Mapping[str, Any], mine: Bools, expected: Mapping[str, set[tuple[int, int]]]
) -> dict[str, set[tuple[int, int]]]:
    """Of some agents those by which a planner is judged, by scenario; lost ones are among them.

    These are the agents that it can drive and whose recordings do not overlap those of others. A refused run does not
    name its agent: in a scenario with such runs, as many that were not driven are left out.

    Args:
        rows: Columns of the data set as arrays, as `rows_of` makes them.
        mine: Which rows are of the planner.
        expected: The agents (seed, id) by scenario.
    """
    driven = expected_agents(rows, mine)
    refused = Counter(rows["scenario_sha256"][mine & (rows["status"] == "refused")].astype(str).tolist())
    unable: dict[str, set[tuple[int, int]]] = {}
    for row in np.flatnonzero(mine & rows["unable"]).tolist():
        unable.setdefault(str(rows["scenario_sha256"][row]), set()).add(
            (int(rows["seed"][row]), int(rows["agent_id"][row]))
        )
    unscored = _unscored(rows)
    found = {}
    for name, agents in expected.items():
        there = driven.get(name, set())
        absent = sorted(agents - there - unable.get(name, set()))
        found[name] = (there | set(absent[refused[name] :])) - unscored.get(name, set())
    return found


def _unscored(rows: Mapping[str, Any]) -> dict[str, set[tuple[int, int]]]:
    """Agents (seed, id) that have no score although they drove, as their recordings overlap those of others."""
    return expected_agents(rows, (rows["status"] == "finished") & np.isnan(rows["score"].astype(np.float64)))


def among(rows: Mapping[str, Any], agents: Mapping[str, set[tuple[int, int]]]) -> Bools:
    """Rows of these agents under test."""
    found: Bools = rows["under_test"] == 1
    for row in np.flatnonzero(found).tolist():
        agent = int(rows["seed"][row]), int(rows["agent_id"][row])
        found[row] = agent in agents.get(str(rows["scenario_sha256"][row]), set())
    return found


def expected_agents(rows: Mapping[str, Any], here: Bools) -> dict[str, set[tuple[int, int]]]:
    """Agents (seed, id) that any planner drove, by scenario."""
    found: dict[str, set[tuple[int, int]]] = {}
    for row in np.flatnonzero(here & (rows["under_test"] == 1)).tolist():
        agent = int(rows["seed"][row]), int(rows["agent_id"][row])
        found.setdefault(str(rows["scenario_sha256"][row]), set()).add(agent)
    return found


def planner_score(
    rows: Mapping[str, Any],
    mine: Bools,
    expected: Mapping[str, set[tuple[int, int]]],
    groups: Mapping[str, str] | None = None,
) -> PlannerScore:
    """The score over the rows of one planner.

    Args:
        rows: Columns of the data set as arrays, with `variant`.
        mine: Which rows count.
        expected: Agents (seed, id) by scenario; those without a row count as 0.
        groups: The place of each scenario, by its hash: what intervals draw together; each alone by default.
    """
    tested = np.flatnonzero(mine & (rows["under_test"] == 1) & ~np.isnan(rows["score"].astype(np.float64)))
    score, former = (rows[name][tested].astype(np.float64) for name in ("score", "score_1"))
    scenario = rows["scenario_sha256"][tested].astype(str)
    driven: dict[str, set[tuple[int, int]]] = {}
    for row, name in zip(tested.tolist(), scenario.tolist(), strict=True):
        driven.setdefault(name, set()).add((int(rows["seed"][row]), int(rows["agent_id"][row])))
    failures = _failures(rows, mine)
    names = sorted({name for name in expected if expected[name]} | set(driven))
    n_lost = {
        name: max(len(expected.get(name, set()) - driven.get(name, set())), failures.get(name, 0)) for name in names
    }
    lost = [name for name in names for _ in range(n_lost[name])]
    total, means, _ = mean_of_files(np.append(score, np.zeros(len(lost))), [*scenario.tolist(), *lost])
    former_total = mean_of_files(np.append(former, np.zeros(len(lost))), [*scenario.tolist(), *lost])[0]
    n_agents = len(tested) + len(lost)
    low, high = mean_interval(100.0 * means, [groups[name] if groups else name for name in names])
    first = next(iter(np.flatnonzero(mine).tolist()), None)

    def per_hundred(values: NDArray[Any]) -> float:
        return 100.0 * float(np.nansum(values[tested].astype(np.float64))) / n_agents if n_agents else float("nan")

    return PlannerScore(
        variant="" if first is None else str(rows["variant"][first]),
        traffic="" if first is None else str(rows["traffic"][first]),
        agents="" if first is None else str(rows["agents"][first]),
        score=100.0 * total,
        low=low,
        high=high,
        score_1=100.0 * former_total,
        n_scenarios=len(names),
        n_agents=n_agents,
        at_fault=per_hundred(rows["fault"]),
        at_fault_nuplan=per_hundred(rows["fault_nuplan"]),
        reached=per_hundred(rows["outcome"] == "goal_reached"),
        zeros=_zeros(rows, tested[score == 0.0], len(lost)),
        by_scenario=dict(zip(names, means.tolist(), strict=True)),
        panel="; ".join(sorted({name for name in rows["panel"][tested].tolist() if isinstance(name, str)})),
    )


def _failures(rows: Mapping[str, Any], mine: Bools) -> Counter[str]:
    """Runs of single agents that were lost, by scenario; runs of several agents do not say how many these were."""
    lost = mine & (rows["agents"] == ALONE) & ~np.isin(rows["status"].astype(str), ["finished", "refused"])
    return Counter(rows["scenario_sha256"][lost].astype(str).tolist())


def _zeros(rows: Mapping[str, Any], zero: Ints, lost: int) -> dict[str, int]:
    found = Counter(_reason(rows, row) for row in zero.tolist())
    found["lost"] = lost
    return {name: found[name] for name in ZEROS if found[name]}


def _reason(rows: Mapping[str, Any], row: int) -> str:
    outcome = str(rows["outcome"][row])
    if outcome in ("planner_error", "infeasible"):
        return outcome
    if kind := rows["fault_kind"][row]:
        return str(kind)
    if outcome == "collision" and rows["off_road"][row] == 1:
        return "off_road"
    return next((name for name in _GATES if rows[f"gate_{name}"][row] == 0.0), "terms")
