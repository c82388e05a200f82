"""Figures for papers: one or two columns wide, one style, agents of one's choice."""

from __future__ import annotations

import textwrap
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import patheffects
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from interdrive.criticality import measure_named
from interdrive.errors import InputError
from interdrive.plots.participants import (
    AGENTS,
    INK,
    MARKS,
    RECORDED,
    RECORDED_EDGE,
    body_outlines,
    heading_mark,
    outlines,
    placed,
)
from interdrive.plots.road import road_artists
from interdrive.plots.still import draw_run
from interdrive.plots.view import View, view_around

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes

    from interdrive.criticality import Criticality
    from interdrive.plots.view import Floats
    from interdrive.run import Plans, Run

_MM = 1.0 / 25.4

#: Widths on paper [mm] by number of columns: those of IEEE journals (88.9 and 181.9 mm), a little less.
WIDTHS = {1: 88.0, 2: 180.0}

#: Lines beyond this number could not be told apart.
LINES_MAX = 20

_FONT, _PANEL = 7.0, 34.0 * _MM
#: Letters in a line of a label beside a panel.
_LABEL = 22
_DASHES: tuple[Any, ...] = ("-", (0, (4.5, 1.6)), (0, (1.2, 1.2)))
_HALO = [patheffects.withStroke(linewidth=1.6, foreground="white")]

#: Up to here values of a measure matter; further up they would only press the rest down.
_CAPS = {"ttc": 10.0, "thw": 10.0, "psd": 10.0, "btn": 3.0, "stn": 3.0}
_LEVELS = {"btn": 1.0, "stn": 1.0, "psd": 1.0}


def chosen_agents(run: Run, agents: Sequence[int] | None, most: int | None = None) -> list[int]:
    """Ids of the agents to draw, in their order; all of them by default.

    Raises:
        InputError: An id that is no agent of the run, nobody to draw, or more than `most`.
    """
    known = [agent.id for agent in run.agents]
    for number in agents or ():
        if number not in known:
            raise InputError(f"agent {number} is not one of the run; its agents are {', '.join(map(str, known))}")
    shown = known if agents is None else sorted(set(agents))
    if not shown:
        raise InputError(f"{run.scenario.name}: there is no agent to draw")
    if most is not None and len(shown) > most:
        raise InputError(f"{len(shown)} agents are too many for lines in one picture; name at most {most} of them")
    return shown


def draw_trajectories(run: Run, agents: Sequence[int] | None = None, *, columns: int = 2) -> Figure:
    """The picture of `draw_run` for some agents; the others are drawn like recorded traffic.

    Raises:
        InputError: An id that is no agent of the run.
    """
    shown = chosen_agents(run, agents)
    kept = np.isin(run.outcomes.agent_id, shown)
    rows = np.flatnonzero(kept).tolist()
    ended = run.outcomes
    outcomes = replace(
        ended,
        planner=tuple(ended.planner[row] for row in rows),
        outcome=tuple(ended.outcome[row] for row in rows),
        message=tuple(ended.message[row] for row in rows),
        agent_id=ended.agent_id[kept],
        time_step=ended.time_step[kept],
        partner_id=ended.partner_id[kept],
        off_road=ended.off_road[kept],
        impact_speed=ended.impact_speed[kept],
    )
    states = replace(run.states, is_agent=run.states.is_agent & np.isin(run.states.ids, shown))
    some = replace(run, states=states, outcomes=outcomes, agents=tuple(a for a in run.agents if a.id in shown))
    others = "recorded traffic" if len(shown) == len(run.agents) else "other vehicles"
    return draw_run(some, width_mm=WIDTHS[columns], others=others)


