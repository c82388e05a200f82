"""What the page of a batch says about planners: how values are printed, which differences are significant."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from interdrive.comparison import METRICS
from interdrive.comparison.caveats import is_certain
from interdrive.comparison.metrics import SHARES
from interdrive.comparison.tables import meaning_of_bold, metrics_shown, shown
from interdrive.comparison.variants import ALL

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from interdrive.comparison import Comparison
    from interdrive.comparison.metrics import Metric
    from interdrive.report.contract import Compared, ComparedRow, Difference, Pair

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
            metrics, wins = metrics_shown(rows), _wins(found, comparison.level)
            yield {
                "traffic": one.traffic,
                "agents": one.agents,
                "category": category,
                "title": one.title if category == ALL else f"{one.title}: {category}",
                "size": one.size if category == ALL else "",
                "headings": [metric.heading for metric in metrics],
                "rows": [_row(row, rows, metrics, wins) for row in rows],
                "pairs": _pairs(found, comparison.level),
                "note": _note(found, comparison.level, comparison.group),
            }


def _is_known(row: dict[str, Any]) -> bool:
    return row["difference"] is not None and math.isfinite(row["difference"]) and row["n_agents"] > 0


def _wins(differences: Rows, level: float) -> set[tuple[str, str, str]]:
    """Metrics with the planner that is certainly better, and the other one."""
    better = {metric.name: metric.better for metric in METRICS}
    found = set()
    for row in differences:
        gain = better[row["metric"]] * row["difference"]
        if gain and is_certain(row, level):
            pair = (row["variant"], row["other"])
            found.add((row["metric"], *(pair if gain > 0 else pair[::-1])))
    return found


def _row(row: dict[str, Any], rows: Rows, metrics: Sequence[Metric], wins: set[tuple[str, str, str]]) -> ComparedRow:
    """A planner among all those of its table; a value is strong if it is certainly better than all others."""
    planner = row["variant"]
    others = [other["variant"] for other in rows if other["variant"] != planner]
    lost = f" ({row['runs_lost']} lost)" if row["runs_lost"] else ""
    return {
        "planner": planner,
        "runs": f"{row['runs']}{lost}",
        "n_agents": row["n_agents"],
        "shares": {metric.column: row[metric.name] for metric in SHARES if row[metric.name]},
        "cells": [
            {
                "text": shown(metric, row[metric.name]),
                "strong": bool(others) and all((metric.name, planner, other) in wins for other in others),
            }
            for metric in metrics
        ],
    }


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
    sure, low, high = is_certain(row, level), row["low"], row["high"]
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
