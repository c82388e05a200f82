"""Example scenes: what every predictor expects at the same moment, and what happened."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from interdrive.config.specs import bound_predictor
from interdrive.files import read_scenario
from interdrive.plots.road import map_axes
from interdrive.plots.style import (
    FONT,
    INK,
    MM,
    PAGE,
    PREDICTION,
    RECORDED,
    RECORDED_EDGE,
    THRESHOLD,
    add_legend,
    empty_figure,
)
from interdrive.plots.vehicles import outlines, placed
from interdrive.plots.view import View, view_around
from interdrive.prediction_evaluation.measures import HORIZONS, Predicted, step_of
from interdrive.prediction_evaluation.recordings import Recording
from interdrive.prediction_evaluation.samples import answered

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from interdrive.array_types import Floats
    from interdrive.prediction_evaluation.recordings import Moment
    from interdrive.prediction_evaluation.samples import Samples
    from interdrive.prediction_evaluation.tables import PredictionEvaluation

_GAP, _PAD, _TITLE, _STRIP = 2.5 * MM, 0.5 * MM, 5.0 * MM, 6.0 * MM
_OTHERS = "#d2d2d2"
#: Opacity of the least probable mode.
_FAINTEST = 0.15
#: Mass of the ellipses.
_MASS = 0.9
#: Between these distances from a straight drive [m] a vehicle is worth looking at: it turns, brakes or starts.
_DEPARTURE = (2.0, 20.0)
#: Such vehicles within this distance of the one in their middle are in the picture [m].
_NEAR = 35.0
#: Ratio of width to height of the view above which panels stand above each other.
_LYING = 2.2


@dataclass(frozen=True)
class ExampleScene:
    """A moment, and what the predictors say about it.

    Attributes:
        category: Of the file.
        recording: Where it happened.
        moment: When.
        predicted: By name of the predictor, for the judged vehicles of the moment.
        row: Places in the moment's rows of the vehicles that the picture is about, which turn, brake or start.
    """

    category: str
    recording: Recording
    moment: Moment
    predicted: Mapping[str, Predicted]
    row: list[int]


def example_scenes(found: PredictionEvaluation) -> Iterator[ExampleScene]:
    """One per category: the moment at which most vehicles turn, brake or start; the first of several."""
    samples = found.samples
    for category in dict.fromkeys(samples.category.tolist()):
        chosen = _chosen(samples, samples.category == category)
        if chosen is None:
            continue
        file, time_step = chosen
        recording = Recording(read_scenario(found.files[file], raw=found.simulation.recording.raw), found.simulation)
        moment = recording.at(time_step)
        predicted = {}
        for choice in found.choices:
            predictor = bound_predictor(choice, found.simulation.predictor, recording.core_scenario)
            predicted[choice.label] = answered(predictor, recording, moment)
        there = (samples.file == file) & (samples.time_step == time_step) & _is_telling(samples)
        wanted = set(samples.participant_id[there].tolist())
        numbers = moment.scene.ids[moment.row].tolist()
        row = [i for i, number in enumerate(numbers) if number in wanted] or list(range(len(numbers)))
        yield ExampleScene(category, recording, moment, predicted, row)


def _is_telling(samples: Samples) -> np.ndarray:
    departure: np.ndarray = samples.departure
    with np.errstate(invalid="ignore"):
        return (departure > _DEPARTURE[0]) & (departure < _DEPARTURE[1])


def _chosen(samples: Samples, mask: np.ndarray) -> tuple[int, int] | None:
    """File and time step with the most telling samples; with any, if there is none."""
    telling = mask & _is_telling(samples)
    use = telling if telling.any() else mask & np.isfinite(samples.departure)
    if not use.any():
        return None
    moments, counts = np.unique(np.stack([samples.file[use], samples.time_step[use]]), axis=1, return_counts=True)
    file, time_step = moments[:, counts.argmax()]
    return int(file), int(time_step)


def scene_figure(scene: ExampleScene) -> Figure:
    """A figure, 180 mm wide, with a panel per predictor: the same scene, its predictions, and the true future."""
    view = _view(scene)
    stacked = view.width > _LYING * view.height
    view = view.shaped(*((0.08, 0.35) if stacked else (0.7, 1.4)))
    count = len(scene.predicted)
    columns = 1 if stacked else min(count, 2 if count == 4 else 3)
    rows = -(-count // columns)
    width = (PAGE - (columns - 1) * _GAP - 2.0 * _PAD) / columns
    height = width * view.height / view.width
    total = rows * (height + _TITLE) + _STRIP
    figure = empty_figure(PAGE, total)
    for index, (name, predicted) in enumerate(scene.predicted.items()):
        left = _PAD + (index % columns) * (width + _GAP)
        bottom = total - (index // columns + 1) * (height + _TITLE)
        place = left / PAGE, bottom / total, width / PAGE, height / total
        axes = map_axes(figure, place, scene.recording.scenario.lanelets, view)
        axes.set_title(name, fontsize=FONT, pad=2.5, loc="left")
        if index == 0:
            where = (
                f"{scene.recording.scenario.name}, {scene.moment.scene.time_step * scene.recording.scenario.dt:.1f} s"
            )
            axes.set_title(where, fontsize=FONT - 1.0, pad=2.5, loc="right", color=THRESHOLD)
        _draw_bodies(axes, scene, view)
        _draw_predicted(axes, scene, predicted, view)
        _draw_truth(axes, scene, view)
    _legend(figure)
    return figure


def _view(scene: ExampleScene) -> View:
    """Around the vehicles that the scene is about, now and in the next 3 s."""
    now, truth = _now(scene.moment), scene.moment.truth
    row = scene.row
    middle = now[row] - np.median(now[row], axis=0)
    center = now[row][np.hypot(*middle.T).argmin()]
    row = [i for i in row if np.hypot(*(now[i] - center)) <= _NEAR]
    ways = [np.concatenate([now[i : i + 1], truth[i][np.isfinite(truth[i, :, 0])]]) for i in row]
    points = np.concatenate(ways)
    return view_around(np.concatenate([points - 3.0, points + 3.0]), np.stack([way[-1] - way[0] for way in ways]))


def _now(moment: Moment) -> np.ndarray:
    scene = moment.scene
    return np.stack([scene.x[moment.row, -1], scene.y[moment.row, -1]], axis=1)


def _draw_bodies(axes: Axes, scene: ExampleScene, view: View) -> None:
    """Footprints of all present participants, pale where they are not evaluated."""
    now, obstacles = scene.moment.scene, scene.recording.scenario.obstacles
    shapes = dict(zip(obstacles.ids.tolist(), obstacles.shapes, strict=True))
    about = set(now.ids[scene.moment.row[scene.row]].tolist())
    lines, fills = [], []
    for i, number in enumerate(now.ids.tolist()):
        for line in outlines(shapes[number]):
            lines.append(view.picture_from_world(placed(line, now.x[i, -1], now.y[i, -1], now.orientation[i, -1])))
            fills.append(RECORDED if number in about else _OTHERS)
    axes.add_collection(
        PolyCollection(lines, facecolors=fills, edgecolors=RECORDED_EDGE, linewidths=0.4, zorder=3), autolim=False
    )


def _draw_predicted(axes: Axes, scene: ExampleScene, predicted: Predicted, view: View) -> None:
    """Every mode of the vehicles in question until 3 s; ellipses at whole seconds."""
    now, dt = _now(scene.moment), scene.recording.scenario.dt
    steps = [step_of(h, dt) for h in HORIZONS]
    asked = np.isin(np.arange(len(now)), scene.row)[:, None]
    rows, modes = np.nonzero(asked & (predicted.probability > 0))
    order = np.argsort(predicted.probability[rows, modes], kind="stable")
    for i, m in zip(rows[order].tolist(), modes[order].tolist(), strict=True):
        valid = predicted.valid[i, m, : steps[-1] + 1]
        alpha = float(strength(predicted.probability[i, m]))
        line = np.concatenate([now[i : i + 1], predicted.mean[i, m, : steps[-1] + 1][valid]])
        axes.add_collection(
            LineCollection(
                [view.picture_from_world(line)], colors=[to_rgba(PREDICTION, alpha)], linewidths=1.0, zorder=5
            ),
            autolim=False,
        )
        at = [step for step in steps if step < len(valid) and valid[step]]
        if not at:
            continue
        rings = view.picture_from_world(ellipse_rings(predicted.mean[i, m, at], predicted.covariance[i, m, at], _MASS))
        axes.add_collection(
            PolyCollection(
                list(rings),
                facecolors=[to_rgba(PREDICTION, 0.13 * alpha)],
                edgecolors=[to_rgba(PREDICTION, 0.8 * alpha)],
                linewidths=0.6,
                zorder=4,
            ),
            autolim=False,
        )


def ellipse_rings(means: Floats, covariance: Floats, mass: float) -> Floats:
    """Outlines [m] of the ellipses that hold a probability mass of normal distributions.

    Args:
        means: Shape (..., 2) [m].
        covariance: Shape (..., 2, 2) [m²].
        mass: Between 0 and 1.

    Returns:
        Shape (ellipses, 24, 2), in the order of the means, without means that are not numbers.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    means, covariance = means.reshape(-1, 2), covariance.reshape(-1, 2, 2)
    finite = np.isfinite(means).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2))
    values, vectors = np.linalg.eigh(covariance[finite])
    axes = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    rings: Floats = means[finite][:, None] + np.sqrt(-2.0 * np.log1p(-mass)) * (axes @ circle).transpose(0, 2, 1)
    return rings


