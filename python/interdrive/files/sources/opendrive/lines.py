"""Lines between lanes by the names of CommonRoad."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from interdrive.files.sources.opendrive.records import LaneRecord, Section

#: Names of lines by types of road marks; what is not here is not known. Those with two parts go from the inside out.
_NAMES = {
    "solid": "solid",
    "broken": "dashed",
    "solid solid": "solid_solid",
    "broken broken": "dashed_dashed",
    "solid broken": "solid_dashed",
    "broken solid": "dashed_solid",
    "curb": "curb",
    "none": "no_marking",
}
_BROAD = {"solid": "broad_solid", "dashed": "broad_dashed"}
_MIRRORED = {"solid_dashed": "dashed_solid", "dashed_solid": "solid_dashed"}


def line_names(section: Section, row: int, *, forward: bool) -> tuple[str, str]:
    """Lines on the left and right border of a lane of a section, in its driving direction.

    A lane states the line of its outer border; the inner one is the outer one of the lane inside, or that of lane 0.
    """
    lane = section.lanes[row]
    inside = section.lanes[row + 1 if lane.number > 0 else row - 1]
    middle = 0.5 * (section.end - section.start)
    outer, inner = (_name(one, middle) for one in (lane, inside))
    # Seen along s: outwards is leftwards for lanes on the left. Marks of lane 0 are stated from left to right.
    if lane.number > 0:
        outer = _MIRRORED.get(outer, outer)
        inner = _MIRRORED.get(inner, inner) if inside.number else inner
    left, right = (outer, inner) if lane.number > 0 else (inner, outer)
    if forward:
        return left, right
    return _MIRRORED.get(right, right), _MIRRORED.get(left, left)


def _name(lane: LaneRecord, at: float) -> str:
    stated = [mark for mark in lane.marks if mark[0] <= at] or list(lane.marks[:1])
    if not stated:
        return "unknown"
    _, kind, weight = stated[-1]
    name = _NAMES.get(kind, "unknown")
    return _BROAD.get(name, name) if weight == "bold" else name
