"""When vehicles want to enter by a lane, and what they are: by the seed alone, whatever other lanes there are."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from interdrive.traffic import draws
from interdrive.traffic.settings import MIXED

if TYPE_CHECKING:
    from interdrive.array_types import Floats, Ints
    from interdrive.traffic.settings import TrafficSettings

#: Mean and standard deviation of length and width by kind [m].
_SIZES = {"car": (4.6, 0.3, 1.8, 0.08), "truck": (8.5, 1.5, 2.5, 0.0), "motorcycle": (2.2, 0.0, 0.8, 0.0)}
#: Bounds of what drivers draw.
_FACTORS, _GAPS = (0.6, 1.4), (0.8, 2.0)
#: The centre of a vehicle that enters is so far into its lane [m]: half of the longest lorry, and a metre.
ENTRY = 6.8


class Driver(NamedTuple):
    """Who drives a generated vehicle.

    Attributes:
        planner: Position of its planner in `TrafficSettings.planners`.
        speed_factor: Factor on speed limits.
        time_gap: Time gap to who drives ahead [s]; None: that of its planner.
    """

    planner: int
    speed_factor: float
    time_gap: float | None


class Wish(NamedTuple):
    """A vehicle before it has a way.

    Attributes:
        lane: The lanelet by which it enters, or in which it is from the beginning.
        number: Counts the vehicles of the lane.
        due: When it wants to enter [s].
        kind: "car", "truck" or "motorcycle".
        length: [m]. width: [m].
        driver: Who drives it.
        s: Where its centre is in its lane [m].
        speed: The most that it has there [m/s].
    """

    lane: int
    number: int
    due: float
    kind: str
    length: float
    width: float
    driver: Driver
    s: float = ENTRY
    speed: float = math.inf


@dataclass(frozen=True)
class Vehicles:
    """Vehicles of one lane, one entry each.

    Attributes:
        kinds: "car", "truck" or "motorcycle".
        length: [m]. width: [m].
        drivers: Who drives them.
    """

    kinds: tuple[str, ...]
    length: Floats
    width: Floats
    drivers: tuple[Driver, ...]


def due_times(settings: TrafficSettings, seed: int, lane: int, rate: float) -> Floats:
    """When vehicles want to enter by a lane [s]: their headways are exponential beyond the least one.

    Cowan, "Useful headway models", Transportation Research 9, 1975, doi 10.1016/0041-1647(75)90008-8.

    Args:
        settings: Of the traffic.
        seed: Of the run.
        lane: Its id.
        rate: Vehicles per hour, times the factors of `traffic.profile`.
    """
    if rate <= 0.0:
        return np.zeros(0)
    most = math.ceil(settings.duration / settings.min_headway) + 1
    if not settings.profile_steps:
        # Seldom more than these.
        enough = min(most, math.ceil(1.2 * rate * settings.duration / 3600.0) + 20)
        for n in (enough, most):
            drawn = -np.log1p(-draws.uniform(seed, draws.HEADWAY, lane, np.arange(n)))
            due = np.cumsum(settings.min_headway + (3600.0 / rate - settings.min_headway) * drawn)
            if due[-1] >= settings.duration:
                break
        return np.asarray(due[due < settings.duration])
    drawn = -np.log1p(-draws.uniform(seed, draws.HEADWAY, lane, np.arange(most)))
    found, now = [], 0.0
    for number in drawn.tolist():
        while (factor := _factor(settings, now)) == 0.0:
            now = min((time for time, _ in settings.profile_steps if time > now), default=math.inf)
        now += settings.min_headway + (3600.0 / (rate * factor) - settings.min_headway) * number
        if not now < settings.duration:
            break
        found.append(now)
    return np.array(found)


def _factor(settings: TrafficSettings, time: float) -> float:
    if math.isinf(time):
        return 1.0
    return next((factor for begin, factor in reversed(settings.profile_steps) if begin <= time), 1.0)


def vehicles(settings: TrafficSettings, seed: int, lane: int, numbers: Ints) -> Vehicles:
    """Kinds, sizes and drivers of vehicles of a lane.

    Args:
        settings: Of the traffic.
        seed: Of the run.
        lane: Its id.
        numbers: Which ones.
    """

    def drawn(what: int, mean: float | Floats, sd: float | Floats) -> Floats:
        values: Floats = mean + sd * draws.normal(seed, what, lane, numbers)
        return values

    place = _chosen(settings.mix, draws.uniform(seed, draws.KIND, lane, numbers))
    sizes = np.array([_SIZES[kind] for kind in MIXED])[place]
    factors = np.clip(drawn(draws.SPEED, *settings.speed_factor), *_FACTORS)
    gaps: list[float | None] = [None] * len(numbers)
    if settings.time_gap is not None:
        gaps = np.clip(drawn(draws.GAP, *settings.time_gap), *_GAPS).tolist()
    shares = tuple(share for _, share in settings.planners)
    planners = _chosen(shares, draws.uniform(seed, draws.PLANNER, lane, numbers))
    return Vehicles(
        kinds=tuple(MIXED[i] for i in place.tolist()),
        length=drawn(draws.LENGTH, sizes[:, 0], sizes[:, 1]),
        width=drawn(draws.WIDTH, sizes[:, 2], sizes[:, 3]),
        drivers=tuple(map(Driver._make, zip(planners.tolist(), factors.tolist(), gaps, strict=True))),
    )


def _chosen(shares: tuple[float, ...], drawn: Floats) -> Ints:
    """Positions in `shares`, for uniform numbers."""
    bounds = np.cumsum(shares) / sum(shares)
    found: Ints = np.minimum(np.searchsorted(bounds, drawn, side="right"), len(shares) - 1)
    return found