def draw_velocity(run: Run, agents: Sequence[int] | None = None, *, columns: int = 1) -> Figure:
    """Velocity of agents over time, with the markers of their outcomes.

    Raises:
        InputError: An id that is no agent of the run, or more than `LINES_MAX` agents.
    """
    shown = chosen_agents(run, agents, LINES_MAX)
    first = run.states.first_time_step
    time: Floats = run.scenario.dt * np.arange(first, first + run.states.n_steps, dtype=np.float64)
    lines = {number: run.states.velocity[int(np.searchsorted(run.states.ids, number))] for number in shown}
    figure, panels = _panels(["velocity [m/s]"], len(shown), columns)
    _draw_lines(panels[0], time, lines)
    ended = dict(zip(run.outcomes.agent_id.tolist(), run.outcomes.outcome, strict=True))
    for number, values in lines.items():
        last = np.flatnonzero(np.isfinite(values))[-1:]
        mark = MARKS[ended[number]]
        panels[0].plot(
            time[last],
            values[last],
            mark.marker,
            ms=mark.size,
            mfc=mark.color,
            mec=INK,
            mew=0.5,
            zorder=5,
            clip_on=False,
        )
    panels[0].set_ylim(bottom=min(0.0, panels[0].get_ylim()[0]))
    _finish(figure, panels, shown, [ended[number] for number in shown])
    return figure


def draw_measures(
    found: Criticality, agents: Sequence[int], measures: Sequence[str] = ("ttc", "thw"), *, columns: int = 1
) -> Figure:
    """Criticality measures of agents over time, one panel each; where a line is missing, there is no conflict.

    Raises:
        InputError: A participant that was not judged, an unknown measure, or more than `LINES_MAX` agents.
    """
    if len(agents) > LINES_MAX:
        raise InputError(
            f"{len(agents)} agents are too many for lines in one picture; name at most {LINES_MAX} of them"
        )
    wanted = [measure_named(name) for name in dict.fromkeys(measures)]
    first = found.first_time_step
    time: Floats = found.dt * np.arange(first, first + found.present.shape[1], dtype=np.float64)
    figure, panels = _panels([measure.label for measure in wanted], len(agents), columns)
    for measure, axes in zip(wanted, panels, strict=True):
        values = found[measure.name]
        lines = {number: np.where(np.isfinite(row := values[found.row(number)]), row, np.nan) for number in agents}
        _draw_lines(axes, time, lines)
        level = found.settings.ttc_threshold if measure.name == "ttc" else _LEVELS.get(measure.name)
        if level is not None:
            axes.axhline(level, color="#7a7a7a", linewidth=0.7, linestyle=(0, (4, 2)), zorder=1)
        if not any(np.isfinite(line).any() for line in lines.values()):
            axes.text(0.5, 0.5, "no conflict", ha="center", va="center", fontsize=_FONT, transform=axes.transAxes)
        _limit(axes, list(lines.values()), level, _CAPS.get(measure.name, np.inf))
    _finish(figure, panels, list(agents), [])
    return figure


def draw_scene(
    run: Run, plans: Plans | None, time: float, agents: Sequence[int] | None = None, *, columns: int = 1
) -> Figure:
    """Everybody at one time: agents with ids, past (thin) and plan (thick), recorded traffic grey.

    Args:
        run: What happened.
        plans: Every plan; none: plans are not drawn.
        time: Since the start of the scenario [s]; the nearest time step is drawn.
        agents: Who is coloured and decides which part of the world is shown; all by default.
        columns: Width on paper.

    Raises:
        InputError: An id that is no agent of the run, or a time at which none of them is there.
    """
    shown = chosen_agents(run, agents)
    column = round(time / run.scenario.dt) - run.states.first_time_step
    rows = [int(np.searchsorted(run.states.ids, number)) for number in shown]
    there = [row for row in rows if 0 <= column < run.states.n_steps and run.states.valid[row, column]]
    if not there:
        raise InputError(f"{run.scenario.name}: none of these agents is there at {time:g} s")
    view = _around(run, there, column)
    width = WIDTHS[columns] * _MM
    view = view.shaped(0.3, 0.8)
    height = width * view.height / view.width
    figure = Figure(figsize=(width, height), dpi=300)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.003, 0.003, 0.994, 0.994))
    axes.set(xlim=view.x_limits, ylim=view.y_limits, xticks=[], yticks=[])
    for side in axes.spines.values():
        side.set(color=RECORDED, linewidth=0.5)
    for artist in road_artists(run.scenario.lanelets, view):
        axes.add_collection(artist, autolim=False)
    _draw_goals(axes, run, shown, view)
    colors = {row: AGENTS[place % len(AGENTS)] for place, row in enumerate(rows)}
    _draw_bodies(axes, run, column, colors, view)
    for row in there:
        _draw_ways(axes, run, plans, (row, column), colors[row], view)
    _draw_scale(axes, view, width)
    return figure


