"""The figure of a comparison: how agents ended, and how planners differ. Loads matplotlib."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from interdrive.comparison.caveats import is_certain
from interdrive.comparison.intervals import PLACES_SURE
from interdrive.comparison.metrics import METRICS, SHARES
from interdrive.comparison.variants import ALL
from interdrive.plots.style import AGENTS, FONT, MM, OUTCOME_MARKS, PAGE, RECORDED, add_legend, empty_figure

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from interdrive.comparison.result import Comparison

#: Between panels [inches].
_GAP = 3.6 * MM
#: Widths of a character of that size, plain and bold [inches].
_CHARACTER, _BOLD = 1.32 * MM, 1.5 * MM
_BLUE = AGENTS[0]
#: Heights: a row, a heading above rows, the legend, between both halves, below the lower axes [inches].
_ROW, _HEADING, _HEAD, _BETWEEN, _FOOT = 4.6 * MM, 6.2 * MM, 6.5 * MM, 11.0 * MM, 12.5 * MM

#: Metrics whose differences are drawn, and how they are called.
_DRAWN = (
    ("goal_reached", "goal reached [%]"),
    ("collisions", "collisions per 100 agents"),
    ("ttc_critical", "time with TTC < 2 s [%]"),
    ("jerk_rms", "jerk, rms [m/s³]"),
)


@dataclass(frozen=True)
class _Line:
    """A line of the figure: a heading, or a row of one of the tables with its name."""

    text: str
    key: tuple[str, ...] = ()


def draw_comparison(comparison: Comparison) -> Figure:
    """A figure, 180 mm wide: shares of outcomes per planner, below them differences with their intervals.

    Only what holds for all categories together is drawn. A filled dot says that the interval does not contain zero;
    over fewer than `PLACES_SURE` places no dot is filled.
    """
    rows = {_key(row): row for row in comparison.table.to_pylist() if row["category"] == ALL}
    differences = {
        (*_key(row), row["other"], row["metric"]): row
        for row in comparison.differences.to_pylist()
        if row["category"] == ALL
    }
    upper, lower = _lines(comparison, rows), _lines(comparison, dict.fromkeys(key[:4] for key in differences))
    heights = [sum(_HEADING if not line.key else _ROW for line in lines) for lines in (upper, lower)]
    height = _HEAD + heights[0] + _BETWEEN + (heights[1] + _FOOT if lower else 0.0)
    figure = empty_figure(PAGE, height)
    longest = max(len(line.text) for line in (*upper, *lower) if line.key)
    left, right = min(0.4, (5.0 * MM + _CHARACTER * longest) / PAGE), 1.0 - 3.0 * MM / PAGE
    shares = figure.add_axes((left, 1.0 - (_HEAD + heights[0]) / height, right - left, heights[0] / height))
    _draw_shares(figure, shares, upper, rows)
    _name_lines(figure, shares, upper, is_first=True)
    if lower:
        gap = _GAP / PAGE
        width = (right - left - gap * (len(_DRAWN) - 1)) / len(_DRAWN)
        for k, (name, label) in enumerate(_DRAWN):
            place = (left + k * (width + gap), _FOOT / height, width, heights[1] / height)
            panel = figure.add_axes(place)
            drawn = {key[:4]: row for key, row in differences.items() if key[4] == name}
            _draw_differences(panel, lower, drawn, comparison.level)
            _name_lines(figure, panel, lower, is_first=k == 0)
            metric = next(metric for metric in METRICS if metric.name == name)
            _set_range(panel, [row for key, row in differences.items() if key[4] == name], metric.digits, width * PAGE)
            arrow = "better →" if metric.better > 0 else "← better"
            panel.set_xlabel(f"{label}\n{arrow}", fontsize=FONT, labelpad=1.5, linespacing=1.3)
    return figure


def _key(row: Mapping[str, Any]) -> tuple[str, ...]:
    return (row["traffic"], row["agents"], row["variant"])


def _lines(comparison: Comparison, keys: Iterable[tuple[str, ...]]) -> list[_Line]:
    """A heading per set, then its planners or pairs of planners."""
    known, lines = list(keys), []
    for one in comparison.sets:
        inside = [key for key in known if key[:2] == (one.traffic, one.agents)]
        if inside:
            scenarios = f"{one.n_scenarios} scenario{'s' * (one.n_scenarios != 1)}"
            drawn = f"{one.n_places} {comparison.group}{'s' * (one.n_places != 1)}"
            few = f" ({drawn}: too few for claims)" if one.n_places < PLACES_SURE else ""
            title = one.title + (f" ({one.n_agents} agents, {scenarios})" if len(inside[0]) == 3 else few)
            lines.append(_Line(title))
            lines += [_Line(" − ".join(key[2:]), key) for key in inside]
    return lines


def _places(lines: Sequence[_Line]) -> list[float]:
    """Heights of lines from the top [inches], their middles."""
    places, at = [], 0.0
    for line in lines:
        step = _ROW if line.key else _HEADING
        places.append(at + (0.5 if line.key else 0.6) * step)
        at += step
    return places


def _name_lines(figure: Figure, panel: Axes, lines: Sequence[_Line], *, is_first: bool) -> None:
    """Names left of the first panel, headings above their rows, and the extent that all panels share."""
    places = _places(lines)
    named = [(place, line.text) for place, line in zip(places, lines, strict=True) if line.key] if is_first else []
    panel.set_yticks([place for place, _ in named], [text for _, text in named])
    panel.set_ylim(sum(_ROW if line.key else _HEADING for line in lines), 0.0)
    top = panel.get_position().y1
    for place, line in zip(places, lines, strict=True):
        if is_first and not line.key:
            size = FONT * min(1.0, 0.98 * PAGE / (_BOLD * len(line.text)))
            figure.text(
                MM / PAGE, top - place / figure.get_figheight(), line.text, va="center", ha="left",
                fontsize=size, fontweight="bold", bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5},
            )  # fmt: skip
    _plain(panel)


def _draw_shares(
    figure: Figure, panel: Axes, lines: Sequence[_Line], rows: Mapping[tuple[str, ...], Mapping[str, Any]]
) -> None:
    here = [(place, rows[line.key]) for place, line in zip(_places(lines), lines, strict=True) if line.key]
    place = np.array([place for place, _ in here])
    before = np.zeros(len(here))
    bars = []
    for metric in SHARES:
        share = np.nan_to_num(np.array([row[metric.name] for _, row in here], dtype=np.float64))
        if not share.any():
            continue
        mark = OUTCOME_MARKS[metric.column]
        bars.append(
            panel.barh(
                place, share, 0.74 * _ROW, left=before, color=mark.color, hatch=mark.hatch, edgecolor="white",
                linewidth=0.3, label=mark.text,
            )
        )  # fmt: skip
        before += share
    panel.set_xlim(0, 100)
    panel.set_xlabel("agents [%]", fontsize=FONT, labelpad=1.5)
    narrow = {"handlelength": 1.3, "columnspacing": 1.0, "handletextpad": 0.4, "borderaxespad": 0.2}
    add_legend(figure, bars, "upper center", ncols=len(bars), **narrow)


def _draw_differences(
    panel: Axes, lines: Sequence[_Line], rows: Mapping[tuple[str, ...], Mapping[str, Any]], level: float
) -> None:
    panel.axvline(0.0, color=RECORDED, linewidth=0.7, zorder=0)
    for place, line in zip(_places(lines), lines, strict=True):
        row = rows.get(line.key)
        if row is None or row["difference"] is None or not np.isfinite(row["difference"]):
            continue
        if row["low"] is not None:
            panel.plot([row["low"], row["high"]], [place, place], color=_BLUE, linewidth=1.2, solid_capstyle="butt")
        face = _BLUE if is_certain(row, level) else "white"
        panel.plot(row["difference"], place, "o", markersize=3.4, color=_BLUE, markerfacecolor=face)


def _set_range(panel: Axes, rows: Sequence[Mapping[str, Any]], digits: int, width: float) -> None:
    """The horizontal axis holds zero and all intervals, and as many ticks as their labels have room for.

    Args:
        panel: Whose axis.
        rows: Differences that are drawn in it.
        digits: That tables print of them; where all are smaller than ten units of the last one, the axis ends there.
        width: Of the panel [inches].
    """
    values = [row[name] for row in rows for name in ("low", "difference", "high")]
    known = [0.0, *(value for value in values if value is not None and np.isfinite(value))]
    low, high = min(known), max(known)
    least = 10.0 ** (1 - digits)
    if high - low < least:
        low, high = min(low, -least), max(high, least)
    low, high = low - 0.1 * (high - low), high + 0.1 * (high - low)
    panel.set_xlim(low, high)
    for n_ticks in range(4, 0, -1):
        ticks = np.asarray(MaxNLocator(n_ticks, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high))
        longest = max(map(len, panel.xaxis.get_major_formatter().format_ticks(ticks.tolist())))
        half = 0.5 * (longest + 1) * _CHARACTER
        place = width * (ticks - low) / (high - low)
        inside = (place > half - 0.4 * _GAP) & (place < width - half + 0.4 * _GAP)
        panel.set_xticks(ticks[inside])
        if (np.diff(place[inside]) > 2.0 * half).all():
            return


def _plain(panel: Axes) -> None:
    panel.tick_params(labelsize=FONT, length=2, width=0.5, pad=2)
    panel.tick_params(axis="y", length=0)
    for side in ("top", "right", "left"):
        panel.spines[side].set_visible(False)
    panel.spines["bottom"].set_linewidth(0.5)
