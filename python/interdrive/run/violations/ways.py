"""Which lanelets vehicles took, told from where they were, and when they were where on them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Set

    from interdrive import _core
    from interdrive.array_types import Floats, Ints
    from interdrive.run.violations.drives import Drives
    from interdrive.scenario import Lanelets

#: A vehicle can only take lanelets that lead its way within this angle [rad].
ANGLE_MAX = 1.0
#: Distance for which a route is followed beyond the last state of a vehicle [m].
_BEYOND = 20.0
#: A shorter lanelet may have been passed between two states [m].
_SHORT = 5.0


@dataclass(frozen=True)
class TakenLanelet:
    """A lanelet that a vehicle took.

    Attributes:
        lanelet: Its id.
        columns: Columns in which the centre was on it; empty if the drive ended before. s: Arc length there [m].
        start: Distance travelled at the beginning of the lanelet [m]; only without columns.
    """

    lanelet: int
    columns: Ints
    s: Floats
    start: float = np.nan


class Ways:
    """The lanelets that each vehicle took, and how far it had come in each column.

    Attributes:
        taken: For each vehicle its lanelets, in the order of time.
        travelled: Distance travelled since its first state [m], shape (vehicles, columns); nan where absent.
    """

    taken: list[list[TakenLanelet]]
    travelled: Floats

    def __init__(
        self,
        drives: Drives,
        lanelets: Lanelets,
        road: _core.RoadNetwork,
        routes: Mapping[int, tuple[int, ...]],
        collided: Set[int],
    ) -> None:
        """Follows all vehicles.

        Args:
            drives: Their motion.
            lanelets: The lanelets.
            road: The same as a road network.
            routes: Lanelets of the routes of agents, by id: where they would have gone.
            collided: Ids of vehicles that ended in a collision; they are followed beyond their last state.
        """
        self._relations = _Relations(lanelets)
        self._valid = drives.valid
        self.travelled = _travelled(drives)
        below = _below(drives, road)
        self.taken = [
            self._of_vehicle(k, found, routes.get(number, ()), is_followed=number in collided)
            for k, (found, number) in enumerate(zip(below, drives.ids.tolist(), strict=True))
        ]

    def _of_vehicle(
        self, k: int, found: dict[int, tuple[Ints, Floats, Floats]], route: tuple[int, ...], *, is_followed: bool
    ) -> list[TakenLanelet]:
        """Lanelets below a vehicle on chains from where it or the road begins to where it or the road ends."""
        present = np.flatnonzero(self._valid[k])
        before, after = self._relations.before, self._relations.after
        starts = [i for i, (columns, *_) in found.items() if not before[i] or columns[0] == present[0]]
        ends = [i for i, (columns, *_) in found.items() if not after[i] or columns[-1] == present[-1]]
        passed = self._relations.reached(starts, after, found) & self._relations.reached(ends, before, found)

        def fits(lanelet: int) -> tuple[bool, int, float, int]:
            columns, _, d = found[lanelet]
            is_ahead = columns[-1] == present[-1] and lanelet in route
            return is_ahead, len(columns), -float(np.abs(d).mean()), -lanelet

        # Lanelets that begin or end together share ground; the vehicle took the one on which it was for longer. An
        # agent whose drive ended on such ground would have kept to its route.
        kept = [
            lanelet
            for lanelet in passed
            if all(fits(other) < fits(lanelet) for other in self._relations.siblings[lanelet] & passed)
        ]
        ways = [TakenLanelet(lanelet, *found[lanelet][:2]) for lanelet in kept]
        ways.sort(key=lambda way: (int(way.columns[0]), way.lanelet))
        return ways + (self._beyond(k, ways, present, route) if is_followed else [])

    def _beyond(self, k: int, ways: list[TakenLanelet], present: Ints, route: tuple[int, ...]) -> list[TakenLanelet]:
        """Where a route leads on from the last state."""
        last = next((way for way in reversed(ways) if way.columns[-1] == present[-1] and way.lanelet in route), None)
        if last is None:
            return []
        found: list[TakenLanelet] = []
        lanelet, start = last.lanelet, float(self.travelled[k, present[-1]] - last.s[-1])
        for following in route[route.index(last.lanelet) + 1 :]:
            start += self._relations.length[lanelet]
            is_far = start - self.travelled[k, present[-1]] > _BEYOND
            if following not in self._relations.successors[lanelet] or is_far:
                break
            found.append(TakenLanelet(following, np.empty(0, np.int64), np.empty(0), start))
            lanelet = following
        return found

    def distance_at(self, k: int, way: TakenLanelet, s: float) -> float:
        """The distance that a vehicle has travelled when its centre is at an arc length of a lanelet [m]."""
        if not len(way.columns):
            return way.start + s
        nearest = int(np.abs(way.s - s).argmin())
        return float(self.travelled[k, way.columns[nearest]] + s - way.s[nearest])

    def column_at(self, k: int, distance: float) -> float:
        """The column in which a vehicle has travelled a distance [m]; -inf before its first state, inf beyond."""
        present = np.flatnonzero(np.isfinite(self.travelled[k]))
        far = np.maximum.accumulate(self.travelled[k, present])
        if distance < far[0]:
            return -np.inf
        if distance > far[-1]:
            return np.inf
        place = int(np.searchsorted(far, distance))
        if place == 0:
            return float(present[0])
        share = (distance - far[place - 1]) / (far[place] - far[place - 1])
        return float(present[place - 1] + share * (present[place] - present[place - 1]))


class _Relations:
    """By ids: lanelets from and to which vehicles drive, lanelets that begin or end together; lengths [m]."""

    def __init__(self, lanelets: Lanelets) -> None:
        ids = lanelets.ids.tolist()
        # Files may name lanelets that they do not have.
        known = [
            {i: {*some} & {*ids} for i, some in zip(ids, lists, strict=True)}
            for lists in (lanelets.successors, lanelets.predecessors)
        ]
        self.successors, predecessors = known
        beside: dict[int, set[int]] = {number: set() for number in ids}
        for side in ("left", "right"):
            others = getattr(lanelets, f"adjacent_{side}").tolist()
            same = getattr(lanelets, f"adjacent_{side}_same_direction").tolist()
            for number, other, is_same in zip(ids, others, same, strict=True):
                if is_same and other in beside:
                    beside[number].add(other)
        self.before = {i: predecessors[i] | beside[i] if predecessors[i] else set() for i in ids}
        self.after = {i: self.successors[i] | beside[i] if self.successors[i] else set() for i in ids}
        forks = {i: {other for p in predecessors[i] for other in self.successors.get(p, ())} for i in ids}
        merges = {i: {other for s in self.successors[i] for other in predecessors.get(s, ())} for i in ids}
        self.siblings = {i: (forks[i] | merges[i]) - {i} - beside[i] for i in ids}
        self.length = {
            number: float(np.hypot(*np.diff(0.5 * (left + right), axis=0).T).sum())
            for number, left, right in zip(ids, lanelets.left, lanelets.right, strict=True)
        }

    def reached(self, starts: Iterable[int], nexts: Mapping[int, Set[int]], found: Collection[int]) -> set[int]:
        """Those found that chains of them lead to; short ones need not have been found."""
        seen = set(starts)
        left = list(seen)
        while left:
            new = {i for i in nexts[left.pop()] if i in found or self.length[i] < _SHORT} - seen
            seen |= new
            left += new
        return seen.intersection(found)


def _travelled(drives: Drives) -> Floats:
    """Distance along the heading since the first state; standing vehicles whose position is noisy do not get on."""
    travelled = np.full(drives.valid.shape, np.nan)
    for k in range(len(drives.ids)):
        present = np.flatnonzero(drives.valid[k])
        x, y, heading = (getattr(drives, name)[k, present] for name in ("x", "y", "orientation"))
        middle = np.stack([np.cos(heading), np.sin(heading)])
        middle = 0.5 * (middle[:, 1:] + middle[:, :-1])
        steps = np.diff(x) * middle[0] + np.diff(y) * middle[1]
        travelled[k, present] = np.concatenate([[0.0], np.cumsum(steps)])[: len(present)]
    return travelled


def _below(drives: Drives, road: _core.RoadNetwork) -> list[dict[int, tuple[Ints, Floats, Floats]]]:
    """For each vehicle the lanelets below its centre, with columns, arc lengths and offsets."""
    vehicle, column = np.nonzero(drives.valid)
    x, y, orientation = (getattr(drives, name)[vehicle, column] for name in ("x", "y", "orientation"))
    pose, lanelet, s, d = road.lanes_below(x, y, orientation, ANGLE_MAX)
    found: list[dict[int, tuple[Ints, Floats, Floats]]] = [{} for _ in drives.ids]
    order = np.lexsort((pose, lanelet, vehicle[pose]))
    keys = np.stack([vehicle[pose], lanelet])[:, order]
    borders = np.flatnonzero(np.any(np.diff(keys, axis=1) != 0, axis=0)) + 1
    for part in np.split(order, borders):
        if len(part):
            one = int(vehicle[pose[part[0]]])
            found[one][int(lanelet[part[0]])] = (column[pose[part]], s[part], d[part])
    return found