def strength(probability: Floats) -> Floats:
    """How strongly a mode is drawn, between 0 and 1: by its probability, but never invisible."""
    strong: Floats = _FAINTEST + (1.0 - _FAINTEST) * np.clip(probability, 0.0, 1.0)
    return strong


def _draw_truth(axes: Axes, scene: ExampleScene, view: View) -> None:
    """Recorded ways until 3 s with dots at whole seconds."""
    now, truth = _now(scene.moment)[scene.row], scene.moment.truth[scene.row]
    ways = [np.concatenate([now[i : i + 1], truth[i][np.isfinite(truth[i, :, 0])]]) for i in range(len(now))]
    axes.add_collection(
        LineCollection([view.picture_from_world(way) for way in ways], colors=INK, linewidths=0.8, zorder=6),
        autolim=False,
    )
    dots = truth[:, [step_of(h, scene.recording.scenario.dt) for h in HORIZONS]].reshape(-1, 2)
    dots = view.picture_from_world(dots[np.isfinite(dots).all(axis=1)])
    axes.plot(*dots.T, "o", ms=2.2, mfc="white", mec=INK, mew=0.6, zorder=7)


def _legend(figure: Figure) -> None:
    handles = [
        Line2D([], [], color=INK, linewidth=0.9, marker="o", ms=2.6, mfc="white", label="what happened (1, 2, 3 s)"),
        Line2D([], [], color=PREDICTION, linewidth=1.2, label="predicted (faint: improbable)"),
        Patch(fc=_OTHERS, ec=RECORDED_EDGE, lw=0.4, label="others"),
        Patch(fc=to_rgba(PREDICTION, 0.13), ec=PREDICTION, lw=0.6, label=f"{100 * _MASS:.0f} % ellipses (1, 2, 3 s)"),
    ]
    add_legend(figure, handles, "lower center", ncols=len(handles), handlelength=1.8, columnspacing=1.6)
