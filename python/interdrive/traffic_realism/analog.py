"""What recorded vehicles in a like situation did: a forecast without road and interaction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.traffic_realism.rollouts import moved, recorded
from interdrive.traffic_realism.tracks import GRID, HEADWAY_MAX, leaders

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.traffic_realism.rollouts import Rollouts
    from interdrive.traffic_realism.windows import Window

#: So many neighbours make a forecast.
_NEIGHBOURS = 24
#: Weights of speed, acceleration, headway, and speed of traffic minus own one.
_WEIGHTS = np.array([1.0, 1.5, 1.0, 0.5])
#: Vehicles of the same recording count if they start at least this much earlier or later [s].
_APART = 48.0
#: Without so many of the same place, those of other places are taken, too.
_POOL_MIN = 240
#: Points of the past that tell the acceleration, and the least number of points.
_PAST_POINTS, _PAST_MIN = 5, 4
#: Vehicles nearer than this [m] are the traffic around.
_NEAR = 100.0


@dataclass(frozen=True)
class Situations:
    """Judged vehicles at their starts, and what they did.

    Attributes:
        features: Speed [m/s], acceleration [m/s²], headway [s], speed of traffic minus own one [m/s], shape (n, 4).
        deviations: From constant velocity, in the frame of the start: along and across [m], heading [rad], speed [m/s],
            shape (4, n, points); nan once the recording is over.
        known: Points for which each is recorded, shape (n,).
        place: Number of the place of each.
        recording: Number of its recording.
        time: Of its start [s].
    """

    features: Floats
    deviations: Floats
    known: Ints
    place: Ints
    recording: Ints
    time: Floats


def situations(windows: Sequence[Window], judged: Sequence[Ints]) -> Situations:
    """All judged vehicles of windows.

    Args:
        windows: Where they start.
        judged: Their ids in each window.
    """
    places = {name: number for number, name in enumerate(dict.fromkeys(window.place for window in windows))}
    parts = [_situations_in(window, ids) for window, ids in zip(windows, judged, strict=True)]
    counts = [len(ids) for ids in judged]

    def each(values: list[float]) -> Floats:
        return np.repeat(np.array(values, dtype=np.float64), counts)

    return Situations(
        features=np.concatenate([features for features, _ in parts]),
        deviations=np.concatenate([deviations for _, deviations in parts], axis=1),
        known=np.concatenate([np.isfinite(deviations[0]).sum(axis=1) for _, deviations in parts]),
        place=each([places[window.place] for window in windows]).astype(np.int64),
        recording=each([window.recording for window in windows]).astype(np.int64),
        time=each([window.time for window in windows]),
    )


def _situations_in(window: Window, judged: Ints) -> tuple[Floats, Floats]:
    found = recorded(window, judged)
    x, y, heading, speed = found.states[0]
    tracks, at = found.tracks, window.start_point
    rows = tracks.rows(judged)
    acceleration = _slope(tracks.speed[rows, max(0, at - _PAST_POINTS) : at + 1])
    gap, _ = leaders(tracks.at(at), rows)
    headway = np.minimum(
        np.where(np.isfinite(gap[:, 0]), gap[:, 0], np.inf) / np.maximum(speed[:, 0], 1.0), HEADWAY_MAX
    )
    near = np.hypot(tracks.x[:, at] - tracks.x[rows, at, None], tracks.y[:, at] - tracks.y[rows, at, None]) < _NEAR
    near &= np.cos(tracks.heading[:, at] - tracks.heading[rows, at, None]) > 0.5
    near[np.arange(len(rows)), rows] = False
    traffic = np.array(
        [np.median(tracks.speed[one, at]) if one.any() else own for one, own in zip(near, speed[:, 0], strict=True)]
    )
    time = GRID * np.arange(x.shape[1])
    cos, sin = np.cos(heading[:, :1]), np.sin(heading[:, :1])
    dx, dy = x - x[:, :1], y - y[:, :1]
    turn = heading - heading[:, :1]
    deviations = np.stack(
        (
            dx * cos + dy * sin - speed[:, :1] * time,
            dy * cos - dx * sin,
            np.arctan2(np.sin(turn), np.cos(turn)),
            speed - speed[:, :1],
        )
    )
    gone = ~np.logical_and.accumulate(np.isfinite(x), axis=1)
    deviations[:, gone] = np.nan
    return np.column_stack((speed[:, 0], acceleration, headway, traffic - speed[:, 0])), deviations


def _slope(values: Floats) -> Floats:
    """Slope of straight lines through what is known of the past [1/s]; 0 where that is less than four values."""
    known = np.isfinite(values)
    known &= np.logical_and.accumulate(known[:, ::-1], axis=1)[:, ::-1]
    n = known.sum(axis=1)
    times = np.where(known, GRID * np.arange(values.shape[1]), 0.0)
    times = np.where(known, times - (times.sum(axis=1) / np.maximum(n, 1))[:, None], 0.0)
    with np.errstate(invalid="ignore"):
        slope = (times * np.where(known, values, 0.0)).sum(axis=1) / np.maximum((times**2).sum(axis=1), 1e-9)
    return np.where(n >= _PAST_MIN, slope, 0.0)


def analog(window: Window, judged: Ints, own: Bools, known: Situations) -> Rollouts | None:
    """Rollouts with the deviations of the nearest recorded vehicles; None if there are too few.

    Args:
        window: Where the vehicles start.
        judged: Their ids.
        own: Which of the situations they are.
        known: All situations.
    """
    place, recording, time = known.place[own][0], known.recording[own][0], known.time[own][0]
    is_far = (known.recording != recording) | (np.abs(known.time - time) >= _APART)
    pool = np.flatnonzero((known.place == place) & is_far)
    if len(pool) < _POOL_MIN:
        pool = np.flatnonzero((known.place != place) | is_far)
    if len(pool) < _NEIGHBOURS:
        return None
    scale = _WEIGHTS / np.maximum(known.features[pool].std(axis=0), 1e-6)
    states = recorded(window, judged).states[0]
    n_points = states.shape[2]
    found = np.full((_NEIGHBOURS, 4, len(judged), n_points), np.nan)
    seconds = GRID * np.arange(n_points)
    for i, (features, n_known) in enumerate(zip(known.features[own], known.known[own], strict=True)):
        distance = (((known.features[pool] - features) * scale) ** 2).sum(axis=1)
        longest = np.sort(known.known[pool])[-_NEIGHBOURS]
        distance[known.known[pool] < min(n_known, longest)] = np.inf
        nearest = pool[np.argsort(distance, kind="stable")[:_NEIGHBOURS]]
        along, across, turn, faster = known.deviations[:, nearest]
        x, y, heading, speed = states[:, i, 0]
        along = along + speed * seconds
        found[:, 0, i] = x + along * np.cos(heading) - across * np.sin(heading)
        found[:, 1, i] = y + along * np.sin(heading) + across * np.cos(heading)
        found[:, 2, i], found[:, 3, i] = heading + turn, speed + faster
    return moved(window, judged, found)
