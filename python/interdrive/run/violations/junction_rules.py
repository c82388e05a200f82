"""Rules at junctions: which vehicle goes first over an area that two ways share, and that no vehicle stands in one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from interdrive import _core
from interdrive.run.violations.drives import Drives, Row, stretches

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence, Set

    from interdrive.run.violations.lines import Passing
    from interdrive.run.violations.ways import Ways

#: The vehicle that goes first must not reach the area sooner than this after the other one has left [s] ...
GAP = 1.0
#: ... nor need, or show, this deceleration [m/s²] within this time [s], if it is so near [m].
HARD, HARD_TIME, HARD_REACH = 2.0, 3.0, 30.0
#: A vehicle that is already so near that stopping takes more than this when it enters the scene cannot wait [m/s²].
HARDEST = 3.0
#: Largest distance of a light's line before an area to which it belongs [m].
LINE_REACH = 60.0
#: Time of standing in an area after which it is blocked [s].
BLOCKING_TIME = 3.0


@dataclass(frozen=True)
class Use:
    """A vehicle on its way over an area.

    Attributes:
        vehicle: Its position among the drives. lanelet: The lanelet on which it takes it.
        entry: Distance travelled when its front reaches the area [m].
        enters: Column then; -inf before its first state, inf if it does not. leaves: The same for its rear and the end.
    """

    vehicle: int
    lanelet: int
    entry: float
    enters: float
    leaves: float


class Told(NamedTuple):
    """What agents were told about areas.

    Attributes:
        obeying: Ids of the agents that enter junctions when they are told to.
        waiting: Those that entered an area although they had been told to wait, with its number.
    """

    obeying: Set[int]
    waiting: Set[tuple[int, int]]

    def to_enter(self, agent: int, area: int) -> bool:
        """An agent that entered an area had been told to, or had never been told to wait for it."""
        return agent in self.obeying and (agent, area) not in self.waiting


def uses(drives: Drives, ways: Ways, areas: Mapping[str, Any]) -> list[tuple[list[Use], list[Use]]]:
    """For each area the vehicles that drive over it on either of its two lanelets."""
    found: list[tuple[list[Use], list[Use]]] = [([], []) for _ in areas["junction"]]
    sides: dict[int, list[tuple[int, int]]] = {}
    for area, lanelets in enumerate(areas["lanelet"].tolist()):
        for side, lanelet in enumerate(lanelets):
            sides.setdefault(lanelet, []).append((area, side))
    for k, taken in enumerate(ways.taken):
        half, wider = 0.5 * float(drives.length[k]), 0.5 * max(0.0, float(drives.width[k]) - _core.DESIGN_WIDTH)
        for way in taken:
            for area, side in sides.get(way.lanelet, ()):
                entry = ways.distance_at(k, way, float(areas["entry"][area, side]) - half - wider)
                end = ways.distance_at(k, way, float(areas["exit"][area, side]) + half + wider)
                use = Use(k, way.lanelet, entry, ways.column_at(k, entry), ways.column_at(k, end))
                found[area][side].append(use)
    return found


def right_of_way(
    drives: Drives,
    ways: Ways,
    areas: Mapping[str, Any],
    used: Sequence[tuple[list[Use], list[Use]]],
    passed: Sequence[Passing],
    collisions: Set[tuple[int, int]],
    road: _core.RoadNetwork,
) -> list[Row]:
    """Vehicles that entered an area although another one goes first and was too near; one row for each pair.

    Args:
        drives: Their motion.
        ways: The lanelets that they took.
        areas: The areas.
        used: The vehicles that drive over them.
        passed: The stop lines that they passed.
        collisions: Pairs of ids that ran into each other; another vehicle that leaves the road is not in the way.
        road: The road network.
    """
    lines: dict[int, list[Passing]] = {}
    for line in sorted(passed, key=lambda line: line.column):
        lines.setdefault(line.vehicle, []).append(line)
    rows: dict[tuple[int, int], Row] = {}
    for area, (first, aside) in enumerate(zip(areas["first"].tolist(), areas["side_by_side"].tolist(), strict=True)):
        if first < 0 or aside:
            continue
        for one in used[area][1 - first]:
            if not drives.sources[one.vehicle] or not np.isfinite(one.enters) or _began_too_near(drives, one):
                continue
            other = _next(drives, ways, one, used[area][first])
            if other is None or _is_held(ways, other, one.enters, lines.get(other.vehicle, ())):
                continue
            if (int(drives.ids[one.vehicle]), int(drives.ids[other.vehicle])) not in collisions:
                one = _until_gone(drives, one)  # noqa: PLW2901
            gap = (other.enters - one.leaves) * drives.dt if np.isfinite(other.enters) else 0.0
            is_near = (other.enters - one.leaves) * drives.dt < GAP and not _lets_pass(drives, one, other)
            if is_near or _is_hindered(drives, ways, one, other):
                last = int(np.flatnonzero(drives.valid[one.vehicle])[-1])
                columns = int(np.ceil(one.enters)), int(min(np.ceil(one.leaves), last))
                row = drives.row(
                    one.vehicle, "right_of_way", columns, max(gap, 0.0), road=road, lanelet=one.lanelet,
                    partner=int(drives.ids[other.vehicle]),
                )  # fmt: skip
                known = rows.setdefault((one.vehicle, other.vehicle), row)
                begin, end = min(known, row, key=_begin), max(known.last_time_step, row.last_time_step)
                value = min(known.value, row.value)
                rows[one.vehicle, other.vehicle] = begin._replace(last_time_step=end, value=value)
    return list(rows.values())


def _began_too_near(drives: Drives, use: Use) -> bool:
    """A vehicle could not stop before the area when it entered the scene."""
    speed = float(drives.velocity[use.vehicle, int(np.argmax(drives.valid[use.vehicle]))])
    return speed > 0.0 and speed * speed > 2.0 * HARDEST * use.entry


def _until_gone(drives: Drives, use: Use) -> Use:
    """An area is free when a vehicle in it leaves the road, at its goal or with the end of its recording."""
    if drives.valid[use.vehicle, -1]:
        return use
    return replace(use, leaves=min(use.leaves, float(np.flatnonzero(drives.valid[use.vehicle])[-1] + 1)))


def _begin(row: Row) -> int:
    return row.first_time_step


def _next(drives: Drives, ways: Ways, one: Use, others: Sequence[Use]) -> Use | None:
    """The nearest vehicle that goes first and comes to the area when a vehicle enters it."""
    column = int(one.enters)
    nearest, least = None, np.inf
    for other in others:
        k = other.vehicle
        if k == one.vehicle or not drives.valid[k, column] or other.enters <= one.enters:
            continue
        distance, speed = other.entry - ways.travelled[k, column], float(drives.velocity[k, column])
        if 0.0 < distance < least and distance <= max(_core.REACH, _core.REACH_TIME * speed):
            nearest, least = (other if speed > _core.JUDGED_STANDSTILL_SPEED else None), distance
    return nearest


def _is_held(ways: Ways, other: Use, instant: float, lines: Sequence[Passing]) -> bool:
    """A light told the vehicle that otherwise goes first to wait, or that vehicle has passed a red light."""
    near = [
        line
        for line in lines
        if line.column - 1 <= other.enters
        and other.entry - ways.travelled[other.vehicle, line.column] <= LINE_REACH
    ]  # fmt: skip
    return bool(near) and (near[-1].is_red or (near[-1].column > instant and near[-1].holds(int(instant))))


def _lets_pass(drives: Drives, one: Use, other: Use) -> bool:
    """A vehicle stands with its front in the area, and the other one passes."""
    if not other.enters < one.leaves:
        return False
    return bool(drives.velocity[one.vehicle, int(other.enters)] <= _core.JUDGED_STANDSTILL_SPEED)


def _is_hindered(drives: Drives, ways: Ways, one: Use, other: Use) -> bool:
    """The vehicle that goes first has to brake hard, or does."""
    k, dt = other.vehicle, drives.dt
    passes = _lets_pass(drives, one, other)
    begin = int(np.ceil(one.enters))
    before = int(one.enters)
    comes = float(drives.velocity[k, before]) * ((one.leaves - before) * dt + GAP)
    would_reach = comes > other.entry - float(ways.travelled[k, before])
    for column in range(begin, min(begin + round(HARD_TIME / dt) + 1, drives.valid.shape[1])):
        if not drives.valid[k, column] or column >= min(one.leaves, other.enters):
            break
        distance, left = other.entry - float(ways.travelled[k, column]), (one.leaves - column) * dt
        if distance > HARD_REACH:
            continue
        speed = float(drives.velocity[k, column])
        shows = would_reach and float(drives.acceleration[k, column]) <= -HARD
        if shows or (not passes and needed_deceleration(speed, distance, left) >= HARD):
            return True
    return False


def needed_deceleration(speed: float, distance: float, time: float) -> float:
    """The constant deceleration that keeps a vehicle from reaching a place sooner than after a time [m/s²].

    Args:
        speed: Its speed [m/s].
        distance: To the place [m].
        time: The time [s]; inf: it has to stop.
    """
    if distance <= 0.0:
        return np.inf
    if speed * time <= distance:
        return 0.0
    if 2.0 * distance <= speed * time:
        return speed * speed / (2.0 * distance)
    return 2.0 * (speed * time - distance) / (time * time)


def keep_clear(
    drives: Drives,
    areas: Mapping[str, Any],
    used: Sequence[tuple[list[Use], list[Use]]],
    told: Told,
    road: _core.RoadNetwork,
) -> list[Row]:
    """Vehicles that stood in an area that they had entered without being told to; one row for each stop.

    Args:
        drives: Their motion.
        areas: The areas.
        used: The vehicles that drive over them.
        told: What agents were told.
        road: The road network.
    """
    stops: dict[int, list[tuple[int, int]]] = {}
    for k in drives.judged:
        is_still = drives.valid[k] & (np.abs(drives.velocity[k]) < _core.JUDGED_STANDSTILL_SPEED)
        stops[k] = stretches(is_still, BLOCKING_TIME / drives.dt)
    rows: dict[tuple[int, int], Row] = {}
    for area, both in enumerate(used):
        for use in (*both[0], *both[1]):
            k = use.vehicle
            counts = drives.width[k] > areas["meeting_width"][area] and not areas["side_by_side"][area]
            if not stops.get(k) or not counts or not np.isfinite(use.enters):
                continue
            if told.to_enter(int(drives.ids[k]), area):
                continue
            for first, last in stops[k]:
                begin, end = max(first, int(np.ceil(use.enters))), int(min(last, use.leaves))
                if (end - begin + 1) * drives.dt >= BLOCKING_TIME - 1e-9 and (k, first) not in rows:
                    value = (end - begin + 1) * drives.dt
                    rows[k, first] = drives.row(
                        k, "keep_clear", (begin, end), value, road=road, lanelet=use.lanelet
                    )  # fmt: skip
    return list(rows.values())
