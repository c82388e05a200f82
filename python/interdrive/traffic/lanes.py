"""What a map offers to traffic: lanes by which vehicles enter and leave, ways at forks, lanes to fill."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from heapq import heappop, heappush
from typing import TYPE_CHECKING

import numpy as np

from interdrive.scenario.model import KINDS

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from interdrive import _core
    from interdrive.array_types import Floats
    from interdrive.scenario.known_goals import MapEnds
    from interdrive.scenario.model import Lanelets

#: Speed where no limit is stated [m/s]: 50 km/h, the usual limit in towns.
USUAL_LIMIT = 13.9
#: Vehicles enter only by lanes of this width [m] from which a way of this length [m] leads out of the map.
_WIDTH_MIN, _WAY_MIN = 2.0, 50.0
#: Where a way leads is judged by its heading after this distance [m].
_TURN_LENGTH = 20.0
#: Bends are measured over so many metres.
_BEND = 4
#: Lanes overlap others if one of their points, so far apart [m], lies in another one.
_SPACING = 5.0
#: Shorter lanelets are not filled [m].
_FILLED_MIN = 10.0
#: The kinds that generated vehicles have all use the lanes of cars.
_CAR = KINDS.index("car")


@dataclass(frozen=True)
class Chain:
    """Lanelets that follow each other without a fork and overlap no other one.

    Attributes:
        lanelet_ids: In driving order.
        length: Of all together [m].
        is_ring: The last one leads to the first one.
    """

    lanelet_ids: tuple[int, ...]
    length: float
    is_ring: bool


class LaneGraph:
    """The lanes of cars on a map, and how they are linked."""

    def __init__(self, lanelets: Lanelets, road: _core.RoadNetwork, ends: MapEnds) -> None:
        """Reads the map.

        Args:
            lanelets: As the file states them.
            road: The same in the core.
            ends: Where its roads lead out of it.
        """
        ids = lanelets.ids.tolist()
        self.row = {number: row for row, number in enumerate(ids)}
        self._lanelets, self._road, self._ends = lanelets, road, ends
        self._clear: dict[int, bool] = {}
        self._bend: dict[int, tuple[float, float]] = {}
        self._lines: dict[int, tuple[Floats, Floats, Floats]] = {}
        self._ways: dict[int, list[tuple[int, int]]] = {}
        self.ids = [number for number in ids if road.admits(number, _CAR)]
        admitted = set(self.ids)
        self.after = {number: sorted(admitted.intersection(road.successors(number))) for number in self.ids}
        self.before: dict[int, list[int]] = {number: [] for number in self.ids}
        for number in self.ids:
            for other in self.after[number]:
                self.before[other].append(number)

    def center(self, lanelet: int) -> Floats:
        """Centre line of a lanelet [m], shape (points, 2)."""
        row = self.row[lanelet]
        line: Floats = 0.5 * (self._lanelets.left[row] + self._lanelets.right[row])
        return line

    @cached_property
    def length(self) -> dict[int, float]:
        """Length of the centre line of each lanelet [m]."""
        return {number: float(np.hypot(*np.diff(self.center(number), axis=0).T).sum()) for number in self.ids}

    def limit(self, lanelet: int) -> float:
        """Speed limit of a lanelet [m/s]; `USUAL_LIMIT` where none is stated."""
        limit = float(self._lanelets.speed_limit[self.row[lanelet]])
        return USUAL_LIMIT if math.isnan(limit) else limit

    def place(self, lanelet: int, s: float) -> tuple[float, float, float]:
        """Position [m] and heading [rad] on the centre line at an arc length [m], also a little beyond its end."""
        if s > self.length[lanelet] + 1e-6 and self.after[lanelet]:
            return self.place(self.after[lanelet][0], s - self.length[lanelet])
        if lanelet not in self._lines:
            line = self.center(lanelet)
            steps = np.hypot(*np.diff(line, axis=0).T)
            self._lines[lanelet] = line, steps, np.concatenate([[0.0], np.cumsum(steps)])
        line, steps, at = self._lines[lanelet]
        i = int(np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(steps) - 1))
        x, y = line[i] + (line[i + 1] - line[i]) * (s - at[i]) / max(steps[i], 1e-9)
        dx, dy = line[i + 1] - line[i]
        return float(x), float(y), math.atan2(dy, dx)

    def beside(self, lanelet: int) -> list[int]:
        """The lanelets of the same direction right beside one."""
        row, lanes = self.row[lanelet], self._lanelets
        sides = (
            (lanes.adjacent_left, lanes.adjacent_left_same_direction),
            (lanes.adjacent_right, lanes.adjacent_right_same_direction),
        )
        return [
            int(ids[row]) for ids, same in sides if same[row] and int(ids[row]) in self.after and ids[row] != lanelet
        ]

    def _carriageway(self, lanelet: int) -> list[int]:
        """All lanelets of the same direction beside one, with itself."""
        found = [lanelet]
        for number in found:
            found += [other for other in self.beside(number) if other not in found]
        return found

    @cached_property
    def exits(self) -> frozenset[int]:
        """Lanelets that lead out of the map: nothing follows them and those beside them, nor lies ahead of their ends.

        Where none is such, all lanelets that nothing follows.
        """
        ends = [number for number in self.ids if not self.after[number]]
        ends = [n for n in ends if not any(self.after[other] for other in self._carriageway(n))]
        return frozenset(filter(self._ends.leads_out, ends)) or frozenset(ends)

    def onward(self, lanelet: int) -> list[int]:
        """Where a way goes on: successors, or the lanes beside one that ends."""
        if self.after[lanelet] or lanelet in self.exits:
            return self.after[lanelet]
        return [other for other in self.beside(lanelet) if self.after[other]]

    @cached_property
    def to_exit(self) -> dict[int, float]:
        """Shortest way from the start of a lanelet out of the map [m]; lanelets without such a way are not in it."""
        backward: dict[int, list[int]] = {}
        for number in self.ids:
            for other in self.onward(number):
                backward.setdefault(other, []).append(number)
        found: dict[int, float] = {}
        heap = [(self.length[number], number) for number in sorted(self.exits)]
        while heap:
            way, number = heappop(heap)
            if number in found:
                continue
            found[number] = way
            for other in backward.get(number, ()):
                own = self.length[other] if number in self.after[other] else 0.0
                heappush(heap, (way + own, other))
        return found

    @cached_property
    def entries(self) -> tuple[int, ...]:
        """Lanelets by which vehicles enter the map, ascending: nothing leads to them or to those beside them."""
        found = []
        for number in self.ids:
            if self.before[number] or any(self.before[other] for other in self._carriageway(number)):
                continue
            row = self.row[number]
            width = float(np.hypot(*(self._lanelets.left[row][0] - self._lanelets.right[row][0])))
            if width >= _WIDTH_MIN and self.to_exit.get(number, 0.0) >= _WAY_MIN:
                found.append(number)
        return tuple(found)

    def ways(self, lanelet: int) -> list[tuple[int, int]]:
        """Where traffic goes on from a lanelet, and the turn of each: 0 straight on, 1 to the left, 2 to the right.

        Lanelets that lead to no exit are left out, unless all do.
        """
        if lanelet not in self._ways:
            self._ways[lanelet] = self._turns(lanelet)
        return self._ways[lanelet]

    def leads_back(self, lanelet: int, driven: Collection[int]) -> bool:
        """Whether there is no way from a lanelet but to those that were driven already."""
        at, seen = lanelet, {lanelet}
        while at not in driven:
            ways = self.ways(at)
            if len(ways) != 1 or ways[0][0] in seen:
                return False
            at = ways[0][0]
            seen.add(at)
        return True

    def _turns(self, lanelet: int) -> list[tuple[int, int]]:
        onward = self.onward(lanelet)
        leading = [other for other in onward if other in self.to_exit] or onward
        if len(leading) < 2 or not self.after[lanelet]:
            return [(other, 0) for other in leading]
        turns = {other: self._turn(lanelet, other) for other in leading}
        straight = min(leading, key=lambda other: (abs(turns[other]), other))
        return [(other, 0 if other == straight else 1 if turns[other] > turns[straight] else 2) for other in leading]

    def sweep(self, lanelet: int, width: float, reach: float) -> float:
        """How far the front of a vehicle sweeps beyond the outer bound of a lanelet in its sharpest bend [m].

        Args:
            lanelet: Its id.
            width: Of the vehicle [m].
            reach: From its rear axle, which follows the middle of the lane, to its front [m].
        """
        curvature, lane_width = self._bends(lanelet)
        if curvature < 1e-3:
            return 0.0
        radius = 1.0 / curvature
        return math.hypot(radius + 0.5 * width, reach) - radius - 0.5 * lane_width

    def _bends(self, lanelet: int) -> tuple[float, float]:
        """Largest curvature of a lanelet over some metres [1/m], and its least width [m]."""
        if lanelet not in self._bend:
            line, row = self.center(lanelet), self.row[lanelet]
            at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
            s = np.linspace(0.0, at[-1], max(3, round(at[-1])))
            x, y = (np.interp(s, at, line[:, axis]) for axis in (0, 1))
            heading = np.unwrap(np.arctan2(np.diff(y), np.diff(x)))
            window = min(_BEND, len(heading) - 1)
            turned = np.abs(heading[window:] - heading[:-window]) / (window * (s[1] - s[0]))
            width = np.hypot(*(self._lanelets.left[row] - self._lanelets.right[row]).T).min()
            self._bend[lanelet] = float(turned.max()), float(width)
        return self._bend[lanelet]

    def _turn(self, lanelet: int, following: int) -> float:
        """How the heading changes over the first metres of a following lanelet [rad]."""
        *_, before = self.place(lanelet, self.length[lanelet])
        rest, at = _TURN_LENGTH, following
        while rest > self.length[at] and len(self.after[at]) == 1 and self.after[at][0] != following:
            rest -= self.length[at]
            at = self.after[at][0]
        *_, behind = self.place(at, min(rest, self.length[at]))
        return math.remainder(behind - before, math.tau)

    def chains(self) -> Iterator[Chain]:
        """The lanes that can be filled, in the order of their first lanelet."""
        clear = {number for number in self.ids if self.is_clear(number)}
        follows = {
            number: self.after[number][0]
            for number in clear
            if len(self.after[number]) == 1
            and self.after[number][0] in clear
            and len(self.before[self.after[number][0]]) == 1
        }
        behind = {other: number for number, other in follows.items()}
        done: set[int] = set()
        heads = [number for number in sorted(clear) if number not in behind]
        for head in [*heads, *sorted(clear)]:
            if head in done:
                continue
            chain = [head]
            while (other := follows.get(chain[-1])) is not None and other != head:
                chain.append(other)
            done.update(chain)
            length = sum(self.length[number] for number in chain)
            if length >= _FILLED_MIN:
                yield Chain(tuple(chain), length, follows.get(chain[-1]) == head)

    def is_clear(self, lanelet: int) -> bool:
        """Whether no other lanelet lies over the middle of a lanelet, and traffic has somewhere to go from it."""
        if lanelet not in self._clear:
            self._clear[lanelet] = self._lies_alone(lanelet)
        return self._clear[lanelet]

    def _lies_alone(self, lanelet: int) -> bool:
        if lanelet not in self.to_exit and not self.onward(lanelet):
            return False
        n = max(2, math.ceil(self.length[lanelet] / _SPACING))
        for i in range(n):
            x, y, _ = self.place(lanelet, (i + 0.5) * self.length[lanelet] / n)
            if any(other != lanelet for other in self._road.lanelets_at(x, y)):
                return False
        return True
