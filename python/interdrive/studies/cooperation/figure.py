"""The figure of the study of cooperation. Loads matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.plots.style import AGENTS, FONT, INK, MM, PAGE, empty_figure, plain
from interdrive.studies.cooperation.summary import summary_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from interdrive.studies.cooperation.measure import CooperationStudy

_HEIGHT = 110.0 * MM

#: What is drawn: column, its interval, factor, axis.
_MEASURES = (
    ("reached_change", ("reached_low", "reached_high"), 100.0, "in time [points]"),
    ("time_lost", ("time_low", "time_high"), 1.0, "time lost [s]"),
    ("ttc_change", ("ttc_low", "ttc_high"), 100.0, "TTC < 1.5 s [points]"),
)


def cooperation_figure(study: CooperationStudy) -> Figure:
    """Goals in time, time lost and share of time with a small TTC, 180 mm wide.

    They are drawn over penetration, delay and loss, and with occlusion over penetration, by what is sent. Means with
    95 % intervals over scenarios, as differences to runs without V2X.
    """
    every: list[dict[str, Any]] = summary_table(study).to_pylist()
    rows = [row for row in every if not row["occlusion"]]
    hidden = [row for row in every if row["occlusion"]]
    without = [row for row in hidden if row["penetration"] == 0]
    services = dict.fromkeys(row["services"] for row in hidden if row["penetration"] > 0)
    none = [row for row in rows if row["penetration"] == 0]
    perfect = [row for row in rows if not row["delay"] and not row["loss"] and row["penetration"] > 0]
    full = [row for row in rows if row["penetration"] == 1 and row["negotiate"]]
    series = (
        (
            "penetration",
            "share of equipped agents",
            (
                ("plans", [*none, *(row for row in perfect if not row["negotiate"])]),
                ("plans, negotiation", [*none, *(row for row in perfect if row["negotiate"])]),
            ),
        ),
        ("delay", "delay [s]", (("plans, negotiation", [row for row in full if not row["loss"]]),)),
        ("loss", "loss", (("plans, negotiation", [row for row in full if not row["delay"]]),)),
        (
            "penetration",
            "the same with occlusion",
            tuple((name, [*without, *(row for row in hidden if row["services"] == name)]) for name in services),
        ),
    )
    figure = empty_figure(PAGE, _HEIGHT, layout="constrained")
    panels = figure.subplots(len(_MEASURES), len(series), squeeze=False, sharey="row", sharex="col")
    colours: dict[str, str] = {}
    for across, (variable, label, lines) in enumerate(series):
        for down, (column, interval, factor, name) in enumerate(_MEASURES):
            panel = panels[down, across]
            for title, picked in lines:
                colour = colours.setdefault(title, AGENTS[len(colours)])
                _draw(panel, picked, (variable, column, interval), factor, colour, title)
            panel.axhline(0.0, color=INK, linewidth=0.8, linestyle=":")
            if across == 0:
                panel.set_ylabel(name, fontsize=FONT)
            plain(panel)
        panels[-1, across].set_xlabel(label, fontsize=FONT)
    handles = {
        label: handle for panel in panels[0] for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        handles.values(),
        [label.replace("+", ", ").upper() if label in services else label for label in handles],
        loc="outside lower center",
        ncols=len(handles),
        fontsize=FONT,
        frameon=False,
    )
    return figure


def _draw(
    panel: Axes,
    rows: list[dict[str, Any]],
    columns: tuple[str, str, tuple[str, str]],
    factor: float,
    colour: str,
    title: str,
) -> None:
    variable, column, interval = columns
    ordered = sorted(rows, key=lambda row: row[variable])
    x = [row[variable] for row in ordered]
    values, low, high = (factor * np.array([row[name] for row in ordered]) for name in (column, *interval))
    panel.plot(x, values, "o-", color=colour, linewidth=1.0, markersize=2.2, label=title)
    panel.fill_between(x, low, high, color=colour, alpha=0.2, linewidth=0)
