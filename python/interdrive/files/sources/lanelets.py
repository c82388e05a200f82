"""Lanes of a source as lanelets: what is too narrow, folded, closed, short or apart is put in order, and counted."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

from interdrive.files.convert import turned_bound
from interdrive.files.sources.polylines import SAME_POINT, distinct, length
from interdrive.scenario import Lanelets
from interdrive.scenario.limits import LARGEST_SPEED_LIMIT, LONGEST_LANELET

if TYPE_CHECKING:
    from interdrive.array_types import Floats
    from interdrive.files.sources.model import Lane, Roads
    from interdrive.files.sources.notes import Notes

#: A lane that is nowhere as wide as this is left out [m].
_NARROW = 0.5
#: No place of a lane is narrower than this [m]: a polygon of no width touches itself.
_LEAST_WIDTH = 0.1
#: Points of a border that runs against its lane lie this far apart [m].
_FOLDED = 0.02
#: A lane whose ends are nearer to each other than this is closed [m].
_CLOSED = 0.1
#: Pieces shorter than this are joined to the next [m].
_SHORT = 0.5
#: Borders of linked lanes are at most this far apart [m].
_GAP = 0.5
#: What is moved at an end is moved less and less over this length [m].
_BLEND = 5.0
#: Smallest unit of coordinates: decimals of metres.
DECIMALS = 4


@dataclasses.dataclass(frozen=True)
class Numbers:
    """What became of lanes, by their positions: the lanelets in which they begin and end."""

    first: dict[int, int]
    last: dict[int, int]


def lanelets_of(roads: Roads, notes: Notes) -> tuple[Lanelets, tuple[str, ...], Numbers]:
    """Lanelets with ids 1, 2, ... in the order of the lanes, and the key of each; coordinates have 4 decimals."""
    for lane in roads.lanes:
        if not (math.isnan(lane.speed_limit) or 0.0 < lane.speed_limit <= LARGEST_SPEED_LIMIT):
            notes.name("speed limits without a sensible value left out, lanes", lane.key)
            lane.speed_limit = math.nan
    lanes = [_cleaned(lane, left_hand=bool(roads.left_hand)) for lane in roads.lanes]
    order = _Network(lanes, roads.links)
    order.drop_narrow(notes)
    order.open_closed()
    order.join_short(notes)
    order.check_links(notes)
    order.check_neighbours()
    return *order.lanelets(), order.numbers()


class _Network:
    """Lanes by their positions, with links and neighbours, while they are put in order; None: left out."""

    def __init__(self, lanes: list[Lane | None], links: list[tuple[int, int]]) -> None:
        self.lanes = lanes
        self.links = list(dict.fromkeys(link for link in links if link[0] != link[1] or _is_closed(lanes[link[0]])))
        self.order = list(range(len(lanes)))
        #: Lanes that were cut, and their second halves; short ones, and what they were joined to.
        self.halves: dict[int, int] = {}
        self.joined: dict[int, int] = {}

    def drop_narrow(self, notes: Notes) -> None:
        for place, lane in enumerate(self.lanes):
            if lane is None:
                notes.leave_out("lanes", "shorter than 1 mm")
                self._bridge(place)
            elif float(np.hypot(*(lane.left - lane.right).T).max()) < _NARROW:
                notes.leave_out("lanes", f"narrower than {_NARROW:g} m")
                self.lanes[place] = None
            elif length(lane.left) > LONGEST_LANELET:
                notes.leave_out("lanes", "longer than 100 km")
                self.lanes[place] = None
            elif turned_bound(lane.left, lane.right) is not None:
                notes.leave_out("lanes", "turning back on itself")
                self.lanes[place] = None
        self._keep_links()

    def _bridge(self, place: int) -> None:
        """What leads to a lane of no length leads to what follows it."""
        before = [a for a, b in self.links if b == place != a]
        after = [b for a, b in self.links if a == place != b]
        self.links = [link for link in self.links if place not in link]
        self.links += [(a, b) for a in before for b in after if (a, b) not in self.links]

    def open_closed(self) -> None:
        """Cuts lanes whose end is their start in two."""
        halves: dict[int, int] = {}
        for place in list(self.order):
            lane = self.lanes[place]
            if lane is None or not _is_closed(lane) or len(lane.left) < 4:
                continue
            at = len(lane.left) // 2
            left, right = lane.left[: at + 1].copy(), lane.right[: at + 1].copy()
            self.lanes[place] = dataclasses.replace(lane, left=left, right=right)
            left, right = lane.left[at:].copy(), lane.right[at:].copy()
            self.lanes.append(dataclasses.replace(lane, key=f"{lane.key}+", left=left, right=right))
            halves[place] = len(self.lanes) - 1
            self.order.insert(self.order.index(place) + 1, halves[place])
        if not halves:
            return
        self.halves = halves
        self.links = [(halves.get(start, start), end) for start, end in self.links]
        self.links += list(halves.items())
        for place, second_place in halves.items():
            for side in ("left_neighbour", "right_neighbour"):
                self._cut_neighbour(place, second_place, side, halves)

    def _cut_neighbour(self, place: int, second: int, side: str, halves: dict[int, int]) -> None:
        """Halves lie beside the halves of what the whole lay beside; opposite ones the other way round."""
        one, other = self.lanes[place], self.lanes[second]
        beside = getattr(one, side)
        if one is None or other is None or beside is None:
            return
        if beside[0] not in halves:
            setattr(one, side, None)
            setattr(other, side, None)
            return
        pair = (beside[0], halves[beside[0]])
        first, last = pair if beside[1] else pair[::-1]
        setattr(one, side, (first, beside[1]))
        setattr(other, side, (last, beside[1]))

    def join_short(self, notes: Notes) -> None:
        """Joins short pieces to what follows, or precedes, if that holds for all lanes beside each other."""
        joined: set[int] = set()
        for place in self.order:
            lane = self.lanes[place]
            if place in joined or lane is None or not lane.road or not _is_short(lane):
                continue
            group = self._beside(place)
            joined |= group
            for ahead in (True, False):
                partners = self._partners(group, ahead=ahead)
                if partners is None:
                    continue
                for short, long in partners.items():
                    self._join(short, long)
                notes.leave_out("pieces of lanes", f"shorter than {_SHORT:g} m, joined to the next,", len(partners))
                break

    def _beside(self, place: int) -> set[int]:
        group, waiting = {place}, [place]
        while waiting:
            lane = self.lanes[waiting.pop()]
            for beside in (lane.left_neighbour, lane.right_neighbour) if lane is not None else ():
                if beside is not None and beside[0] not in group and self.lanes[beside[0]] is not None:
                    group.add(beside[0])
                    waiting.append(beside[0])
        return group

    def _partners(self, group: set[int], *, ahead: bool) -> dict[int, int] | None:
        """The one lane to which each of a group leads, along the road to one side of it; None: not one to one."""
        found: dict[int, int] = {}
        first = self.lanes[min(group)]
        for place in sorted(group):
            lane = self.lanes[place]
            if lane is None or first is None:
                return None
            same = float((lane.left[-1] - lane.left[0]) @ (first.left[-1] - first.left[0])) >= 0.0
            out = ahead is same
            others = [b if out else a for a, b in self.links if (a if out else b) == place]
            if len(others) != 1 or others[0] in group:
                return None
            back = [a if out else b for a, b in self.links if (b if out else a) == others[0]]
            other = self.lanes[others[0]]
            if back != [place] or other is None or other.road != lane.road or not _meets(lane, other, out=out):
                return None
            found[place] = others[0]
        return found if len(set(found.values())) == len(found) else None

    def _join(self, short: int, long: int) -> None:
        piece, lane = self.lanes[short], self.lanes[long]
        if piece is None or lane is None:
            return
        is_before = (short, long) in self.links
        parts = (piece, lane) if is_before else (lane, piece)
        left, right = (np.concatenate([getattr(part, side) for part in parts]) for side in ("left", "right"))
        self.lanes[long] = _cleaned(dataclasses.replace(lane, left=left, right=right), left_hand=False)
        self.lanes[short] = None
        self.joined[short] = long
        self.links = [(long if a == short else a, long if b == short else b) for a, b in self.links]
        self.links = [link for link in self.links if link[0] != link[1]]

    def check_links(self, notes: Notes) -> None:
        """Leaves out links between borders that do not meet, and moves the others until they do."""
        kept, gaps = [], []
        for start, end in self.links:
            one, other = self.lanes[start], self.lanes[end]
            if one is None or other is None:
                continue
            gap = _gap(one, other)
            if gap <= _GAP:
                kept.append((start, end))
            else:
                gaps.append((gap, one.key, other.key))
        self.links = kept
        if gaps:
            worst, start_key, end_key = max(gaps)
            far = f"{worst:.1f} m apart ({start_key} to {end_key})"
            if len(gaps) == 1:
                notes.say(f"1 link left out, whose ends are {far}")
            else:
                notes.say(f"{len(gaps)} links left out, whose ends are up to {far}")
        self._snap()

    def _snap(self) -> None:
        """Moves the ends of linked borders to the middle of all that meet there."""
        groups: dict[tuple[int, int], tuple[int, int]] = {}

        def root(end: tuple[int, int]) -> tuple[int, int]:
            while groups.setdefault(end, end) != end:
                end = groups[end]
            return end

        for start, end in self.links:
            groups[root((start, -1))] = root((end, 0))
        members: dict[tuple[int, int], list[tuple[int, int]]] = {}
        for one in list(groups):
            members.setdefault(root(one), []).append(one)
        for ends in members.values():
            for side in ("left", "right"):
                borders = [(getattr(self.lanes[place], side), at) for place, at in ends]
                middle = np.mean([border[at] for border, at in borders], axis=0)
                for border, at in borders:
                    _move_end(border, at, middle - border[at])

    def check_neighbours(self) -> None:
        """Neighbours are mutual or none."""
        for place in self.order:
            lane = self.lanes[place]
            if lane is None:
                continue
            for side, opposite in (("left", "right"), ("right", "left")):
                beside = getattr(lane, f"{side}_neighbour")
                if beside is None:
                    continue
                other = self.lanes[beside[0]]
                back = None if other is None else getattr(other, f"{opposite if beside[1] else side}_neighbour")
                if back != (place, beside[1]):
                    setattr(lane, f"{side}_neighbour", None)

    def _keep_links(self) -> None:
        self.links = [(a, b) for a, b in self.links if self.lanes[a] is not None and self.lanes[b] is not None]

    def numbers(self) -> Numbers:
        ids = self._ids()
        first: dict[int, int] = {}
        last: dict[int, int] = {}
        for place in range(len(self.lanes)):
            for found, end in ((first, place), (last, self.halves.get(place, place))):
                at = end
                while at in self.joined:
                    at = self.joined[at]
                if at in ids:
                    found[place] = ids[at]
        return Numbers(first, last)

    def _ids(self) -> dict[int, int]:
        places = (place for place in self.order if self.lanes[place] is not None)
        return {place: number for number, place in enumerate(places, 1)}

    def lanelets(self) -> tuple[Lanelets, tuple[str, ...]]:
        ids = self._ids()
        lanes = [lane for place in ids if (lane := self.lanes[place]) is not None]
        after: dict[int, list[int]] = {number: [] for number in ids.values()}
        before: dict[int, list[int]] = {number: [] for number in ids.values()}
        for start, end in self.links:
            after[ids[start]].append(ids[end])
            before[ids[end]].append(ids[start])

        def beside(side: str) -> tuple[list[int], list[bool]]:
            found = [getattr(lane, f"{side}_neighbour") for lane in lanes]
            return [-1 if one is None else ids[one[0]] for one in found], [bool(one and one[1]) for one in found]

        def lines(side: str) -> tuple[str, ...]:
            found = tuple(getattr(lane, f"{side}_line") for lane in lanes)
            return found if any(line != "unknown" for line in found) else ()

        (left, left_same), (right, right_same) = beside("left"), beside("right")
        return Lanelets(
            ids=np.arange(1, len(lanes) + 1, dtype=np.int64),
            left=tuple(np.round(lane.left, DECIMALS) + 0.0 for lane in lanes),
            right=tuple(np.round(lane.right, DECIMALS) + 0.0 for lane in lanes),
            predecessors=tuple(tuple(sorted(before[number])) for number in ids.values()),
            successors=tuple(tuple(sorted(after[number])) for number in ids.values()),
            adjacent_left=np.array(left, dtype=np.int64),
            adjacent_left_same_direction=np.array(left_same, dtype=np.bool_),
            adjacent_right=np.array(right, dtype=np.int64),
            adjacent_right_same_direction=np.array(right_same, dtype=np.bool_),
            speed_limit=np.array([lane.speed_limit for lane in lanes], dtype=np.float64),
            types=tuple((lane.kind,) for lane in lanes),
            left_marking=lines("left"),
            right_marking=lines("right"),
        ), tuple(lane.key for lane in lanes)


def _cleaned(lane: Lane, *, left_hand: bool) -> Lane | None:
    """The lane without repeated points, wide enough everywhere, and without folds; None: it has no length."""
    left, right = lane.left, lane.right
    keep = distinct(0.5 * (left + right))
    if keep.sum() < 2:
        return None
    left, right = left[keep].copy(), right[keep].copy()
    ahead = _directions(0.5 * (left + right))
    narrow = np.hypot(*(left - right).T) < _LEAST_WIDTH
    if narrow.any():
        at = np.vstack((ahead, ahead[-1:]))
        across = np.column_stack((-at[:, 1], at[:, 0]))
        if left_hand:
            left[narrow] = right[narrow] + _LEAST_WIDTH * across[narrow]
        else:
            right[narrow] = left[narrow] - _LEAST_WIDTH * across[narrow]
    return dataclasses.replace(lane, left=_unfolded(left, ahead), right=_unfolded(right, ahead))


def _directions(points: Floats) -> Floats:
    """Unit vector of each piece of a polyline, shape (points - 1, 2)."""
    steps = np.diff(points, axis=0)
    found: Floats = steps / np.maximum(np.hypot(*steps.T), 1e-12)[:, None]
    return found


def _unfolded(border: Floats, ahead: Floats) -> Floats:
    """A border that runs nowhere against the directions of its lane; its end stays where one of both passes leaves it.

    The first pass goes along the border, the second one, where the first moves the end, from there back.
    """
    along = (np.diff(border, axis=0) * ahead).sum(axis=1)
    if along.min() >= SAME_POINT:
        return border
    found, back = border.copy(), border.copy()
    for place in range(1, len(border)):
        if float((found[place] - found[place - 1]) @ ahead[place - 1]) < SAME_POINT:
            found[place] = found[place - 1] + _FOLDED * ahead[place - 1]
    if math.dist(found[-1], border[-1]) <= _GAP:
        return found
    for place in range(len(border) - 2, -1, -1):
        if float((back[place + 1] - back[place]) @ ahead[place]) < SAME_POINT:
            back[place] = back[place + 1] - _FOLDED * ahead[place]
    return back if math.dist(back[0], border[0]) <= _GAP else found


def _is_closed(lane: Lane | None) -> bool:
    return lane is not None and all(
        float(np.hypot(*(border[-1] - border[0]))) < _CLOSED and length(border) > 4.0 * _CLOSED
        for border in (lane.left, lane.right)
    )


def _is_short(lane: Lane) -> bool:
    return length(0.5 * (lane.left + lane.right)) < _SHORT


def _gap(one: Lane, other: Lane) -> float:
    return max(math.dist(one.left[-1], other.left[0]), math.dist(one.right[-1], other.right[0]))


def _meets(lane: Lane, other: Lane, *, out: bool) -> bool:
    return (_gap(lane, other) if out else _gap(other, lane)) <= _GAP


def _move_end(border: Floats, at: int, by: Floats) -> None:
    """Moves an end of a border, and what is near it less and less."""
    if not by.any():
        return
    steps = np.hypot(*np.diff(border, axis=0).T)
    along = np.concatenate(([0.0], np.cumsum(steps)))
    away = along if at == 0 else along[-1] - along
    over = min(_BLEND, 0.5 * along[-1])
    border += np.maximum(0.0, 1.0 - away / over)[:, None] * by
