"""Goals of recorded vehicles that do not tell the recorded time: a place, the recorded lanelets, or the turns alone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from interdrive.scenario.model import GoalState
from interdrive.scenario.native import core_shape
from interdrive.scenario.shape import Shape

if TYPE_CHECKING:
    from interdrive import _core
    from interdrive.array_types import Floats
    from interdrive.scenario.model import Scenario

#: What agents know of their recording.
Information: TypeAlias = Literal["timed", "place", "route", "turns"]

#: No agent wants to be slower than this on a free road [m/s].
_SPEED_MIN = 5.0
#: Vehicles that are nearer than this [m] and head the same way within this [rad] show how fast traffic is.
_NEAR, _SAME_WAY = 100.0, math.radians(60.0)
#: The vehicle ahead is at most so far beside the way, of the sum of both widths, and never farther than this [m]; it
#: heads elsewhere by at most this [rad]. Slower vehicles have no headway [m/s].
_AHEAD_WIDTHS, _AHEAD_BESIDE, _AHEAD_ANGLE, _HEADWAY_SPEED = 0.4, 3.0, 0.6, 3.0
#: A route without a goal is so long for each metre per second of desired speed [s], and at least so long [m].
_ROUTE_TIME, _ROUTE_LENGTH = 60.0, 600.0
#: A road leads out of the map if no other lane lies ahead of its end within this distance [m] and this angle [rad], ...
_BEYOND, _BEYOND_ANGLE = 60.0, math.radians(30.0)
#: ... and if it is longer than this [m] from its last fork: shorter ones are bays, and so is a drive way; a lane beside
#: one that leads out is none.
_BAY, _BAY_TYPES = 15.0, frozenset(("driveWay", "parking"))
#: Lanes are looked at every so many metres.
_SPACING = 3.0
#: The map ends for a vehicle this far [m] before its front leaves it, and at least the way of so many time steps.
_MAP_END, _MAP_END_STEPS = 6.0, 2.0


@dataclass(frozen=True)
class Temperament:
    """What a driver makes of the traffic around it when it starts.

    Attributes:
        free_weight: Share of the difference between its speed and that of faster traffic that it wants to make up.
        desired_factor: Factor on the desired speed that follows, and on speed limits.
    """

    free_weight: float = 1.0
    desired_factor: float = 1.0


def desired_speed(scenario: Scenario, row: int, time_step: int, limit: float, temper: Temperament) -> float:
    """Speed that a recorded vehicle wants to have on a free road, from what it could see at a time step [m/s].

    Args:
        scenario: With the recording.
        row: Of the vehicle.
        time_step: At which it is present.
        limit: Speed limit there [m/s]; inf: none.
        temper: Of its driver.
    """
    obstacles = scenario.obstacles
    there = obstacles.valid[:, time_step] & ~obstacles.is_static
    x, y, heading, speed = (
        table[:, time_step] for table in (obstacles.x, obstacles.y, obstacles.orientation, obstacles.velocity)
    )
    near = there & (np.hypot(x - x[row], y - y[row]) < _NEAR)
    near &= np.cos(heading - heading[row]) > math.cos(_SAME_WAY)
    near &= np.array([kind not in ("pedestrian", "bicycle") for kind in obstacles.kinds], dtype=np.bool_)
    near[row] = False
    own = max(0.0, float(speed[row]))
    traffic = float(np.median(speed[near])) if near.any() else own
    wanted = max(_SPEED_MIN, own + temper.free_weight * max(0.0, traffic - own))
    return temper.desired_factor * min(wanted, limit)


def headway_at(scenario: Scenario, row: int, time_step: int) -> float:
    """Time from a recorded vehicle to the one ahead of it at a time step [s]; nan without one, or where it is slow.

    Args:
        scenario: With the recording.
        row: Of the vehicle.
        time_step: At which it is present.
    """
    obstacles = scenario.obstacles
    speed = float(obstacles.velocity[row, time_step])
    if not speed > _HEADWAY_SPEED:
        return math.nan
    x, y, heading = (table[:, time_step] for table in (obstacles.x, obstacles.y, obstacles.orientation))
    dx, dy, turn = x - x[row], y - y[row], np.mod(heading - heading[row] + math.pi, 2.0 * math.pi) - math.pi
    along = dx * math.cos(heading[row]) + dy * math.sin(heading[row])
    across = dy * math.cos(heading[row]) - dx * math.sin(heading[row])
    # On an arc the way bends aside by half the angle.
    beside = np.abs(across - 0.5 * along * turn)
    near = np.flatnonzero((along > 0.0) & (along < _NEAR) & (np.abs(turn) < _AHEAD_ANGLE) & (beside < _AHEAD_BESIDE))
    extents = {int(other): core_shape(obstacles.shapes[other]).extent for other in (row, *near)}
    own_length, own_width = extents[row]
    gaps = [
        float(along[other]) - 0.5 * (own_length + extents[other][0])
        for other in near.tolist()
        if beside[other] < _AHEAD_WIDTHS * (own_width + extents[other][1])
    ]
    return max(min(gaps), 0.0) / speed if gaps else math.nan


def onwards(speed: float, first: int, last: int) -> GoalState:
    """The goal of a vehicle that goes on until a time step: any place, around a desired speed [m/s]."""
    last = max(last, first + 1)
    return GoalState(areas=(), lanelet_ids=(), time_step=(last, last), velocity=(0.0, 2.0 * speed))


def arrival(areas: tuple[Shape, ...], first: int, last: int) -> GoalState:
    """The goal of a vehicle that may arrive at any time."""
    return GoalState(areas=areas, lanelet_ids=(), time_step=(first + 1, max(first + 1, last - 1)))


def track_of(scenario: Scenario, row: int, time_step: int) -> Floats:
    """Recorded positions from a time step on [m], shape (points, 2)."""
    obstacles = scenario.obstacles
    steps = np.flatnonzero(obstacles.valid[row, time_step:]) + time_step
    return np.column_stack((obstacles.x[row, steps], obstacles.y[row, steps]))


def route_length(speed: float) -> float:
    """Length of a route without a goal [m], for a desired speed [m/s]."""
    return max(_ROUTE_LENGTH, _ROUTE_TIME * speed)


class MapEnds:
    """Where vehicles leave a map, looked up by lanelet."""

    def __init__(self, scenario: Scenario, road: _core.RoadNetwork) -> None:
        """Reads the map.

        Args:
            scenario: With the lanelets.
            road: The same.
        """
        self._lanelets, self._road, self._dt = scenario.lanelets, road, scenario.dt
        self._rows = {number: row for row, number in enumerate(scenario.lanelets.ids.tolist())}
        self._out: dict[int, bool] = {}
        self._lengths: dict[int, float] = {}
        self._led_from = {number for ids in scenario.lanelets.predecessors for number in ids}

    def areas(self, last_lanelet: int, length: float, speed: float) -> tuple[Shape, ...]:
        """Where a vehicle leaves the map, if the last lanelet of its route leads out of it.

        Args:
            last_lanelet: Its id.
            length: Of the vehicle [m].
            speed: Its desired speed [m/s].
        """
        return self._areas(self._side_by_side(last_lanelet), length, speed)

    def last_stretch(self, lanelet: int, size: float) -> tuple[Shape, ...]:
        """The last metres of a lanelet, or those around its middle where it ends earlier than the file says.

        Args:
            lanelet: Its id.
            size: How many metres [m].
        """
        length = self._length(lanelet)
        size = min(size, length)
        for s, before, after in ((length, size, 0.0), (0.5 * length, 0.5 * size, 0.5 * size)):
            found = [np.asarray(polygon) for polygon in self._road.lane_stretch(lanelet, s, before, after)]
            areas = tuple(Shape("polygon", vertices=polygon) for polygon in found if _is_area(polygon))
            if areas:
                return areas
        return ()

    def areas_anywhere(self, last_lanelet: int, length: float, speed: float, user: int) -> tuple[Shape, ...]:
        """The same, and all other places where a vehicle leaves the map that gets onto another way than its own.

        Those are at the edge of the map, on lanes for it; where a drive way or a parking bay ends it does not leave.

        Args:
            last_lanelet: Its id.
            length: Of the vehicle [m].
            speed: Its desired speed [m/s].
            user: Its kind, a position in `KINDS`.
        """
        if not self.areas(last_lanelet, length, speed):
            return ()
        own = self._side_by_side(last_lanelet)
        found = [n for n in self._rows if n in own or (self._road.admits(n, user) and self.leads_out(n))]
        return self._areas(found, length, speed)

    def leads_out(self, number: int) -> bool:
        """Whether a lanelet without successors ends at the edge of the map, and is more than a bay."""
        if number not in self._out:
            own = self._is_beyond(number)
            beside = [other for other in self._side_by_side(number) if self._end_together(number, other)]
            self._out[number] = own or (not self._is_for_bays(number) and any(map(self._is_beyond, beside)))
        return self._out[number]

    def _is_beyond(self, number: int) -> bool:
        return not self._is_bay(number) and not self._goes_on(number)

    def _is_for_bays(self, number: int) -> bool:
        return not _BAY_TYPES.isdisjoint(self._lanelets.types[self._rows[number]])

    def _is_bay(self, number: int) -> bool:
        lanelets, length, seen = self._lanelets, 0.0, {number}
        if self._is_for_bays(number):
            return True
        while length < _BAY:
            length += self._length(number)
            before = [n for n in lanelets.predecessors[self._rows[number]] if n in self._rows]
            if not before:
                return False  # what begins at the edge of the map is no bay of another road
            # Where ways come together, the longest one counts.
            number = max(before, key=self._length)
            if number in seen or len(lanelets.successors[self._rows[number]]) > 1:
                return length < _BAY
            seen.add(number)
        return False

    def _end_together(self, number: int, other: int) -> bool:
        """Whether two lanes beside each other end at the same edge of the map."""
        if self._lanelets.successors[self._rows[other]] or other in self._led_from:
            return False
        own, ahead = self._end(number)
        return abs(float(ahead @ (self._end(other)[0] - own))) < _MAP_END

    def _goes_on(self, number: int) -> bool:
        """Whether there is more of the map ahead of the end of a lanelet."""
        end, ahead = self._end(number)
        away = self._points - end
        along, across = away @ ahead, np.abs(away @ np.array([-ahead[1], ahead[0]]))
        # Not what ends beside it.
        near = (along > _MAP_END) & (along < _BEYOND) & (across < along * math.tan(_BEYOND_ANGLE))
        return bool(near.any())

    def _centre(self, number: int) -> Floats:
        row = self._rows[number]
        line: Floats = 0.5 * (self._lanelets.left[row] + self._lanelets.right[row])
        return line

    def _length(self, number: int) -> float:
        if number not in self._lengths:
            self._lengths[number] = float(np.hypot(*np.diff(self._centre(number), axis=0).T).sum())
        return self._lengths[number]

    def _end(self, number: int) -> tuple[Floats, Floats]:
        """The last point of a lanelet [m], and where it heads there."""
        line = self._centre(number)
        ahead = line[-1] - line[-2]
        return line[-1], ahead / max(float(np.hypot(*ahead)), 1e-9)

    @cached_property
    def _points(self) -> Floats:
        """Points in the middle of all lanelets, no farther apart than some metres [m], shape (points, 2)."""
        found = []
        for number in self._rows:
            line = self._centre(number)
            at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
            s = np.linspace(0.0, at[-1], max(2, math.ceil(at[-1] / _SPACING) + 1))
            found.append(np.column_stack([np.interp(s, at, line[:, axis]) for axis in (0, 1)]))
        return np.concatenate(found)

    def _areas(self, numbers: list[int], length: float, speed: float) -> tuple[Shape, ...]:
        """Those of some lanelets."""
        lanelets, found = self._lanelets, []
        before = 0.5 * length + max(_MAP_END, _MAP_END_STEPS * speed * self._dt)
        for number in numbers:
            if lanelets.successors[self._rows[number]] or number in self._led_from:
                continue
            found += [
                Shape("polygon", vertices=np.asarray(polygon))
                for polygon in self._road.lane_stretch(number, self._length(number), before, 0.0)
            ]
        return tuple(found)

    def _side_by_side(self, lanelet: int) -> list[int]:
        """A lanelet and those of its direction beside it."""
        lanelets, found = self._lanelets, [lanelet]
        for neighbours, same in (
            (lanelets.adjacent_left, lanelets.adjacent_left_same_direction),
            (lanelets.adjacent_right, lanelets.adjacent_right_same_direction),
        ):
            row = self._rows[lanelet]
            while same[row] and int(neighbours[row]) in self._rows and int(neighbours[row]) not in found:
                found.append(int(neighbours[row]))
                row = self._rows[found[-1]]
        return found


def _is_area(polygon: Floats) -> bool:
    """Whether the vertices of a polygon do not lie on a line."""
    x, y = (polygon - polygon[0]).T
    return bool(abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1))) > 1e-3)
