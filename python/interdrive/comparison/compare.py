"""Planners by category, and their differences with intervals that say how much depends on the choice of scenarios."""

from __future__ import annotations

import hashlib
import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.batches.store import BatchFolder
from interdrive.comparison.caveats import caveats
from interdrive.comparison.metrics import METRICS, together, weighted_medians
from interdrive.comparison.result import DIFFERENCE_COLUMNS, TABLE_COLUMNS, Comparison
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
    from pathlib import Path

    from numpy.typing import NDArray

    from interdrive.array_types import Floats, Ints
    from interdrive.comparison.metrics import Metric
    from interdrive.comparison.variants import ComparedSet
    from interdrive.storage import ArrowTable

#: Numbers that are held at once for the medians of samples.
_CELLS_MAX = 10_000_000


def compare(
    folder: str | Path,
    *,
    planners: Sequence[str] | None = None,
    samples: int = 2000,
    level: float = 0.95,
    seed: int = 0,
) -> Comparison:
    """Compares the planners of a batch over the agents that all of them drove in the same traffic.

    Intervals are percentiles of the differences in samples of scenarios, drawn with replacement; all agents of a
    scenario go together (Efron and Tibshirani, "An Introduction to the Bootstrap", 1993, chapters 8 and 13).

    Args:
        folder: Of the batch.
        planners: Labels of the planners to compare; None: all of the batch.
        samples: Bootstrap samples.
        level: Coverage of the intervals.
        seed: Of the samples.

    Raises:
        ResultsError: The folder is no batch, holds no finished run, or runs that cannot be told apart.
        InputError: A number out of range, or a planner that the batch does not have.
    """
    if not 100 <= samples <= 1_000_000:
        raise InputError(f"samples: expected at least 100 and at most 1000000, not {samples}")
    if not 0.5 <= level < 1.0:
        raise InputError(f"level: expected at least 0.5 and below 1, not {level}")
    stored = BatchFolder.open(folder).table()
    rows = rows_of(stored)
    rows["category"] = categories_of(rows)
    rows = chosen(rows, planners)
    if not (rows["status"] == "finished").any():
        raise ResultsError(f"{folder}: no run of this batch has finished, there is nothing to compare")
    rows["variant"] = variants_of(rows)
    rows.update({f"value of {metric.name}": metric.values(rows) for metric in METRICS})
    sets, counted, table, own, differences = [], [], [], [], []
    for compared, here in _compared(folder, rows):
        sets.append(compared)
        counted.append(here)
        which = {"traffic": compared.traffic, "agents": compared.agents}
        alone = {**here, "counts": here["drawn"]}
        own += [{**which, "category": ALL, **row, "n_left_out": 0} for row in _table(alone, compared.variants)]
        for category, part in by_category(here):
            table += [{**which, "category": category, **row} for row in _table(part, compared.variants)]
            for one, other in itertools.combinations(compared.drivers, 2):
                differences += [
                    {**which, "category": category, "variant": one, "other": other, **row}
                    for row in _differences(part, one, other, samples, level, seed)
                ]
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
            no_humans=left_out_humans(stored) and (planners is None or "recorded" in planners),
        ),
        own=_arrow(TABLE_COLUMNS, own),
        origin=_origin(rows, planners, samples, level, seed),
    )


def _origin(
    rows: Mapping[str, NDArray[Any]], planners: Sequence[str] | None, samples: int, level: float, seed: int
) -> Origin:
    """The choices that are not the defaults, and a hash of the states of all runs."""
    given = {"planners": planners, "samples": samples, "level": level, "seed": seed}
    usual = {"planners": None, "samples": 2000, "level": 0.95, "seed": 0}
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
    found = []
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
                **{metric.name: together(metric, part[f"value of {metric.name}"][tested]) for metric in METRICS},
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
    names, scenario = np.unique(np.array([agent[0] for agent in both], dtype=str), return_inverse=True)
    n = len(names)
    # How often every scenario is in every sample, shape (samples, scenarios).
    drawn = (
        np.random.default_rng(seed).multinomial(n, np.full(n, 1.0 / n), size=samples).astype(np.float64)
        if n > 1
        else None
    )
    found = []
    # Single rules are broken too seldom to compare planners by them.
    for metric in (metric for metric in METRICS if not metric.rule):
        values = part[f"value of {metric.name}"]
        pair = np.stack([values[a], values[b]]) if both else np.empty((2, 0))
        known = ~np.isnan(pair).any(axis=0)
        pair, place = pair[:, known], scenario[known] if both else np.empty(0, dtype=np.int64)
        difference = _difference(metric, pair, place, np.ones((1, max(n, 1))))
        low = high = float("nan")
        spread = _difference(metric, pair, place, drawn) if drawn is not None else np.empty(0)
        spread = spread[~np.isnan(spread)]
        if len(spread):
            low, high = np.quantile(spread, [0.5 - 0.5 * level, 0.5 + 0.5 * level], method="nearest").tolist()
        found.append(
            {
                "metric": metric.name,
                "difference": float(difference[0]),
                "low": low,
                "high": high,
                "n_agents": len(place),
                "n_scenarios": len(np.unique(place)),
            }
        )
    return found


def _difference(metric: Metric, pair: Floats, scenario: Ints, drawn: Floats) -> Floats:
    """The metric of the first minus that of the second, for every sample of scenarios.

    Args:
        metric: The metric.
        pair: Values of the same agents, shape (2, agents).
        scenario: Of each agent, shape (agents,).
        drawn: How often every scenario is in every sample, shape (samples, scenarios).

    Returns:
        Shape (samples,); nan where no agent is in the sample.
    """
    if not metric.median:
        n = drawn.shape[1]
        total = drawn @ np.bincount(scenario, minlength=n)
        apart = drawn @ np.bincount(scenario, weights=pair[0] - pair[1], minlength=n)
        mean: Floats = apart / np.where(total > 0, total, np.nan)
        return mean
    if not len(scenario):
        return np.full(len(drawn), np.nan)
    # In portions: samples times agents can be large.
    portions = np.array_split(drawn, -(-len(drawn) * len(scenario) // _CELLS_MAX))
    first, second = (
        np.concatenate([weighted_medians(values, rows[:, scenario]) for rows in portions]) for values in pair
    )
    with np.errstate(invalid="ignore"):
        found: Floats = np.where(first == second, 0.0, first - second)
    return found


def _arrow(columns: Sequence[Column], rows: Sequence[dict[str, Any]]) -> ArrowTable:
    values: dict[str, Any] = {}
    for column in columns:
        cells = [row[column.name] for row in rows]
        values[column.name] = labels(tuple(map(str, cells))) if column.kind == "label" else cells
    return arrow_table(columns, values)
