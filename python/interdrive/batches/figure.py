"""The figure of a comparison: how agents ended, and how planners differ. Loads matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from interdrive.batches.metrics import METRICS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from interdrive.batches.compare import Comparison

_MM = 1.0 / 25.4
_WIDTH = 180.0 * _MM
_FONT = 7.5
_ROW, _HEAD, _FOOT, _BETWEEN = 5.2 * _MM, 8.0 * _MM, 6.0 * _MM, 15.0 * _MM

#: Outcomes with colours (Okabe and Ito) and hatches, so that they are told apart without colour, too.
_OUTCOMES = (
    ("goal_reached", "reached", "#009E73", ""),
    ("goal_reached_late", "late", "#9BD7C4", "////"),
    ("time_limit", "time limit", "#F0E442", "...."),
    ("goal_missed", "missed", "#E69F00", "\\\\\\\\"),
    ("infeasible", "infeasible", "#CC79A7", "xxxx"),
    ("collisions", "collision", "#D55E00", ""),
    ("planner_error", "broken", "#222222", ""),
)

#: Metrics whose differences are drawn.
_DRAWN = ("goal_reached", "collisions", "ttc_critical", "jerk_rms")


def draw_comparison(comparison: Comparison) -> Figure:
    """A figure, 180 mm wide: shares of outcomes per planner, below them differences with their intervals.

    Only what holds for all categories together is drawn.
    """
    rows = [row for row in comparison.table.to_pylist() if row["category"] == "all"]
    differences = [row for row in comparison.differences.to_pylist() if row["category"] == "all"]
    several = len({(row["traffic"], row["agents"]) for row in rows}) > 1
    pairs = list(dict.fromkeys(_pair(row, several=several) for row in differences))
    upper, lower = len(rows) * _ROW, len(pairs) * _ROW
    height = _HEAD + upper + _FOOT + (_BETWEEN + lower if pairs else 4.0 * _MM)
    figure = Figure(figsize=(_WIDTH, height), dpi=300)
    FigureCanvasAgg(figure)
    names = [_name(row, row["variant"], several=several) for row in rows]
    longest = max(map(len, [*(f"{name}, n = 0000" for name in names), *pairs]))
    left, right = min(0.45, (6.0 + 1.32 * longest) * _MM / _WIDTH), 1.0 - 3.0 * _MM / _WIDTH
    top = 1.0 - _HEAD / height
    shares = figure.add_axes((left, top - upper / height, right - left, upper / height))
    _draw_shares(shares, rows, names)
    if pairs:
        bottom, gap = _FOOT / height, 0.02
        width = (right - left - gap * (len(_DRAWN) - 1)) / len(_DRAWN)
        for k, name in enumerate(_DRAWN):
            panel = figure.add_axes((left + k * (width + gap), bottom, width, lower / height))
            here = [row for row in differences if row["metric"] == name]
            _draw_differences(panel, name, here, [pairs.index(_pair(row, several=several)) for row in here])
            panel.set_yticks(range(len(pairs)), pairs if k == 0 else [])
            panel.set_ylim(len(pairs) - 0.4, -0.6)
    return figure


def _name(row: dict[str, Any], text: str, *, several: bool) -> str:
    return f"{text} ({row['traffic']}, {row['agents']})" if several else text


def _pair(row: dict[str, Any], *, several: bool) -> str:
    return _name(row, f"{row['variant']} − {row['other']}", several=several)


def _draw_shares(panel: Axes, rows: Sequence[dict[str, Any]], names: Sequence[str]) -> None:
    place = np.arange(len(rows))
    before = np.zeros(len(rows))
    for name, label, colour, hatch in _OUTCOMES:
        share = np.nan_to_num(np.array([row[name] for row in rows], dtype=np.float64))
        panel.barh(
            place, share, 0.72, left=before, color=colour, hatch=hatch, edgecolor="white", linewidth=0.3, label=label
        )
        before += share
    panel.set_yticks(place, [f"{name}, n = {row['n_agents']}" for name, row in zip(names, rows, strict=True)])
    panel.set_ylim(len(rows) - 0.4, -0.6)
    panel.set_xlim(0, 100)
    panel.set_xlabel("agents under test [%]", fontsize=_FONT, labelpad=1.5)
    panel.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=len(_OUTCOMES), fontsize=_FONT - 0.5, frameon=False,
        handlelength=1.2, columnspacing=0.9, handletextpad=0.4, borderaxespad=0.2,
    )  # fmt: skip
    _plain(panel)


def _draw_differences(panel: Axes, name: str, rows: Sequence[dict[str, Any]], places: Sequence[int]) -> None:
    metric = next(item for item in METRICS if item.name == name)
    panel.axvline(0.0, color="#888888", linewidth=0.7)
    for row, place in zip(rows, places, strict=True):
        if row["difference"] is None or not np.isfinite(row["difference"]):
            continue
        low, high = (row[end] if row[end] is not None else row["difference"] for end in ("low", "high"))
        sure = row["low"] is not None and (low > 0 or high < 0)
        panel.plot([low, high], [place, place], color="#0072B2", linewidth=1.1, solid_capstyle="butt")
        panel.plot(
            row["difference"],
            place,
            "o",
            markersize=3.2,
            color="#0072B2",
            markerfacecolor="#0072B2" if sure else "white",
        )
    panel.set_title(metric.heading, fontsize=_FONT, pad=3)
    panel.margins(x=0.12)
    _plain(panel)


def _plain(panel: Axes) -> None:
    panel.tick_params(labelsize=_FONT, length=2, width=0.5, pad=2)
    panel.tick_params(axis="y", length=0)
    for side in ("top", "right", "left"):
        panel.spines[side].set_visible(False)
    panel.spines["bottom"].set_linewidth(0.5)
