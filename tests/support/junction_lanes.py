"""Lanes of junctions that are laid out by their centre lines."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.scenario import Lanelets

if TYPE_CHECKING:
    from collections.abc import Mapping


def straight(start: tuple[float, float], end: tuple[float, float]) -> np.ndarray:
    """A straight centre line [m]."""
    return np.linspace(start, end, 41)


def left_turn(radius: float, start: tuple[float, float], heading: float = 0.0) -> np.ndarray:
    """The centre line of a left turn by 90° from a point on, with a heading there [rad]."""
    turned = heading + np.linspace(0.0, 0.5 * np.pi, 25)
    along = np.column_stack([np.sin(turned), -np.cos(turned)]) - np.array([np.sin(heading), -np.cos(heading)])
    return np.array(start) + radius * along


def network(
    centers: Mapping[int, np.ndarray],
    successors: Mapping[int, tuple[int, ...]],
    left_of: Mapping[int, int] | None = None,
    *,
    width: float = 3.5,
    speed_limit: float = np.nan,
) -> Lanelets:
    """Lanelets of one width by ids; `left_of` has the left neighbour of the same direction of those that have one."""
    ids = sorted(centers)
    left = dict(left_of or {})
    right = {other: number for number, other in left.items()}
    bounds = []
    for number in ids:
        along = np.gradient(centers[number], axis=0)
        aside = 0.5 * width * np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
        bounds.append((centers[number] + aside, centers[number] - aside))
    return Lanelets(
        np.array(ids),
        tuple(one for one, _ in bounds),
        tuple(other for _, other in bounds),
        tuple(tuple(before for before in ids if number in successors.get(before, ())) for number in ids),
        tuple(successors.get(number, ()) for number in ids),
        np.array([left.get(number, -1) for number in ids]),
        np.array([number in left for number in ids]),
        np.array([right.get(number, -1) for number in ids]),
        np.array([number in right for number in ids]),
        np.full(len(ids), speed_limit),
        ((),) * len(ids),
    )
