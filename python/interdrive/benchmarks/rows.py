"""Rows of a benchmark: a planner in one category or in all, and its score in each scenario."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive import _core
from interdrive.benchmarks.ranking import Standings
from interdrive.benchmarks.sets import NON_REACTIVE, REACTIVE
from interdrive.comparison.paper import paper_table
from interdrive.comparison.scores import among, own_agents, planner_score
from interdrive.comparison.variants import ALL

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.benchmarks.ranking import Ranking
    from interdrive.benchmarks.sets import BenchmarkSet, SetFile
    from interdrive.comparison.paper import PaperTable
    from interdrive.comparison.scores import PlannerScore

    _Agents = Mapping[str, set[tuple[int, int]]]

#: The planner that replays what humans drove.
_HUMAN = "recorded"

#: The traffic of sets that state none.
_USUAL = (NON_REACTIVE, REACTIVE)

#: Numbers among reacting traffic, which a replayed human does not have: it does not react.
_REACTIVE = ("score", "score_1", "low", "high", "reached", "at_fault", "ttc_critical", "jerk")


@dataclass(frozen=True)
class Row:
    """One planner in one category, or in all.

    Attributes:
        planner: Label. category: Of the roads, or "all".
        score: Among reacting traffic, 0 to 100; nan in rows of earlier releases. low: End of its interval over places.
        high: Other end.
        non_reactive: The same number among replayed traffic.
        score_1: The score of earlier releases among reacting traffic. score_1_non_reactive: Among replayed traffic.
        hindrance: Mean of the term, reacting traffic. hits: Hits per 100 agents that were not their fault, reacting
            traffic.
        reached: Agents that reached their goal in time, reacting traffic [%].
        at_fault: Collisions at fault per 100 agents, reacting traffic.
        ttc_critical: Share of time with a TTC under 2 s, reacting traffic [%].
        jerk: Root mean square, mean of agents, reacting traffic [m/s³].
        plan_ms: Wall time per plan, replayed traffic [ms].
        n_scenarios: Scenarios. n_agents: Agents.
        zeros: Agents with a score of 0 by reason, reacting traffic.
        version: Of interdrive that made it.
        n_left_out: Agents of the set that the planner cannot drive, or whose recordings overlap those of others; they
            have no row and are no zeros.
        n_common: Agents that all planners of the benchmark can drive; 0 if that is not known.
        common: `score` over those. common_non_reactive: `non_reactive` over those.
        by_traffic: Its score in each kind of traffic, with the weights of classes in sets that have any.
        total: The number of sets with weights: the mean of `by_traffic` over the traffic that counts; nan in other sets
            and in single categories. total_low: End of its interval over places. total_high: Other end.
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
    n_left_out: int = 0
    n_common: int = 0
    common: float = math.nan
    common_non_reactive: float = math.nan
    score_1: float = math.nan
    score_1_non_reactive: float = math.nan
    hindrance: float = math.nan
    hits: float = math.nan
    by_traffic: Mapping[str, float] = field(default_factory=dict)
    total: float = math.nan
    total_low: float = math.nan
    total_high: float = math.nan

    @property
    def number(self) -> float:
        """The number of the planner: `total` in sets with weights, otherwise its score among reacting traffic."""
        return self.score if math.isnan(self.total) else self.total

    @property
    def columns(self) -> dict[str, float]:
        """The score by kind of traffic; nan where it has none."""
        return dict(self.by_traffic) or {NON_REACTIVE: self.non_reactive, REACTIVE: self.score}


def planner_rows(
    rows: Mapping[str, Any], labels: Sequence[str], there: Sequence[SetFile], traffic: Sequence[str] = _USUAL
) -> list[Row]:
    """Per planner all categories together, then each of several; `traffic` is what was driven."""
    categories = sorted({file.category for file in there})
    own = {label: _own(rows, label, there, traffic) for label in labels}
    common = {file.sha256: set.intersection(*(agents[file.sha256] for agents in own.values())) for file in there}
    found = []
    for label in labels:
        for category in [ALL, *categories] if len(categories) > 1 else [ALL]:
            part = [file for file in there if category in (ALL, file.category)]
            found.append(_row(rows, label, category, part, own[label], common, traffic))
    return found


