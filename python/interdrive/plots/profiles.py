"""Lateral position and velocity over time, several runs of the same two vehicles overlaid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from interdrive.plots.participants import AGENTS, INK, MARKS, RECORDED

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes

    from interdrive.plots.view import Floats

_MM = 1.0 / 25.4
_WIDTH, _HEIGHT = 180.0 * _MM, 87.0 * _MM
_FONT = 7.5
_LEGEND_ROW, _LEGEND_COLUMNS = 5.0 * _MM, 6

#: Colour and dashes of the runs in their order; told apart without colour, too (colours: Okabe and Ito).
_STYLES: tuple[tuple[str, Any], ...] = (("#222222", "-"), ("#CC79A7", (0, (4.5, 1.6))), ("#009E73", (0, (1.2, 1.2))))

#: Lateral positions further away than this are left to the scene figure [m]; axes span at least so much [m], [m/s].
_ASIDE_MAX, _SPAN_MIN = 8.0, 2.0


@dataclass(frozen=True)
class Profile:
    """How one vehicle drives in one run.

    Attributes:
        time: Shape (time_steps,) [s].
        lateral: Lateral position [m], shape (time_steps,); nan where it has none.
        velocity: Speed [m/s], shape (time_steps,); nan where it is absent.
        nearest: Index of the time step at which the two vehicles are nearest to each other; none: never both there.
        outcome: One of `interdrive.run.OUTCOMES`, or "" for a vehicle that replays its recording.
    """

    time: Floats
    lateral: Floats
    velocity: Floats
    nearest: int | None
    outcome: str


def draw_profiles(profiles: Mapping[str, Sequence[Profile]], titles: Sequence[str], lateral_label: str) -> Figure:
    """A figure, 180 mm wide, with a column of panels per vehicle: lateral position above, velocity below.

    Args:
        profiles: Per name of a run one profile per vehicle.
        titles: One per vehicle.
        lateral_label: What the lateral position is measured from.

    Returns:
        A matplotlib figure without pyplot; `save_figure` writes it.
    """
    handles = _handles(profiles)
    legend_rows = -(-len(handles) // _LEGEND_COLUMNS)
    height = _HEIGHT + legend_rows * _LEGEND_ROW
    figure = Figure(figsize=(_WIDTH, height), dpi=300)
    FigureCanvasAgg(figure)
    left, right = 15.0 * _MM / _WIDTH, 1.0 - 2.0 * _MM / _WIDTH
    bottom, top = 10.0 * _MM / height, 1.0 - (8.0 * _MM + legend_rows * _LEGEND_ROW) / height
    panels = figure.subplots(
        2,
        len(titles),
        sharex=True,
        squeeze=False,
        gridspec_kw={"left": left, "right": right, "bottom": bottom, "top": top, "wspace": 0.14, "hspace": 0.12},
    )
    for column, title in enumerate(titles):
        panels[0, column].set_title(title, fontsize=_FONT + 0.5, pad=3, color=AGENTS[column])
        for name, style in zip(profiles, _STYLES, strict=False):
            _draw(panels[0, column], profiles[name][column], profiles[name][column].lateral, name, style)
            _draw(panels[1, column], profiles[name][column], profiles[name][column].velocity, name, style)
        every = [runs[column] for runs in profiles.values()]
        _limit(panels[0, column], [np.where(np.abs(p.lateral) <= _ASIDE_MAX, p.lateral, np.nan) for p in every])
        panels[1, column].set_xlabel("time [s]", fontsize=_FONT)
    for row, label in enumerate((lateral_label, "velocity [m/s]")):
        panels[row, 0].set_ylabel(label, fontsize=_FONT)
    fastest = max((np.nanmax(p.velocity, initial=0.0) for runs in profiles.values() for p in runs), default=0.0)
    times = [p.time[np.isfinite(p.velocity)] for runs in profiles.values() for p in runs]
    span = np.concatenate([np.zeros(1), *times])
    for axes in panels[1]:
        axes.set_ylim(-0.04 * fastest, 1.08 * max(fastest, _SPAN_MIN))
    for axes in panels.flat:
        _plain(axes)
        axes.set_xlim(span.min(), span.max() + 0.01 * np.ptp(span) + 0.1)
    figure.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=-(-len(handles) // legend_rows),
        fontsize=_FONT,
        frameon=False,
        handlelength=2.6,
        handletextpad=0.5,
        columnspacing=1.3,
        borderpad=0.3,
    )
    figure.align_ylabels()
    return figure


def _draw(axes: Axes, profile: Profile, values: Floats, name: str, style: tuple[str, Any]) -> None:
    color, dashes = style
    axes.plot(profile.time, values, color=color, linestyle=dashes, linewidth=1.4, label=name)
    if profile.nearest is not None:
        at = profile.time[profile.nearest], values[profile.nearest]
        axes.plot(*at, "o", ms=4.2, mfc="white", mec=color, mew=1.1, zorder=4)
    present = np.flatnonzero(np.isfinite(values))
    if profile.outcome and len(present):
        mark = MARKS[profile.outcome]
        last = present[-1]
        axes.plot(
            profile.time[last], values[last], mark.marker, ms=mark.size, mfc=mark.color, mec=INK, mew=0.5, zorder=5
        )


def _limit(axes: Axes, shown: Sequence[Floats]) -> None:
    """The axis spans what is shown, with room for markers, and never so little that noise looks like motion."""
    values = np.concatenate([*shown, np.empty(0)])
    values = values[np.isfinite(values)]
    low, high = (values.min(), values.max()) if len(values) else (0.0, 0.0)
    half = 0.5 * max(1.16 * (high - low), _SPAN_MIN)
    axes.set_ylim(0.5 * (low + high) - half, 0.5 * (low + high) + half)


def _plain(axes: Axes) -> None:
    axes.grid(visible=True, color="#e3e3e3", linewidth=0.5)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=_FONT - 0.5, length=2.5, width=0.5, pad=2)
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    for name, side in axes.spines.items():
        side.set(linewidth=0.5, color=RECORDED, visible=name in ("left", "bottom"))


def _handles(profiles: Mapping[str, Sequence[Profile]]) -> list[Line2D]:
    handles = [
        Line2D([], [], color=color, linestyle=dashes, linewidth=1.4, label=name)
        for name, (color, dashes) in zip(profiles, _STYLES, strict=False)
    ]
    if any(p.nearest is not None for runs in profiles.values() for p in runs):
        handles.append(Line2D([], [], ls="", marker="o", ms=4.2, mfc="white", mec=INK, mew=1.1, label="nearest"))
    ends = {p.outcome: None for runs in profiles.values() for p in runs if p.outcome}
    for mark in (MARKS[outcome] for outcome in MARKS if outcome in ends):
        style: dict[str, Any] = {"marker": mark.marker, "ms": mark.size, "mfc": mark.color, "mec": INK, "mew": 0.5}
        handles.append(Line2D([], [], ls="", label=mark.text, **style))
    return handles
