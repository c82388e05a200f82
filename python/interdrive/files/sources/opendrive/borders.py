"""Borders of the lanes of a section, as points that are nowhere far from the curves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Floats
    from interdrive.files.sources.opendrive.records import Road, Section

#: A profile is evaluated this far before the end of its section [m]: what begins there belongs to the next one.
_BEFORE_END = 1e-7
#: Distance of a border from its curve [m].
_CHORD_ERROR = 0.05
#: Points are at most this far apart along the road [m], unless a section is longer than this many of them.
_APART, _MOST = 5.0, 4000
#: No point begins nearer to the ends of a section than this [m].
_NEAR_END = 0.05
#: Halvings of the distance between points.
_HALVINGS = 8


def offsets_at(road: Road, section: Section, s: Floats) -> Floats:
    """Lateral position of the outer border of each lane of a section, and of the reference line [m].

    Args:
        road: The road.
        section: One of its sections.
        s: Along the road [m], shape (points,).

    Returns:
        To the left of the reference line, in the order of the lanes from left to right, shape (lanes, points): the
        border of a lane on the left is its left one, of a lane on the right its right one, that of lane 0 between both.
    """
    base = road.offset.at(s)
    found = np.empty((len(section.lanes), len(s)))
    numbers = [lane.number for lane in section.lanes]
    for place in (place for place, number in enumerate(numbers) if number == 0):
        found[place] = base
    for side in (1, -1):
        inner = base
        places = [place for place, number in enumerate(numbers) if number * side > 0]
        for place in sorted(places, key=lambda one: abs(numbers[one])):
            lane = section.lanes[place]
            if lane.width or not lane.border:
                inner = inner + side * np.maximum(lane.width.at(s - section.start), 0.0)
            else:
                inner = base + lane.border.at(s - section.start)
            found[place] = inner
    return found


def points_at(road: Road, offsets: Floats, s: Floats) -> Floats:
    """Points beside the reference line, shape (lanes, points, 2)."""
    x, y, heading = road.line.at(s)
    if road.superelevation:
        offsets = offsets * np.cos(road.superelevation.at(s))
    found = np.empty((*offsets.shape, 2))
    found[..., 0] = x - np.sin(heading) * offsets
    found[..., 1] = y + np.cos(heading) * offsets
    return found


def borders_of(road: Road, section: Section, rows: Sequence[int]) -> Floats:
    """Borders from left to right, all sampled at the same places.

    Args:
        road: The road.
        section: One of its sections; its lanes include the reference line.
        rows: Borders that matter, by the place of their lanes in the section.

    Returns:
        Shape (lanes, points, 2).
    """
    last = max(section.start, section.end - _BEFORE_END)

    def at(s: Floats) -> Floats:
        return points_at(road, offsets_at(road, section, s), s)

    s = _first_places(road, section)
    s[-1] = last
    points = at(s)
    start, end = s[:-1], s[1:]
    before, after = points[:, :-1], points[:, 1:]
    kept_s, kept = [s], [points]
    for _ in range(_HALVINGS):
        middle = 0.5 * (start + end)
        between = at(middle)
        chord = (between - 0.5 * (before + after))[rows]
        far = (np.square(chord).sum(axis=-1) > _CHORD_ERROR**2).any(axis=0)
        if not far.any():
            break
        middle, between = middle[far], between[:, far]
        kept_s.append(middle)
        kept.append(between)
        start, end = np.concatenate((start[far], middle)), np.concatenate((middle, end[far]))
        before = np.concatenate((before[:, far], between), axis=1)
        after = np.concatenate((between, after[:, far]), axis=1)
    if len(kept) == 1:
        return points
    order = np.argsort(np.concatenate(kept_s), kind="stable")
    ordered: Floats = np.concatenate(kept, axis=1)[:, order]
    return ordered


def _first_places(road: Road, section: Section) -> Floats:
    """Starts of records and places between them, at most 5 m apart, from start to end of a section."""
    start, end = section.start, section.end
    records = [road.line.starts, road.offset.starts, road.superelevation.starts]
    for lane in section.lanes:
        records += [lane.width.starts + start, lane.border.starts + start]
    breaks = np.unique(np.concatenate(records))
    inner = breaks[(breaks > start + _NEAR_END) & (breaks < end - _NEAR_END)]
    edges = np.concatenate(([start], inner, [end]))
    apart = max(_APART, (end - start) / _MOST)
    counts = np.maximum(1, np.ceil(np.diff(edges) / apart - 1e-9).astype(np.int64))
    pieces = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(edges[:-1], edges[1:], counts, strict=True)]
    return np.concatenate((*pieces, [end]))
