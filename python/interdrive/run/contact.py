"""Which sides of two participants touched in a collision."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive.array_types import Floats
    from interdrive.run.arrays import States

#: Halvings of the last step in the search for the moment of contact.
_HALVINGS = 20
#: Relative way [m] between looks for the first contact within a step, and the most looks.
_PIECE, _MOST_PIECES = 0.1, 2000


@dataclass(frozen=True)
class Contact:
    """How two participants touched.

    Attributes:
        sides: Side of each that touched: front, rear, left or right.
        approach: Speed at which each moved towards the other one before the contact [m/s], negative: away.
    """

    sides: tuple[str, str]
    approach: tuple[float, float]


def contact_between(states: States, first: int, second: int, time_step: int, dt: float) -> Contact:
    """How two participants touched on the way to a time step.

    Footprints count as the rectangles around them, poses between time steps as interpolated. The side of each
    faces the other across the line that separates them best at the first moment of contact.

    Args:
        states: States of all participants.
        first: Row of one.
        second: Row of the other one.
        time_step: Time step of the first recorded states after the contact.
        dt: Time between steps [s].
    """
    column = time_step - states.first_time_step
    before = column - 1 if column > 0 and states.valid[[first, second], column - 1].all() else column

    def boxes(fraction: float) -> list[tuple[Floats, Floats, Floats]]:
        return [_box(states, row, before, column, fraction) for row in (first, second)]

    moved = [box[0] - start[0] for box, start in zip(boxes(1.0), boxes(0.0), strict=True)]
    # Two that meet in a long step may be apart again at its end.
    n = min(_MOST_PIECES, max(1, math.ceil(float(np.hypot(*(moved[1] - moved[0]))) / _PIECE)))
    piece = next((i for i in range(1, n + 1) if _gap(*boxes(i / n))[0] <= 0.0), n)
    apart, touching = (piece - 1) / n, piece / n
    for _ in range(_HALVINGS):
        middle = 0.5 * (apart + touching)
        if _gap(*boxes(middle))[0] > 0.0:
            apart = middle
        else:
            touching = middle
    one, other = boxes(apart)
    normal = _gap(one, other)[1]
    return Contact(
        (_side(one, normal), _side(other, -normal)),
        (float(moved[0] @ normal) / dt, float(moved[1] @ -normal) / dt),
    )


def _box(states: States, row: int, before: int, after: int, fraction: float) -> tuple[Floats, Floats, Floats]:
    """Centre, axes (forward, left) and half sizes of a footprint between two columns."""
    x, y = ((1.0 - fraction) * table[row, before] + fraction * table[row, after] for table in (states.x, states.y))
    start, turn = states.orientation[row, before], states.orientation[row, after] - states.orientation[row, before]
    angle = start + fraction * float(np.arctan2(np.sin(turn), np.cos(turn)))
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return np.array([x, y]), axes, 0.5 * np.array([states.length[row], states.width[row]])


def _gap(one: tuple[Floats, Floats, Floats], other: tuple[Floats, Floats, Floats]) -> tuple[float, Floats]:
    """Largest distance between two rectangles along one of their axes, negative if they overlap; and that axis."""
    offset = other[0] - one[0]
    found: tuple[float, Floats] = (-np.inf, np.zeros(2))
    for axis in (*one[1], *other[1]):
        reach = sum(float(np.abs(box[1] @ axis) @ box[2]) for box in (one, other))
        gap = abs(float(offset @ axis)) - reach
        if gap > found[0] + 1e-9:
            found = gap, axis if offset @ axis >= 0.0 else -axis
    return found


def _side(box: tuple[Floats, Floats, Floats], normal: Floats) -> str:
    """The side of a rectangle that faces a direction."""
    forward, left = (box[1] @ normal).tolist()
    if abs(forward) >= abs(left):
        return "front" if forward > 0.0 else "rear"
    return "left" if left > 0.0 else "right"
