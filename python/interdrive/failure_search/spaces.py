"""What a search may change: starts, speeds and drivers near an agent, an error of one, its senses, lost messages."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import TYPE_CHECKING, Annotated

import numpy as np

from interdrive.config.binding import bind, dotted
from interdrive.config.drivers import PARAMETERS, SETTINGS, TEMPERAMENT, read_drivers
from interdrive.errors import InputError
from interdrive.failure_search.disturbances import Disturbance, Error
from interdrive.files import content_of_input
from interdrive.storage.reading import decoded, parsed_toml

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from interdrive.array_types import Floats
    from interdrive.failure_search.disturbances import Pair

#: Errors of one other vehicle, each with one line of explanation.
ERRORS = {
    "brakes": "it brakes for no reason, and then goes on",
    "drifts": "it leaves the middle of its way to one side",
    "inattentive": "it does not look for a while, and goes on with the plan that it has",
    "disobeys": "it keeps no rules of the road",
    "replays": "it replays its recording and does not react",
}
#: Those of them that only a vehicle makes which is driven by a planner otherwise.
_OF_DRIVERS = ("inattentive", "disobeys", "replays")
#: The traffic of a search that replays its recordings.
RECORDED = "recorded"

#: Coordinates of the error, and of what the agent sees, behind those of the other vehicles.
_OF_ERROR = ("error", "error_by", "error_time", "error_size")
_OF_SIGHT = ("sight", "occlusion")
#: Settings of the view that are errors of perception, their largest values, and what says whether there are any, and
#: which.
_ERRORS_OF_PERCEPTION = ("delay", "position_error", "speed_error", "missed")
_LARGEST = {"delay": 10.0, "position_error": 100.0, "speed_error": 10.0}
_OF_PERCEPTION = ("perception", *_ERRORS_OF_PERCEPTION, "error_seed")
_SEEDS = 2**32
#: That of messages, where there are any.
_OF_MESSAGES = ("v2x_loss",)
#: Coordinates that choose among kinds: a neighbour of a point draws them anew, or leaves them.
CHOICES = ("error", "error_by", "occlusion", "perception", "error_seed")
#: Normal numbers of a driver lie within the ellipse that holds 99 % of all drivers; this is the 99 % quantile.
_RARE = 2.3263
_NORMAL = NormalDist()


@dataclass(frozen=True)
class Space:
    """Bounds of what a search changes.

    Attributes:
        start_time: The others start this much further along their recording [s].
        start_speed: Their speeds are multiplied by this.
        driver: What their drivers differ in: parameters of the population that the traffic's planner has; empty: in
            nothing.
        drivers: The population, as in `drivers=NAME` of traffic.
        quantiles: Bounds of the quantiles of the population that are drawn.
        errors: Errors of which at most one vehicle makes one, keys of `ERRORS`.
        error_share: Share of the runs in which one does.
        error_time: When it brakes, drifts or looks away, from its first state on [s].
        sight: Radius within which the agent sees [m].
        occlusion: Share of the runs in which it does not see through vehicles and buildings.
        perception: Share of the runs in which it perceives others with errors.
        delay: How late it perceives them [s].
        position_error: Standard deviation of the errors of their positions [m].
        speed_error: Standard deviation of the errors of their speeds, as a share.
        missed: Share of the time steps at which it does not perceive one that it sees.
        v2x_loss: Share of messages that are lost, where agents have V2X.
        others: Number of vehicles that are disturbed: those that come nearest to the agent.
    """

    start_time: Annotated[tuple[float, float], "s"] = (-2.0, 2.0)
    start_speed: tuple[float, float] = (0.8, 1.2)
    driver: tuple[str, ...] = ("time_gap", "acceleration")
    drivers: str = "house"
    quantiles: tuple[float, float] = (0.01, 0.99)
    errors: tuple[str, ...] = ("brakes", "drifts", "inattentive", "disobeys", "replays")
    error_share: float = 0.75
    error_time: Annotated[tuple[float, float], "s"] = (0.0, 8.0)
    sight: Annotated[tuple[float, float], "m"] = (30.0, 80.0)
    occlusion: float = 0.25
    perception: float = 0.25
    delay: Annotated[tuple[float, float], "s"] = (0.0, 0.3)
    position_error: Annotated[tuple[float, float], "m"] = (0.0, 0.5)
    speed_error: tuple[float, float] = (0.0, 0.1)
    missed: tuple[float, float] = (0.0, 0.2)
    v2x_loss: tuple[float, float] = (0.0, 1.0)
    others: int = 4

    def __post_init__(self) -> None:
        """Checks bounds and names."""
        bounds = {
            "start_time": self.start_time,
            "start_speed": self.start_speed,
            "sight": self.sight,
            "quantiles": self.quantiles,
            "error_time": self.error_time,
            "v2x_loss": self.v2x_loss,
            **{name: getattr(self, name) for name in _ERRORS_OF_PERCEPTION},
        }
        _check_bounds(bounds)
        if not self.quantiles[1] < 1.0:
            raise InputError("quantiles", f"must be below 1, is {self.quantiles[1]:g}")
        for name in self.errors:
            if name not in ERRORS:
                raise InputError("errors", f"there is no error {name}; there are {', '.join(ERRORS)}")
        drawn = [name for name in PARAMETERS if name not in TEMPERAMENT]
        for name in self.driver:
            if name not in drawn:
                raise InputError("driver", f"drivers do not differ in {name}; there are {', '.join(drawn)}")
        shares = [(name, getattr(self, name)) for name in ("error_share", "occlusion", "perception")]
        shares += [(name, bound) for name in ("missed", "v2x_loss") for bound in getattr(self, name)]
        for name, share in shares:
            if not 0.0 <= share <= 1.0:
                raise InputError(name, f"must be from 0 to 1, is {share:g}")
        if self.others < 1:
            raise InputError("others", f"must be positive, is {self.others}")

    @classmethod
    def read(cls, path: Path) -> Space:
        """The space of a TOML file with some of the attributes; the others have their defaults.

        Args:
            path: The file.

        Raises:
            InputError: The file does not exist, is not TOML, or says something that is no space.
        """
        content = content_of_input(path)
        try:
            values = dict(dotted(parsed_toml(decoded(content))))
        except ValueError as cause:
            raise InputError(f"{path}: not a TOML file: {cause}") from None
        try:
            return bind(cls(), values)
        except InputError as error:
            raise error.within(str(path)) from None

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates of a point, those of the other vehicles with their place, nearest first."""
        own = ("start_time", "start_speed", *self.driver)
        others = (f"{name}.{place}" for place in range(self.others) for name in own)
        return (*others, *_OF_ERROR, *_OF_SIGHT, *_OF_PERCEPTION, *(_OF_MESSAGES if self.v2x_loss[1] > 0.0 else ()))

    def with_traffic(self, traffic: str) -> Space:
        """The same without draws of drivers, and without errors of drivers, where the traffic has none.

        Raises:
            InputError: The space asks for them.
        """
        if traffic == RECORDED and set(self.errors) & set(_OF_DRIVERS):
            if self.errors != Space.errors:
                named = next(name for name in self.errors if name in _OF_DRIVERS)
                raise InputError("errors", f"{named} means nothing to traffic that replays its recording")
            return replace(self, errors=tuple(n for n in self.errors if n not in _OF_DRIVERS)).with_traffic(traffic)
        known = SETTINGS.get(traffic.partition(",")[0], {})
        able = tuple(name for name in self.driver if name in known)
        if able == self.driver:
            read_drivers(self.drivers)
            return self
        if self.driver != Space.driver:
            missing = ", ".join(name for name in self.driver if name not in known)
            raise InputError("driver", f"traffic {traffic} has no {missing} to draw")
        return replace(self, driver=able)

    def with_v2x(self, *, is_on: bool) -> Space:
        """The same without losses of messages where no vehicle sends any.

        Args:
            is_on: Agents have V2X.

        Raises:
            InputError: The space asks for them.
        """
        if is_on or self.v2x_loss[1] == 0.0:
            return self
        if self.v2x_loss != Space.v2x_loss:
            raise InputError("v2x_loss", "no vehicle has V2X; set v2x.penetration")
        return replace(self, v2x_loss=(0.0, 0.0))


