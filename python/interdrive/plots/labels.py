"""Where ids stand in a picture: beside what they name, where the fewest things are, and not on each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.plots.style import HALO

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from interdrive.array_types import Floats
    from interdrive.plots.view import View

#: Distances [points] and directions [degrees] that are tried, the preferred ones first.
_REACHES, _DIRECTIONS = (4.0, 8.0, 13.0, 20.0), (90, 270, 180, 0, 135, 45, 225, 315)
#: A label further away than this is joined to what it names by a line [points].
_LOOSE = 12.0
#: Costs: per point of distance, per other label that is covered, and of leaving the picture.
_FAR, _COVERED, _OUTSIDE = 0.3, 40.0, 100.0


def draw_labels(
    axes: Axes, view: View, width: float, wanted: Sequence[tuple[str, Floats, str]], crowd: Floats, size: float
) -> None:
    """Writes short texts beside their places.

    Args:
        axes: Of a map.
        view: What the map shows.
        width: Of the map on paper [in].
        wanted: Text, place in the picture [m], shape (2,), and colour of each label.
        crowd: Points that labels had better not cover, in the picture [m], shape (points, 2).
        size: Of the letters [points].
    """
    scale = 72.0 * width / view.width  # points per metre
    crowd = crowd * scale
    window = np.array([view.x_limits[0], view.y_limits[0], view.x_limits[1], view.y_limits[1]]) * scale
    boxes: list[Floats] = []
    for text, anchor, color in wanted:
        half = 0.5 * np.array([0.62 * size * len(text) + 1.0, size])
        best, best_cost = np.zeros(4), np.inf
        for reach in _REACHES:
            for angle in np.radians(_DIRECTIONS):
                way = np.array([np.cos(angle), np.sin(angle)])
                center = anchor * scale + way * (reach + half * (0.6 + 0.4 * np.abs(way)))
                box = np.concatenate([center - half, center + half])
                cost = _FAR * reach + ((crowd >= box[:2]) & (crowd <= box[2:])).all(axis=1).sum()
                cost += sum(_COVERED for other in boxes if (box[:2] < other[2:]).all() and (other[:2] < box[2:]).all())
                cost += _OUTSIDE * bool((box[:2] < window[:2]).any() or (box[2:] > window[2:]).any())
                if cost < best_cost:
                    best, best_cost = box, cost
        boxes.append(best)
        place = 0.5 * (best[:2] + best[2:]) / scale
        if np.hypot(*(place - anchor)) * scale > _LOOSE:
            axes.plot(*np.stack([anchor, place]).T, "-", color=color, lw=0.3, zorder=6.5)
        style: dict[str, Any] = {"fontsize": size, "color": color, "ha": "center", "va": "center", "path_effects": HALO}
        axes.text(place[0], place[1], text, zorder=7, clip_on=True, **style)
