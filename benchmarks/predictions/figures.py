"""Figures of an evaluation of predictors: error over time by category, and calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import PercentFormatter

from interdrive.plots.style import AGENTS, FONT, INK, MM, PAGE, RECORDED, add_legend, empty_figure, plain
from interdrive.prediction_evaluation.curves import MOVING, STAYING, calibration_table, error_table
from interdrive.prediction_evaluation.measures import HORIZONS
from interdrive.prediction_evaluation.recordings import CATEGORIES
from interdrive.prediction_evaluation.tables import ALL, ANY

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from interdrive.prediction_evaluation.tables import PredictionEvaluation

_PANEL, _LEGEND, _TITLE, _AXIS = 46.0 * MM, 5.0 * MM, 6.0 * MM, 9.0 * MM
_COLUMNS = 3
_BEST = (0, (3.0, 1.5))


def error_figure(found: PredictionEvaluation) -> Figure:
    """Mean distance over time, 180 mm wide, a panel per category: most probable mode solid, best mode dashed."""
    rows = [row for row in error_table(found).to_pylist() if row["traffic"] == ANY]
    there = {row["category"] for row in rows}
    shown = [name for name in (*CATEGORIES, ALL) if name in there]
    figure, panels = _panels(len(shown), found, [("most probable mode", "-"), ("best mode", _BEST)])
    for index, (axes, category) in enumerate(zip(panels, shown, strict=True)):
        count = np.isfinite(found.samples.values[found.predictors[0]]["error"][:, -1])
        count = count if category == ALL else count & (found.samples.category == category)
        axes.set_title(f"{category} ({int(count.sum())} samples at 3 s)", fontsize=FONT, pad=3, loc="left")
        for name, color in _colors(found).items():
            line = [row for row in rows if row["predictor"] == name and row["category"] == category]
            time = [0.0, *(row["time"] for row in line)]
            for measure, dashes in (("error", "-"), ("error_best", _BEST)):
                values = [0.0, *(np.nan if row[measure] is None else row[measure] for row in line)]
                axes.plot(time, values, color=color, linestyle=dashes, linewidth=1.3 if dashes == "-" else 1.0)
        axes.set(xlim=(0.0, 3.05), ylim=(0.0, None), xticks=[0, 1, 2, 3])
        axes.set_xlabel("time from now [s]", fontsize=FONT)
        if index % _COLUMNS == 0:
            axes.set_ylabel("mean distance [m]", fontsize=FONT)
    return figure


def calibration_figure(found: PredictionEvaluation) -> Figure:
    """Observed over nominal share of positions inside regions, all files, 180 mm wide.

    A panel per horizon for moving vehicles, and below for vehicles that stand and stay, if there are any.
    """
    table = [row for row in calibration_table(found).to_pylist() if (row["category"], row["traffic"]) == (ALL, ANY)]
    shown = [name for name in (MOVING, STAYING) if any(row["samples"] for row in table if row["vehicles"] == name)]
    figure, panels = _panels(
        len(HORIZONS) * len(shown),
        found,
        [("region of highest density", "-"), ("ellipse of the most probable mode", _BEST)],
    )
    for index, axes in enumerate(panels):
        vehicles, h = shown[index // len(HORIZONS)], HORIZONS[index % len(HORIZONS)]
        rows = [row for row in table if row["vehicles"] == vehicles and row["horizon"] == h]
        axes.plot([0, 1], [0, 1], color=RECORDED, linewidth=0.8)
        axes.set_title(f"{vehicles}, after {h} s ({rows[0]['samples']} samples)", fontsize=FONT, pad=3, loc="left")
        for name, color in _colors(found).items():
            curve = [row for row in rows if row["predictor"] == name]
            nominal = [row["nominal"] for row in curve]
            for measure, dashes in (("region", "-"), ("ellipse", _BEST)):
                values = [np.nan if row[measure] is None else row[measure] for row in curve]
                axes.plot(nominal, values, color=color, linestyle=dashes, linewidth=1.3 if dashes == "-" else 1.0)
        axes.set(xlim=(0, 1), ylim=(0, 1.01), aspect="equal")
        axes.xaxis.set_major_formatter(PercentFormatter(1.0))
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        axes.set_xlabel("nominal", fontsize=FONT)
        if h == HORIZONS[0]:
            axes.set_ylabel("observed", fontsize=FONT)
    return figure


def _colors(found: PredictionEvaluation) -> Mapping[str, str]:
    return {name: AGENTS[index % len(AGENTS)] for index, name in enumerate(found.predictors)}


def _panels(
    count: int, found: PredictionEvaluation, dashes: Sequence[tuple[str, object]]
) -> tuple[Figure, Sequence[Axes]]:
    """So many panels in rows of three, and above them a legend of predictors and line styles."""
    rows = -(-count // _COLUMNS)
    handles = [Line2D([], [], color=color, linewidth=1.6, label=name) for name, color in _colors(found).items()]
    handles += [Line2D([], [], color=INK, linewidth=1.1, linestyle=style, label=text) for text, style in dashes]
    legend = _LEGEND * -(-len(handles) // 4)
    height = legend + rows * (_PANEL + _TITLE + _AXIS)
    figure = empty_figure(PAGE, height)
    left, gap = 13.0 * MM, 10.0 * MM
    width = (PAGE - left - 3.0 * MM - (_COLUMNS - 1) * gap) / _COLUMNS
    panels = []
    for index in range(count):
        row, column = divmod(index, _COLUMNS)
        bottom = height - legend - (row + 1) * (_PANEL + _TITLE + _AXIS) + _AXIS
        place = (left + column * (width + gap)) / PAGE, bottom / height, width / PAGE, _PANEL / height
        axes = figure.add_axes(place)
        plain(axes)
        panels.append(axes)
    add_legend(figure, handles, "upper center", ncols=min(4, len(handles)), handlelength=2.4, columnspacing=1.4)
    return figure, panels
