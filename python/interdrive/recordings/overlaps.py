"""Participants that are in each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from interdrive.scenario.native import core_shape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive._core import RoadNetwork
    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.scenario import Obstacles, Shape

#: Time between the moments that are looked at [s].
_SPACING = 1.0
_VEHICLES = frozenset(("car", "truck", "bus", "motorcycle", "taxi", "priority_vehicle"))


class Placed(Protocol):
    """Participants over time: ids and footprints, and tables of shape (participants, time_steps)."""

    @property
    def ids(self) -> Ints: ...  # noqa: D102
    @property
    def shapes(self) -> Sequence[Shape]: ...  # noqa: D102
    @property
    def x(self) -> Floats: ...  # noqa: D102
    @property
    def y(self) -> Floats: ...  # noqa: D102
    @property
    def orientation(self) -> Floats: ...  # noqa: D102
    @property
    def valid(self) -> Bools: ...  # noqa: D102


def overlapping(obstacles: Obstacles, dt: float, storeys: RoadNetwork | None = None) -> tuple[tuple[int, int], ...]:
    """Pairs of moving vehicles whose boxes overlap, looked at once a second.

    People and bicycles do not count: a vehicle that meets them in a recording may have had an accident.

    Args:
        obstacles: Recorded traffic.
        dt: Time between steps [s].
        storeys: The road, if ways can be one above the other.

    Returns:
        Pairs of ids, the smaller one first, ascending.
    """
    boxes = np.array([_box(shape) for shape in obstacles.shapes]).reshape(-1, 5)
    vehicles = np.array([kind in _VEHICLES for kind in obstacles.kinds], dtype=np.bool_) & ~obstacles.is_static
    n = len(obstacles.ids)
    #: Pairs of rows as row times n plus other row, ascending: what is known is not looked at again.
    known = np.zeros(0, dtype=np.int64)
    for column in range(0, obstacles.n_steps, max(1, round(_SPACING / dt))):
        rows = np.flatnonzero(obstacles.valid[:, column] & vehicles)
        x, y, orientation = (table[rows, column] for table in (obstacles.x, obstacles.y, obstacles.orientation))
        placed = _placed(boxes[rows], x, y, orientation)
        first, second = _near_in_x(placed)
        is_new = ~_contains(known, _numbers(rows[first], rows[second], n))
        first, second = _overlaps(placed, first[is_new], second[is_new])
        meet = _meet(obstacles, rows[first], rows[second], column, storeys)
        if meet.any():
            known = np.union1d(known, _numbers(rows[first[meet]], rows[second[meet]], n))
    return tuple(sorted(_pairs(obstacles.ids[known // max(n, 1)], obstacles.ids[known % max(n, 1)])))


def overlapping_at_first(traffic: Placed, storeys: RoadNetwork | None = None) -> tuple[tuple[int, int], ...]:
    """Pairs that overlap at their first common time step: one of them stands in the other as it appears.

    They were never driven together, so that what measures say about them is about the recording.

    Args:
        traffic: Participants over time.
        storeys: The road, if ways can be one above the other.

    Returns:
        Pairs of ids, the smaller one first, ascending.
    """
    ids, valid = traffic.ids, traffic.valid
    boxes = np.array([_box(shape) for shape in traffic.shapes]).reshape(-1, 5)
    first = np.where(valid.any(axis=1), valid.argmax(axis=1), -1)
    found: set[tuple[int, int]] = set()
    for column in np.unique(first[first >= 0]).tolist():
        rows = np.flatnonzero(valid[:, column])
        x, y, orientation = (table[rows, column] for table in (traffic.x, traffic.y, traffic.orientation))
        placed = _placed(boxes[rows], x, y, orientation)
        one, other = _overlaps(placed, *_near_in_x(placed))
        is_new = (first[rows[one]] == column) | (first[rows[other]] == column)
        touch = [_touch(traffic, int(a), int(b), column) for a, b in zip(rows[one], rows[other], strict=True)]
        is_new &= np.array(touch, dtype=np.bool_) & _meet(traffic, rows[one], rows[other], column, storeys)
        found |= _pairs(ids[rows[one[is_new]]], ids[rows[other[is_new]]])
    return tuple(sorted(found))


def _touch(traffic: Placed, one: int, other: int, column: int) -> bool:
    """Whether two footprints share a point, not only their boxes."""
    first, second = core_shape(traffic.shapes[one]), core_shape(traffic.shapes[other])
    return first.distance(_pose(traffic, one, column), second, _pose(traffic, other, column)) <= 0.0


def _meet(traffic: Placed, one: Ints, other: Ints, column: int, storeys: RoadNetwork | None) -> Bools:
    """Whether pairs of rows are on the same storey of the road."""
    if storeys is None:
        return np.ones(len(one), dtype=np.bool_)
    pairs = zip(one.tolist(), other.tolist(), strict=True)
    return np.array(
        [not storeys.are_apart(_pose(traffic, a, column), _pose(traffic, b, column)) for a, b in pairs], dtype=np.bool_
    )


def _pose(traffic: Placed, row: int, column: int) -> tuple[float, float, float]:
    return float(traffic.x[row, column]), float(traffic.y[row, column]), float(traffic.orientation[row, column])


def _numbers(one: Ints, other: Ints, n: int) -> Ints:
    """A number for each pair of rows of `n`, whichever comes first."""
    found: Ints = np.minimum(one, other) * n + np.maximum(one, other)
    return found


def _contains(ascending: Ints, numbers: Ints) -> Bools:
    """Which of some numbers are among others, which ascend."""
    if not len(ascending):
        return np.zeros(len(numbers), dtype=np.bool_)
    found: Bools = ascending[np.searchsorted(ascending, numbers).clip(max=len(ascending) - 1)] == numbers
    return found


def _pairs(first: Ints, second: Ints) -> set[tuple[int, int]]:
    """Pairs of ids, the smaller one first."""
    return set(zip(np.minimum(first, second).tolist(), np.maximum(first, second).tolist(), strict=True))


def _box(shape: Shape) -> tuple[float, float, float, float, float]:
    """Centre, half length, half width and orientation of a box around a footprint in its body frame."""
    if shape.kind == "rectangle":
        return (*shape.center, 0.5 * shape.length, 0.5 * shape.width, shape.orientation)
    low, high = _bounds(shape)
    return (*(0.5 * (low + high)).tolist(), *(0.5 * (high - low)).tolist(), 0.0)


def _bounds(shape: Shape) -> tuple[Floats, Floats]:
    """Smallest and largest coordinates of a footprint [m]."""
    if not (shape.members if shape.kind == "group" else len(shape.vertices) or shape.kind != "polygon"):
        return np.zeros(2), np.zeros(2)
    if shape.kind == "group":
        parts = [_bounds(member) for member in shape.members]
        return np.min([low for low, _ in parts], axis=0), np.max([high for _, high in parts], axis=0)
    if shape.kind == "polygon":
        return shape.vertices.min(axis=0), shape.vertices.max(axis=0)
    center = np.array(shape.center)
    if shape.kind == "circle":
        return center - shape.radius, center + shape.radius
    cos, sin = abs(np.cos(shape.orientation)), abs(np.sin(shape.orientation))
    half = 0.5 * np.array([cos * shape.length + sin * shape.width, sin * shape.length + cos * shape.width])
    return center - half, center + half


def _placed(boxes: Floats, x: Floats, y: Floats, orientation: Floats) -> Floats:
    """Boxes of the body frame in the world, columns as from `_box`."""
    cos, sin = np.cos(orientation), np.sin(orientation)
    return np.column_stack(
        (
            x + cos * boxes[:, 0] - sin * boxes[:, 1],
            y + sin * boxes[:, 0] + cos * boxes[:, 1],
            boxes[:, 2],
            boxes[:, 3],
            orientation + boxes[:, 4],
        )
    )


def _overlaps(boxes: Floats, first: Ints, second: Ints) -> tuple[Ints, Ints]:
    """Those of some pairs of rows whose boxes overlap: no axis of either separates them."""
    reach = np.hypot(boxes[:, 2], boxes[:, 3])
    distance = np.hypot(*(boxes[first, :2] - boxes[second, :2]).T)
    near = distance < reach[first] + reach[second]
    first, second = first[near], second[near]
    a, b = boxes[first], boxes[second]
    apart = b[:, :2] - a[:, :2]
    cos, sin = (np.abs(turn(b[:, 4] - a[:, 4])) for turn in (np.cos, np.sin))
    overlap = np.ones(len(first), dtype=np.bool_)
    for own, other in ((a, b), (b, a)):
        axis = np.column_stack((np.cos(own[:, 4]), np.sin(own[:, 4])))
        along = np.abs((apart * axis).sum(axis=1))
        across = np.abs(apart[:, 1] * axis[:, 0] - apart[:, 0] * axis[:, 1])
        overlap &= along < own[:, 2] + cos * other[:, 2] + sin * other[:, 3]
        overlap &= across < own[:, 3] + sin * other[:, 2] + cos * other[:, 3]
    return first[overlap], second[overlap]


def _near_in_x(boxes: Floats) -> tuple[Ints, Ints]:
    """Rows of all pairs of boxes whose x differ by at most the largest diagonal, each pair once."""
    x, reach = boxes[:, 0], 2.0 * np.hypot(boxes[:, 2], boxes[:, 3]).max(initial=0.0)
    order = np.argsort(x, kind="stable")
    ends = np.searchsorted(x[order], x[order] + reach, side="right")
    counts = ends - np.arange(len(x)) - 1
    first = np.repeat(np.arange(len(x)), counts)
    second = first + 1 + np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return order[first], order[second]
