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


def right_turn(radius: float, start: tuple[float, float]) -> np.ndarray:
    """The centre line of a right turn by 90° that begins at a point with heading 0 [m]."""
    turned = np.linspace(0.0, 0.5 * np.pi, 25)
    return np.array(start) + radius * np.column_stack([np.sin(turned), np.cos(turned) - 1.0])


def quarters(points: np.ndarray | tuple[float, float], turns: int) -> np.ndarray:
    """Points turned around the origin by a multiple of 90°."""
    cos, sin = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][turns % 4]
    return np.asarray(points) @ np.array([[cos, sin], [-sin, cos]])


def cross_with_turns(half: float = 12.0, arm: float = 90.0) -> Lanelets:
    """Four arms of one lane per direction, 1.75 m beside the middle; from each one leads straight on, left and right.

    Who drives in direction k (0 east, 1 north, ...) comes on lanelet n = 10 k + 10, from where n + 1 leads straight on,
    n + 2 left and n + 3 right; n + 4 leads away in this direction. The junction reaches so far from the origin
    (`half`), the arms to `arm` [m]. The limit is 10 m/s.
    """
    centers, after = {}, {}
    for k in range(4):
        first, start = 10 * k + 10, (-half, -1.75)
        ways = {
            first: straight((-arm, -1.75), start),
            first + 1: straight(start, (half, -1.75)),
            first + 2: left_turn(half + 1.75, start),
            first + 3: right_turn(half - 1.75, start),
            first + 4: straight((half, -1.75), (arm, -1.75)),
        }
        centers |= {number: quarters(points, k) for number, points in ways.items()}
        after[first] = (first + 1, first + 2, first + 3)
        for way, turns in ((1, 0), (2, 1), (3, 3)):
            after[first + way] = (10 * ((k + turns) % 4) + 14,)
    return network(centers, after, speed_limit=10.0)


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
