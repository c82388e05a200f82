"""Planners by category, and their differences with intervals that say how much depends on the choice of scenarios."""

from __future__ import annotations

import hashlib
import itertools
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.batches.store import BatchFolder
from interdrive.comparison.caveats import caveats
from interdrive.comparison.intervals import (
    LEVEL,
    PLACES_MIN,
    SAMPLES,
    SEED,
    chance,
    drawn_means,
    draws,
    holm,
    interval,
    mean_of_files,
)
from interdrive.comparison.metrics import METRICS, together, weighted_medians
from interdrive.comparison.paper import paper_table
from interdrive.comparison.places import GROUPS, groups_of
from interdrive.comparison.result import DIFFERENCE_COLUMNS, TABLE_COLUMNS, Comparison
from interdrive.comparison.scores import planner_score, scenario_places
from interdrive.comparison.variants import (
    ALL,
    by_category,
    categories_of,
    chosen,
    compared_sets,
    left_out_humans,
    rows_of,
    variants_of,
)
from interdrive.errors import InputError, ResultsError
from interdrive.storage import Column, Origin, arrow_table, labels

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from interdrive.array_types import Floats, Ints
    from interdrive.comparison.metrics import Metric
    from interdrive.comparison.paper import PaperTable
    from interdrive.comparison.variants import ComparedSet
    from interdrive.storage import ArrowTable

#: Metrics of tables for papers besides the score, arrivals and faults.
_PAPER = ("violations", "ttc_critical", "jerk_rms", "plan_ms")

#: Numbers that are held at once for the medians of samples.
_CELLS_MAX = 10_000_000


def compare(
    folder: str | Path,
    *,
    planners: Sequence[str] | None = None,
    samples: int = SAMPLES,
    level: float = LEVEL,
    seed: int = SEED,
    group: str = "place",
) -> Comparison:
    """Compares the planners of a batch over the agents that all of them drove in the same traffic.

    Intervals come from samples of places, drawn with replacement; all agents of a place go together. Ends are moved
    away from the difference where places are few; with fewer than 5 there is no interval.

    Args:
        folder: Of the batch.
        planners: Labels of the planners to compare; None: all of the batch.
        samples: Bootstrap samples.
        level: Coverage of the intervals.
        seed: Of the samples.
        group: What is drawn together: "place" (one stretch of road, by the names of files), "file" or "agent".

    Raises:
        ResultsError: The folder is no batch, holds no finished run, or runs that cannot be told apart.
        InputError: A number out of range, or a planner that the batch does not have.
    """
    if not 100 <= samples <= 1_000_000:
        raise InputError(f"samples: expected at least 100 and at most 1000000, not {samples}")
    if not 0.5 <= level < 1.0:
        raise InputError(f"level: expected at least 0.5 and below 1, not {level}")
    if group not in GROUPS:
        raise InputError(f"group {group!r}: expected one of {', '.join(GROUPS)}")
    stored = BatchFolder.open(folder).table()
    rows = rows_of(stored)
    rows["category"] = categories_of(rows)
    rows = chosen(rows, planners)
    if not (rows["status"] == "finished").any():
        raise ResultsError(f"{folder}: no run of this batch has finished, there is nothing to compare")
    rows["variant"] = variants_of(rows)
    rows.update({f"value of {metric.name}": metric.values(rows) for metric in METRICS})
    sets, counted, table, own, differences, paper = [], [], [], [], [], []
    for compared, here in _compared(folder, rows):
        here["group"] = groups_of(here, group)
        sets.append(replace(compared, n_places=len({*here["group"][here["counts"]].tolist()})))
        counted.append(here)
        paper.append(_paper(compared, here, folder))
        which = {"traffic": compared.traffic, "agents": compared.agents}
        alone = {**here, "counts": here["drawn"]}
        own += [{**which, "category": ALL, **row, "n_left_out": 0} for row in _table(alone, compared.variants)]
        for category, part in by_category(here):
            table += [{**which, "category": category, **row} for row in _table(part, compared.variants)]
            pairs = [
                {**which, "category": category, "variant": one, "other": other, **row}
                for one, other in itertools.combinations(compared.drivers, 2)
                for row in _differences(part, one, other, samples, level, seed)
            ]
            differences += _adjusted(pairs)
    return Comparison(
        table=_arrow(TABLE_COLUMNS, table),
        differences=_arrow(DIFFERENCE_COLUMNS, differences),
        sets=tuple(sets),
        samples=samples,
        level=level,
        seed=seed,
        caveats=caveats(
            rows,
            sets,
            counted,
            differences,
            level,
            group=group,
            no_humans=left_out_humans(stored) and (planners is None or "recorded" in planners),
        ),
        own=_arrow(TABLE_COLUMNS, own),
        group=group,
        paper=tuple(paper),
        origin=_origin(rows, planners, samples, level, seed, group),
    )


def _paper(one: ComparedSet, here: Mapping[str, Any], folder: str | Path) -> PaperTable:
    """Scores over the agents that all planners drove."""
    places = scenario_places(here)
    mine = {name: here["counts"] & (here["variant"] == name) for name in one.drivers}
    scores = [planner_score(here, rows, {}, places) for rows in mine.values()]
    about = f"{one.title}; {one.size}; interdrive compare {Path(folder).name}"
    further = {
        metric.heading: {
            name: together(metric, metric.values(here)[rows], here["scenario_sha256"][rows].astype(str).tolist())
            for name, rows in mine.items()
        }
        for metric in METRICS
        if metric.name in _PAPER
    }
    return paper_table(scores, places, about, further)