def standings(
    rows: Mapping[str, Any],
    labels: Sequence[str],
    there: Sequence[SetFile],
    chosen: BenchmarkSet,
    traffic: Sequence[str] = _USUAL,
) -> Standings:
    """Scores of planners in each kind of traffic by file, or by place in sets with weights.

    Args:
        rows: Columns of the data set as arrays.
        labels: Planners.
        there: Files of the set that were driven.
        chosen: The set.
        traffic: What was driven.
    """
    is_weighted = bool(chosen.weights)
    units = sorted({(file.place if is_weighted else file.sha256, file.place, file.road_class) for file in there})
    values = np.full((len(labels), len(traffic), len(units)), math.nan)
    unit_of = {file.sha256: file.place if is_weighted else file.sha256 for file in there}
    number = {name: u for u, (name, _, _) in enumerate(units)}
    for p, label in enumerate(labels):
        own = _own(rows, label, there, traffic)
        for c, kind in enumerate(traffic):
            if kind not in _judged_in(label, traffic):
                continue
            one = planner_score(rows, _mine(rows, label, kind, there), own, {file.sha256: file.place for file in there})
            inside: dict[int, list[float]] = {}
            for sha256, score in one.by_scenario.items():
                inside.setdefault(number[unit_of[sha256]], []).append(100.0 * score)
            for u, scores in inside.items():
                values[p, c, u] = float(np.mean(scores))
    return Standings(
        planners=tuple(labels),
        traffic=tuple(traffic),
        values=values,
        places=tuple(place for _, place, _ in units),
        classes=tuple(road_class if is_weighted else "" for _, _, road_class in units),
        weights=chosen.weights or {"": 1.0},
        counted=chosen.counted if {*chosen.counted} <= {*traffic} else (),
    )


def with_totals(made: Sequence[Row], ranking: Ranking, *, is_weighted: bool) -> list[Row]:
    """Rows of all categories with what the ranking says of them."""
    ranks = {one.planner: one for one in ranking.ranks}
    found = []
    for row in made:
        one = ranks[row.planner]
        if row.category == ALL:
            row = replace(row, by_traffic=dict(one.columns))  # noqa: PLW2901 - the same row with more of it
            if is_weighted:
                row = replace(row, total=one.number, total_low=one.low, total_high=one.high)  # noqa: PLW2901 - likewise
        found.append(row)
    return found


def paper(
    rows: Mapping[str, Any],
    labels: Sequence[str],
    there: Sequence[SetFile],
    about: str,
    numbers: Mapping[str, float] | None = None,
) -> PaperTable:
    """The table for a paper: planners among reacting traffic, over the agents that all of them can drive.

    Args:
        rows: Of the batch.
        labels: The planners.
        there: The files.
        about: What was driven, and the command, for the caption.
        numbers: The number of each planner in sets that weight classes, which differs from its score.
    """
    labels = [label for label in labels if label != _HUMAN]
    own = {label: _own(rows, label, there) for label in labels}
    common = {file.sha256: set.intersection(*(agents[file.sha256] for agents in own.values())) for file in there}
    scores = [_scores(rows, label, there, common, only=True)[REACTIVE] for label in labels]
    every = [_row(rows, label, ALL, there, own[label], common) for label in labels]
    further = {
        **({"number": numbers} if numbers else {}),
        "NR": {row.planner: row.common_non_reactive for row in every},
        "hindrance": {row.planner: 100.0 * row.hindrance for row in every},
        "hits per 100": {row.planner: row.hits for row in every},
        "TTC < 2 s %": {row.planner: row.ttc_critical for row in every},
        "jerk": {row.planner: row.jerk for row in every},
        "plan ms": {row.planner: row.plan_ms for row in every},
    }
    if numbers:
        weighted = "Number: with the weights of classes, mean over the traffic that counts"
        about = f"{about.rstrip('.')}. {weighted}; other columns: among {REACTIVE}, NR among replayed traffic"
    return paper_table(scores, {file.sha256: file.place for file in there}, about, further)


def scenario_scores(rows: Mapping[str, Any], label: str, there: Sequence[SetFile]) -> dict[str, dict[str, float]]:
    """100 times the mean score of the agents of each scenario, by its name and by traffic."""
    scores = _scores(rows, label, there, _own(rows, label, there))
    found: dict[str, dict[str, float]] = {}
    for file in there:
        for traffic, one in scores.items():
            if file.sha256 in one.by_scenario:
                found.setdefault(file.name, {})[traffic] = 100.0 * one.by_scenario[file.sha256]
    return found


def _listed(part: Sequence[SetFile]) -> _Agents:
    """The agents (seed, id) of files by the hash of their content."""
    return {file.sha256: {(0, number) for number in file.agents} for file in part}


def _judged_in(label: str, traffic: Sequence[str]) -> tuple[str, ...]:
    """The traffic among which a planner is judged, of what was driven: replayed humans do not react."""
    return tuple(kind for kind in traffic if label != _HUMAN or kind == NON_REACTIVE)


