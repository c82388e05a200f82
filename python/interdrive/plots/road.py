"""The road as a quiet background: surfaces, edges, lane markings and arrows, all from the lanelets' bounds."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D
from matplotlib.path import Path

from interdrive.plots.style import HALO, INK, RECORDED

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from interdrive.array_types import Bools, Floats
    from interdrive.plots.view import View
    from interdrive.scenario import Lanelets

SURFACE = "#e7e7e7"
EDGE = "#8f8f8f"
MARKING = "#ffffff"
ARROW = "#c9c9c9"

#: Bounds are judged in pieces of this length [m], by looking this far and this little to the side [m].
_PIECE, _SIDE, _NEAR = 2.0, 0.3, 0.05

#: Length of an arrow, and distance between arrows [m].
_ARROW_LENGTH, _ARROW_EVERY = 1.6, 25.0


@dataclass(frozen=True)
class _Lane:
    """One lanelet in the picture frame."""

    left: Floats
    right: Floats
    area: Path
    low: Floats
    high: Floats

    def contains(self, points: Floats) -> Bools:
        """Whether each point lies inside, shape (points,)."""
        inside: Bools = np.all((points >= self.low) & (points <= self.high), axis=1)
        if inside.any():
            inside[inside] = self.area.contains_points(points[inside])
        return inside


@dataclass(frozen=True)
class RoadLines:
    """What a road is drawn with, in the picture frame [m]; every line and outline of shape (points, 2).

    Attributes:
        surfaces: Outlines of the lanelets.
        arrows: Chevrons in driving direction.
        dashed: Markings between lanes of the same direction.
        solid: Markings between lanes of opposite directions.
        edges: Borders of the road.
    """

    surfaces: list[Floats]
    arrows: list[Floats]
    dashed: list[Floats]
    solid: list[Floats]
    edges: list[Floats]


def road_lines(lanelets: Lanelets, view: View) -> RoadLines:
    """Surfaces and lines of the lanelets that touch the view."""
    lanes = list(_lanes(lanelets, view))
    edges, dashed, solid = [], [], []
    for index, lane in enumerate(lanes):
        others = lanes[:index] + lanes[index + 1 :]
        for bound, side in ((lane.left, 1.0), (lane.right, -1.0)):
            for kind, line in _judged(bound, side, others):
                # A marking belongs to two lanelets; the one on its right draws it.
                if kind == "edge":
                    edges.append(line)
                elif side > 0 and kind == "same direction":
                    dashed.append(line)
                elif side > 0:
                    solid.append(line)
    surfaces = [np.concatenate([lane.left, lane.right[::-1]]) for lane in lanes]
    return RoadLines(surfaces, list(_arrows(lanes)), dashed, solid, edges)


def road_artists(lanelets: Lanelets, view: View, linewidth: float = 0.6) -> list[Any]:
    """Collections, in drawing order, for the lanelets that touch the view.

    Args:
        lanelets: The roads.
        view: The part that will be seen.
        linewidth: Of the road's edge [pt]; everything else follows from it.

    Returns:
        Matplotlib collections in picture coordinates.
    """
    road = road_lines(lanelets, view)
    return [
        # The outline in the same colour closes hairline gaps between neighbours.
        PolyCollection(road.surfaces, facecolors=SURFACE, edgecolors=SURFACE, linewidths=0.4, zorder=0),
        LineCollection(road.arrows, colors=ARROW, linewidths=linewidth, capstyle="round", zorder=1),
        LineCollection(road.dashed, colors=MARKING, linewidths=1.2 * linewidth, linestyles=[(0, (5, 5))], zorder=1),
        LineCollection(road.solid, colors=MARKING, linewidths=1.8 * linewidth, zorder=1),
        LineCollection(road.edges, colors=EDGE, linewidths=linewidth, capstyle="round", zorder=1),
    ]


def _lanes(lanelets: Lanelets, view: View) -> Iterator[_Lane]:
    for raw_left, raw_right in zip(lanelets.left, lanelets.right, strict=True):
        left, right = view.picture_from_world(raw_left), view.picture_from_world(raw_right)
        outline = np.concatenate([left, right[::-1]])
        if view.touches(outline):
            yield _Lane(left, right, Path(outline), outline.min(axis=0), outline.max(axis=0))


def _judged(bound: Floats, side: float, others: list[_Lane]) -> Iterator[tuple[str, Floats]]:
    """Stretches of a bound with what they are: road edge, or marking between lanes of the same or opposite direction.

    Stretches inside a lanelet that also covers the own side (crossing lanes of a junction), and edges just inside the
    edge of another lanelet, are nothing at all.
    """
    points = _pieces(bound)
    direction = np.diff(points, axis=0)
    length = np.hypot(*direction.T)
    points, direction = points[np.append(length > 1e-9, True)], direction[length > 1e-9] / length[length > 1e-9, None]
    if not len(direction):
        return
    middle = 0.5 * (points[1:] + points[:-1])
    outward = side * np.stack([-direction[:, 1], direction[:, 0]], axis=1)
    kind = np.zeros(len(middle), dtype=np.int64)  # 0 edge, 1 same direction, 2 opposite, 3 nothing
    for other in others:
        if (other.low > middle.max(axis=0) + 1.0).any() or (other.high < middle.min(axis=0) - 1.0).any():
            continue
        near, far = (other.contains(middle + reach * outward) for reach in (_NEAR, _SIDE))
        if near.any() or far.any():
            hidden = (near & ~far) | (far & other.contains(middle - _SIDE * outward))
            along = _along(other, middle, direction)
            kind = np.where(hidden, 3, np.where(far, np.maximum(kind, np.where(along, 1, 2)), kind))
    starts = np.concatenate([[0], np.flatnonzero(np.diff(kind)) + 1, [len(kind)]])
    for first, last in pairwise(starts.tolist()):
        if kind[first] != 3:
            yield ("edge", "same direction", "opposite direction")[kind[first]], points[first : last + 1]


def _along(lane: _Lane, points: Floats, direction: Floats) -> Bools:
    """Whether the lanelet runs in the given direction near each point."""
    nearest = np.argmin(np.hypot(*(lane.left[:-1, None] - points[None]).transpose(2, 0, 1)), axis=0)
    along: Bools = ((lane.left[nearest + 1] - lane.left[nearest]) * direction).sum(axis=1) > 0.0
    return along


def _pieces(line: Floats, spacing: float = _PIECE) -> Floats:
    """The line with additional vertices, so that no segment is longer than the spacing [m]."""
    parts = [
        np.linspace(a, b, max(1, int(np.ceil(np.hypot(*(b - a)) / spacing))), endpoint=False) for a, b in pairwise(line)
    ]
    return np.concatenate([*parts, line[-1:]])


def _arrows(lanes: list[_Lane]) -> Iterator[Floats]:
    """Chevrons along the middle of every lane, where no other lane lies."""
    for index, lane in enumerate(lanes):
        n = min(len(lane.left), len(lane.right))
        line = 0.5 * (lane.left[:n] + lane.right[:n])
        s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
        if s[-1] < 0.5 * _ARROW_EVERY:
            continue
        count = max(1, round(s[-1] / _ARROW_EVERY))
        at = (np.arange(count) + 0.5) * s[-1] / count
        tips = np.stack([np.interp(at, s, line[:, axis]) for axis in (0, 1)], axis=1)
        before = np.stack([np.interp(at - 1.0, s, line[:, axis]) for axis in (0, 1)], axis=1)
        hidden = np.zeros(count, dtype=bool)
        for other in lanes[:index] + lanes[index + 1 :]:
            hidden |= other.contains(tips)
        for tip, tail in zip(tips[~hidden], before[~hidden], strict=True):
            forward = (tip - tail) / max(float(np.hypot(*(tip - tail))), 1e-9)
            left = np.array([-forward[1], forward[0]])
            back = tip - 0.6 * _ARROW_LENGTH * forward
            yield np.stack([back + 0.5 * _ARROW_LENGTH * left, tip, back - 0.5 * _ARROW_LENGTH * left])


def map_axes(figure: Figure, place: tuple[float, float, float, float], lanelets: Lanelets, view: View) -> Axes:
    """Framed axes in picture coordinates that show the road.

    Args:
        figure: Where to draw.
        place: Left, bottom, width and height as parts of the figure.
        lanelets: The roads.
        view: What is shown.
    """
    axes = figure.add_axes(place)
    axes.set(xlim=view.x_limits, ylim=view.y_limits, xticks=[], yticks=[])
    for side in axes.spines.values():
        side.set(color=RECORDED, linewidth=0.5)
    for artist in road_artists(lanelets, view):
        axes.add_collection(artist, autolim=False)
    return axes


def draw_scale(axes: Axes, view: View, metres_per_mm: float, font: float) -> None:
    """A scale bar in the lower left corner."""
    length = next(nice for nice in (100.0, 50.0, 20.0, 10.0, 5.0, 2.0) if nice <= 0.24 * view.width or nice == 2.0)
    corner = view.x_limits[0] + 2.0 * metres_per_mm, view.y_limits[0] + 2.0 * metres_per_mm
    draw_bar(axes, corner, length, 0.7 * metres_per_mm)
    style: dict[str, Any] = {"fontsize": font - 0.5, "color": INK, "va": "center", "path_effects": HALO, "zorder": 9}
    axes.text(corner[0] + length + metres_per_mm, corner[1], f"{length:g} m", **style)


def draw_bar(axes: Axes, start: tuple[float, float], length: float, tick: float) -> None:
    """A line of that length [m] to the right, with ticks at its ends."""
    x, y = start
    bar = Line2D([x, x, x, x + length, x + length, x + length], [y - tick, y + tick, y, y, y - tick, y + tick])
    bar.set(color=INK, linewidth=0.9, zorder=9, path_effects=HALO)
    axes.add_line(bar)
