"""A map with the ids of its lanelets, to choose lanes by."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from interdrive.errors import InputError
from interdrive.plots.road import map_axes
from interdrive.plots.style import INK
from interdrive.plots.view import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from interdrive.array_types import Floats
    from interdrive.scenario import Scenario

#: Space around a whole map [m], and around its picture [inch].
_MARGIN, _BORDER = 5.0, 0.45
#: The longer side of the picture [inch].
_SIDE = 12.0
#: Where on its lane an id may stand, best first, and how far from others it should [pt].
_PLACES, _ROOM = (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9), 14.0
#: Points of a lane that may lie in the box.
_FINE = 101
#: Of planning problems.
_BLUE = "#0b5c8e"
#: Sizes of ids [pt], and the least length of a lane on paper that has one [pt].
_FONT, _LEAST = (4.0, 9.0), 6.0


def draw_map(scenario: Scenario, box: tuple[float, float, float, float] | None = None) -> tuple[Figure, int]:
    """The lanelets with their ids, planning problems with theirs, and coordinates at the sides; x points to the right.

    Args:
        scenario: What to draw.
        box: Smallest x and y, largest x and y of the part to show [m]; None: the whole map.

    Returns:
        The figure, and the number of lanelets in it that are too short for their id.

    Raises:
        InputError: No lanelet lies in the box.
    """
    lanelets = scenario.lanelets
    bounds = [np.concatenate([left, right]) for left, right in zip(lanelets.left, lanelets.right, strict=True)]
    if box is None:
        every = np.concatenate(bounds)
        low, high = every.min(axis=0) - _MARGIN, every.max(axis=0) + _MARGIN
    else:
        low, high = np.array(box[:2]), np.array(box[2:])
    center, (width, height) = 0.5 * (low + high), high - low
    view = View(0.0, (float(center[0]), float(center[1])), float(width), float(height))
    shown = [row for row, points in enumerate(bounds) if view.touches(points)]
    if not shown:
        every = np.concatenate(bounds)
        (x0, y0), (x1, y1) = every.min(axis=0).tolist(), every.max(axis=0).tolist()
        raise InputError(f"no lanelet lies in the box; the map is in {x0:.0f},{y0:.0f},{x1:.0f},{y1:.0f}")
    view = view.shaped(0.3, 3.0)
    scale = (_SIDE - 2.0 * _BORDER) / max(view.width, view.height)
    size = (view.width * scale + 2.0 * _BORDER, view.height * scale + 2.0 * _BORDER)
    figure = Figure(figsize=size, facecolor="white")
    place = (_BORDER / size[0], _BORDER / size[1], 1.0 - 2.0 * _BORDER / size[0], 1.0 - 2.0 * _BORDER / size[1])
    axes = map_axes(figure, place, lanelets, view)
    axes.xaxis.set_major_locator(MaxNLocator(8))
    axes.yaxis.set_major_locator(MaxNLocator(8))
    axes.tick_params(labelsize=7, colors=INK, length=2)
    too_short = _write_ids(axes, scenario, shown, (low, high), 72.0 * scale)
    for problem in scenario.planning_problems:
        start = problem.initial_state
        if low[0] <= start.x <= high[0] and low[1] <= start.y <= high[1]:
            axes.plot(start.x, start.y, marker=(3, 0, np.degrees(start.orientation) - 90.0), color=_BLUE, ms=7)
            axes.annotate(
                f"problem {problem.id}", (start.x, start.y), (5, 5), textcoords="offset points", fontsize=7, color=_BLUE
            )
    return figure, too_short


def _write_ids(axes: Axes, scenario: Scenario, shown: list[int], box: tuple[Floats, Floats], points: float) -> int:
    """Writes ids on their lanes, away from each other; returns how many lanes are too short for that.

    Args:
        axes: Of the map.
        scenario: With the lanelets.
        shown: Rows of the lanelets in the box.
        box: Its lowest and highest corner [m].
        points: Per metre on paper.
    """
    lanelets, too_short = scenario.lanelets, 0
    taken: list[Floats] = []
    for row in shown:
        middle = 0.5 * (lanelets.left[row] + lanelets.right[row])
        at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(middle, axis=0).T))])
        if at[-1] * points < _LEAST:
            too_short += 1
            continue
        along = np.linspace(0.0, at[-1], _FINE)
        places = np.stack([np.interp(along, at, middle[:, axis]) for axis in (0, 1)], axis=1)
        places = places[np.all((places >= box[0]) & (places <= box[1]), axis=1)]
        if not len(places):
            continue
        places = places[np.round(np.array(_PLACES) * (len(places) - 1)).astype(np.int64)]
        free = [min((float(np.hypot(*(place - other))) for other in taken), default=np.inf) for place in places]
        chosen = next((k for k, room in enumerate(free) if room * points > _ROOM), int(np.argmax(free)))
        taken.append(places[chosen])
        broad = float(np.median(np.hypot(*(lanelets.left[row] - lanelets.right[row]).T))) * points
        x, y = places[chosen].tolist()
        name = str(int(lanelets.ids[row]))
        text = axes.text(x, y, name, fontsize=float(np.clip(0.7 * broad, *_FONT)), color=INK, clip_on=True)
        text.set(ha="center", va="center")
    return too_short