def _check_bounds(bounds: dict[str, tuple[float, float]]) -> None:
    for name, (low, high) in bounds.items():
        if not -math.inf < low <= high < math.inf:
            raise InputError(name, f"needs two finite bounds, the lower one first, not {low:g} and {high:g}")
        if name in ("start_speed", "sight", "quantiles") and not low > 0.0:
            raise InputError(name, f"must be positive, is {low:g}")
        if name in ("error_time", *_ERRORS_OF_PERCEPTION) and not low >= 0.0:
            raise InputError(name, f"must not be negative, is {low:g}")
        if high > _LARGEST.get(name, math.inf):
            raise InputError(name, f"must be at most {_LARGEST[name]:g}, is {high:g}")


def with_drivers(traffic: str, space: Space) -> tuple[str, Space]:
    """Traffic without `drivers=NAME`, and the space that draws its drivers from that population.

    Raises:
        InputError: The space names another population.
    """
    parts = traffic.split(",")
    named = [part.partition("=")[2] for part in parts[1:] if part.startswith("drivers=")]
    if not named:
        return traffic, space
    if space.drivers not in (Space.drivers, named[-1]):
        raise InputError("drivers", f"the space names {space.drivers}, the traffic {named[-1]}")
    left = ",".join(part for part in parts if not part.startswith("drivers="))
    return left, replace(space, drivers=named[-1])