def _origin(
    rows: Mapping[str, NDArray[Any]],
    planners: Sequence[str] | None,
    samples: int,
    level: float,
    seed: int,
    group: str,
) -> Origin:
    """The choices that are not the defaults, and a hash of the states of all runs."""
    given = {"planners": planners, "samples": samples, "level": level, "seed": seed, "group": group}
    usual = {"planners": None, "samples": SAMPLES, "level": LEVEL, "seed": SEED, "group": "place"}
    runs = sorted(set(map(str, rows["digest"].tolist())))
    return Origin(
        {name: value for name, value in given.items() if value != usual[name]},
        {"runs": hashlib.sha256("\n".join(runs).encode()).hexdigest()},
    )


def _compared(folder: str | Path, rows: dict[str, Any]) -> Iterator[tuple[ComparedSet, dict[str, Any]]]:
    try:
        yield from compared_sets(rows)
    except ResultsError as cause:
        raise ResultsError(f"{folder}: {cause}") from None


def _table(part: dict[str, Any], variants: Sequence[str]) -> list[dict[str, Any]]:
    found, files = [], part["scenario_sha256"].astype(str)
    for variant in variants:
        mine = part["variant"] == variant
        if not mine.any():
            continue
        status = dict(zip(part["key"][mine], part["status"][mine], strict=True))
        tested = mine & part["counts"]
        found.append(
            {
                "variant": variant,
                "runs": sum(item == "finished" for item in status.values()),
                "runs_lost": sum(item not in ("finished", "refused") for item in status.values()),
                "n_agents": int(tested.sum()),
                "n_left_out": int((mine & part["drawn"]).sum() - tested.sum()),
                **{
                    metric.name: together(metric, part[f"value of {metric.name}"][tested], files[tested].tolist())
                    for metric in METRICS
                },
            }
        )
    return found


def _differences(
    part: dict[str, Any], one: str, other: str, samples: int, level: float, seed: int
) -> list[dict[str, Any]]:
    """All metrics of one variant minus those of another one, over the agents that count."""
    who = []
    for variant in (one, other):
        rows = np.flatnonzero((part["variant"] == variant) & part["counts"])
        agents = zip(part["scenario_sha256"][rows], part["draw"][rows], part["agent_id"][rows], strict=True)
        who.append(dict(zip(agents, rows.tolist(), strict=True)))
    both = sorted(who[0].keys() & who[1].keys())
    a, b = (np.array([rows[agent] for agent in both], dtype=np.int64) for rows in who)
    files = np.array([agent[0] for agent in both], dtype=str)
    names, group = np.unique(part["group"][a].astype(str), return_inverse=True)
    drawn = draws(max(len(names), 1), samples, seed)
    found = []
    # Single rules are broken too seldom to compare planners by them.
    for metric in (metric for metric in METRICS if not metric.rule):
        values = part[f"value of {metric.name}"]
        pair = np.stack([values[a], values[b]])
        known = ~np.isnan(pair).any(axis=0)
        if metric.traffic and not known.any():
            continue
        pair, place, file = pair[:, known], group[known], files[known]
        difference = float(_difference(metric, pair, place, file, np.ones((1, drawn.shape[1])))[0])
        n = len(np.unique(place))
        spread = _difference(metric, pair, place, file, drawn) if n >= PLACES_MIN else np.empty(0)
        low, high = interval(difference, spread, n, level)
        found.append(
            {
                "metric": metric.name,
                "difference": difference,
                "low": low,
                "high": high,
                "p": chance(difference, spread, n, level),
                "n_agents": len(place),
                "n_scenarios": len(np.unique(file)),
                "n_places": n,
            }
        )
    return found


def _adjusted(pairs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Differences of all pairs of planners with p adjusted after Holm, each metric for itself."""
    for name in {row["metric"] for row in pairs}:
        mine = [row for row in pairs if row["metric"] == name]
        for row, adjusted in zip(mine, holm([row["p"] for row in mine]), strict=True):
            row["p"] = adjusted
    return pairs


def _difference(metric: Metric, pair: Floats, group: Ints, files: NDArray[np.str_], drawn: Floats) -> Floats:
    """The metric of the first minus that of the second, for every sample of groups.

    Args:
        metric: The metric.
        pair: Values of the same agents, shape (2, agents).
        group: Number of the group of each agent, shape (agents,).
        files: Of each agent, shape (agents,).
        drawn: How often every group is in every sample, shape (samples, groups).

    Returns:
        Shape (samples,); nan where no agent is in the sample.
    """
    if not len(group):
        return np.full(len(drawn), np.nan)
    if metric.by_file:
        _, means, names = mean_of_files(pair[0] - pair[1], files.tolist())
        first = dict(zip(reversed(files.tolist()), reversed(group.tolist()), strict=True))
        return drawn_means(means, np.array([first[name] for name in names], dtype=np.int64), drawn)
    if not metric.median:
        return drawn_means(pair[0] - pair[1], group, drawn)
    # In portions: samples times agents can be large.
    portions = np.array_split(drawn, -(-len(drawn) * len(group) // _CELLS_MAX))
    first_median, second = (
        np.concatenate([weighted_medians(values, rows[:, group]) for rows in portions]) for values in pair
    )
    with np.errstate(invalid="ignore"):
        found: Floats = np.where(first_median == second, 0.0, first_median - second)
    return found


def _arrow(columns: Sequence[Column], rows: Sequence[dict[str, Any]]) -> ArrowTable:
    values: dict[str, Any] = {}
    for column in columns:
        cells = [row[column.name] for row in rows]
        values[column.name] = labels(tuple(map(str, cells))) if column.kind == "label" else cells
    return arrow_table(columns, values)
