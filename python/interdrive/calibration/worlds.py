"""Stage B: drivers in the world, where their leaders are drivers too and mistakes add up."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.calibration.following import NOISY_JERK, TELLING_MIN
from interdrive.calibration.verdicts import PERSISTENCE_VEHICLES_MIN
from interdrive.config.plugins import Choice
from interdrive.errors import InterdriveError
from interdrive.scenario.native import core_road
from interdrive.traffic_realism import rollouts
from interdrive.traffic_realism.estimators import wasserstein
from interdrive.traffic_realism.jobs import done, planning_from
from interdrive.traffic_realism.measures import HORIZONS, measured
from interdrive.traffic_realism.persistence import Persistence, Thirds, persistence, thirds

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from interdrive.array_types import Floats
    from interdrive.config.drivers import Drivers
    from interdrive.config.schema import SimulationSettings
    from interdrive.traffic_realism.measures import WindowMeasures
    from interdrive.traffic_realism.windows import Window

#: So many windows of a place are driven, each so many times.
SHORT_WINDOWS, ROLLOUTS = 6, 2
#: Horizons that count, of `HORIZONS`, in s.
_HORIZONS = (1, 3, 5)
#: Weights of what long drives show: persistence, spread, and the share of vehicles that collide.
_PERSISTENCE_WEIGHT, _SPREAD_WEIGHT, _COLLISION_WEIGHT = 2.0, 2.0, 50.0


@dataclass(frozen=True)
class _Drive:
    """A window, and who drives in it."""

    window: Window
    settings: SimulationSettings
    agents: tuple[int, ...]
    is_long: bool
    seeds: tuple[int, ...]
    planner: str = ""
    drivers: Drivers | None = None


@dataclass(frozen=True)
class _Long:
    headways: Thirds
    collisions: int
    vehicles: int


class Worlds:
    """The objective of stage B: less is better."""

    def __init__(
        self,
        planner: str,
        short: Sequence[Window],
        long: Sequence[Window],
        settings: SimulationSettings,
        *,
        seed: int,
        workers: int,
    ) -> None:
        """Measures the recording.

        Args:
            planner: Name of the planner.
            short: Windows of a few seconds.
            long: Windows for safety and spread.
            settings: Of the runs.
            seed: Of what drivers draw.
            workers: Processes that share the windows.
        """
        self._planner, self._workers = planner, workers
        drives = [
            _Drive(window, planning_from(settings, window), (), is_long, (seed,) if is_long else seeds)
            for seeds in [tuple(seed + i for i in range(ROLLOUTS))]
            for is_long, windows in ((False, short), (True, long))
            for window in windows
        ]
        able = done(_planning, drives, workers, None, "routes")
        self._drives = [replace(one, agents=tuple(own)) for one, own in zip(drives, able, strict=True) if own]
        self._truth = list(done(_recorded, self._drives, workers, None, "recordings"))

    @property
    def n_long(self) -> int:
        """Number of long drives."""
        return sum(drive.is_long for drive in self._drives)

    def parts(self, drivers: Drivers, on_step: Callable[[str, int, int], None] | None = None) -> dict[str, float]:
        """What a population costs, by what it is bad at."""
        drives = [replace(one, planner=self._planner, drivers=drivers) for one in self._drives]
        found = list(done(_driven, drives, self._workers, on_step, "drives"))
        parts: dict[str, list[float]] = {}
        for place in dict.fromkeys(drive.window.place for drive in drives):
            chosen = [i for i, drive in enumerate(drives) if drive.window.place == place]
            own = [(found[i], self._truth[i]) for i in chosen if not drives[i].is_long]
            far = [(found[i], self._truth[i]) for i in chosen if drives[i].is_long]
            for name, value in {**_short_parts(own), **_long_parts(far)}.items():
                parts.setdefault(name, []).append(value)
        return {name: float(np.mean(values)) for name, values in parts.items()}


def _short_parts(pairs: Sequence[tuple[WindowMeasures, tuple[WindowMeasures, WindowMeasures]]]) -> dict[str, float]:
    """Scores over those of constant velocity, and distances of distributions over what varies in the recording."""
    if not pairs:
        return {}
    ratios = []
    for horizon in _HORIZONS:
        row = HORIZONS.index(horizon)
        for name in ("energy", "crps"):
            own, usual = (
                np.concatenate([getattr(part, name)[row] for part in parts])
                for parts in ([found for found, _ in pairs], [still for _, (_, still) in pairs])
            )
            known = np.isfinite(own) & np.isfinite(usual)
            if known.any():
                ratios.append(float(own[known].mean()) / max(float(usual[known].mean()), TELLING_MIN))
    parts = {"scores": float(np.mean(ratios))} if ratios else {}
    jerk = _samples([truth for _, (truth, _) in pairs], "jerk")
    is_noisy = len(jerk) > 1 and float(jerk.std()) > NOISY_JERK
    for name, weight in (("acceleration", 1.0), ("headway", 1.0), ("jerk", 0.5)):
        truth = _samples([truth for _, (truth, _) in pairs], name)
        if len(truth) > 1 and (name == "headway" or not is_noisy):
            distance = wasserstein(_samples([found for found, _ in pairs], name), truth)
            parts[name] = weight * distance / max(float(truth.std()), TELLING_MIN) / 3.0
    return parts


def _long_parts(pairs: Sequence[tuple[_Long, _Long]]) -> dict[str, float]:
    if not pairs:
        return {}
    own, truth = (persistence([pair[side].headways for pair in pairs]) for side in (0, 1))
    vehicles = sum(found.vehicles for found, _ in pairs)
    parts = {"collisions": _COLLISION_WEIGHT * sum(found.collisions for found, _ in pairs) / max(vehicles, 1)}
    if min(own.n_vehicles, truth.n_vehicles) >= PERSISTENCE_VEHICLES_MIN:
        parts |= _differences(own, truth)
    return parts


def _differences(own: Persistence, truth: Persistence) -> dict[str, float]:
    return {
        "persistence": _PERSISTENCE_WEIGHT * abs(own.persistence - truth.persistence),
        "spread": _SPREAD_WEIGHT * abs(own.spread - truth.spread),
    }


def _samples(parts: Sequence[WindowMeasures], name: str) -> Floats:
    return np.concatenate([part.samples[name] for part in parts])


def _planning(drive: _Drive, _attempt: int) -> list[int] | InterdriveError:
    """Exceptions are answers: raised in a process they would end it."""
    try:
        return rollouts.planning(drive.window, drive.settings)
    except InterdriveError as error:
        return error


def _judged(drive: _Drive) -> np.ndarray:
    return np.intersect1d(drive.window.judged, np.array(drive.agents, dtype=np.int64))


def _recorded(drive: _Drive, _attempt: int) -> Any:  # noqa: ANN401 - of short or long drives
    window, agents = drive.window, np.array(drive.agents, dtype=np.int64)
    truth = rollouts.recorded(window, _judged(drive))
    if drive.is_long:
        return _Long(thirds(truth.tracks, agents, window.start_point), 0, 0)
    road = core_road(window.scenario, drive.settings.road)
    still = rollouts.constant_velocity(window, truth.judged)
    return tuple(measured(window, truth, one, road) for one in (truth, still))


def _driven(drive: _Drive, _attempt: int) -> WindowMeasures | _Long | InterdriveError:
    try:
        window = drive.window
        planner = Choice(drive.planner, {"drivers": drive.drivers})
        found = rollouts.simulated(window, planner, drive.settings, drive.seeds, drive.agents)
        if drive.is_long:
            headways = thirds(found.tracks, np.array(drive.agents, dtype=np.int64), window.start_point)
            return _Long(headways, found.collisions + found.departures, found.n_agents)
        road = core_road(window.scenario, drive.settings.road)
        return measured(window, rollouts.recorded(window, found.judged), found, road)
    except InterdriveError as error:
        return error
