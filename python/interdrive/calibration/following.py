"""Stage A: drivers behind recorded leaders, along their lane, all vehicles at once.

Nothing but the car-following law of `idm` is simulated, so thousands of populations can be tried. The leader is the one
that each vehicle has in the recording at that time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.config.drivers import HEADWAY_USUAL, HEADWAYS_KEPT, PARAMETERS
from interdrive.scenario.known_goals import Temperament, desired_speed
from interdrive.scenario.native import core_road
from interdrive.traffic_realism.estimators import crps, smooth, wasserstein
from interdrive.traffic_realism.rollouts import recorded
from interdrive.traffic_realism.tracks import GRID, HEADWAY_MAX, leaders

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.config.drivers import Drivers
    from interdrive.config.schema import SimulationSettings
    from interdrive.traffic_realism.windows import Window

#: Draws of each vehicle, and the waves of which noise consists, as in the core.
DRAWS, _WAVES = 4, 16
#: Points that are driven, and points of the past that filters see.
_POINTS, _PAST = 32, 6
#: Scores count after these times [s]; distributions at the points between the first and the last of these [s].
_HORIZONS, _FROM, _UNTIL = (1, 3, 5), 1.0, 5.0
#: Smaller scores [m, m/s] and standard deviations [m/s², s, m/s³] count as this one: what hardly moves tells nothing.
TELLING_MIN = 0.05
#: Gaps below this [m] are too small; this many more of them than recorded weigh as much.
_GAP_MIN, _GAP_WEIGHT = 0.3, 10.0
#: Recordings whose jerk varies more than this [m/s³] have noisy positions: their accelerations say nothing.
NOISY_JERK = 0.8
#: Slower vehicles have no headway that they keep [m/s].
_HEADWAY_SPEED = 3.0
#: As in the core: least gap [m] and speed [m/s] of the law, exponent, noise fades below this speed [m/s]; limits of
#: vehicles [m/s²].
_GAP_LEAST, _SPEED_LEAST, _EXPONENT, _SLOW, _LIMITS = 0.1, 0.01, 4.0, 2.0, (-9.0, 4.0)


@dataclass(frozen=True)
class Followers:
    """Judged vehicles of a place, along their ways; arrays have shape (n, points) from the start on.

    Attributes:
        place: Its name.
        way: Recorded way since the start [m], with the past before it, shape (n, past + points); nan where absent.
        speed: Recorded speed [m/s].
        gap: To the recorded leader [m]; nan without one.
        leader: Its speed [m/s].
        wanted: Desired speed for free weights 0 and 1 [m/s], shape (n, 2).
        known: Where the recording goes on without a gap.
    """

    place: str
    way: Floats
    speed: Floats
    gap: Floats
    leader: Floats
    wanted: Floats
    known: Bools

    @property
    def start(self) -> Floats:
        """Speed at the start [m/s]."""
        values: Floats = self.speed[:, 0]
        return values


def followers(place: str, windows: Sequence[Window], judged: Sequence[Ints], settings: SimulationSettings) -> Followers:
    """The judged vehicles of all windows of a place."""
    parts = [_in_window(window, ids, settings) for window, ids in zip(windows, judged, strict=True)]
    return Followers(place, *(np.concatenate(tables) for tables in zip(*parts, strict=True)))


def _in_window(window: Window, judged: Ints, settings: SimulationSettings) -> tuple[Floats, ...]:
    truth = recorded(window, judged)
    tracks, at = truth.tracks, window.start_point
    rows = tracks.rows(judged)
    x, y, heading, speed = (_cut(table, at) for table in tracks.stacked(rows))
    turn = np.arctan2(np.sin(np.diff(heading)), np.cos(np.diff(heading)))
    middle = heading[:, :-1] + 0.5 * turn
    steps = np.diff(x) * np.cos(middle) + np.diff(y) * np.sin(middle)
    way = np.full(x.shape, np.nan)
    way[:, _PAST] = 0.0
    way[:, _PAST + 1 :] = np.cumsum(steps[:, _PAST:], axis=1)
    way[:, :_PAST] = -np.cumsum(steps[:, :_PAST][:, ::-1], axis=1)[:, ::-1]
    gap, closing = (_cut(table, at)[:, _PAST:] for table in leaders(tracks, rows))
    speed = speed[:, _PAST:]
    obstacles, road = window.scenario.obstacles, core_road(window.scenario, settings.road)
    found = np.searchsorted(obstacles.ids, judged)
    limits = road.lane_rules(
        *(table[found, window.start] for table in (obstacles.x, obstacles.y, obstacles.orientation))
    )[0]
    limits = np.where(np.isnan(limits), np.inf, limits)
    wanted = np.array(
        [
            [
                desired_speed(window.scenario, row, window.start, float(limit), Temperament(free_weight=weight))
                for weight in (0.0, 1.0)
            ]
            for row, limit in zip(found.tolist(), limits.tolist(), strict=True)
        ]
    ).reshape(-1, 2)
    known = np.logical_and.accumulate(np.isfinite(way[:, _PAST:]), axis=1)
    return way, speed, gap, speed - closing, wanted, known


def _cut(table: Floats, at: int) -> Floats:
    """Points around a start; nan where there are none."""
    found = np.full((len(table), _PAST + _POINTS + 1), np.nan)
    first, last = max(0, at - _PAST), min(table.shape[1], at + _POINTS + 1)
    found[:, first - at + _PAST : last - at + _PAST] = table[:, first:last]
    return found


class Following:
    """The objective of stage A for a place: less is better, 1 is about as good as constant velocity."""

    def __init__(self, vehicles: Followers, seed: int) -> None:
        """Draws what all populations have in common.

        Args:
            vehicles: Of the place.
            seed: Of the draws.
        """
        n = len(vehicles.start)
        random = np.random.default_rng([seed, n])
        self.vehicles = vehicles
        self._z = random.standard_normal((len(PARAMETERS), DRAWS, n))
        self._omega = random.standard_normal((DRAWS, n, _WAVES))
        self._phase = random.uniform(0.0, 2.0 * np.pi, (DRAWS, n, _WAVES))
        self._truth = self._samples(vehicles.way, vehicles.gap, vehicles.speed)
        self.is_noisy = len(self._truth["jerk"]) > 1 and float(self._truth["jerk"].std()) > NOISY_JERK
        time = GRID * np.arange(_POINTS + 1)
        still = vehicles.start[:, None] * time
        self._usual = self._scores(still[None], np.broadcast_to(vehicles.start[:, None], still.shape)[None])
        self._close = self._share_close(vehicles.gap)
        with np.errstate(divide="ignore", invalid="ignore"):
            headway = np.clip(vehicles.gap[:, 0] / vehicles.start, *HEADWAYS_KEPT) / HEADWAY_USUAL
        self._headway = np.where(np.isfinite(headway) & (vehicles.start > _HEADWAY_SPEED), headway, 1.0)

    def objective(self, drivers: Drivers) -> float:
        """How far a population drives from the recording."""
        way, speed = self.driven(drivers)
        scores = self._scores(way, speed)
        total = sum(own / max(usual, TELLING_MIN) for own, usual in zip(scores, self._usual, strict=True)) / len(scores)
        vehicles = self.vehicles
        gap = vehicles.gap + vehicles.way[:, _PAST:] - way[0]
        samples = self._samples(np.concatenate((vehicles.way[:, :_PAST], way[0]), axis=1), gap, speed[0])
        for name, weight in (("acceleration", 1.0), ("headway", 1.0), ("jerk", 0.5)):
            truth = self._truth[name]
            if len(truth) > 1 and (name == "headway" or not self.is_noisy):
                total += weight * wasserstein(samples[name], truth) / max(float(truth.std()), TELLING_MIN) / 3.0
        return float(total + _GAP_WEIGHT * max(0.0, self._share_close(gap) - self._close))

    def driven(self, drivers: Drivers) -> tuple[Floats, Floats]:
        """Ways [m] and speeds [m/s] of all draws, shape (draws, n, points)."""
        vehicles = self.vehicles
        own = {
            name: drivers.parameters[name].many(self._z[row])
            for row, name in enumerate(PARAMETERS)
            if name in drivers.parameters
        }
        weight = own["free_weight"]
        if drivers.time_gap_kept > 0.0:
            one = drivers.parameters["time_gap"]
            own["time_gap"] = np.clip(own["time_gap"] * self._headway**drivers.time_gap_kept, one.low, one.high)
        wanted = own["desired_factor"] * (vehicles.wanted[:, 0] * (1.0 - weight) + vehicles.wanted[:, 1] * weight)
        wanted = np.maximum(wanted, _SPEED_LEAST)
        noise = self._noise(drivers)
        a, b = own["acceleration"], own["deceleration"]
        way, speed = np.zeros(a.shape), np.broadcast_to(np.maximum(vehicles.start, 0.0), a.shape).copy()
        ways, speeds = np.empty((*a.shape, _POINTS + 1)), np.empty((*a.shape, _POINTS + 1))
        recorded_way = vehicles.way[:, _PAST:]
        for point in range(_POINTS + 1):
            ways[..., point], speeds[..., point] = way, speed
            pace = speed / wanted
            over = -b * (1.0 - np.maximum(pace, 1.0) ** (-a * _EXPONENT / b))
            free = np.where(pace <= 1.0, a * (1.0 - np.minimum(pace, 1.0) ** _EXPONENT), over)
            gap = np.maximum(vehicles.gap[:, point] + recorded_way[:, point] - way, _GAP_LEAST)
            approach = (speed - vehicles.leader[:, point]) / (2.0 * np.sqrt(a * b))
            desired_gap = own["minimum_gap"] + np.maximum(speed * (own["time_gap"] + approach), 0.0)
            ratio = np.where(np.isfinite(gap), (desired_gap / gap) ** 2, 0.0)
            wish = _combined(free, ratio, a, drivers.improved)
            wish = np.where(
                wish < -_core.EXPECTED_DECELERATION, wish, wish + noise[..., point] * np.minimum(speed / _SLOW, 1.0)
            )
            wish = np.clip(wish, *_LIMITS)
            later = speed + wish * GRID
            stops = 0.5 * speed**2 / np.maximum(-wish, 1e-9)
            way = way + np.where(later >= 0.0, (speed + 0.5 * wish * GRID) * GRID, stops)
            speed = np.maximum(later, 0.0)
        return ways, speeds

    def _noise(self, drivers: Drivers) -> Floats:
        time = GRID * np.arange(_POINTS + 1)
        if drivers.noise <= 0.0:
            return np.zeros((*self._omega.shape[:2], len(time)))
        sums = np.zeros((*self._omega.shape[:2], len(time)))
        for wave in range(_WAVES):
            omega = self._omega[..., wave] / drivers.noise_length
            sums += np.cos(omega[..., None] * time + self._phase[..., wave, None])
        found: Floats = drivers.noise * np.sqrt(2.0 / _WAVES) * sums
        return found

    def _scores(self, way: Floats, speed: Floats) -> list[float]:
        """Energy score of the way and CRPS of the speed at each horizon."""
        found = []
        for horizon in _HORIZONS:
            point = round(horizon / GRID)
            known = self.vehicles.known[:, point]
            for own, truth in ((way, self.vehicles.way[:, _PAST:]), (speed, self.vehicles.speed)):
                scores = crps(own[:, known, point], truth[known, point])
                found.append(float(scores.mean()) if known.any() else 0.0)
        return found

    def _samples(self, way: Floats, gap: Floats, speed: Floats) -> dict[str, Floats]:
        """Accelerations, jerks and headways where the recording goes on."""
        points = slice(round(_FROM / GRID), round(_UNTIL / GRID) + 1)
        known = self.vehicles.known[:, points]
        with np.errstate(divide="ignore", invalid="ignore"):
            headway = np.where(speed > 1.0, np.minimum(gap / speed, HEADWAY_MAX), np.nan)
        tables = {
            "acceleration": smooth(way, GRID, 9, 2, 2)[:, _PAST:],
            "jerk": smooth(way, GRID, 13, 3, 3)[:, _PAST:],
            "headway": headway,
        }
        cut = {name: table[:, points] for name, table in tables.items()}
        return {name: table[known & np.isfinite(table)] for name, table in cut.items()}

    def _share_close(self, gap: Floats) -> float:
        there = self.vehicles.known & np.isfinite(gap)
        return float((gap[there] < _GAP_MIN).mean()) if there.any() else 0.0


def _combined(free: Floats, ratio: Floats, acceleration: Floats, improved: float) -> Floats:
    """The free acceleration with what the leader takes away from it, as in the core; ratio: (s* / s)²."""
    plain = free - acceleration * ratio
    if improved <= 0.0:
        return plain
    near = np.minimum(free, 0.0) + acceleration * (1.0 - ratio)
    exponent = acceleration / np.where(free > 0.0, free, 1.0)
    far = np.where(free > 0.0, free * (1.0 - np.minimum(ratio, 1.0) ** exponent), free)
    found: Floats = plain + improved * (np.where(ratio < 1.0, far, near) - plain)
    return found