def _around(run: Run, rows: Sequence[int], column: int) -> View:
    """Where the agents are and will be in the next seconds."""
    states = run.states
    ahead = slice(column, column + round(2.0 / run.scenario.dt) + 1)
    points, motion = [], []
    for row in rows:
        track = np.stack([states.x[row, ahead], states.y[row, ahead]], axis=1)
        track = track[np.isfinite(track).all(axis=1)]
        points += [track - 0.5 * states.length[row], track + 0.5 * states.length[row]]
        motion.append(track[-1:] - track[:1])
    return view_around(np.concatenate(points), np.concatenate(motion))


def _draw_goals(axes: Axes, run: Run, shown: Sequence[int], view: View) -> None:
    areas = [a for agent in run.agents if agent.id in shown for area in agent.goal_areas for a in outlines(area)]
    lines = [view.picture_from_world(line) for line in areas]
    style: dict[str, Any] = {"facecolors": "none", "edgecolors": AGENTS[0], "linewidths": 0.5}
    axes.add_collection(PolyCollection(lines, linestyles=[(0, (3, 2))], zorder=2, **style), autolim=False)


def _draw_bodies(axes: Axes, run: Run, column: int, colors: Mapping[int, str], view: View) -> None:
    states, bodies = run.states, body_outlines(run)
    for row in np.flatnonzero(states.valid[:, column]).tolist():
        pose = states.x[row, column], states.y[row, column], states.orientation[row, column]
        lines = [view.picture_from_world(placed(line, *pose)) for line in bodies[row]]
        color = colors.get(row, "#6f6f6f" if states.is_static[row] else "#b4b4b4")
        edge = INK if row in colors else RECORDED_EDGE
        axes.add_collection(
            PolyCollection(lines, facecolors=color, edgecolors=edge, linewidths=0.4, zorder=4), autolim=False
        )
        if not states.is_static[row]:
            mark = placed(heading_mark(states.length[row], states.width[row]), *pose)
            ahead = PolyCollection([view.picture_from_world(mark)], facecolors=edge, linewidths=0.0, zorder=4)
            axes.add_collection(ahead, autolim=False)


def _draw_ways(axes: Axes, run: Run, plans: Plans | None, at: tuple[int, int], color: str, view: View) -> None:
    """Past and plan of an agent, and its id."""
    states, (row, column) = run.states, at
    past = np.stack([states.x[row, : column + 1], states.y[row, : column + 1]], axis=1)
    lines = [(past[np.isfinite(past).all(axis=1)], 0.7)]
    if plans is not None:
        step = states.first_time_step + column
        own = np.flatnonzero((plans.agent_id == states.ids[row]) & (plans.time_step <= step))
        if len(own):
            plan = np.stack([plans.x[own[-1]], plans.y[own[-1]]], axis=1)
            lines.append((plan[np.isfinite(plan).all(axis=1)], 1.6))
    for line, thick in lines:
        if len(line):
            points = [view.picture_from_world(line)]
            axes.add_collection(LineCollection(points, colors=color, linewidths=thick, zorder=3), autolim=False)
    x, y = view.picture_from_world(np.array([states.x[row, column], states.y[row, column]]))
    axes.annotate(
        str(states.ids[row]),
        (x, y),
        (0, 5),
        textcoords="offset points",
        ha="center",
        fontsize=_FONT - 0.5,
        color=INK,
        path_effects=_HALO,
        zorder=7,
        annotation_clip=True,
    )


def _draw_scale(axes: Axes, view: View, width: float) -> None:
    length = next(nice for nice in (100.0, 50.0, 20.0, 10.0, 5.0, 2.0) if nice <= 0.25 * view.width or nice == 2.0)
    millimetre = view.width * _MM / width
    x, y = view.x_limits[0] + 2.0 * millimetre, view.y_limits[0] + 2.0 * millimetre
    axes.add_line(Line2D([x, x + length], [y, y], color=INK, linewidth=1.0, zorder=9, path_effects=_HALO))
    style: dict[str, Any] = {"fontsize": _FONT - 0.5, "color": INK, "va": "center", "path_effects": _HALO, "zorder": 9}
    axes.text(x + length + millimetre, y, f"{length:g} m", **style)