def _mine(rows: Mapping[str, Any], label: str, traffic: str, part: Sequence[SetFile]) -> Any:  # noqa: ANN401 - truths
    """Runs of a planner, of agents that the set lists; runs that were lost do not name one."""
    agents = {file.sha256: {*file.agents} for file in part}
    scenario, number = rows["scenario_sha256"].astype(str), rows["agent_id"]
    listed = np.array(
        [name in agents and (math.isnan(who) or int(who) in agents[name])
         for name, who in zip(scenario.tolist(), number.tolist(), strict=True)], dtype=np.bool_
    )  # fmt: skip
    return (rows["planner"] == label) & (rows["traffic"] == traffic) & listed


def _own(rows: Mapping[str, Any], label: str, part: Sequence[SetFile], traffic: Sequence[str] = _USUAL) -> _Agents:
    """The agents that a planner can drive in each traffic among which it is judged; lost ones are among them."""
    listed = _listed(part)
    each = [own_agents(rows, _mine(rows, label, kind, part), listed) for kind in _judged_in(label, traffic)]
    return {name: set.intersection(*(agents[name] for agents in each)) if each else set() for name in listed}


def _scores(
    rows: Mapping[str, Any],
    label: str,
    part: Sequence[SetFile],
    agents: _Agents,
    *,
    only: bool = False,
    driven: Sequence[str] = _USUAL,
) -> dict[str, PlannerScore]:
    """The score of some agents by traffic, of others as well unless `only`; what traffic did does not count."""
    places = {file.sha256: file.place for file in part}
    here = {file.sha256: agents[file.sha256] for file in part}
    found = {}
    for traffic in (NON_REACTIVE, REACTIVE):
        judged = traffic in _judged_in(label, driven)
        mine = _mine(rows, label, traffic, part) & judged
        if only:
            mine &= among(rows, here)
        found[traffic] = planner_score(rows, mine, here if judged else {}, places)
    return found


def _row(
    rows: Mapping[str, Any],
    label: str,
    category: str,
    part: Sequence[SetFile],
    own: _Agents,
    common: _Agents,
    driven: Sequence[str] = _USUAL,
) -> Row:
    scores = _scores(rows, label, part, own, driven=driven)
    shared = _scores(rows, label, part, common, only=True, driven=driven)
    reactive = scores[REACTIVE]
    counted = scores[NON_REACTIVE] if label == _HUMAN else reactive

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
        n_scenarios=counted.n_scenarios,
        n_agents=counted.n_agents,
        zeros=reactive.zeros,
        version=_core.__version__,
        n_left_out=sum(len(file.agents) - len(own[file.sha256]) for file in part),
        n_common=sum(len(common[file.sha256]) for file in part),
        common=shared[REACTIVE].score,
        common_non_reactive=shared[NON_REACTIVE].score,
        score_1=reactive.score_1,
        score_1_non_reactive=scores[NON_REACTIVE].score_1,
        hindrance=mean("hindrance", REACTIVE, 1.0),
        hits=mean("hits", REACTIVE, 100.0),
    )


def plain(row: Row) -> dict[str, Any]:
    """A row for JSON, with `number` and `columns`; numbers that are absent are null."""
    values = {**vars(row), "number": row.number, "columns": row.columns}
    return {name: _plain(value) for name, value in values.items()}


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {key: _plain(one) for key, one in value.items()}
    return None if isinstance(value, float) and math.isnan(value) else value


def from_plain(row: Mapping[str, Any], there: Sequence[SetFile]) -> Row:
    """What `plain` made, of a row that comes with a set; `there` are the files of its split.

    Which agents it has in common with other planners is not known: none is stored with it. Rows of earlier releases
    have no `score_1`: what they call their score is that.
    """
    texts = ("planner", "category", "zeros", "version")
    values: dict[str, Any] = {
        name: math.nan if value is None and name not in texts else value
        for name, value in row.items()
        if name not in ("number", "columns")
    }
    by_traffic = row.get("by_traffic") or {}
    values["by_traffic"] = {kind: math.nan if value is None else value for kind, value in by_traffic.items()}
    if "score_1" not in row:
        values |= {"score_1": values["score"], "score_1_non_reactive": values["non_reactive"]}
        values |= dict.fromkeys(("score", "low", "high", "non_reactive"), math.nan) | {"zeros": {}}
    if row["planner"] == _HUMAN:
        values |= {**dict.fromkeys(_REACTIVE, math.nan), "zeros": {}}
    n_listed = sum(len(file.agents) for file in there if row["category"] in (ALL, file.category))
    left_out = {"n_left_out": n_listed - int(row["n_agents"])}
    return Row(**(values | left_out | {"n_common": 0, "common": math.nan, "common_non_reactive": math.nan}))
