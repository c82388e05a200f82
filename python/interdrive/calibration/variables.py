"""The numbers of a population that are fitted, and how far from the usual they are."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.config.drivers import PARAMETERS, Distribution, Drivers

if TYPE_CHECKING:
    from interdrive.array_types import Floats

#: One unit of a logarithmic variable is this factor, one of another variable this share of its range.
_FACTOR, _SHARE = 1.5, 0.25
#: Parameters whose medians are fitted keep this spread [1], as in `house`: recordings cannot tell them apart.
USUAL_SPREAD = 0.25
#: Comfortable deceleration [m/s²]: recordings without emergencies do not show it.
_DECELERATION = 1.5
#: Where in their lanes drivers are is not fitted: each keeps its side, and moves within the lane as on MONA East, where
#: offsets change by 0.16, 0.35 and 0.41 m (root mean square) in 1, 3 and 5 s.
#: They do so with their way rather than with time: the slower they drive, the less they move aside.
_LATERAL_KEPT, _LATERAL_NOISE, _LATERAL_WAY = 1.0, 0.25, 30.0
#: What shows a variable varies among fits of nearly the same quality by less than this, in units.
_NARROW = 1.0
#: Such fits are worse than the best one by at most this share; fewer than so many of them say nothing.
_NEARLY, _FITS_MIN = 0.02, 20


@dataclass(frozen=True)
class Variable:
    """A number that is fitted.

    Attributes:
        name: Parameter and part, such as time_gap.median.
        unit: Of its values; 1: it has none.
        prior: Usual value; without evidence it stays there.
        low: Smallest value.
        high: Largest value.
        is_log: Steps are factors rather than differences.
        in_worlds: It is also varied in rollouts.
    """

    name: str
    unit: str
    prior: float
    low: float
    high: float
    is_log: bool = False
    in_worlds: bool = False

    def at(self, z: float) -> float:
        """The value at so many units from the usual one, within its bounds."""
        value = self.prior * _FACTOR**z if self.is_log else self.prior + z * _SHARE * (self.high - self.low)
        return min(max(value, self.low), self.high)

    def units(self, value: float) -> float:
        """How many units a value is from the usual one."""
        if self.is_log:
            return math.log(value / self.prior) / math.log(_FACTOR)
        return (value - self.prior) / (_SHARE * (self.high - self.low))


VARIABLES = (
    Variable("time_gap.median", "s", 1.0, *PARAMETERS["time_gap"], is_log=True, in_worlds=True),
    Variable("time_gap.sd", "1", USUAL_SPREAD, 0.0, 0.8, in_worlds=True),
    Variable("minimum_gap.median", "m", 2.0, *PARAMETERS["minimum_gap"], is_log=True),
    Variable("acceleration.median", "m/s²", 1.0, *PARAMETERS["acceleration"], is_log=True, in_worlds=True),
    Variable("desired_factor.median", "1", 1.0, *PARAMETERS["desired_factor"], is_log=True, in_worlds=True),
    Variable("desired_factor.sd", "1", 0.1, 0.0, 0.3),
    Variable("free_weight.median", "1", 1.0, *PARAMETERS["free_weight"]),
    Variable("noise", "m/s²", 0.2, 0.0, 1.0, in_worlds=True),
    Variable("noise_length", "s", 1.5, 0.5, 5.0, is_log=True, in_worlds=True),
    Variable("time_gap_kept", "1", 0.0, 0.0, 1.0, in_worlds=True),
)


def values_at(z: Floats) -> dict[str, float]:
    """Values of `VARIABLES` at so many units from the usual ones, rounded to what a file states."""
    return {one.name: float(f"{one.at(float(unit)):.4g}") for one, unit in zip(VARIABLES, z, strict=True)}


def population(name: str, values: dict[str, float]) -> Drivers:
    """Drivers with these numbers; what is not fitted is as in `house`."""

    def lognormal(parameter: str, median: float, sd: float) -> Distribution:
        return Distribution(median, sd, "log", *PARAMETERS[parameter])

    weight = values["free_weight.median"]
    return Drivers(
        name,
        {
            "time_gap": lognormal("time_gap", values["time_gap.median"], values["time_gap.sd"]),
            "minimum_gap": lognormal("minimum_gap", values["minimum_gap.median"], USUAL_SPREAD),
            "acceleration": lognormal("acceleration", values["acceleration.median"], USUAL_SPREAD),
            "deceleration": lognormal("deceleration", _DECELERATION, USUAL_SPREAD),
            "desired_factor": lognormal("desired_factor", values["desired_factor.median"], values["desired_factor.sd"]),
            "free_weight": Distribution(weight, 0.0, "identity", *PARAMETERS["free_weight"]),
        },
        noise=values["noise"],
        noise_length=values["noise_length"],
        time_gap_kept=values["time_gap_kept"],
        lateral_kept=_LATERAL_KEPT,
        lateral_noise=_LATERAL_NOISE,
        lateral_way=_LATERAL_WAY,
    )


@dataclass(frozen=True)
class Range:
    """What fits of nearly the same quality say of a variable.

    Attributes:
        low: Its smallest value among them.
        high: Its largest value among them.
        is_identified: They agree, and not on a bound.
    """

    low: float
    high: float
    is_identified: bool


def ranges(z: Floats, objectives: Floats, *, is_long: bool) -> dict[str, Range]:
    """Of each variable, over all evaluated points.

    Args:
        z: Units, shape (points, variables).
        objectives: Of the points; less is better.
        is_long: Drives were long enough to tell drivers apart; otherwise spreads are not identified, whatever fits say:
            noise does the same to a few seconds.
    """
    near = z[objectives <= objectives.min() * (1.0 + _NEARLY)]
    found = {}
    for column, one in enumerate(VARIABLES):
        low, high = one.at(float(near[:, column].min())), one.at(float(near[:, column].max()))
        inside = not (np.isclose(high, one.low) or np.isclose(low, one.high))
        narrow = one.units(high) - one.units(low) < _NARROW
        shown = len(near) >= _FITS_MIN and (is_long or not one.name.endswith(".sd"))
        found[one.name] = Range(low, high, bool(inside and narrow and shown))
    return found
