"""Where two vehicles are at which time, several runs side by side: footprints with time stamps over the road."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.patches import Patch

from interdrive.plots.road import draw_scale, map_axes
from interdrive.plots.style import (
    FONT,
    HALO,
    INK,
    MM,
    PAGE,
    RECORDED_EDGE,
    TRAFFIC,
    add_legend,
    empty_figure,
    pair_colors,
)
from interdrive.plots.vehicles import Footprints
from interdrive.plots.view import View, view_around

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from interdrive.array_types import Bools, Floats
    from interdrive.run import RunRecord

_GAP, _PAD, _TITLE, _STRIP = 2.5 * MM, 0.5 * MM, 5.0 * MM, 6.0 * MM

#: What is left of a colour in footprints that are not those of the nearest moment.
_PALE = 0.22

#: An encounter is the time in which the two are so near to each other, centre to centre [m]. If they never are, time
#: before and after the nearest moment [s].
_NEAR, _AROUND = 20.0, 2.0

#: Ratio of width to height of the view above which panels stand above each other.
_LYING = 3.5

#: Lowest and highest height / width of a panel that has the figure for itself.
_ALONE = (0.25, 0.62)

#: Time between footprints [s]: the shortest one at which so few of them are in the view.
_EVERY, _FOOTPRINTS_MAX = (0.5, 1.0, 2.0, 3.0, 5.0, 10.0), 7


@dataclass(frozen=True)
class Scene:
    """One run to show.

    Attributes:
        run: What happened.
        title: Above the panel.
        nearest: Column of the run's states at which the two vehicles are nearest; none: never both there.
    """

    run: RunRecord
    title: str
    nearest: int | None


@dataclass(frozen=True)
class _Stamp:
    """A footprint to draw: participant, column of the states, and the text beside it."""

    place: int
    row: int
    column: int
    text: str
    strong: bool


def draw_scenes(
    scenes: Sequence[Scene], pair: tuple[int, int], names: tuple[str, str], *, filled: str = "when nearest"
) -> Figure:
    """A figure, 180 mm wide, with a panel per run; all panels show the same part of the world at the same times.

    Footprints are drawn every so many seconds; those of the moment when the two vehicles are nearest to each other are
    filled, and all others are drawn where they are at that moment.

    Args:
        scenes: The runs, of one scenario.
        pair: Ids of the two vehicles.
        names: What the legend calls them.
        filled: What the legend says about the moment whose footprints are filled.

    Returns:
        A matplotlib figure without pyplot; `save_figure` writes it.
    """
    view = _encounter(scenes, pair)
    stacked = view.width > _LYING * view.height
    view = view.shaped(*(_ALONE if len(scenes) == 1 else (0.05, 0.3) if stacked else (0.8, 1.6)))
    columns, rows = (1, len(scenes)) if stacked else (len(scenes), 1)
    width = (PAGE - (columns - 1) * _GAP - 2.0 * _PAD) / columns
    height = width * view.height / view.width
    total = rows * (height + _TITLE) + _STRIP
    figure = empty_figure(PAGE, total)
    every, colors = _every(scenes, pair, view), pair_colors([scene.run for scene in scenes], pair)
    for index, scene in enumerate(scenes):
        left = _PAD + (index % columns) * (width + _GAP)
        bottom = total - (index // columns + 1) * (height + _TITLE)
        place = left / PAGE, bottom / total, width / PAGE, height / total
        axes = map_axes(figure, place, scene.run.scenario.lanelets, view)
        axes.set_title(scene.title, fontsize=FONT, pad=2.5, loc="left")
        traffic = _traffic(scene, pair, view)
        axes.add_collection(
            PolyCollection(traffic, facecolors=TRAFFIC, edgecolors=RECORDED_EDGE, linewidths=0.4, zorder=3),
            autolim=False,
        )
        stamps = _stamps(scene, pair, every, view)
        _draw_pair(axes, scene, dict(zip(pair, colors, strict=True)), stamps, view)
        _draw_labels(axes, scene, stamps, colors, traffic, view, points_per_metre=72.0 * width / view.width)
        if index == 0:
            draw_scale(axes, view, view.width * MM / width, FONT)
    _legend(figure, scenes, dict(zip(names, colors, strict=True)), filled)
    return figure


def _track(run: RunRecord, number: int) -> Floats:
    """Positions [m], shape (time_steps, 2); nan while absent, and everywhere if the vehicle never takes part."""
    states = run.states
    for row in np.flatnonzero(states.participant_id == number):
        track: Floats = np.stack([states.x[row], states.y[row]], axis=1)
        return np.where(states.valid[row][:, None], track, np.nan)
    return np.full((states.n_steps, 2), np.nan)


def _encounter(scenes: Sequence[Scene], pair: tuple[int, int]) -> View:
    """Where the two are while they are near each other, in any of the runs."""
    points, motion = [], []
    for scene in scenes:
        tracks = [_track(scene.run, number) for number in pair]
        near = np.hypot(*(tracks[0] - tracks[1]).T) < _NEAR
        if not near.any() and scene.nearest is not None:
            reach = round(_AROUND / scene.run.scenario.dt)
            near[max(0, scene.nearest - reach) : scene.nearest + reach + 1] = True
            near &= np.isfinite(tracks[0] + tracks[1]).all(axis=1)
        if scene.nearest is not None:
            near[scene.nearest] = np.isfinite(tracks[0][scene.nearest] + tracks[1][scene.nearest]).all()
        for track in tracks:
            there = track[near] if near.any() else track[np.isfinite(track).all(axis=1)]
            points += [there - 2.3, there + 2.3]
            motion.append(there[-1:] - there[:1])
    return view_around(np.concatenate(points), np.concatenate(motion))


def _inside(view: View, points: Floats) -> Bools:
    x, y = np.abs(view.picture_from_world(points) - view.center).T
    inside: Bools = (x < 0.5 * view.width) & (y < 0.5 * view.height)
    return inside


def _every(scenes: Sequence[Scene], pair: tuple[int, int], view: View) -> float:
    """Time between footprints [s], the same for all panels."""
    counts = [
        _inside(view, _track(scene.run, number)).sum() * scene.run.scenario.dt for scene in scenes for number in pair
    ]
    return next((every for every in _EVERY if max(counts) / every <= _FOOTPRINTS_MAX), _EVERY[-1])


def _stamps(scene: Scene, pair: tuple[int, int], every: float, view: View) -> list[_Stamp]:
    """Footprints of both vehicles; of footprints that would cover each other only the most telling one is kept."""
    states, dt = scene.run.states, scene.run.scenario.dt
    stamps: list[_Stamp] = []
    for place, number in enumerate(pair):
        track = _track(scene.run, number)
        row = int(np.searchsorted(states.participant_id, number))
        stands: list[list[int]] = []  # columns at which the vehicle is in one place
        for column in np.flatnonzero(_inside(view, track)).tolist():
            time = (states.first_time_step + column) * dt
            if abs(time / every - round(time / every)) > 0.01 and column != scene.nearest:
                continue
            if stands and np.hypot(*(track[column] - track[stands[-1][0]])) < 0.25 * states.length[row]:
                stands[-1].append(column)
            else:
                stands.append([column])
        kept: list[int] = []
        for stand in sorted(stands, key=lambda stand: (scene.nearest not in stand, -len(stand), stand[0])):
            strong = scene.nearest in stand
            column = scene.nearest if scene.nearest in stand else stand[0]
            if any(np.hypot(*(track[column] - track[other])) < 1.1 * states.length[row] for other in kept):
                continue
            kept.append(column)
            first, last, only = ((states.first_time_step + at) * dt for at in (stand[0], stand[-1], column))
            text = f"{first:.5g}–{last:.5g} s" if last - first > 0.99 * every else f"{only:.5g} s"
            stamps.append(_Stamp(place, row, column, text, strong))
    return stamps


def _footprint(scene: Scene, row: int, column: int, view: View) -> list[Floats]:
    return Footprints(scene.run).outlines(row, column, view)


def _traffic(scene: Scene, pair: tuple[int, int], view: View) -> list[Floats]:
    """Outlines of all others at the moment when the two are nearest."""
    if scene.nearest is None:
        return []
    states = scene.run.states
    rows = np.flatnonzero(states.valid[:, scene.nearest] & ~np.isin(states.participant_id, pair)).tolist()
    return [line for row in rows for line in _footprint(scene, row, scene.nearest, view)]


def _draw_pair(axes: Axes, scene: Scene, colors: Mapping[int, str], stamps: Sequence[_Stamp], view: View) -> None:
    for number, color in colors.items():
        track = view.picture_from_world(_track(scene.run, number))
        axes.add_collection(LineCollection([track], colors=color, linewidths=0.9, alpha=0.8, zorder=4), autolim=False)
    for stamp in stamps:
        color = list(colors.values())[stamp.place]
        axes.add_collection(
            PolyCollection(
                _footprint(scene, stamp.row, stamp.column, view),
                facecolors=[color if stamp.strong else to_rgba(color, _PALE)],
                edgecolors=[INK if stamp.strong else color],
                linewidths=0.7 if stamp.strong else 0.5,
                zorder=6 if stamp.strong else 5,
            ),
            autolim=False,
        )


def _draw_labels(
    axes: Axes,
    scene: Scene,
    stamps: Sequence[_Stamp],
    colors: Sequence[str],
    traffic: Sequence[Floats],
    view: View,
    points_per_metre: float,
) -> None:
    """Puts every time beside its footprint, where it covers the least."""
    states = scene.run.states
    bodies = [np.concatenate(_footprint(scene, s.row, s.column, view)) * points_per_metre for s in stamps]
    every = [*bodies, *(outline * points_per_metre for outline in traffic)]
    taken = [np.concatenate([body.min(axis=0), body.max(axis=0)]) for body in every]
    window = np.array([view.x_limits[0], view.y_limits[0], view.x_limits[1], view.y_limits[1]]) * points_per_metre
    boxes: list[Floats] = []
    for index in sorted(range(len(stamps)), key=lambda i: (not stamps[i].strong, i)):
        stamp, body = stamps[index], bodies[index]
        center = 0.5 * (taken[index][:2] + taken[index][2:])
        heading = states.orientation[stamp.row, stamp.column] - view.angle
        half = 0.5 * np.array([0.56 * FONT * len(stamp.text) + 1.0, 1.05 * FONT])
        best, best_cost = np.zeros(4), np.inf
        for turn in np.radians([90, -90, 60, -60, 120, -120, 30, -30, 150, -150, 0, 180]):
            # The agent's times stand to its left, the other's to its right, where there is room.
            way = np.array([np.cos(heading + turn), np.sin(heading + turn)])
            reach = float(np.max((body - center) @ way)) + float(np.abs(way) @ half) + 1.2
            for further in (0.0, 5.0, 10.0):
                middle = center + (reach + further) * way
                box = np.concatenate([middle - half, middle + half])
                side = 0.5 - stamp.place
                cost = 0.25 * further + 0.6 * abs(np.cos(turn)) + 0.3 * (np.sin(turn) * side < 0.0)
                cost += sum(8.0 * _overlap(box, other) for other in boxes)
                cost += sum(3.0 * _overlap(box, other) for other in taken)
                # A reader takes the nearest footprint for the labelled one.
                cost += 1.0 * (
                    _distance(box, taken[index]) > min(_distance(box, other) for other in taken[: len(bodies)])
                )
                cost += 50.0 * bool((box[:2] < window[:2] + 1.0).any() or (box[2:] > window[2:] - 1.0).any())
                if cost < best_cost - 1e-9:
                    best, best_cost = box, cost
        boxes.append(best)
        x, y = 0.5 * (best[:2] + best[2:]) / points_per_metre
        axes.text(
            x,
            y,
            stamp.text,
            fontsize=FONT,
            color=colors[stamp.place],
            fontweight="bold" if stamp.strong else "normal",
            ha="center",
            va="center",
            path_effects=HALO,
            zorder=8,
            clip_on=True,
        )


def _distance(box: Floats, other: Floats) -> float:
    """Between the edges of two boxes; 0 where they overlap."""
    return float(np.hypot(*np.maximum(np.maximum(box[:2] - other[2:], other[:2] - box[2:]), 0.0)))


def _overlap(box: Floats, other: Floats) -> float:
    """Part of the first box that the second one covers, and a bit more for touching at all."""
    sides = np.minimum(box[2:], other[2:]) - np.maximum(box[:2], other[:2])
    if (sides <= 0.0).any():
        return 0.0
    return 0.2 + float(sides.prod() / (box[2:] - box[:2]).prod())


def _legend(figure: Figure, scenes: Sequence[Scene], names: Mapping[str, str], filled: str) -> None:
    handles = [Patch(fc=to_rgba(color, _PALE), ec=color, lw=0.7, label=name) for name, color in names.items()]
    if any(scene.nearest is not None for scene in scenes):
        handles.append(Patch(fc="#555555", ec=INK, lw=0.7, label=f"filled: {filled}"))
        handles.append(Patch(fc=TRAFFIC, ec=RECORDED_EDGE, lw=0.4, label="recorded traffic at that time"))
    add_legend(
        figure, handles, "lower center", ncols=len(handles), handlelength=1.8, handleheight=0.8, columnspacing=1.6
    )
