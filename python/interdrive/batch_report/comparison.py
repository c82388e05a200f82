"""What the page of a batch says about planners: how values are printed, which differences are significant."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from interdrive.comparison import METRICS
from interdrive.comparison.caveats import is_sure
from interdrive.comparison.intervals import PLACES_SURE
from interdrive.comparison.metrics import SHARES
from interdrive.comparison.tables import meaning_of_bold, metrics_shown, shown
from interdrive.comparison.variants import ALL

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from interdrive.comparison import Comparison
    from interdrive.comparison.metrics import Metric
    from interdrive.report.contract import Cell, Compared, ComparedRow, Difference, Pair

    Rows = Sequence[dict[str, Any]]


def compared_of(comparison: Comparison | None) -> Iterator[Compared]:
    """What can be chosen on the page: every set, over all categories and within each."""
    if comparison is None:
        return
    table, differences = comparison.table.to_pylist(), comparison.differences.to_pylist()
    for one in comparison.sets:
        mine = [row for row in table if (row["traffic"], row["agents"]) == (one.traffic, one.agents)]
        for category in dict.fromkeys(row["category"] for row in mine):
            which = {"traffic": one.traffic, "agents": one.agents, "category": category}
            rows = [row for row in mine if row["category"] == category]
            found = [row for row in differences if which.items() <= row.items() and _is_known(row)]
            enough = any(row["n_places"] >= PLACES_SURE for row in found)
            metrics = metrics_shown(rows)
            yield {
                "traffic": one.traffic,
                "agents": one.agents,
                "category": category,
                "title": one.title if category == ALL else f"{one.title}: {category}",
                "size": one.size if category == ALL else "",
                "headings": [metric.heading for metric in metrics],
                "rows": [_row(row, rows, metrics, enough=enough) for row in rows],
                "pairs": _pairs(found, comparison.level),
                "note": _note(found, comparison.level, comparison.group),
            }


def _is_known(row: dict[str, Any]) -> bool:
    return row["difference"] is not None and math.isfinite(row["difference"]) and row["n_agents"] > 0


def _row(row: dict[str, Any], rows: Rows, metrics: Sequence[Metric], *, enough: bool) -> ComparedRow:
    """A planner among all those of its table; the best values are strong if there are enough scenarios."""
    lost = f" ({row['runs_lost']} lost)" if row["runs_lost"] else ""
    return {
        "planner": row["variant"],
        "runs": f"{row['runs']}{lost}",
        "n_agents": row["n_agents"],
        "shares": {metric.column: row[metric.name] for metric in SHARES if row[metric.name]},
        "cells": [_cell(metric, row, rows, enough=enough) for metric in metrics],
    }


def _cell(metric: Metric, row: dict[str, Any], rows: Rows, *, enough: bool) -> Cell:
    texts = {shown(metric, other[metric.name]) for other in rows}
    known = [value for other in rows if (value := other[metric.name]) is not None and not math.isnan(value)]
    best = max(known, key=lambda value: metric.better * value, default=None)
    strong = enough and metric.better != 0 and len(texts) > 1 and row[metric.name] == best
    return {"text": shown(metric, row[metric.name]), "strong": strong}


def _pairs(rows: Rows, level: float) -> list[Pair]:
    metrics = {metric.name: metric for metric in METRICS}
    ends = {name: [0.0] for name in metrics}
    for row in rows:
        ends[row["metric"]] += [abs(row[end]) for end in ("low", "difference", "high") if row[end] is not None]
    extents = {name: max(filter(math.isfinite, values)) for name, values in ends.items()}
    found: dict[str, list[Difference]] = {}
    for row in rows:
        if extents[row["metric"]]:
            name = f"{row['variant']} − {row['other']}"
            found.setdefault(name, []).append(_difference(metrics[row["metric"]], row, extents[row["metric"]], level))
    return [{"name": name, "differences": differences} for name, differences in found.items()]


def _difference(metric: Metric, row: dict[str, Any], extent: float, level: float) -> Difference:
    sure, low, high = is_sure(row, level), row["low"], row["high"]
    verdict = "better" if metric.better * row["difference"] > 0 else "worse"
    finite = low is not None and math.isfinite(low) and math.isfinite(high)
    return {
        "metric": metric.heading,
        "text": shown(metric, row["difference"]),
        "interval": "" if low is None else f"{shown(metric, low)} to {shown(metric, high)}",
        "verdict": verdict if sure and metric.better else "",
        "sure": sure,
        "value": row["difference"],
        "low": low if finite else None,
        "high": high if finite else None,
        "extent": extent,
    }


def _note(rows: Rows, level: float, group: str) -> str:
    known = {row["metric"] for row in rows}
    bold = meaning_of_bold(rows, [metric for metric in METRICS if metric.name in known], group) if rows else ""
    return f"Over the same agents; intervals of {100 * level:g} % over {group}s. {bold}"
