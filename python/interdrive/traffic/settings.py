"""Settings of generated traffic."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, TypeVar

from interdrive.errors import InputError

T = TypeVar("T", int, float)

#: An hour [s].
_HOUR = 3600.0
#: Kinds of generated vehicles, in the order of `TrafficSettings.mix`.
MIXED = ("car", "truck", "motorcycle")


@dataclass(frozen=True)
class TrafficSettings:
    """Vehicles that enter the map, drive through it and leave it; there are none unless a rate or a density is set.

    Attributes:
        rate: Vehicles that want to enter by every lane that begins at the edge of the map, per hour.
        rates: Rates of single lanes, as LANELET:RATE, in the place of `rate`.
        profile: Factors on all rates from a time on, as SECONDS:FACTOR; before the first one the factor is 1.
        density: Vehicles per km and lane at the first time step; none: as many as the rate makes at free speed. 0: the
            map begins empty.
        duration: How long vehicles want to enter.
        warm_up: Flows, speeds and queues are counted from then on.
        planner: Their planner, or a mix such as rollout:0.7+idm_mobil:0.3. Its settings are those under `planner`.
        min_headway: Shortest time between two vehicles that want to enter by one lane.
        turn: Shares of vehicles that go straight on, to the left and to the right at forks, of the ways that there are.
        mix: Shares of cars, trucks and motorcycles.
        speed_factor: Mean and standard deviation of the factor on speed limits, drawn per driver within 0.6 and 1.4.
        time_gap: Mean and standard deviation of the time gap, drawn per driver within 0.8 and 2.0, for planners that
            have such a setting; none: they keep their own.
    """

    rate: Annotated[float, "1/h"] = 0.0
    rates: tuple[str, ...] = ()
    profile: tuple[str, ...] = ()
    density: Annotated[float | None, "1/km"] = None
    duration: Annotated[float, "s"] = 60.0
    warm_up: Annotated[float, "s"] = 0.0
    planner: str = "rollout"
    min_headway: Annotated[float, "s"] = 1.5
    turn: tuple[float, float, float] = (0.7, 0.15, 0.15)
    mix: tuple[float, float, float] = (0.88, 0.1, 0.02)
    speed_factor: tuple[float, float] = (1.0, 0.1)
    time_gap: Annotated[tuple[float, float] | None, "s"] = (1.2, 0.2)

    def __post_init__(self) -> None:
        """Checks the ranges."""
        for name, least, most in (
            ("duration", 0.0, 1e5),
            ("warm_up", 0.0, 1e5),
            ("min_headway", 0.1, 60.0),
            ("density", 0.0, 500.0),
        ):
            value = getattr(self, name)
            if value is not None and not least <= value <= most:
                raise InputError(name, f"must be at least {least:g} and at most {most:g}, not {value}")
        if self.duration == 0.0:
            raise InputError("duration", "must be above 0: in no time no vehicle enters")
        for name in ("turn", "mix"):
            shares = getattr(self, name)
            if not all(share >= 0.0 and math.isfinite(share) for share in shares) or not sum(shares) > 0.0:
                raise InputError(name, f"must be shares of at least 0 that are not all 0, not {shares}")
        for name in ("speed_factor", "time_gap"):
            drawn = getattr(self, name)
            if drawn is None:
                continue
            mean, sd = drawn
            if not (0.1 <= mean <= 10.0 and 0.0 <= sd <= 10.0):
                raise InputError(name, f"must be a mean from 0.1 to 10 and a deviation from 0 to 10, not {mean}, {sd}")
        _ = self.planners
        factor = max([1.0, *(value for _, value in self.profile_steps)])
        for lane, rate in [(None, self.rate), *self.lane_rates.items()]:
            self._check_rate(lane, rate, factor)

    def _check_rate(self, lane: int | None, rate: float, factor: float) -> None:
        most = _HOUR / self.min_headway
        if not 0.0 <= rate * factor < most:
            where = "" if lane is None else f" of lanelet {lane}"
            times = f" times {factor:g} (traffic.profile)" if factor > 1.0 else ""
            raise InputError(
                "rate" if lane is None else "rates",
                f"the rate{where} must be at least 0 and below {most:g} vehicles per hour (3600 s / "
                f"traffic.min_headway), not {rate:g}{times}",
            )

    @property
    def is_on(self) -> bool:
        """Whether there is any generated traffic."""
        return bool(self.rate > 0.0 or self.density or any(rate > 0.0 for rate in self.lane_rates.values()))

    @property
    def lane_rates(self) -> dict[int, float]:
        """Rates of single lanes [1/h], by lanelet id.

        Raises:
            InputError: A text is not LANELET:RATE, or a lanelet is there twice.
        """
        return dict(_pairs("rates", "LANELET:RATE", self.rates, int))

    @property
    def profile_steps(self) -> tuple[tuple[float, float], ...]:
        """Times [s] and the factors that count from then on, ascending.

        Raises:
            InputError: A text is not SECONDS:FACTOR, a factor is negative, or a time is there twice.
        """
        found = tuple(sorted(_pairs("profile", "SECONDS:FACTOR", self.profile, float)))
        if any(not factor >= 0.0 for _, factor in found):
            raise InputError("profile", "factors must not be negative")
        return found

    @property
    def planners(self) -> tuple[tuple[str, float], ...]:
        """Planners and their shares, which add up to 1.

        Raises:
            InputError: The shares are no numbers of at least 0, or all are 0.
        """
        parts = [part.strip() for part in self.planner.split("+")]
        found = []
        for part in parts:
            name, _, share = part.rpartition(":")
            try:
                found.append((name, float(share)) if name else (part, 1.0))
            except ValueError:
                found.append((part, 1.0))  # module:object
        total = sum(share for _, share in found)
        if found and total == 0.0 and all(name and share == 0.0 for name, share in found):
            raise InputError("planner", f"the shares of {self.planner} are all 0; give one of them more")
        if not all(name and share >= 0.0 for name, share in found) or not total < math.inf:
            raise InputError("planner", f"write a planner, or shares such as rollout:0.7+idm:0.3, not {self.planner!r}")
        return tuple((name, share / total) for name, share in found)


def _pairs(name: str, form: str, texts: tuple[str, ...], kind: type[T]) -> list[tuple[T, float]]:
    found: list[tuple[T, float]] = []
    for text in texts:
        key, _, value = text.partition(":")
        try:
            found.append((kind(key), float(value)))
        except ValueError:
            raise InputError(name, f"write {form}, not {text!r}") from None
    if len({key for key, _ in found}) < len(found):
        raise InputError(name, f"a number is there twice: {', '.join(texts)}")
    return found
