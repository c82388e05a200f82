"""Recordings with disturbed starts, speeds and errors, and whether such a world is plausible."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from interdrive.scenario import STATE_FIELDS
from interdrive.scenario.inspection import lanelets_at

if TYPE_CHECKING:
    from interdrive.array_types import Floats
    from interdrive.failure_search.disturbances import Disturbance, Error
    from interdrive.scenario import Obstacles, Scenario

#: A vehicle that has braked takes up its recorded speed with this [m/s²].
_RECOVERY = 2.0
#: A follower may have to brake so hard for the vehicle ahead at its start [m/s²]; sideways distance of followers [m].
_BRAKING_MAX, _LANE = 4.0, 2.0
#: Pairs farther apart than this are not looked at [m]; for so long they are thought to drive straight on [s].
_REACH, _STRAIGHT = 80.0, 3.0


def disturbed(scenario: Scenario, disturbance: Disturbance) -> Scenario:
    """The scenario with other tracks of the vehicles that are disturbed.

    A vehicle that starts earlier on its way than its recording comes straight along its first heading; behind its last
    state it is gone.
    """
    obstacles = scenario.obstacles
    tables = {name: getattr(obstacles, name).copy() for name in STATE_FIELDS}
    valid = obstacles.valid.copy()
    for who, time in disturbance.times.items():
        row = int(np.searchsorted(obstacles.ids, who))
        error = disturbance.error if disturbance.error is not None and disturbance.error.who == who else None
        factor = disturbance.speeds[who]
        if time == 0.0 and factor == 1.0 and (error is None or error.kind not in ("brakes", "drifts")):
            continue
        first = int(obstacles.valid[row].argmax())
        for name in STATE_FIELDS:
            tables[name][row, first:] = math.nan
        valid[row, first:] = False
        track = _Track(obstacles, row, scenario.dt)
        states = _states(track, time, factor, error, obstacles.x.shape[1] - first)
        last = first + len(states["x"])
        valid[row, first:last] = True
        for name in STATE_FIELDS:
            tables[name][row, first:last] = states[name]
    return replace(scenario, obstacles=replace(obstacles, valid=valid, **tables))


class _Track:
    """The recorded states of a vehicle, as a function of time."""

    def __init__(self, obstacles: Obstacles, row: int, dt: float) -> None:
        there = np.flatnonzero(obstacles.valid[row])
        self.dt, self.end = dt, (len(there) - 1) * dt
        self.columns = {
            name: np.asarray(getattr(obstacles, name)[row, there], dtype=np.float64) for name in STATE_FIELDS
        }
        self.columns["orientation"] = np.unwrap(self.columns["orientation"])

    def at(self, times: Floats) -> dict[str, Floats]:
        """The states at times from its first one on [s]; before that straight back along its heading."""
        before = times <= 0.0
        place = np.minimum(np.maximum(times, 0.0) / self.dt, len(self.columns["x"]) - 1.0)
        low = np.minimum(place.astype(np.int64), len(self.columns["x"]) - 2)
        share = place - low
        states = {
            name: np.where(before, values[0], (1.0 - share) * values[low] + share * values[low + 1])
            for name, values in self.columns.items()
        }
        back = np.where(before, states["velocity"] * times, 0.0)
        heading = float(self.columns["orientation"][0])
        states["x"] += back * math.cos(heading)
        states["y"] += back * math.sin(heading)
        for name in ("acceleration", "yaw_rate"):
            states[name][times < 0.0] = 0.0
        return states

    def velocity_at(self, time: float) -> float:
        """The velocity at one time [m/s]."""
        values = self.columns["velocity"]
        place = min(max(time, 0.0) / self.dt, len(values) - 1.0)
        low = min(int(place), len(values) - 2)
        return float((1.0 - (place - low)) * values[low] + (place - low) * values[low + 1])


def _states(track: _Track, time: float, factor: float, error: Error | None, n: int) -> dict[str, Floats]:
    """Its disturbed states, one per time step, up to the end of the recording."""
    elapsed: Floats = np.arange(n, dtype=np.float64) * track.dt
    if error is not None and error.kind == "brakes":
        paces = _braked_paces(track, time, factor, error, n)
    else:
        paces = np.full(n, factor)
    # Seconds of the recording that have passed; each sum rests on the one before it.
    passed = np.add.accumulate(np.concatenate(([time], paces[1:] * track.dt)))
    there = passed <= track.end + 1e-9
    paces, states = paces[there], track.at(passed[there])
    states["velocity"] = speed = paces * states["velocity"]
    states["acceleration"][:1] *= paces[:1] * paces[:1]
    states["acceleration"][1:] = np.diff(speed) / track.dt
    states["yaw_rate"] = paces * states["yaw_rate"]
    if error is not None and error.kind == "drifts":
        _drift(states, error, elapsed[there])
    return states


def _braked_paces(track: _Track, time: float, factor: float, error: Error, n: int) -> Floats:
    """Seconds of the recording that pass in a second at each time step, which braking slows down."""
    paces = np.full(n, factor)
    pace, passed = factor, time
    for step in range(n - 1):
        if passed > track.end + 1e-9:
            break
        elapsed, recorded = step * track.dt, max(track.velocity_at(passed), 0.0)
        if recorded > 0.0:
            wanted, speed = factor * recorded, pace * recorded
            if error.time <= elapsed < error.time + error.duration:
                wanted = max(speed - error.size * track.dt, 0.0)
            elif elapsed >= error.time + error.duration:
                wanted = min(wanted, speed + _RECOVERY * track.dt)
            pace = wanted / recorded
        paces[step + 1] = pace
        passed += pace * track.dt
    return paces


def _drift(states: dict[str, Floats], error: Error, elapsed: Floats) -> None:
    """Moves states sideways, smoothly within the duration of the error."""
    share = np.clip((elapsed - error.time) / error.duration, 0.0, 1.0)
    offset = error.size * share * share * (3.0 - 2.0 * share)
    rate = error.size * 6.0 * share * (1.0 - share) / error.duration
    heading, velocity = states["orientation"].copy(), states["velocity"]
    states["x"] -= offset * np.sin(heading)
    states["y"] += offset * np.cos(heading)
    moving = velocity > 1.0
    states["orientation"][moving] = heading[moving] + np.arctan2(rate[moving], velocity[moving])


def implausible(original: Scenario, changed: Scenario, moved: set[int]) -> str:
    """Why a disturbed world cannot have come about; "" if it can.

    A vehicle is off the road at its start; or, where this is not so in the recording, it overlaps another one then, one
    of both has to brake hard, or they touch straight on whichever brakes.
    """
    before, after = original.obstacles, changed.obstacles
    names = sorted(moved)
    rows = np.searchsorted(after.ids, names)
    starts = after.valid[rows].argmax(axis=1)
    lanelets = lanelets_at(changed.lanelets, after.x[rows, starts], after.y[rows, starts])
    for who, row, first, own in zip(names, rows.tolist(), starts.tolist(), lanelets, strict=True):
        if after.valid[row].sum() < 2:
            return f"{who} has no way left"
        if not own.any():
            return f"{who} starts off every lanelet"
        away = np.hypot(after.x[:, first] - after.x[row, first], after.y[:, first] - after.y[row, first])
        for other in np.flatnonzero(after.valid[:, first] & (away <= _REACH)).tolist():
            if other == row:
                continue
            number = int(after.ids[other])
            if _overlap(after, row, other, first) and not _overlap(before, row, other, first):
                return f"{who} and {number} overlap at the start"
            worst = max(_braking(after, row, other, first), _braking(after, other, row, first))
            recorded = max(_braking(before, row, other, first), _braking(before, other, row, first))
            if worst > _BRAKING_MAX >= recorded:
                return f"{who} or {number} has to brake with {worst:.1f} m/s² at the start"
            if _is_too_late(after, row, other, first) and not _is_too_late(before, row, other, first):
                return f"{who} and {number} touch, whichever brakes with {_BRAKING_MAX:g} m/s² at the start"
    return ""


def _size(obstacles: Obstacles, row: int) -> tuple[float, float]:
    """Length and width of a footprint [m]."""
    shape = obstacles.shapes[row]
    if len(shape.vertices):
        return float(np.ptp(shape.vertices[:, 0])), float(np.ptp(shape.vertices[:, 1]))
    return shape.length or 2.0 * shape.radius, shape.width or 2.0 * shape.radius


def _radius(obstacles: Obstacles, row: int) -> float:
    """How far a footprint reaches at most from its centre [m]."""
    return 0.5 * math.hypot(*_size(obstacles, row)) + 1e-9


def _corners(obstacles: Obstacles, row: int, column: int) -> Floats:
    """Corners of a footprint about its centre, in their order, shape (4, 2)."""
    length, width = _size(obstacles, row)
    heading = obstacles.orientation[row, column]
    along = 0.5 * length * np.array([math.cos(heading), math.sin(heading)])
    across = 0.5 * width * np.array([-math.sin(heading), math.cos(heading)])
    corners: Floats = np.array([along + across, along - across, -along - across, -along + across])
    return corners


def _centre(obstacles: Obstacles, row: int, column: int) -> Floats:
    return np.array([obstacles.x[row, column], obstacles.y[row, column]], dtype=np.float64)


def _overlap(obstacles: Obstacles, row: int, other: int, column: int) -> bool:
    """Whether two rectangles overlap at a time step."""
    if not (obstacles.valid[row, column] and obstacles.valid[other, column]):
        return False
    apart = _centre(obstacles, other, column) - _centre(obstacles, row, column)
    if math.hypot(*apart) > _radius(obstacles, row) + _radius(obstacles, other):
        return False
    return _touches(_corners(obstacles, row, column), _corners(obstacles, other, column), apart[None])


def _is_too_late(obstacles: Obstacles, row: int, other: int, column: int) -> bool:
    """Whether two vehicles that drive straight on touch, whichever of them brakes as hard as a follower may have to."""
    if not (obstacles.valid[row, column] and obstacles.valid[other, column]):
        return False
    speeds = (max(float(obstacles.velocity[number, column]), 0.0) for number in (row, other))
    reach = _STRAIGHT * sum(speeds) + _radius(obstacles, row) + _radius(obstacles, other)
    if math.hypot(*(_centre(obstacles, other, column) - _centre(obstacles, row, column))) > reach:
        return False
    bodies = _corners(obstacles, row, column), _corners(obstacles, other, column)
    centres = _centre(obstacles, row, column), _centre(obstacles, other, column)
    free, braked = (
        [_way(obstacles, number, column, braking) for number in (row, other)] for braking in (0.0, _BRAKING_MAX)
    )
    apart = centres[1] - centres[0]
    return _touches(*bodies, apart + free[1] - braked[0]) and _touches(*bodies, apart + braked[1] - free[0])


def _way(obstacles: Obstacles, row: int, column: int, braking: float) -> Floats:
    """How far a vehicle gets straight on, shape (times, 2) [m]."""
    time = np.arange(0.0, _STRAIGHT, 0.1)
    speed, heading = max(float(obstacles.velocity[row, column]), 0.0), obstacles.orientation[row, column]
    moving = time if braking == 0.0 else np.minimum(time, speed / braking)
    way: Floats = (speed * moving - 0.5 * braking * moving**2)[:, None] * np.array(
        [math.cos(heading), math.sin(heading)]
    )
    return way


def _touches(body: Floats, other: Floats, apart: Floats) -> bool:
    """Whether two rectangles overlap at one of some displacements: no side of either separates them."""
    overlaps = np.ones(len(apart), dtype=np.bool_)
    for side in (body[0] - body[1], body[1] - body[2], other[0] - other[1], other[1] - other[2]):
        first, second, shift = body @ side, other @ side, apart @ side
        overlaps &= (first.max() >= second.min() + shift) & (second.max() + shift >= first.min())
    return bool(overlaps.any())


def _braking(obstacles: Obstacles, follower: int, leader: int, column: int) -> float:
    """What the follower needs not to hit a leader on the same line [m/s²]; 0 if that is not its leader."""
    if not (obstacles.valid[follower, column] and obstacles.valid[leader, column]):
        return 0.0
    heading = obstacles.orientation[follower, column]
    dx = obstacles.x[leader, column] - obstacles.x[follower, column]
    dy = obstacles.y[leader, column] - obstacles.y[follower, column]
    along, across = dx * math.cos(heading) + dy * math.sin(heading), dy * math.cos(heading) - dx * math.sin(heading)
    turned = math.cos(obstacles.orientation[leader, column] - heading)
    closing = obstacles.velocity[follower, column] - obstacles.velocity[leader, column] * turned
    if along <= 0.0 or abs(across) > _LANE or turned < math.cos(math.pi / 4.0) or closing <= 0.0:
        return 0.0
    half = 0.5 * sum(_size(obstacles, row)[0] for row in (follower, leader))
    return float(closing * closing / (2.0 * max(along - half, 0.01)))
