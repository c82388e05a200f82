"""Heights of bounds: ways that cross one above the other do not meet. You are told where heights are missing."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from interdrive.scenario.native import CLEARANCE

if TYPE_CHECKING:
    from collections.abc import Iterable

    from interdrive.array_types import Floats
    from interdrive.files.shapes import Foreign


def heights_of(lanelet: Foreign) -> Floats:
    """Heights of the middle of a lanelet [m], shape (vertices,); empty where the file states none."""
    line = _middle(lanelet)
    return np.empty(0) if line is None else line[:, 2]


def missing_heights(lanelets: Iterable[Foreign]) -> tuple[str, ...]:
    """One line per pair of crossing lanelets of which only one has heights, in maps with ways one above the other.

    Args:
        lanelets: Lanelets of commonroad-io.
    """
    lines = {int(one.lanelet_id): _middle(one) for one in lanelets}
    known = [line[:, 2] for line in lines.values() if line is not None]
    if len(known) in (0, len(lines)) or float(np.ptp(np.concatenate(known))) <= CLEARANCE:
        return ()
    flat = {int(one.lanelet_id): _flat(one) for one in lanelets}
    notes = []
    for first, second in itertools.combinations(sorted(lines), 2):
        if (lines[first] is None) == (lines[second] is None):
            continue
        lacking = first if lines[first] is None else second
        if _cross(flat[first], flat[second]):
            notes.append(f"lanelets {first} and {second} cross, and {lacking} has no heights: vehicles on them meet")
    return tuple(notes)


def _middle(lanelet: Foreign) -> Floats | None:
    """Centre line with heights [m], shape (vertices, 3); of one bound's heights if the other has none."""
    sides = [np.asarray(side, dtype=np.float64) for side in (lanelet.left_vertices, lanelet.right_vertices)]
    known = [side[:, 2] for side in sides if side.shape[1] > 2]
    if not known or len(sides[0]) != len(sides[1]) or not all(np.isfinite(height).all() for height in known):
        return None
    return np.column_stack([0.5 * (sides[0][:, :2] + sides[1][:, :2]), np.mean(known, axis=0)])


def _flat(lanelet: Foreign) -> Floats:
    sides = [np.asarray(side, dtype=np.float64)[:, :2] for side in (lanelet.left_vertices, lanelet.right_vertices)]
    middle: Floats = 0.5 * (sides[0] + sides[1])
    return middle


def _cross(one: Floats, other: Floats) -> bool:
    """Whether two lines cross."""
    if (one.min(axis=0) > other.max(axis=0)).any() or (other.min(axis=0) > one.max(axis=0)).any():
        return False
    side, other_side = np.diff(one, axis=0)[:, None], np.diff(other, axis=0)[None]
    offset = other[None, :-1] - one[:-1, None]

    def cross(a: Floats, b: Floats) -> Floats:
        found: Floats = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
        return found

    area = cross(side, other_side)
    with np.errstate(divide="ignore", invalid="ignore"):
        along, across = cross(offset, other_side) / area, cross(offset, side) / area
    return bool(((along >= 0.0) & (along <= 1.0) & (across >= 0.0) & (across <= 1.0)).any())