def _panels(labels: Sequence[str], n_lines: int, columns: int) -> tuple[Figure, list[Axes]]:
    """A figure with one panel above the other and room for a legend below."""
    width = WIDTHS[columns] * _MM
    labels = [textwrap.fill(label, _LABEL) for label in labels]
    lines = max(label.count("\n") + 1 for label in labels)
    legend = 4.0 * _MM * -(-(n_lines + 2) // _legend_columns(columns)) + 1.0 * _MM
    height = len(labels) * _PANEL + 8.0 * _MM + legend
    figure = Figure(figsize=(width, height), dpi=300)
    FigureCanvasAgg(figure)
    grid = {
        "left": (8.0 + 3.0 * lines) * _MM / width,
        "right": 1.0 - 2.5 * _MM / width,
        "bottom": (7.5 * _MM + legend) / height,
        "top": 1.0 - 2.0 * _MM / height,
        "hspace": 0.12,
    }
    panels = figure.subplots(len(labels), 1, sharex=True, squeeze=False, gridspec_kw=grid)[:, 0]
    for axes, label in zip(panels, labels, strict=True):
        axes.set_ylabel(label, fontsize=_FONT)
        axes.grid(visible=True, color="#e3e3e3", linewidth=0.5)
        axes.set_axisbelow(True)
        axes.tick_params(labelsize=_FONT - 0.5, length=2.5, width=0.5, pad=2)
        axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        axes.yaxis.set_major_formatter(ScalarFormatter(useOffset=False))
        for name, side in axes.spines.items():
            side.set(linewidth=0.5, color=RECORDED, visible=name in ("left", "bottom"))
    panels[-1].set_xlabel("time [s]", fontsize=_FONT)
    return figure, list(panels)


def _legend_columns(columns: int) -> int:
    return 4 if columns == 1 else 8


def _style(place: int) -> dict[str, Any]:
    """Colour and dashes together tell the lines apart."""
    return {"color": AGENTS[place % len(AGENTS)], "linestyle": _DASHES[place // len(AGENTS)], "linewidth": 1.2}


def _draw_lines(axes: Axes, time: Floats, lines: Mapping[int, Floats]) -> None:
    for place, values in enumerate(lines.values()):
        # A single value between two infinite ones would be invisible.
        axes.plot(time, values, marker="." if np.isfinite(values).sum() == 1 else None, **_style(place))


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


def _finish(figure: Figure, panels: Sequence[Axes], shown: Sequence[int], ends: Sequence[str]) -> None:
    """Limits of time and the legend: agents, then the outcomes that occur."""
    lines = [np.asarray(line.get_xdata())[np.isfinite(line.get_ydata())] for a in panels for line in a.get_lines()]
    times = np.concatenate([np.empty(0), *(line for line in lines if len(line) > 2)])
    if len(times):
        panels[0].set_xlim(times.min(), times.max() + 0.01 * np.ptp(times))
    handles = [Line2D([], [], label=str(number), **_style(place)) for place, number in enumerate(shown)]
    for outcome in (name for name in MARKS if name in ends):
        mark = MARKS[outcome]
        style: dict[str, Any] = {"marker": mark.marker, "ms": mark.size, "mfc": mark.color, "mec": INK, "mew": 0.5}
        handles.append(Line2D([], [], ls="", label=mark.text, **style))
    columns = 1 if figure.get_size_inches()[0] < 120.0 * _MM else 2
    figure.legend(
        handles=handles,
        loc="lower center",
        # Rows of about equal length: a legend is filled column by column.
        ncols=-(-len(handles) // -(-len(handles) // _legend_columns(columns))),
        fontsize=_FONT - 0.5,
        frameon=False,
        handlelength=1.8,
        handletextpad=0.4,
        columnspacing=1.0,
        borderpad=0.2,
        labelspacing=0.3,
    )
