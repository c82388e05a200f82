"""One picture of a whole run: all trajectories, coloured by time, and all outcomes."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from interdrive.errors import ResultsError
from interdrive.plots.labels import draw_labels
from interdrive.plots.road import draw_bar, map_axes
from interdrive.plots.style import (
    GOAL,
    HALO,
    INK,
    MM,
    RECORDED,
    RECORDED_EDGE,
    STATIC,
    TRAFFIC,
    add_legend,
    empty_figure,
    mark_handles,
    mark_style,
    others_named,
)
from interdrive.plots.trajectories import track
from interdrive.plots.vehicles import Footprints, goal_outlines
from interdrive.plots.view import view_of
from interdrive.storage import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from interdrive.array_types import Floats
    from interdrive.plots.view import View
    from interdrive.run import RunRecord

_ASPECT_MAX, _PAD = 150.0 / 180.0, 0.5 * MM

#: Below this width the colour bar has a row for itself, and the legend fewer columns [in].
_NARROW = 120.0 * MM

#: Height of the strip with legend and colour bar, per row of the legend [in].
_STRIP, _STRIP_ROW = 3.0 * MM, 4.2 * MM

#: Viridis without its pale end, which is lost on a light road.
_TIME_COLORS = ListedColormap(mpl.colormaps["viridis"](np.linspace(0.0, 0.93, 256)))

_GOAL_FILL, _GOAL_DASHES = (0.0, 0.447, 0.698, 0.06), (0, (3, 2))

_FONT = 7.0

#: Ends that get the agent's id, in this colour.
_WRONG, _WRONG_INK = ("goal_missed", "infeasible", "collision", "planner_error"), "#a03000"


def draw_run(run: RunRecord, *, width_mm: float = 180.0, others: str | None = None, view: View | None = None) -> Figure:
    """A figure of the run: trajectories coloured by time over the road, outcomes as markers.

    Args:
        run: Finished or interrupted.
        width_mm: Width of the figure on paper [mm].
        others: Name in the legend of what moves and is no agent; None: recorded traffic, or vehicles of SUMO.
        view: What is shown; None: where the agents move.

    Returns:
        A matplotlib figure without pyplot; `save_figure` or `savefig` write it as PNG, PDF or SVG.
    """
    width = width_mm * MM
    view = (view or view_of(run)).shaped(0.2, _ASPECT_MAX)
    handles = _legend_handles(run, others)
    columns, bar_row = (4, 0.0) if width > _NARROW else (3, 6.0 * MM)
    rows = -(-len(handles) // columns)
    strip = _STRIP + _STRIP_ROW * (rows if bar_row else max(2, rows)) + bar_row
    height = width * view.height / view.width
    total = height + strip
    figure = empty_figure(width, total)
    place = _PAD / width, strip / total, 1.0 - 2.0 * _PAD / width, (height - _PAD) / total
    axes = map_axes(figure, place, run.scenario.lanelets, view)
    axes.set_aspect("equal", adjustable="box")
    dashed: dict[str, Any] = {"linewidths": 0.4, "linestyles": [_GOAL_DASHES], "zorder": 2}
    areas = goal_outlines(run.agents, view)
    axes.add_collection(PolyCollection(areas, facecolors=[_GOAL_FILL], edgecolors=GOAL, **dashed), autolim=False)
    footprints = Footprints(run)
    _draw_recorded(axes, run, footprints, view)
    times = _draw_trajectories(axes, run, footprints, view)
    ends = _draw_ends(axes, run, view)
    _draw_labels(axes, run, view, ends, width)
    _draw_scale(axes, run, view, width)
    tight = {"handletextpad": 0.3, "columnspacing": 1.0, "borderpad": 0.2, "labelspacing": 0.35}
    add_legend(figure, handles, "lower left", ncols=columns, fontsize=_FONT, **tight)
    if run.agents:
        # Beside the legend, or between it and the picture.
        _draw_color_bar(figure, times, (strip - 4.0 * MM) if bar_row else 6.2 * MM)
    return figure


def save_figure(figure: Figure, path: str | Path) -> None:
    """Writes a figure, whole or not at all.

    Args:
        figure: A matplotlib figure.
        path: File that ends in .png, .pdf or .svg, which chooses the format.

    Raises:
        ResultsError: For another ending or a file that cannot be written.
    """
    kind = Path(path).suffix.lower().lstrip(".")
    if kind not in ("png", "pdf", "svg"):
        raise ResultsError(f"{path}: pictures end in .png, .pdf or .svg")
    # Editable text in vector files, and the same bytes for the same run.
    options = {"pdf.fonttype": 42, "svg.fonttype": "none", "svg.hashsalt": "interdrive"}
    metadata = {"png": {"Software": None}, "pdf": {"CreationDate": None}, "svg": {"Date": None}}[kind]
    drawn = io.BytesIO()  # matplotlib's writer of PDF breaks when a disk is full, and hides why
    with mpl.rc_context(options):
        figure.savefig(drawn, format=kind, metadata=metadata)
    with replacing(path) as partial:
        partial.write_bytes(drawn.getbuffer())


def _draw_recorded(axes: Axes, run: RunRecord, footprints: Footprints, view: View) -> None:
    states = run.states
    lines, areas, colors = [], [], []
    for row in np.flatnonzero(~states.is_agent & states.valid.any(axis=1)).tolist():
        lines.append(view.picture_from_world(track(run, row)))
        last = int(np.flatnonzero(states.valid[row])[-1])
        for outline in footprints.outlines(row, last, view):
            areas.append(outline)
            colors.append(STATIC if states.is_static[row] else TRAFFIC)
    axes.add_collection(LineCollection(lines, colors=RECORDED, linewidths=0.5, alpha=0.7, zorder=3), autolim=False)
    axes.add_collection(
        PolyCollection(areas, facecolors=colors, edgecolors=RECORDED_EDGE, linewidths=0.3, zorder=3), autolim=False
    )


def _draw_trajectories(axes: Axes, run: RunRecord, footprints: Footprints, view: View) -> Normalize:
    """Draws lines and footprints of the agents; returns the range of times."""
    states, dt = run.states, run.scenario.dt
    agents = np.flatnonzero(states.is_agent & states.valid.any(axis=1)).tolist()
    width = float(np.clip(2.2 - 0.04 * len(agents), 1.0, 1.8))
    spans = [np.flatnonzero(states.valid[row])[[0, -1]] for row in agents] or [np.zeros(2, dtype=np.int64)]
    first, last = min(span[0] for span in spans), max(span[1] for span in spans)
    times = Normalize((states.first_time_step + first) * dt, (states.first_time_step + max(last, first + 1)) * dt)
    for order, row in enumerate(agents):
        points = view.picture_from_world(track(run, row))
        at = dt * (states.first_time_step + np.flatnonzero(states.valid[row])).astype(np.float64)
        zorder = 4.0 + 0.5 * order / max(1, len(agents))
        axes.add_collection(
            LineCollection([points], colors="white", linewidths=width + 0.9, alpha=0.7, zorder=zorder), autolim=False
        )
        segments = np.stack([points[:-1], points[1:]], axis=1)
        # Short overlapping strokes would show their round ends; butt ends leave no seam at this spacing.
        line = LineCollection(list(segments), cmap=_TIME_COLORS, norm=times, linewidths=width, zorder=zorder + 0.01)
        line.set_array(0.5 * (at[:-1] + at[1:]))
        line.set_capstyle("projecting")
        axes.add_collection(line, autolim=False)
        for step in _shown_steps(run, row, every_second=len(agents) <= 8):
            color = _TIME_COLORS(times((states.first_time_step + step) * dt))
            axes.add_collection(
                PolyCollection(
                    footprints.outlines(row, step, view),
                    facecolors=[(*color[:3], 0.16)],
                    edgecolors=[color],
                    linewidths=0.5,
                    zorder=3.5,
                ),
                autolim=False,
            )
    return times


def _shown_steps(run: RunRecord, row: int, *, every_second: bool) -> list[int]:
    """Columns at which a footprint is drawn: first, last, and whole seconds in between unless they would overlap."""
    states = run.states
    steps = np.flatnonzero(states.valid[row])
    shown = [int(steps[0])]
    if every_second:
        for step in steps[:: max(1, round(1.0 / run.scenario.dt))]:
            way = np.hypot(*(table[row, step] - table[row, shown[-1]] for table in (states.x, states.y)))
            if way > 1.25 * states.length[row]:
                shown.append(int(step))
    return [*shown, int(steps[-1])]


def _draw_ends(axes: Axes, run: RunRecord, view: View) -> dict[int, tuple[Floats, Floats]]:
    """Marks starts and outcomes; returns first and last position per agent."""
    ended = dict(zip(run.outcomes.agent_id.tolist(), run.outcomes.outcome, strict=True))
    ends = {}
    for row, number in enumerate(run.states.participant_id.tolist()):
        if number not in ended or not run.states.valid[row].any():
            continue
        points = view.picture_from_world(track(run, row))
        ends[number] = points[0], points[-1]
        axes.plot(*points[0], "o", ms=2.2, mfc="white", mec=INK, mew=0.6, zorder=5)
        axes.plot(*points[-1], **mark_style(ended[number]), zorder=6)
    return ends


def _draw_labels(axes: Axes, run: RunRecord, view: View, ends: dict[int, tuple[Floats, Floats]], width: float) -> None:
    """Puts every agent's id beside its start, and beside its end if it went wrong."""
    size = _FONT - 1.0 if len(ends) <= 30 else _FONT - 2.0
    ended = dict(zip(run.outcomes.agent_id.tolist(), run.outcomes.outcome, strict=True))
    wanted = [(str(number), start, INK) for number, (start, _) in ends.items()]
    wanted += [(str(number), end, _WRONG_INK) for number, (_, end) in ends.items() if ended[number] in _WRONG]
    draw_labels(axes, view, width, wanted, _crowd(run, view), size)


