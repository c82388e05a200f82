"""Lanes of maps that have only their centre lines: links, neighbours and borders from what lies beside each other.

Lines that meet, heading the same way, are linked. Half widths are half the distance to the nearest parallel line, at
most that to the edge of the road, smoothed along the line. Where lanes meet, all take the mean place and direction and
the smallest half widths, so that borders meet exactly. A line is cut where a parallel one begins or ends beside it,
because neighbours lie beside each other as a whole.
"""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError
from interdrive.files.sources.model import Lane, Roads
from interdrive.files.sources.nearby import Nearby
from interdrive.scenario.limits import LONGEST_LANELET

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.files.sources.notes import Notes

#: Points of lines are this far apart [m]; nearer ones are left out, farther ones get others between them.
SPACING, _NEAREST = 0.5, 0.25
#: All lines together have at most so many points.
_MOST_POINTS = 1_000_000
#: Lines whose ends are this near [m] and whose headings differ by at most this [rad] are linked.
_JOINED, _JOINED_TURN = 1.0, math.radians(45.0)
#: Several lines begin at a joint if none of them is farther from it than the nearest one plus this [m].
_SAME_JOINT = 0.01
#: Lines are parallel if their headings differ by at most this [rad], and beside each other within these distances [m].
_PARALLEL, _BESIDE = math.radians(20.0), (2.0, 5.5)
#: A line so far beside another one shares the ground between them [m]: the middle counts as far as an edge of the road.
_SHARES = (2.0, 8.0)
#: A point is beside another one if it is at most this far ahead or behind [m].
_ALONG = 0.6
#: Distances from an edge of the road that count [m]; points of edges lie this far apart [m].
_EDGE, _EDGE_SPACING = (0.3, 4.0), 0.25
#: Smallest, largest and usual half width [m].
_HALF_WIDTHS, _USUAL_HALF_WIDTH = (1.3, 2.6), 1.75
#: Half widths are smoothed over this many points before and after.
_SMOOTHED = 10
#: At a joint places and widths change over this length [m], at most this share of the lane, and directions over this.
_BLEND, _BLEND_SHARE, _TURN_BLEND = 8.0, 0.45, 2.0
#: Pieces are at least this long [m]; a parallel line ends beside a point at most this far ahead or behind [m].
_SHORTEST, _CUT_ALONG = 5.0, 1.0
#: Ends of neighbours are at most this far ahead or behind [m], and their middles turned by at most this [rad].
_NEIGHBOUR_ALONG, _NEIGHBOUR_TURN = 3.0, math.radians(30.0)
#: Points of borders are this far apart, and from the last one [m].
_THINNED, _FROM_LAST = 1.0, 0.7


@dataclass(frozen=True)
class CentreLine:
    """A lane of a source: its name, the points in its middle in driving direction [m], CommonRoad's type."""

    key: str
    points: Floats
    kind: str = "urban"


@dataclass
class _Piece:
    """A part of a line between two cuts; `line` is the position of that line."""

    line: int
    points: Floats
    along: Floats
    heading: Floats
    half: Floats

    @property
    def normal(self) -> Floats:
        return _normals(self.heading)


