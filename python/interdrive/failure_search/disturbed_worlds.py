"""Recordings with disturbed starts, speeds and errors."""

from __future__ import annotations

import math
import weakref
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from interdrive.scenario import STATE_FIELDS

if TYPE_CHECKING:
    from interdrive.array_types import Floats
    from interdrive.failure_search.disturbances import Disturbance, Error
    from interdrive.scenario import Obstacles, Scenario

#: Places of two of the state fields.
_ORIENTATION, _VELOCITY = STATE_FIELDS.index("orientation"), STATE_FIELDS.index("velocity")
#: A vehicle that has braked takes up its recorded speed with this [m/s²].
_RECOVERY = 2.0


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
        track = _track(obstacles, row, scenario.dt)
        states = _states(track, time, factor, error, obstacles.x.shape[1] - first)
        last = first + len(states["x"])
        valid[row, first:last] = True
        for name in STATE_FIELDS:
            tables[name][row, first:last] = states[name]
    return replace(scenario, obstacles=replace(obstacles, valid=valid, **tables))


#: By the identity of recordings that are in use: a reference to them, and the tracks of their rows.
_TRACKS: dict[int, tuple[weakref.ref[Obstacles], dict[int, _Track]]] = {}


def _track(obstacles: Obstacles, row: int, dt: float) -> _Track:
    """The track of a vehicle of a recording, made once."""
    number = id(obstacles)
    if number not in _TRACKS:
        _TRACKS[number] = weakref.ref(obstacles, lambda _: _TRACKS.pop(number, None)), {}
    known = _TRACKS[number][1]
    if row not in known:
        known[row] = _Track(obstacles, row, dt)
    return known[row]


class _Track:
    """The recorded states of a vehicle, as a function of time."""

    def __init__(self, obstacles: Obstacles, row: int, dt: float) -> None:
        there = np.flatnonzero(obstacles.valid[row])
        self.dt, self.end = dt, (len(there) - 1) * dt
        #: One row per state field.
        self.values = np.array([getattr(obstacles, name)[row, there] for name in STATE_FIELDS], dtype=np.float64)
        self.values[_ORIENTATION] = np.unwrap(self.values[_ORIENTATION])

    def at(self, times: Floats) -> dict[str, Floats]:
        """The states at times from its first one on [s]; before that straight back along its heading."""
        place = np.minimum(np.maximum(times, 0.0) / self.dt, self.values.shape[1] - 1.0)
        low = np.minimum(place.astype(np.int64), self.values.shape[1] - 2)
        share = place - low
        values = (1.0 - share) * self.values[:, low] + share * self.values[:, low + 1]
        if not (len(times) and times[0] <= 0.0):  # times ascend
            return dict(zip(STATE_FIELDS, values, strict=True))
        before = times <= 0.0
        states = dict(zip(STATE_FIELDS, np.where(before, self.values[:, :1], values), strict=True))
        back = np.where(before, states["velocity"] * times, 0.0)
        heading = float(self.values[_ORIENTATION, 0])
        states["x"] += back * math.cos(heading)
        states["y"] += back * math.sin(heading)
        for name in ("acceleration", "yaw_rate"):
            states[name][times < 0.0] = 0.0
        return states

    def velocity_at(self, time: float) -> float:
        """The velocity at one time [m/s]."""
        values = self.values[_VELOCITY]
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