def undisturbed(space: Space) -> Floats:
    """The point of a space at which nothing is changed."""
    neutral = {
        "start_time": _back(0.0, space.start_time),
        "start_speed": _back(1.0, space.start_speed),
        **dict.fromkeys(space.driver, 0.5),
        **dict.fromkeys(_OF_ERROR, 0.0),
        **dict.fromkeys(("error", *_OF_SIGHT, "perception"), 1.0),
        **{name: _back(0.0, getattr(space, name)) for name in _ERRORS_OF_PERCEPTION},
        "error_seed": 0.0,
        "v2x_loss": _back(0.0, space.v2x_loss),
    }
    return np.array([neutral[name.partition(".")[0]] for name in space.coordinates])


def disturbance(space: Space, traffic: str, pair: Pair, point: Sequence[float] | Floats) -> Disturbance:
    """What a point means for a pair among the traffic of a planner; coordinates are from 0 to 1."""
    at = dict(zip(space.coordinates, (float(value) for value in point), strict=True))
    times, speeds, drivers, rare = {}, {}, {}, None
    for place, who in enumerate(pair.others):
        times[who] = _toward(at[f"start_time.{place}"], space.start_time, 0.0)
        speeds[who] = _toward(at[f"start_speed.{place}"], space.start_speed, 1.0)
        normal = {
            name: _NORMAL.inv_cdf(_toward(value, space.quantiles, 0.5))
            for name in space.driver
            if (value := at[f"{name}.{place}"]) != 0.5
        }
        if normal:
            drivers[who] = _driver(space, traffic, normal)
        if sum(z * z for z in normal.values()) > _ellipse(len(normal)):
            rare = who
    error = _error(space, pair, at)
    low, high = space.sight
    sight = None if at["sight"] >= 1.0 else low + (high - low) * at["sight"]
    lost = at.get("v2x_loss")
    loss = None if lost is None or lost == _back(0.0, space.v2x_loss) else _toward(lost, space.v2x_loss, 0.0)
    occluded = at["occlusion"] < space.occlusion
    return Disturbance(times, speeds, error, sight, occluded, drivers, rare, loss, _perception(space, at))


def _perception(space: Space, at: dict[str, float]) -> dict[str, float]:
    """Settings of the agent's view; empty if it perceives everything as it is."""
    if at["perception"] >= space.perception:
        return {}
    drawn = {name: _toward(at[name], getattr(space, name), 0.0) for name in _ERRORS_OF_PERCEPTION}
    found = {name: value for name, value in drawn.items() if value > 0.0}
    return {**found, "error_seed": int(at["error_seed"] * (_SEEDS - 1))} if found else {}


def _driver(space: Space, traffic: str, normal: dict[str, float]) -> dict[str, float]:
    """Settings of the traffic's planner for a driver with these normal numbers."""
    names = SETTINGS[traffic.partition(",")[0]]
    known = read_drivers(space.drivers).parameters
    return {names[name]: known[name].at(z) for name, z in normal.items() if name in known}


def _ellipse(n: int) -> float:
    """99 % quantile of the chi-squared distribution, after Wilson and Hilferty; 0 without degrees of freedom."""
    return n * (1.0 - 2.0 / (9.0 * n) + _RARE * math.sqrt(2.0 / (9.0 * n))) ** 3 if n else 0.0


def _error(space: Space, pair: Pair, at: dict[str, float]) -> Error | None:
    if not (at["error"] < space.error_share and space.errors):
        return None
    kinds, size = len(space.errors), at["error_size"]
    when = space.error_time[0] + (space.error_time[1] - space.error_time[0]) * at["error_time"]
    kind = space.errors[min(int(at["error"] / space.error_share * kinds), kinds - 1)]
    whom = pair.others[min(int(at["error_by"] * len(pair.others)), len(pair.others) - 1)]
    if kind == "brakes":
        return Error(kind, whom, when, 4.0 + 2.0 * size, 0.5 + 1.5 * size)
    if kind == "drifts":
        side = 1.0 if size >= 0.5 else -1.0
        return Error(kind, whom, when, side * (0.3 + 0.7 * abs(2.0 * size - 1.0)), 2.0)
    if kind == "inattentive":
        return Error(kind, whom, when, 0.0, 0.5 + 2.5 * size)
    return Error(kind, whom, 0.0, 0.0, 0.0)


def _back(neutral: float, bounds: tuple[float, float]) -> float:
    """Coordinate of the undisturbed value, or of the bound that is nearest to it."""
    low, high = bounds
    return 0.0 if high == low else min(max((neutral - low) / (high - low), 0.0), 1.0)


def _toward(coordinate: float, bounds: tuple[float, float], neutral: float) -> float:
    """The value of a coordinate; exactly the undisturbed one at its coordinate."""
    low, high = bounds
    if low <= neutral <= high and coordinate == _back(neutral, bounds):
        return neutral
    return low + (high - low) * coordinate
