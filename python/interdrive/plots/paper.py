"""Figures for papers: one or two columns wide, one style, agents of one's choice."""

from __future__ import annotations

import textwrap
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D

from interdrive.criticality import measure_named
from interdrive.errors import InputError
from interdrive.plots.labels import draw_labels
from interdrive.plots.measures import levels_of
from interdrive.plots.road import draw_scale, map_axes
from interdrive.plots.still import draw_run
from interdrive.plots.style import (
    GOAL,
    INK,
    MM,
    RECORDED_EDGE,
    STATIC,
    THRESHOLD,
    TRAFFIC,
    add_legend,
    agent_colors,
    empty_figure,
    line_style,
    mark_handles,
    mark_style,
    plain,
)
from interdrive.plots.trajectories import plan_points, track
from interdrive.plots.vehicles import Footprints, goal_outlines
from interdrive.plots.view import View, view_around

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from interdrive.array_types import Floats
    from interdrive.criticality import Criticality
    from interdrive.run import Plans, RunRecord

#: Widths on paper [mm] by number of columns: those of IEEE journals (88.9 and 181.9 mm), a little less.
WIDTHS = {1: 88.0, 2: 180.0}

#: Lines beyond this number could not be told apart.
LINES_MAX = 20

_FONT, _PANEL = 7.0, 34.0 * MM
#: Letters in a line of a label beside a panel.
_LABEL = 22


def chosen_agents(run: RunRecord, agents: Sequence[int] | None, most: int | None = None) -> list[int]:
    """Ids of the agents to draw, in their order; all of them by default.

    Raises:
        InputError: An id is not that of an agent of the run, or there is no agent to draw, or more than `most`.
    """
    known = [agent.id for agent in run.agents]
    for number in agents or ():
        if number not in known:
            raise InputError(f"agent {number} is not in the run; its agents are {', '.join(map(str, known))}")
    shown = known if agents is None else sorted(set(agents))
    if not shown:
        raise InputError(f"{run.scenario.name}: there is no agent to draw")
    if most is not None and len(shown) > most:
        raise InputError(
            f"{len(shown)} agents are too many for lines in one picture; name at most {most} of them "
            "(--agents ID,ID, or agents=)"
        )
    return shown


def draw_trajectories(run: RunRecord, agents: Sequence[int] | None = None, *, columns: int = 2) -> Figure:
    """The picture of `draw_run` for some agents; the others are drawn like recorded traffic.

    Args:
        run: The run.
        agents: Ids of the agents to draw; None: all.
        columns: Width: 1 (88 mm) or 2 (180 mm).

    Raises:
        InputError: An id that is not an agent of the run.
    """
    shown = chosen_agents(run, agents)
    outcomes = run.outcomes.where(np.isin(run.outcomes.agent_id, shown))
    states = replace(run.states, is_agent=run.states.is_agent & np.isin(run.states.participant_id, shown))
    some = replace(run, states=states, outcomes=outcomes, agents=tuple(a for a in run.agents if a.id in shown))
    others = None if len(shown) == len(run.agents) else "other vehicles"
    return draw_run(some, width_mm=WIDTHS[columns], others=others)


def draw_velocity(run: RunRecord, agents: Sequence[int] | None = None, *, columns: int = 1) -> Figure:
    """Velocity of agents over time, with the markers of their outcomes.

    Args:
        run: The run.
        agents: Ids of the agents to draw, at most `LINES_MAX`; None: all.
        columns: Width: 1 (88 mm) or 2 (180 mm).

    Raises:
        InputError: An id that is not an agent of the run, or more than `LINES_MAX` agents.
    """
    shown = chosen_agents(run, agents, LINES_MAX)
    first = run.states.first_time_step
    time: Floats = run.scenario.dt * np.arange(first, first + run.states.n_steps, dtype=np.float64)
    lines = {number: run.states.velocity[int(np.searchsorted(run.states.participant_id, number))] for number in shown}
    styles = _styles([agent.id for agent in run.agents], shown)
    figure, panels = _panels(["velocity [m/s]"], len(shown), columns)
    _draw_lines(panels[0], time, lines, styles)
    ended = dict(zip(run.outcomes.agent_id.tolist(), run.outcomes.outcome, strict=True))
    for number, values in lines.items():
        last = np.flatnonzero(np.isfinite(values))[-1:]
        panels[0].plot(time[last], values[last], **mark_style(ended[number]), zorder=5, clip_on=False)
    panels[0].set_ylim(bottom=min(0.0, panels[0].get_ylim()[0]))
    _finish(figure, panels, styles, [ended[number] for number in shown])
    return figure


