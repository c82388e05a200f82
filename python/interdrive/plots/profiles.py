"""Lateral position and velocity over time, several runs of the same two vehicles overlaid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D

from interdrive.plots.style import FONT, INK, MM, PAGE, add_legend, empty_figure, mark_handles, mark_style, plain

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from interdrive.array_types import Floats

_HEIGHT = 87.0 * MM
_LEGEND_ROW, _LEGEND_COLUMNS = 5.0 * MM, 6

#: Colour and dashes of the runs in their order; told apart without colour, too (colours: Okabe and Ito).
_STYLES: tuple[tuple[str, Any], ...] = (("#222222", "-"), ("#CC79A7", (0, (4.5, 1.6))), ("#009E73", (0, (1.2, 1.2))))

#: Lateral positions further away than this are left to the scene figure [m]; least span of axes [m], [m/s].
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


def draw_profiles(profiles: Mapping[str, Sequence[Profile]], titles: Mapping[str, str], lateral_label: str) -> Figure:
    """A figure, 180 mm wide, with a column of panels per vehicle: lateral position above, velocity below.

    Args:
        profiles: Per name of a run one profile per vehicle.
        titles: One per vehicle, with its colour.
        lateral_label: What the lateral position is measured from.

    Returns:
        A matplotlib figure without pyplot; `save_figure` writes it.
    """
    handles = _handles(profiles)
    legend_rows = -(-len(handles) // _LEGEND_COLUMNS)
    height = _HEIGHT + legend_rows * _LEGEND_ROW
    figure = empty_figure(PAGE, height)
    left, right = 15.0 * MM / PAGE, 1.0 - 2.0 * MM / PAGE
    bottom, top = 10.0 * MM / height, 1.0 - (8.0 * MM + legend_rows * _LEGEND_ROW) / height
    panels = figure.subplots(
        2,
        len(titles),
        sharex=True,
        squeeze=False,
        gridspec_kw={"left": left, "right": right, "bottom": bottom, "top": top, "wspace": 0.14, "hspace": 0.12},
    )
    for column, (title, vehicle_color) in enumerate(titles.items()):
        panels[0, column].set_title(title, fontsize=FONT + 0.5, pad=3, color=vehicle_color)
        for name, style in zip(profiles, _STYLES, strict=False):
            _draw(panels[0, column], profiles[name][column], profiles[name][column].lateral, name, style)
            _draw(panels[1, column], profiles[name][column], profiles[name][column].velocity, name, style)
        every = [runs[column] for runs in profiles.values()]
        _limit(panels[0, column], [np.where(np.abs(p.lateral) <= _ASIDE_MAX, p.lateral, np.nan) for p in every])
        panels[1, column].set_xlabel("time [s]", fontsize=FONT)
    for row, label in enumerate((lateral_label, "velocity [m/s]")):
        panels[row, 0].set_ylabel(label, fontsize=FONT)
    fastest = max((np.nanmax(p.velocity, initial=0.0) for runs in profiles.values() for p in runs), default=0.0)
    slowest = min((np.nanmin(p.velocity, initial=0.0) for runs in profiles.values() for p in runs), default=0.0)
    times = [p.time[np.isfinite(p.velocity)] for runs in profiles.values() for p in runs]
    span = np.concatenate([np.zeros(1), *times])
    for axes in panels[1]:
        axes.set_ylim(1.08 * slowest - 0.04 * fastest, 1.08 * max(fastest, _SPAN_MIN))
    for axes in panels.flat:
        plain(axes, ticks=6)
        axes.set_xlim(span.min(), span.max() + 0.01 * np.ptp(span) + 0.1)
    columns = -(-len(handles) // legend_rows)
    add_legend(figure, handles, "upper center", ncols=columns, handlelength=2.6, handletextpad=0.5, columnspacing=1.3)
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
        axes.plot(profile.time[present[-1]], values[present[-1]], **mark_style(profile.outcome), zorder=5)


def _limit(axes: Axes, shown: Sequence[Floats]) -> None:
    """The axis spans what is shown, with room for markers, and never so little that noise looks like motion."""
    values = np.concatenate([*shown, np.empty(0)])
    values = values[np.isfinite(values)]
    low, high = (values.min(), values.max()) if len(values) else (0.0, 0.0)
    half = 0.5 * max(1.16 * (high - low), _SPAN_MIN)
    axes.set_ylim(0.5 * (low + high) - half, 0.5 * (low + high) + half)


def _handles(profiles: Mapping[str, Sequence[Profile]]) -> list[Line2D]:
    handles = [
        Line2D([], [], color=color, linestyle=dashes, linewidth=1.4, label=name)
        for name, (color, dashes) in zip(profiles, _STYLES, strict=False)
    ]
    if any(p.nearest is not None for runs in profiles.values() for p in runs):
        handles.append(Line2D([], [], ls="", marker="o", ms=4.2, mfc="white", mec=INK, mew=1.1, label="nearest"))
    return handles + mark_handles([p.outcome for runs in profiles.values() for p in runs])