def _crowd(run: RunRecord, view: View) -> Floats:
    """Points [m] that labels had better not cover: the agents' tracks."""
    rows = np.flatnonzero(run.states.is_agent & run.states.valid.any(axis=1)).tolist()
    tracks = [view.picture_from_world(track(run, row)) for row in rows]
    return np.concatenate([np.empty((0, 2)), *(points[:: max(1, len(points) // 60)] for points in tracks)])


def _draw_scale(axes: Axes, run: RunRecord, view: View, width: float) -> None:
    """A scale bar and, in a turned picture, the world's axes, in the emptiest corners."""
    metre = view.width / (width / MM)  # metres per millimetre of paper
    corners = _free_corners(run, view)
    nice = np.array([1, 2, 5, 10, 20, 50, 100, 200, 500, 1000])
    length = float(nice[np.argmin(np.abs(np.log(nice / (0.12 * view.width))))])
    inside = corners[0] - np.sign(corners[0] - view.center) * 5.0 * metre
    x, y = inside[0] - (length if corners[0][0] > view.center[0] else 0.0), inside[1] - metre
    draw_bar(axes, (x, y), length, 0.7 * metre)
    style: dict[str, Any] = {"fontsize": _FONT, "color": INK, "ha": "center", "path_effects": HALO, "zorder": 8}
    axes.text(x + 0.5 * length, y + metre, f"{length:g} m", va="bottom", **style)
    if view.angle:
        origin = corners[1] - np.sign(corners[1] - view.center) * 8.0 * metre
        for name, way in (("x", np.array([1.0, 0.0])), ("y", np.array([0.0, 1.0]))):
            along = view.picture_from_world(way) * metre
            arrow = {"arrowstyle": "-|>", "lw": 0.7, "color": INK, "mutation_scale": 5, "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", tuple(origin + 4.5 * along), tuple(origin), arrowprops=arrow, zorder=8)
            label = origin + 6.0 * along
            axes.text(label[0], label[1], name, va="center", **style)


def _free_corners(run: RunRecord, view: View) -> list[Floats]:
    """Corners of the view [m], those with the fewest tracks around them first."""
    crowd, reach = _crowd(run, view), np.array([0.25 * view.width, 0.4 * view.height])
    corners = [np.array([x, y]) for y in view.y_limits for x in view.x_limits]
    return sorted(corners, key=lambda corner: int((np.abs(crowd - corner) < reach).all(axis=1).sum()))


def _legend_handles(run: RunRecord, others: str | None) -> list[Any]:
    handles: list[Any] = list(mark_handles(run.outcomes.outcome, count=True))
    if run.agents:
        handles.append(Line2D([], [], ls="", marker="o", ms=2.6, mfc="white", mec=INK, mew=0.6, label="start"))
    if any(agent.goal_areas for agent in run.agents):
        handles.append(Patch(fc=_GOAL_FILL, ec=GOAL, lw=0.4, ls=_GOAL_DASHES, label="goal area"))
    named = others_named(run, others)
    return handles + [Patch(fc=color, ec=RECORDED_EDGE, lw=0.3, label=name) for name, color in named]


def _draw_color_bar(figure: Figure, times: Normalize, bottom: float) -> None:
    """A bar of times at a distance above the lower edge of the figure [in]."""
    width, total = figure.get_size_inches()
    place = 1.0 - 47.0 * MM / width, bottom / total, 44.0 * MM / width, 1.8 * MM / total
    bar = figure.add_axes(place)
    bar.imshow(
        np.linspace(0.0, 1.0, 256)[None],
        aspect="auto",
        cmap=_TIME_COLORS,
        extent=(times.vmin or 0.0, times.vmax or 1.0, 0.0, 1.0),
    )
    bar.set(yticks=[])
    bar.tick_params(labelsize=_FONT - 1, length=2, width=0.5, pad=1)
    bar.text(-0.03, 0.5, "time [s]", fontsize=_FONT, ha="right", va="center", transform=bar.transAxes)
    for side in bar.spines.values():
        side.set_linewidth(0.5)