def lanes_of(lines: Sequence[CentreLine], edges: Sequence[Floats], file: str, notes: Notes) -> Roads:
    """Lanes around centre lines.

    Args:
        lines: The lanes.
        edges: Edges of the road [m], shape (points, 2) each.
        file: Name of the source in messages.
        notes: What is left out is added.

    Raises:
        InputError: The lines are too long; one line.
    """
    places = [_spaced(line.points, SPACING) for line in lines]
    kept = [index for index, points in enumerate(places) if len(points) > 1]
    if len(kept) < len(lines):
        notes.leave_out("lanes", f"shorter than {_NEAREST:g} m", len(lines) - len(kept))
    lines, places = [lines[index] for index in kept], [places[index] for index in kept]
    _require_length(places, file)
    if not lines:
        return Roads([])
    table = _Table(places)
    halves = _half_widths(table, edges)
    pieces, links = _pieces(table, halves, _cuts(table))
    joints = _joints(len(pieces), links)
    collapsed = {piece.line for place, piece in enumerate(pieces) if _collapses(place, piece, joints)}
    if collapsed:
        notes.leave_out("lanes", "that lie within one joint", len(collapsed))
        return lanes_of([line for place, line in enumerate(lines) if place not in collapsed], edges, file, notes)
    for piece in pieces:
        piece.half = _smoothed(piece.half)
    for ends in joints:
        _meet([(pieces[end // 2], -(end % 2)) for end in ends])
    counts: dict[int, int] = defaultdict(int)
    roads = Roads([], links=links)
    for piece in pieces:
        line = lines[piece.line]
        counts[piece.line] += 1
        key = line.key if counts[piece.line] == 1 else f"{line.key}/{counts[piece.line]}"
        rows = _thinned(piece.along)
        left, right = (
            piece.points[rows] + sign * half[rows][:, None] * piece.normal[rows]
            for sign, half in zip((1.0, -1.0), piece.half, strict=True)
        )
        roads.lanes.append(Lane(key, left, right, kind=line.kind))
    _add_neighbours(roads, pieces)
    return roads


def _require_length(places: Sequence[Floats], file: str) -> None:
    if sum(map(len, places)) > _MOST_POINTS:
        raise InputError(
            f"{file}: its lanes are longer than {_MOST_POINTS * SPACING / 1000.0:.0f} km together; cut the map"
        )


def _spaced(points: Floats, spacing: float) -> Floats:
    """A line whose points are neither much nearer to each other than a distance [m] nor much farther."""
    kept = [0] if len(points) else []
    for index in range(1, len(points)):
        if math.dist(points[index], points[kept[-1]]) >= _NEAREST:
            kept.append(index)
    if len(kept) > 1:
        kept[-1] = max(kept[-1], len(points) - 1)
    line = points[kept]
    steps = np.hypot(*np.diff(line, axis=0).T)
    if not len(steps) or steps.sum() > LONGEST_LANELET:
        return line[:1]
    parts = np.maximum(np.ceil(steps / (1.2 * spacing)), 1).astype(np.int64)
    if parts.max() == 1:
        return line
    at = np.concatenate([index + np.arange(n) / n for index, n in enumerate(parts.tolist())] + [[len(parts)]])
    return np.column_stack([np.interp(at, np.arange(len(line)), column) for column in line.T])


class _Table:
    """Points of all lines below each other, with their lines, arc lengths [m] and headings [rad]."""

    def __init__(self, places: Sequence[Floats]) -> None:
        self.points = np.concatenate(places)
        self.first = np.concatenate(([0], np.cumsum([len(points) for points in places])))
        self.line = np.repeat(np.arange(len(places)), np.diff(self.first))
        self.along = np.concatenate([_along(points) for points in places])
        self.heading = np.concatenate([_headings(points) for points in places])
        self.length = np.array([self.along[last - 1] for last in self.first[1:]])

    @property
    def ends(self) -> Ints:
        """Rows of the first and the last point of each line, shape (lines, 2)."""
        return np.column_stack((self.first[:-1], self.first[1:] - 1))

    def apart(self, rows: Ints, others: Floats) -> tuple[Floats, Floats]:
        """How far other places are ahead and to the left of the points of rows [m]."""
        v, heading = others - self.points[rows], self.heading[rows]
        cos, sin = np.cos(heading), np.sin(heading)
        return v[:, 0] * cos + v[:, 1] * sin, v[:, 1] * cos - v[:, 0] * sin


def _along(points: Floats) -> Floats:
    return np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))


def _headings(points: Floats) -> Floats:
    direction = np.gradient(points, axis=0)
    return np.arctan2(direction[:, 1], direction[:, 0])


def _normals(heading: Floats) -> Floats:
    return np.column_stack((-np.sin(heading), np.cos(heading)))


def _turn(one: Floats | float, other: Floats | float) -> Floats:
    """By how much directions differ [rad], at most half a turn."""
    found: Floats = np.abs(np.remainder(np.asarray(one) - other + np.pi, 2.0 * np.pi) - np.pi)
    return found


def _is_beside(lateral: Floats, within: tuple[float, float] = _BESIDE) -> Bools:
    return (np.abs(lateral) > within[0]) & (np.abs(lateral) < within[1])


# Half widths


def _half_widths(table: _Table, edges: Sequence[Floats]) -> Floats:
    """Half widths to the left and right of every point [m], shape (2, points)."""
    nearest = np.full((2, len(table.points)), np.inf)
    reach = math.hypot(_SHARES[1], _ALONG)
    for rows, others in Nearby(table.points, reach).pairs(table.points):
        ahead, left = table.apart(rows, table.points[others])
        turn = _turn(table.heading[rows], table.heading[others])
        fits = (np.abs(ahead) < _ALONG) & _is_beside(left, _SHARES) & (table.line[rows] != table.line[others])
        fits &= (turn < _PARALLEL) | (turn > np.pi - _PARALLEL)
        _lower(nearest, rows[fits], left[fits], 0.5)
    spaced = [_spaced(edge, _EDGE_SPACING) for edge in edges if len(edge) > 1]
    spaced = [edge for edge in spaced if len(edge) > 1]
    _require_length(spaced, "the edges of the road")
    border = np.concatenate(spaced) if spaced else np.zeros((0, 2))
    for rows, others in Nearby(border, math.hypot(_EDGE[1], _ALONG)).pairs(table.points):
        ahead, left = table.apart(rows, border[others])
        fits = (np.abs(ahead) < _ALONG) & (np.abs(left) > _EDGE[0]) & (np.abs(left) < _EDGE[1])
        _lower(nearest, rows[fits], left[fits], 1.0)
    return np.where(np.isinf(nearest), _USUAL_HALF_WIDTH, nearest.clip(*_HALF_WIDTHS))


def _lower(nearest: Floats, rows: Ints, left: Floats, factor: float) -> None:
    """Takes distances to the left (positive) and right into account where they are the smallest so far."""
    for side, on_side in enumerate((left > 0.0, left < 0.0)):
        np.minimum.at(nearest[side], rows[on_side], factor * np.abs(left[on_side]))


def _smoothed(half: Floats) -> Floats:
    """Medians, then means, over neighbouring points; shape (2, points)."""
    found = half
    for smooth in (np.median, np.mean):
        padded = np.pad(found, ((0, 0), (_SMOOTHED, _SMOOTHED)), mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * _SMOOTHED + 1, axis=1)
        found = smooth(windows, axis=2)
    return found


# Pieces


def _cuts(table: _Table) -> dict[int, list[int]]:
    """Rows of points of each line beside which a parallel line begins or ends."""
    ends = table.ends.ravel()
    of_line = np.repeat(np.arange(len(table.first) - 1), 2)
    nearest: dict[tuple[int, int], tuple[float, int]] = {}
    reach = math.hypot(_BESIDE[1], _CUT_ALONG)
    for end, rows in Nearby(table.points, reach).pairs(table.points[ends]):
        apart = np.hypot(*(table.points[rows] - table.points[ends[end]]).T)
        fits = (table.line[rows] != of_line[end]) & (apart < reach)
        # Of every end and line the nearest point, of equally near ones the first.
        for one, row, distance in zip(end[fits].tolist(), rows[fits].tolist(), apart[fits].tolist(), strict=True):
            key = (one, int(table.line[row]))
            nearest[key] = min(nearest.get(key, (math.inf, 0)), (distance, row))
    found: dict[int, list[int]] = defaultdict(list)
    if not nearest:
        return found
    end = np.array([key[0] for key in nearest])
    rows = np.array([row for _, row in nearest.values()])
    ahead, left = table.apart(rows, table.points[ends[end]])
    fits = (np.abs(ahead) < _CUT_ALONG) & _is_beside(left)
    fits &= _turn(table.heading[rows], table.heading[ends[end]]) < _PARALLEL
    for row in np.unique(rows[fits]).tolist():
        found[int(table.line[row])].append(row)
    return found


def _pieces(table: _Table, halves: Floats, cuts: dict[int, list[int]]) -> tuple[list[_Piece], list[tuple[int, int]]]:
    """Pieces of the lines, in their order, and the links between them."""
    pieces: list[_Piece] = []
    links: list[tuple[int, int]] = []
    outer = []
    for line, (first, last) in enumerate(table.ends.tolist()):
        at = [first]
        for row in cuts.get(line, ()):
            if min(table.along[row] - table.along[at[-1]], table.length[line] - table.along[row]) > _SHORTEST:
                at.append(row)
        at.append(last)
        outer.append((len(pieces), len(pieces) + len(at) - 2))
        links += [(piece, piece + 1) for piece in range(*outer[-1])]
        for begin, end in itertools.pairwise(at):
            rows = slice(begin, end + 1)
            along = table.along[rows] - table.along[begin]
            pieces.append(
                _Piece(line, table.points[rows].copy(), along, table.heading[rows].copy(), halves[:, rows].copy())
            )
    starts, ends = (table.ends[:, side] for side in (0, 1))
    for one, other in _joined(table.points[ends], table.heading[ends], table.points[starts], table.heading[starts]):
        links.append((outer[one][1], outer[other][0]))
    return pieces, sorted(set(links))


def _joined(ends: Floats, end_headings: Floats, starts: Floats, start_headings: Floats) -> list[tuple[int, int]]:
    """Ends and the starts that follow them: the nearest one, and those that are hardly farther."""
    found: dict[int, list[tuple[float, int]]] = defaultdict(list)
    for one, other in Nearby(starts, _JOINED).pairs(ends):
        apart = np.hypot(*(starts[other] - ends[one]).T)
        fits = (apart < _JOINED) & (one != other)
        fits &= _turn(end_headings[one], start_headings[other]) < _JOINED_TURN
        for end, start, distance in zip(one[fits].tolist(), other[fits].tolist(), apart[fits].tolist(), strict=True):
            found[end].append((distance, start))
    return [
        (end, start)
        for end, starts_near in found.items()
        for distance, start in starts_near
        if distance <= min(starts_near)[0] + _SAME_JOINT
    ]


def _joints(n_pieces: int, links: Sequence[tuple[int, int]]) -> list[list[int]]:
    """Ends that meet, of two or more pieces: 2 i is the start of piece i, 2 i + 1 its end."""
    group = list(range(2 * n_pieces))

    def found(end: int) -> int:
        while group[end] != end:
            group[end] = group[group[end]]
            end = group[end]
        return end

    for one, other in links:
        group[found(2 * one + 1)] = found(2 * other)
    members = defaultdict(list)
    for end in range(len(group)):
        members[found(end)].append(end)
    return [ends for ends in members.values() if len(ends) > 1]


def _collapses(place: int, piece: _Piece, joints: Sequence[list[int]]) -> bool:
    """Whether both ends of a short piece meet, so that nothing of it would be left."""
    if piece.along[-1] >= 2.0 * _JOINED:
        return False
    return any(2 * place in ends and 2 * place + 1 in ends for ends in joints)


def _meet(ends: Sequence[tuple[_Piece, int]]) -> None:
    place = np.mean([piece.points[at] for piece, at in ends], axis=0)
    headings = np.array([piece.heading[at] for piece, at in ends])
    heading = math.atan2(float(np.sin(headings).mean()), float(np.cos(headings).mean()))
    half = np.min([piece.half[:, at] for piece, at in ends], axis=0)
    for piece, at in ends:
        from_end = piece.along if at == 0 else piece.along[-1] - piece.along
        share = (1.0 - from_end / min(_BLEND, _BLEND_SHARE * piece.along[-1])).clip(0.0, 1.0)
        piece.half = piece.half + (half - piece.half[:, at])[:, None] * share
        piece.points = piece.points + (place - piece.points[at]) * share[:, None]
        turn = math.remainder(heading - float(piece.heading[at]), 2.0 * math.pi)
        piece.heading = piece.heading + turn * (1.0 - from_end / _TURN_BLEND).clip(0.0, 1.0)


def _thinned(along: Floats) -> Ints:
    kept, last = [0], float(along[-1])
    for index, at in enumerate(along[1:-1].tolist(), 1):
        if at - along[kept[-1]] >= _THINNED and last - at > _FROM_LAST:
            kept.append(index)
    return np.array([*kept, len(along) - 1])


# Neighbours


def _add_neighbours(roads: Roads, pieces: Sequence[_Piece]) -> None:
    """Pieces whose ends lie beside each other, the nearest on each side; only where both say so."""
    best: dict[tuple[int, str], tuple[float, int, bool]] = {}
    ends = np.array([[piece.points[0], piece.points[-1]] for piece in pieces])
    middle = np.array([piece.heading[len(piece.heading) // 2] for piece in pieces])
    reach = math.hypot(_BESIDE[1], _NEIGHBOUR_ALONG)
    for at in (0, 1):  # beside the start of a piece lies the start of another one, or the end of an opposite one
        same = at == 0
        for one, other in Nearby(ends[:, at], reach).pairs(ends[:, 0]):
            turn = _turn(middle[one], middle[other])
            fits = (one != other) & ((turn < _NEIGHBOUR_TURN) if same else (turn > np.pi - _NEIGHBOUR_TURN))
            for first, second in zip(one[fits].tolist(), other[fits].tolist(), strict=True):
                piece = pieces[first]
                if piece.line == pieces[second].line:
                    continue
                lateral = _lateral(piece, ends[second] if same else ends[second][::-1])
                if lateral is None:
                    continue
                key = (first, "left" if lateral > 0.0 else "right")
                best[key] = min(best.get(key, (math.inf, 0, False)), (abs(lateral), second, same))
    for (first, side), (_, second, same) in best.items():
        back = ("right" if side == "left" else "left") if same else side
        if best.get((second, back), (0.0, -1, False))[1] == first:
            setattr(roads.lanes[first], f"{side}_neighbour", (second, same))


def _lateral(piece: _Piece, others: Floats) -> float | None:
    """How far a piece with these ends is to the left of another, sum of both ends [m]; None: it is not beside it."""
    sides = []
    for at, place in ((0, others[0]), (-1, others[1])):
        v = place - piece.points[at]
        cos, sin = math.cos(piece.heading[at]), math.sin(piece.heading[at])
        left = float(v[1] * cos - v[0] * sin)
        if abs(float(v[0] * cos + v[1] * sin)) >= _NEIGHBOUR_ALONG or not _BESIDE[0] < abs(left) < _BESIDE[1]:
            return None
        sides.append(left)
    return sum(sides) if sides[0] * sides[1] > 0.0 else None
