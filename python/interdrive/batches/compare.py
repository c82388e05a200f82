"""Planners by category, and their differences with intervals that say how much depends on the choice of scenarios."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.batches.folder import BatchFolder
from interdrive.batches.metrics import METRICS, together, weighted_medians
from interdrive.batches.reservations import reservations
from interdrive.batches.sheets import markdown
from interdrive.batches.variants import arrays, by_category, categories_of, chosen, compared_sets, variants_of
from interdrive.errors import InputError, ResultsError
from interdrive.results import Column, arrow_table, check_folder, labels, replacing, write_table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from interdrive.batches.metrics import Metric
    from interdrive.batches.variants import ComparedSet
    from interdrive.results import ArrowTable

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]

#: Numbers that are held at once for the medians of samples.
_CELLS_MAX = 10_000_000

_WHICH = (
    Column("traffic", "label", "what vehicles do that are not under test"),
    Column("agents", "label", "who is under test"),
    Column("category", "label", "folder of the scenarios, or all"),
)

#: Files of a comparison on disk; the first one marks its folder.
_MARK = "reservations.txt"
_FILES = (
    *(_MARK, "comparison.md", "comparison.pdf", "comparison.png"),
    *(f"{name}.{ending}" for name in ("table", "differences") for ending in ("parquet", "csv")),
)

#: One row per traffic, agents, category and variant.
TABLE_COLUMNS = (
    *_WHICH,
    Column("variant", "label", "planner, with predictor, settings and version if there are several"),
    Column("runs", "integer", "runs that finished"),
    Column("runs_lost", "integer", "runs that failed, crashed or were ended; refused ones are not among them"),
    Column("n_agents", "integer", "agents under test that all variants drove; all else is about them"),
    *(Column(metric.name, "number", metric.heading, nullable=True) for metric in METRICS),
)

#: One row per traffic, agents, category, pair of variants and metric.
DIFFERENCE_COLUMNS = (
    *_WHICH,
    Column("variant", "label", "the one"),
    Column("other", "label", "the other one"),
    Column("metric", "label", "one of interdrive.batches.METRICS"),
    Column("difference", "number", "of the one minus the other, over agents that all variants drove", nullable=True),
    Column("low", "number", "lower end of the interval", nullable=True),
    Column("high", "number", "upper end of the interval", nullable=True),
    Column("n_agents", "integer", "agents for whom both have a value"),
    Column("n_scenarios", "integer", "scenarios of these agents"),
)


@dataclass(frozen=True)
class Comparison:
    """Planners of a batch compared.

    Attributes:
        table: The columns are `TABLE_COLUMNS`.
        differences: The columns are `DIFFERENCE_COLUMNS`.
        sets: What is compared, and over which agents; rows of both tables belong to one by traffic and agents.
        samples: Bootstrap samples. level: Coverage of the intervals. seed: Of the samples.
        reservations: What the numbers do not prove, one line each.
    """

    table: ArrowTable
    differences: ArrowTable
    sets: tuple[ComparedSet, ...]
    samples: int
    level: float
    seed: int
    reservations: tuple[str, ...]


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
        planners: Labels of those that are compared; all of the batch by default.
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
    rows = arrays(BatchFolder.open(folder).table())
    rows["category"] = categories_of(rows)
    rows = chosen(rows, planners)
    if not (rows["status"] == "finished").any():
        raise ResultsError(f"{folder}: no run of this batch has finished, there is nothing to compare")
    rows["variant"] = variants_of(rows)
    rows.update({f"value of {metric.name}": metric.values(rows) for metric in METRICS})
    sets, counted, table, differences = [], [], [], []
    for compared, here in _compared(folder, rows):
        sets.append(compared)
        counted.append(here)
        which = {"traffic": compared.traffic, "agents": compared.agents}
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
        reservations=reservations(rows, sets, counted, differences, level),
    )


def _compared(folder: str | Path, rows: dict[str, Any]) -> Iterator[tuple[ComparedSet, dict[str, Any]]]:
    try:
        yield from compared_sets(rows)
    except ResultsError as cause:
        raise ResultsError(f"{folder}: {cause}") from None


def save_comparison(found: Comparison, folder: str | Path, *, overwrite: bool = False) -> Path:
    """Writes table and differences (Parquet, CSV, together as Markdown), reservations, figure (PDF, PNG).

    Args:
        found: What to write.
        folder: New or empty folder, or one that holds another comparison.
        overwrite: Replace the other comparison. A folder with anything else in it is never touched.

    Returns:
        The folder.

    Raises:
        ResultsError: If the folder cannot be used or written.
    """
    from interdrive.batches.figure import draw_comparison  # noqa: PLC0415 - loads matplotlib
    from interdrive.plots import save_figure  # noqa: PLC0415

    target = check_folder(folder, "comparison", _MARK, lambda entry: entry.name in _FILES, overwrite=overwrite)
    with replacing(target) as partial:
        partial.mkdir()
        for name, table in (("table", found.table), ("differences", found.differences)):
            for ending in ("parquet", "csv"):
                write_table(table, partial / f"{name}.{ending}")
        (partial / _MARK).write_text("".join(f"{line}\n" for line in found.reservations), encoding="utf-8")
        (partial / "comparison.md").write_text(markdown(found), encoding="utf-8")
        figure = draw_comparison(found)
        for ending in ("pdf", "png"):
            save_figure(figure, partial / f"comparison.{ending}")
    return target


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
    for metric in METRICS:
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