def draw_measures(
    found: Criticality, agents: Sequence[int], measures: Sequence[str] = ("ttc", "thw"), *, columns: int = 1
) -> Figure:
    """Criticality measures of agents over time, one panel each; where a line is missing, there is no conflict.

    Args:
        found: Evaluated measures.
        agents: Ids of the agents to draw, at most `LINES_MAX`.
        measures: Names of the measures.
        columns: Width: 1 (88 mm) or 2 (180 mm).

    Raises:
        InputError: A participant that was not evaluated, an unknown measure, or more than `LINES_MAX` agents.
    """
    if len(agents) > LINES_MAX:
        raise InputError(
            f"{len(agents)} agents are too many for lines in one picture; name at most {LINES_MAX} of them "
            "(--agents ID,ID, or agents=)"
        )
    wanted = [measure_named(name) for name in dict.fromkeys(measures)]
    first = found.first_time_step
    time: Floats = found.dt * np.arange(first, first + found.present.shape[1], dtype=np.float64)
    styles = _styles(found.participant_id.tolist(), agents)
    figure, panels = _panels([measure.label for measure in wanted], len(agents), columns)
    for measure, axes in zip(wanted, panels, strict=True):
        values = found[measure.name]
        lines = {number: np.where(np.isfinite(row := values[found.row(number)]), row, np.nan) for number in agents}
        _draw_lines(axes, time, lines, styles)
        level = levels_of(found.settings).get(measure.name)
        if level is not None:
            axes.axhline(level, color=THRESHOLD, linewidth=0.7, linestyle=(0, (4, 2)), zorder=1)
        if not any(np.isfinite(line).any() for line in lines.values()):
            axes.text(0.5, 0.5, "no conflict", ha="center", va="center", fontsize=_FONT, transform=axes.transAxes)
        _limit(axes, list(lines.values()), level, measure.drawn_to)
    _finish(figure, panels, styles, [])
    return figure


def draw_scene(
    run: RunRecord, plans: Plans | None, time: float, agents: Sequence[int] | None = None, *, columns: int = 1
) -> Figure:
    """All participants at one time: agents with ids, past (thin) and plan (thick), recorded traffic grey.

    Args:
        run: What happened.
        plans: Every plan; none: plans are not drawn.
        time: Since the start of the scenario [s]; the nearest time step is drawn.
        agents: Agents that are coloured and determine the visible part of the world; all by default.
        columns: Width on paper.

    Raises:
        InputError: An id that is not an agent of the run, or a time at which none of them is there.
    """
    shown = chosen_agents(run, agents)
    column = round(time / run.scenario.dt) - run.states.first_time_step
    rows = [int(np.searchsorted(run.states.participant_id, number)) for number in shown]
    there = [row for row in rows if 0 <= column < run.states.n_steps and run.states.valid[row, column]]
    if not there:
        raise InputError(f"{run.scenario.name}: none of these agents is there at {time:g} s")
    view = _around(run, there, column)
    width = WIDTHS[columns] * MM
    view = view.shaped(0.3, 0.8)
    height = width * view.height / view.width
    figure = empty_figure(width, height)
    axes = map_axes(figure, (0.003, 0.003, 0.994, 0.994), run.scenario.lanelets, view)
    areas = goal_outlines([agent for agent in run.agents if agent.id in shown], view)
    dashed: dict[str, Any] = {"linewidths": 0.5, "linestyles": [(0, (3, 2))]}
    axes.add_collection(PolyCollection(areas, facecolors="none", edgecolors=GOAL, zorder=2, **dashed), autolim=False)
    known = agent_colors(run)
    colors = {row: known[number] for row, number in zip(rows, shown, strict=True)}
    _draw_bodies(axes, run, column, colors, view)
    crowd = [_body(run, row, column, view) for row in np.flatnonzero(run.states.valid[:, column]).tolist()]
    for row in there:
        crowd += _draw_ways(axes, run, plans, (row, column), colors[row], view)
    states = run.states
    at = {row: view.picture_from_world(np.array([states.x[row, column], states.y[row, column]])) for row in there}
    wanted = [(str(states.participant_id[row]), at[row], INK) for row in there]
    draw_labels(axes, view, width, wanted, np.concatenate(crowd), _FONT - 0.5)
    draw_scale(axes, view, view.width * MM / width, _FONT)
    return figure


def _around(run: RunRecord, rows: Sequence[int], column: int) -> View:
    """Where the agents are and will be in the next seconds."""
    states = run.states
    ahead = slice(column, column + round(2.0 / run.scenario.dt) + 1)
    points, motion = [], []
    for row in rows:
        way = track(run, row, ahead)
        points += [way - 0.5 * states.length[row], way + 0.5 * states.length[row]]
        motion.append(way[-1:] - way[:1])
    return view_around(np.concatenate(points), np.concatenate(motion))


def _draw_bodies(axes: Axes, run: RunRecord, column: int, colors: Mapping[int, str], view: View) -> None:
    states, footprints = run.states, Footprints(run)
    for row in np.flatnonzero(states.valid[:, column]).tolist():
        lines = footprints.outlines(row, column, view)
        color = colors.get(row, STATIC if states.is_static[row] else TRAFFIC)
        edge = INK if row in colors else RECORDED_EDGE
        axes.add_collection(
            PolyCollection(lines, facecolors=color, edgecolors=edge, linewidths=0.4, zorder=4), autolim=False
        )
        if not states.is_static[row]:
            mark = [footprints.heading_mark(row, column, view)]
            axes.add_collection(PolyCollection(mark, facecolors=edge, linewidths=0.0, zorder=4), autolim=False)


