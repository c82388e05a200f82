"""Criticality of one vehicle over time, and the scene at the most critical moment."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.lines import Line2D

from interdrive.criticality import MEASURES, measure_named
from interdrive.errors import InputError
from interdrive.plots.measures import levels_of
from interdrive.plots.scenes import Scene, draw_scenes
from interdrive.plots.style import AGENTS, FONT, INK, MM, PAGE, THRESHOLD, add_legend, empty_figure, plain
from interdrive.run.goals import said_seconds

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from interdrive.array_types import Floats
    from interdrive.criticality import Criticality, CriticalMoment, Measure
    from interdrive.run import RunRecord

_COLUMNS, _PANEL = 3, 27.0 * MM


def draw_criticality(found: Criticality, participant_id: int, *, color: str = AGENTS[0]) -> Figure:
    """A figure, 180 mm wide, with a panel per measure: its values over time for one vehicle.

    The most critical moment is marked; dashed lines are thresholds: the one of the settings for the TTC,
    1 for numbers that compare what is needed with what is there. Where a line is missing, the measure is infinite (no
    conflict) or cannot be computed.

    Args:
        found: What was evaluated.
        participant_id: A vehicle that was judged.
        color: Of the vehicle; `interdrive.plots.style.agent_colors` says which one it has in other figures.

    Returns:
        A matplotlib figure without pyplot; `save_figure` writes it.

    Raises:
        InputError: The vehicle was not evaluated.
    """
    row = found.row(participant_id)
    rows = -(-len(MEASURES) // _COLUMNS)
    height = rows * _PANEL + 16.0 * MM
    figure = empty_figure(PAGE, height)
    panels = figure.subplots(
        rows,
        _COLUMNS,
        sharex=True,
        squeeze=False,
        gridspec_kw={
            "left": 10.0 * MM / PAGE,
            "right": 1.0 - 2.0 * MM / PAGE,
            "bottom": 9.0 * MM / height,
            "top": 1.0 - 11.0 * MM / height,
            "wspace": 0.2,
            "hspace": 0.42,
        },
    )
    columns = np.flatnonzero(found.present[row])
    time = (found.first_time_step + columns).astype(np.float64) * found.dt
    for measure, axes in zip(MEASURES, panels.flat, strict=False):
        _draw(axes, found, row, measure, time, color)
    for axes in panels[-1]:
        axes.set_xlabel("time [s]", fontsize=FONT)
        axes.set_xlim(time[0], max(time[-1], time[0] + found.dt))
    for axes in list(panels.flat)[len(MEASURES) :]:
        axes.set_axis_off()
    handles = [
        Line2D([], [], color=color, lw=1.3, label=f"vehicle {participant_id}"),
        Line2D([], [], ls="", marker="o", ms=4.2, mfc="white", mec=INK, mew=1.2, label="most critical"),
        Line2D([], [], color=THRESHOLD, lw=0.8, ls=(0, (4, 2)), label="threshold"),
    ]
    add_legend(figure, handles, "upper center", ncols=3)
    return figure


def _draw(axes: Axes, found: Criticality, row: int, measure: Measure, time: Floats, color: str) -> None:
    values = found[measure.name][row, found.present[row]]
    shown = np.where(np.isfinite(values), values, np.nan)
    axes.set_title(measure.label, fontsize=FONT, pad=2.5, loc="left", color=INK)
    plain(axes, ticks=4)
    if not np.isfinite(shown).any():
        text = "cannot be computed" if np.isnan(values).all() else "no conflict"
        axes.text(0.5, 0.5, text, ha="center", va="center", fontsize=FONT, color=THRESHOLD, transform=axes.transAxes)
        axes.set_yticks([])
        return
    # A single value between two infinite ones would be invisible.
    axes.plot(time, shown, color=color, linewidth=1.3, marker="." if np.isfinite(shown).sum() == 1 else None)
    threshold = levels_of(found.settings).get(measure.name)
    low, high = float(np.nanmin(shown)), float(np.nanmax(shown))
    if threshold is not None:
        axes.axhline(threshold, color=THRESHOLD, linewidth=0.8, linestyle=(0, (4, 2)))
        low, high = min(low, threshold), max(high, threshold)
    high = max(low, min(high, measure.drawn_to))
    # What hardly changes is no drama.
    half = max(0.54 * (high - low), 0.05 * abs(high + low), 0.02)
    bottom, top = 0.5 * (low + high) - half, 0.5 * (low + high) + half
    axes.set_ylim(max(bottom, -0.06 * top) if low >= 0.0 else bottom, top)
    extreme = found.extremes[measure.name]
    at = int(extreme.time_step[row]) * found.dt
    # Beyond the panel there is nothing to mark; at its edge the marker is whole.
    if np.isfinite(extreme.value[row]) and axes.get_ylim()[0] <= extreme.value[row] <= axes.get_ylim()[1]:
        axes.plot(at, extreme.value[row], "o", ms=4.2, mfc="white", mec=INK, mew=1.2, zorder=4, clip_on=False)


def draw_critical_moment(run: RunRecord, moment: CriticalMoment) -> Figure:
    """The scene around a critical moment, 180 mm wide: both vehicles with time stamps, all others at that moment.

    Args:
        run: What was judged.
        moment: Of a measure with a partner.

    Returns:
        A matplotlib figure without pyplot; `save_figure` writes it.

    Raises:
        InputError: The moment has no partner.
    """
    measure = measure_named(moment.measure)
    if moment.partner_id < 0:
        raise InputError(f"the moment of {measure.name} has no partner: there is no encounter to draw")
    value = measure.text(moment.value)
    title = f"{run.scenario.name}: {measure.title} {value} at {said_seconds(moment.time_step, run.scenario.dt)} s"
    scene = Scene(run, title, moment.time_step - run.states.first_time_step)
    names = (f"vehicle {moment.participant_id}", f"vehicle {moment.partner_id}")
    return draw_scenes([scene], (moment.participant_id, moment.partner_id), names, filled="at that moment")
