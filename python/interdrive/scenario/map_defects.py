"""Defects of a map, for `interdrive check`: links whose ends do not meet, and lanelets that cannot be as they are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.scenario.lanes import lane_users

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from interdrive.array_types import Floats
    from interdrive.scenario.model import Lanelets

#: Ends of linked lanelets that are farther apart than this do not meet [m].
_GAP_MIN = 0.1
#: As in the core: no route uses a link with a larger gap, and lanelets that overlap by more are cut [m].
_GAP_MAX, _OVERLAP_MIN, _OFFSET_MAX = 3.0, 0.5, 1.0
#: Lanes that are narrower than this somewhere are narrow [m].
_WIDTH_MIN = 2.0
#: Ends of a closed lanelet are at most this far apart [m].
_CLOSED = 0.1
#: This many are named.
_NAMED = 3
#: Bounds with more vertices are not searched for crossings.
_VERTICES_MAX = 1000


def map_defects(lanelets: Lanelets) -> tuple[str, ...]:
    """One line per kind of defect, with the ids of the worst; empty for a map without any."""
    return (*_links(lanelets), *_shapes(lanelets))


def _links(lanelets: Lanelets) -> Iterator[str]:
    rows = {number: row for row, number in enumerate(lanelets.ids.tolist())}
    pairs = {
        *((row, rows[after]) for row in rows.values() for after in lanelets.successors[row] if after in rows),
        *((rows[before], row) for row in rows.values() for before in lanelets.predecessors[row] if before in rows),
    }
    middles = [0.5 * (left + right) for left, right in zip(lanelets.left, lanelets.right, strict=True)]
    gaps, overlaps, unused = [], [], 0
    for before, after in sorted(pairs):
        ends = [(bounds[before][-1], bounds[after][0]) for bounds in (lanelets.left, lanelets.right)]
        gap = max(float(np.hypot(*(end - start))) for end, start in ends)
        if gap <= _GAP_MIN:
            continue
        overlap = _overlap(middles[before], middles[after])
        if before != after and overlap > _OVERLAP_MIN:
            overlaps.append((overlap, before, after))
        else:
            gaps.append((gap, before, after))
            unused += float(np.hypot(*(middles[before][-1] - middles[after][0]))) > _GAP_MAX
    ids = lanelets.ids.tolist()
    if gaps:
        worst = [f"{ids[before]} to {ids[after]} ({gap:.1f} m)" for gap, before, after in _largest(gaps)]
        count = "1 link joins lanelets" if len(gaps) == 1 else f"{len(gaps)} links join lanelets"
        which = "" if not unused else f"; no route uses the {unused} with more than {_GAP_MAX:g} m"
        yield f"{count} whose borders are more than {_GAP_MIN:g} m apart: {', '.join(worst)}{_rest(gaps)}{which}"
    for overlap, before, after in _largest(overlaps):
        yield f"lanelet {ids[after]} begins {round(overlap, 1):g} m before the end of {ids[before]}"
    if len(overlaps) > _NAMED:
        yield f"{len(overlaps) - _NAMED} more lanelets begin before the end of their predecessor"


def _shapes(lanelets: Lanelets) -> Iterator[str]:
    ids = lanelets.ids.tolist()
    narrow, closed, crossing, swapped = [], [], [], []
    users = lane_users(lanelets)
    for row, (left, right) in enumerate(zip(lanelets.left, lanelets.right, strict=True)):
        width = min(
            float(np.hypot(*(left - right).T).min()), *(_distance(end, other) for end, other in _ends(left, right))
        )
        if "car" in users[row] and round(width, 2) < _WIDTH_MIN:
            narrow.append((-width, row, row))
        is_closed = all(len(bound) > 2 and np.hypot(*(bound[0] - bound[-1])) <= _CLOSED for bound in (left, right))
        if is_closed:
            closed.append(ids[row])
        if _crosses_itself(left, right, is_closed=is_closed):
            crossing.append(ids[row])
        elif _is_swapped(left, right):
            swapped.append(ids[row])
    if narrow:
        worst = [f"{ids[row]} ({-width:.2f} m)" for width, row, _ in _largest(narrow)]
        verb = "1 lane is" if len(narrow) == 1 else f"{len(narrow)} lanes are"
        yield f"{verb} narrower than {_WIDTH_MIN:g} m somewhere, lanelets: {', '.join(worst)}{_rest(narrow)}"
    for found, what in (
        (closed, "closed, its end is its start"),
        (crossing, "self-crossing: its outline crosses or touches itself"),
        (swapped, "turned over: its left bound lies on the right of its right bound"),
    ):
        if found:
            named = ", ".join(map(str, found[:_NAMED]))
            plural = "lanelet" if len(found) == 1 else "lanelets"
            yield f"{plural} {named}{_rest(found)} {'is' if len(found) == 1 else 'are each'} {what}"


def _largest(found: Sequence[tuple[float, int, int]]) -> list[tuple[float, int, int]]:
    return sorted(found, key=lambda one: (-one[0], one[1:]))[:_NAMED]


def _rest(found: Sequence[object]) -> str:
    return f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""


def _ends(left: Floats, right: Floats) -> Iterator[tuple[Floats, Floats]]:
    """Vertices of either bound that have no vertex opposite, with the other bound."""
    for bound, other in ((left, right), (right, left)):
        for vertex in bound[:: max(1, len(bound) // 20)]:
            yield vertex, other


def _foot(point: Floats, line: Floats) -> tuple[float, float]:
    """Distance of a point from a polyline and arc length of its foot [m]."""
    steps = np.diff(line, axis=0)
    lengths = np.hypot(*steps.T)
    squared = np.maximum(lengths**2, 1e-18)
    share = np.clip(((point - line[:-1]) * steps).sum(axis=1) / squared, 0.0, 1.0)
    distances = np.hypot(*(line[:-1] + share[:, None] * steps - point).T)
    nearest = int(distances.argmin())
    return float(distances[nearest]), float(lengths[:nearest].sum() + share[nearest] * lengths[nearest])


def _distance(point: Floats, line: Floats) -> float:
    return _foot(point, line)[0]


def _overlap(before: Floats, after: Floats) -> float:
    """How far the end of a middle line lies beyond the start of the next, along both [m]; 0 where they meet or part."""
    length = float(np.hypot(*np.diff(before, axis=0).T).sum())
    (end_offset, end), (start_offset, start) = _foot(before[-1], after), _foot(after[0], before)
    return min(length - start, end) if max(end_offset, start_offset) <= _OFFSET_MAX else 0.0


def _is_swapped(left: Floats, right: Floats) -> bool:
    """The left bound lies on the right all along."""
    middle = 0.5 * (left + right) if len(left) == len(right) else left
    ahead = np.gradient(middle, axis=0)
    across = left - right if len(left) == len(right) else np.zeros_like(left)
    side = ahead[:, 0] * across[:, 1] - ahead[:, 1] * across[:, 0]
    return bool(np.any(side < 0) and np.all(side <= 0))


def _crosses_itself(left: Floats, right: Floats, *, is_closed: bool) -> bool:
    """A bound crosses itself or the other one."""
    bounds = [bound[np.r_[True, np.any(np.diff(bound, axis=0) != 0.0, axis=1)]] for bound in (left, right)]
    if max(len(bound) for bound in bounds) > _VERTICES_MAX:
        return False
    pairs = [(bounds[0], bounds[0]), (bounds[1], bounds[1]), (bounds[0], bounds[1])]
    return any(_cross(a, b, is_closed=is_closed) for a, b in pairs)


def _cross(a: Floats, b: Floats, *, is_closed: bool) -> bool:
    """Two polylines cross; of one and the same, pieces that follow each other do not count."""
    if len(a) < 2 or len(b) < 2:
        return False

    def side(origin: Floats, ahead: Floats, points: Floats) -> Floats:
        away = points[None, :, :] - origin[:, None, :]
        crossed: Floats = ahead[:, None, 0] * away[..., 1] - ahead[:, None, 1] * away[..., 0]
        return crossed

    of_b, of_a = side(a[:-1], np.diff(a, axis=0), b), side(b[:-1], np.diff(b, axis=0), a)
    crossed = (of_b[:, :-1] * of_b[:, 1:] < 0.0) & (of_a[:, :-1] * of_a[:, 1:] < 0.0).T
    if a is b:
        near = np.abs(np.subtract.outer(np.arange(len(a) - 1), np.arange(len(a) - 1)))
        crossed &= near > 1
        if is_closed:
            crossed &= near < len(a) - 3
    return bool(crossed.any())