def _draw_ways(
    axes: Axes, run: RunRecord, plans: Plans | None, at: tuple[int, int], color: str, view: View
) -> list[Floats]:
    """Past and plan of an agent; returns their points in the picture."""
    states, (row, column) = run.states, at
    lines = [(track(run, row, slice(column + 1)), 0.7)]
    if plans is not None:
        step = states.first_time_step + column
        own = np.flatnonzero((plans.agent_id == states.participant_id[row]) & (plans.time_step <= step))
        if len(own):
            lines.append((plan_points(plans, int(own[-1])), 1.6))
    drawn = []
    for line, thick in lines:
        if len(line):
            points = view.picture_from_world(line)
            drawn.append(points[:: max(1, len(points) // 30)])
            axes.add_collection(LineCollection([points], colors=color, linewidths=thick, zorder=3), autolim=False)
    return drawn


def _body(run: RunRecord, row: int, column: int, view: View) -> Floats:
    """Points along the middle of a footprint in the picture, shape (points, 2)."""
    states = run.states
    along = np.linspace(-0.5, 0.5, 5) * states.length[row]
    x = states.x[row, column] + along * np.cos(states.orientation[row, column])
    y = states.y[row, column] + along * np.sin(states.orientation[row, column])
    return view.picture_from_world(np.column_stack([x, y]))


def _panels(labels: Sequence[str], n_lines: int, columns: int) -> tuple[Figure, list[Axes]]:
    """A figure with one panel above the other and room for a legend below."""
    width = WIDTHS[columns] * MM
    labels = [textwrap.fill(label, _LABEL) for label in labels]
    lines = max(label.count("\n") + 1 for label in labels)
    legend = 4.0 * MM * -(-(n_lines + 2) // _legend_columns(columns)) + 1.0 * MM
    height = len(labels) * _PANEL + 8.0 * MM + legend
    figure = empty_figure(width, height)
    grid = {
        "left": (8.0 + 3.0 * lines) * MM / width,
        "right": 1.0 - 2.5 * MM / width,
        "bottom": (7.5 * MM + legend) / height,
        "top": 1.0 - 2.0 * MM / height,
        "hspace": 0.12,
    }
    panels = figure.subplots(len(labels), 1, sharex=True, squeeze=False, gridspec_kw=grid)[:, 0]
    for axes, label in zip(panels, labels, strict=True):
        axes.set_ylabel(label, fontsize=_FONT)
        plain(axes, _FONT, ticks=5)
    panels[-1].set_xlabel("time [s]", fontsize=_FONT)
    return figure, list(panels)


def _legend_columns(columns: int) -> int:
    return 4 if columns == 1 else 8


def _styles(known: Sequence[int], shown: Sequence[int]) -> dict[int, dict[str, Any]]:
    """The line of each shown agent among all known agents."""
    return {number: {**line_style(known.index(number)), "linewidth": 1.2} for number in shown}


def _draw_lines(axes: Axes, time: Floats, lines: Mapping[int, Floats], styles: Mapping[int, Mapping[str, Any]]) -> None:
    for number, values in lines.items():
        # A single value between two infinite ones would be invisible.
        axes.plot(time, values, marker="." if np.isfinite(values).sum() == 1 else None, **styles[number])


def _limit(axes: Axes, lines: Sequence[Floats], level: float | None, cap: float) -> None:
    """The axis spans the values up to a cap, and the level; what hardly changes is no drama."""
    values = np.concatenate([*lines, np.array([np.nan if level is None else level])])
    values = values[np.isfinite(values)]
    if not len(values):
        axes.set_ylim(0.0, 1.0)
        return
    low = min(float(values.min()), cap)
    high = max(min(float(values.max()), cap), low + 0.1)
    axes.set_ylim(low - 0.05 * (high - low), high + 0.02 * (high - low))


def _finish(
    figure: Figure, panels: Sequence[Axes], styles: Mapping[int, Mapping[str, Any]], ends: Sequence[str]
) -> None:
    """Limits of time and the legend: agents, then the outcomes that occur."""
    lines = [np.asarray(line.get_xdata())[np.isfinite(line.get_ydata())] for a in panels for line in a.get_lines()]
    times = np.concatenate([np.empty(0), *(line for line in lines if len(line) > 2)])
    if len(times):
        panels[0].set_xlim(times.min(), times.max() + 0.01 * np.ptp(times))
    handles = [Line2D([], [], label=str(number), **style) for number, style in styles.items()] + mark_handles(ends)
    columns = 1 if figure.get_size_inches()[0] < 120.0 * MM else 2
    # Rows of about equal length: a legend is filled column by column.
    across = -(-len(handles) // -(-len(handles) // _legend_columns(columns)))
    tight = {"handlelength": 1.8, "handletextpad": 0.4, "columnspacing": 1.0, "borderpad": 0.2, "labelspacing": 0.3}
    add_legend(figure, handles, "lower center", ncols=across, fontsize=_FONT - 0.5, **tight)
