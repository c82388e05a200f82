"""How fast an agent gets along, beside its recording: share of lawful free flow over the same metres.

The metres are those that both drive along the agent's reference path. Its pace is the free-flow time for them over its
own time, so there is no deadline, and driving faster than the law allows gains nothing.
"""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from interdrive.scoring.free_flow import ACCELERATION, DECELERATION, SPACING, SPEED_MIN

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive import _core
    from interdrive.runs import Run

    Floats = NDArray[np.float64]

#: An agent is slow below this share of its recording's pace.
SLOW_SHARE = 0.8
#: Recordings that are shorter than this say nothing [m], and agents that drive less have the pace 0 [m].
RECORDED_MIN, DRIVEN_MIN = 10.0, 5.0
#: Metres count as driven from this far before them on [m].
REACHED = 0.5
#: Comfortable acceleration across of light and of heavy vehicles [m/s²].
ACROSS, ACROSS_HEAVY, HEAVY = 4.0, 3.0, ("truck", "bus", "bicycle")
#: A stated limit counts up to this far from where it is stated [m]; elsewhere it is this, or the first speed [m/s].
LIMIT_REACH, UNSTATED_LIMIT = 50.0, 15.0


def free_flow(bound: Floats, speed: float) -> Floats:
    """Times at which a vehicle alone on its way passes the points of a grid of `SPACING` [s].

    Args:
        bound: Speed that limits and curves allow at each point [m/s].
        speed: At the first point [m/s]; where it is above the bound, the vehicle brakes comfortably.
    """
    braking, gaining = 2.0 * DECELERATION * SPACING, 2.0 * ACCELERATION * SPACING
    allowed = bound.tolist()
    for k in range(len(allowed) - 2, -1, -1):
        allowed[k] = min(allowed[k], sqrt(allowed[k + 1] ** 2 + braking))
    driven = [speed]
    for k in range(1, len(allowed)):
        before = driven[-1] ** 2
        driven.append(max(min(allowed[k], sqrt(before + gaining)), sqrt(max(before - braking, 0.0))))
    mean = 0.5 * (np.array(driven[1:]) + np.array(driven[:-1]))
    return np.concatenate([[0.0], np.cumsum(SPACING / np.maximum(mean, SPEED_MIN))])


def paces(run: Run, i: int, route: _core.Route, road: _core.RoadNetwork) -> tuple[float, float]:
    """Pace of an agent, and of its recording, which is never above 1; nan where the recording is too short.

    A planning problem has no recording and is held against free flow, the pace 1. An agent that drives less than 5 m
    has the pace 0, its recording 1.
    """
    agent, states, obstacles, dt = run.agents[i], run.states, run.scenario.obstacles, run.scenario.dt
    row = int(np.searchsorted(states.participant_id, agent.id))
    recording = np.flatnonzero(obstacles.ids == agent.id)
    there = states.valid[row]
    seen = obstacles.valid[recording[0]] if len(recording) else there
    if there.sum() < 2 or seen.sum() < 2:
        return float("nan"), float("nan")
    own = _distance(route, states.x[row, there], states.y[row, there])
    recorded, wanted = own, route.goal_entry_s - route.start_s
    if len(recording):
        recorded = _distance(route, obstacles.x[recording[0], seen], obstacles.y[recording[0], seen])
        wanted = recorded[-1]
    if not wanted >= RECORDED_MIN:
        return float("nan"), float("nan")
    metres = min(own[-1], recorded[-1])
    if metres < DRIVEN_MIN:
        return 0.0, 1.0
    first_speed = max(float(states.velocity[row, there][0]), 0.0)
    times = free_flow(_bound(route, road, first_speed, heavy=states.kinds[row] in HEAVY), first_speed)
    free = float(np.interp(metres, SPACING * np.arange(len(times)), times))
    arrives = own[-1] >= recorded[-1] - REACHED
    seconds = (_first(own, metres) if arrives else len(own) - 1) * dt
    theirs = min(1.0, free / max(_first(recorded, metres) * dt, dt)) if len(recording) else 1.0
    return free / max(seconds, dt), theirs


def _distance(route: _core.Route, x: Floats, y: Floats) -> Floats:
    """Furthest way along the reference path so far [m]."""
    station, _ = route.project(np.ascontiguousarray(x), np.ascontiguousarray(y))
    station = np.where(np.isfinite(station), station, -np.inf)
    if len(station) and not np.isfinite(station[0]):
        station[0] = route.start_s
    furthest: Floats = np.maximum.accumulate(station)
    return furthest - furthest[:1]


def _first(distance: Floats, metres: float) -> int:
    """The first step at which a distance is driven."""
    return int(np.flatnonzero(distance >= metres - REACHED)[0])


def _bound(route: _core.Route, road: _core.RoadNetwork, first_speed: float, *, heavy: bool) -> Floats:
    """Speeds that limits and curves allow on the reference path, from the start on [m/s]."""
    way = np.arange(0.0, route.length, SPACING)
    path = route.reference_path
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    station = route.start_s + way
    x, y, heading = (
        np.interp(station, arc, values) for values in (path[:, 0], path[:, 1], route.reference_orientation)
    )
    limit, _ = road.lane_rules(x, y, heading)
    stated = np.flatnonzero(np.isfinite(limit) & (limit > 0.0))
    unstated = max(UNSTATED_LIMIT, first_speed)
    if len(stated):
        nearest = stated[np.abs(way[:, None] - way[stated][None, :]).argmin(axis=1)]
        limit = np.where(np.abs(way - way[nearest]) <= LIMIT_REACH, limit[nearest], unstated)
    else:
        limit = np.full(len(way), unstated)
    curvature = np.maximum(np.abs(np.interp(station, arc, route.reference_curvature)), 1e-6)
    bound: Floats = np.minimum(np.sqrt((ACROSS_HEAVY if heavy else ACROSS) / curvature), limit)
    return bound
