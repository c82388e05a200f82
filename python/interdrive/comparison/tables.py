"""A comparison as tables of text, for terminals and Markdown."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from interdrive.comparison.caveats import is_certain
from interdrive.comparison.intervals import PLACES_SURE
from interdrive.comparison.metrics import METRICS
from interdrive.comparison.variants import ALL

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from interdrive.comparison.metrics import Metric
    from interdrive.comparison.result import Comparison
    from interdrive.comparison.variants import ComparedSet

#: The first columns of the table about outcomes: a name, and the column of the comparison's table.
_ABOUT = (("runs", "runs"), ("lost", "runs_lost"), ("agents", "n_agents"), ("left out", "n_left_out"))


#: Other outcomes without agents, and rules that no agent broke, need no column.
_ALWAYS = ("goal_reached", "collisions")


@dataclass(frozen=True)
class Cell:
    """A text, strong or not."""

    text: str
    strong: bool = False


@dataclass(frozen=True)
class Sheet:
    """A table of text.

    Attributes:
        title: What it says.
        head: Names of the columns.
        texts: So many columns at the left are texts, the others numbers.
        rows: Cells.
        note: What stands below it; "" for nothing.
    """

    title: str
    head: tuple[str, ...]
    texts: int
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""


def sheets_of(found: Comparison, one: ComparedSet) -> Iterator[Sheet]:
    """How agents ended, how they drove, which rules they broke, and how planners differ, of one set of a comparison."""
    rows = [row for row in found.table.to_pylist() if (row["traffic"], row["agents"]) == (one.traffic, one.agents)]
    differences = [
        row
        for row in found.differences.to_pylist()
        if (row["traffic"], row["agents"], row["category"]) == (one.traffic, one.agents, ALL)
    ]
    metrics = metrics_shown(rows)
    about = _ABOUT if any(row["n_left_out"] for row in rows) else [one for one in _ABOUT if one[1] != "n_left_out"]
    yield _by_category("How agents ended", rows, [m for m in metrics if m.outcome], about)
    own = [row for row in found.own.to_pylist() if (row["traffic"], row["agents"]) == (one.traffic, one.agents)]
    if any(row["n_left_out"] for row in rows):
        yield _by_category(
            "Each planner on its own agents", own, [m for m in metrics_shown(own) if m.outcome], _ABOUT[:3]
        )
    yield _by_category("How they drove", rows, [m for m in metrics if not (m.outcome or m.rule)], ())
    if rules := [m for m in metrics if m.rule]:
        yield _by_category("Rules of the road that they broke, per 100 agents", rows, rules, ())
    if differences:
        yield _of_differences(differences, [m for m in metrics if not m.rule], found.level, found.group)


def metrics_shown(rows: Sequence[dict[str, Any]]) -> list[Metric]:
    """Metrics that are worth a column in a table with these rows."""

    def is_worth_it(metric: Metric) -> bool:
        if metric.traffic:
            return any(row[metric.name] is not None for row in rows)
        return not (metric.outcome or metric.rule) or metric.name in _ALWAYS or any(row[metric.name] for row in rows)

    return [metric for metric in METRICS if is_worth_it(metric)]


def _by_category(
    title: str, rows: Sequence[dict[str, Any]], metrics: Sequence[Metric], about: Sequence[tuple[str, str]]
) -> Sheet:
    lines, last = [], None
    for row in rows:
        texts = ["" if row["category"] == last else row["category"], row["variant"]]
        texts += [str(row[name]) for _, name in about]
        texts += [shown(metric, row[metric.name]) for metric in metrics]
        lines.append(tuple(Cell(text, row["category"] == ALL) for text in texts))
        last = row["category"]
    head = ("category", "planner", *(name for name, _ in about), *(metric.heading for metric in metrics))
    return Sheet(title, head, 2, tuple(lines))


def _of_differences(rows: Sequence[dict[str, Any]], metrics: Sequence[Metric], level: float, group: str) -> Sheet:
    pairs = list(dict.fromkeys((row["variant"], row["other"]) for row in rows))
    at = {(row["metric"], row["variant"], row["other"]): row for row in rows}
    lines = []
    for metric in metrics:
        cells = [Cell(metric.heading)]
        for one, other in pairs:
            row = at[metric.name, one, other]
            low, high = shown(metric, row["low"]), shown(metric, row["high"])
            interval = f" [{low}, {high}]" if row["low"] is not None else ""
            cells.append(Cell(shown(metric, row["difference"]) + interval, is_certain(row, level)))
        lines.append(tuple(cells))
    head = ("metric", *(f"{one} − {other}" for one, other in pairs))
    title = f"Differences over all categories, with {100 * level:g} % intervals over {group}s"
    return Sheet(title, head, 1, tuple(lines), meaning_of_bold(rows, metrics, group))


def meaning_of_bold(rows: Sequence[dict[str, Any]], metrics: Sequence[Metric], group: str) -> str:
    """What bold means, and where it cannot be."""
    enough = {row["metric"] for row in rows if row["n_places"] >= PLACES_SURE}
    names = [metric.heading for metric in metrics if metric.name not in enough]
    if names and len(names) == len(metrics):
        most = max(row["n_places"] for row in rows)
        count = f"there {'is' if most == 1 else 'are'} {most}"
        return (
            f"Nothing is in bold: over fewer than {PLACES_SURE} {group}s ({count}) intervals are rough, so no planner "
            "is called better than another."
        )
    pairs = len({(row["variant"], row["other"]) for row in rows})
    said = "Bold: the interval does not contain zero"
    said += f", also if adjusted for {pairs} pairs (Holm)." if pairs > 1 else "."
    if names:
        said += f" Never in bold, with fewer than {PLACES_SURE} {group}s: {', '.join(names)}."
    return said


def shown(metric: Metric, value: float | None) -> str:
    """A value of a metric, as tables print it; what rounds to zero has no sign."""
    if value is None or math.isnan(value):
        return "-"
    if metric.measure is not None:
        return metric.measure.text(value, metric.digits, with_unit=False)
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    text = f"{value:.{metric.digits}f}"
    return text if float(text) else text.removeprefix("-")


def markdown(found: Comparison) -> str:
    """Everything that a comparison says, as a Markdown text."""
    lines = []
    for one in found.sets:
        lines += [f"### {one.title}", "", f"{one.size}.", ""]
        for sheet in sheets_of(found, one):
            lines += [f"{sheet.title}:", "", *_piped(sheet), ""]
            lines += [sheet.note, ""] if sheet.note else []
    lines += ["Caveats:", "", *(f"- {line}" for line in found.caveats)]
    return "\n".join(lines) + "\n"


def _piped(sheet: Sheet) -> Iterator[str]:
    def line(texts: Sequence[str]) -> str:
        return "| " + " | ".join(text.replace("|", "\\|") for text in texts) + " |"

    yield line(sheet.head)
    yield "|" + "|".join("---" if i < sheet.texts else "--:" for i in range(len(sheet.head))) + "|"
    for row in sheet.rows:
        yield line([f"**{cell.text}**" if cell.strong and cell.text else cell.text for cell in row])
