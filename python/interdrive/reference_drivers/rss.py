"""Safe distances of Responsibility-Sensitive Safety: Shalev-Shwartz, Shammah, Shashua, arXiv 1708.06374.

Formulas and names of the parameters are those of `ad-rss`, the library that Intel published.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated

import numpy as np

from interdrive import _core
from interdrive.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from interdrive.array_types import Floats


#: What is divided by.
_POSITIVE = ("braking_min", "braking_max", "braking_correct", "lateral_braking")


@dataclass(frozen=True)
class RssParameters:
    """Parameters; the defaults are those of JRC's comparison of drivers.

    Attributes:
        response: Response time.
        acceleration: Largest acceleration along the lane during the response.
        braking_min: Least braking after the response.
        braking_max: Hardest braking of a vehicle ahead.
        braking_correct: Least braking of a vehicle in its own lane before oncoming traffic.
        lateral_acceleration: Largest acceleration across the lane during the response.
        lateral_braking: Least braking across the lane after the response.
        fluctuation: Sideways fluctuation of a vehicle that keeps its lane.
    """

    response: Annotated[float, "s"] = 0.75
    acceleration: Annotated[float, "m/s²"] = 3.0
    braking_min: Annotated[float, "m/s²"] = 6.0
    braking_max: Annotated[float, "m/s²"] = 6.0
    braking_correct: Annotated[float, "m/s²"] = 6.0
    lateral_acceleration: Annotated[float, "m/s²"] = 1.0
    lateral_braking: Annotated[float, "m/s²"] = 1.0
    fluctuation: Annotated[float, "m"] = 0.3

    def __post_init__(self) -> None:
        """Refuses parameters with which distances are no distances."""
        for field in fields(self):
            value = getattr(self, field.name)
            is_number = isinstance(value, (int, float, np.number)) and np.isfinite(value)
            if not is_number or value < 0.0 or (value == 0.0 and field.name in _POSITIVE):
                must = "positive" if field.name in _POSITIVE else "not negative"
                raise InputError(f"RssParameters: {field.name} must be {must}, is {value!r}")

    @property
    def _along(self) -> tuple[float, float, float, float, float]:
        return (self.response, self.acceleration, self.braking_min, self.braking_max, self.braking_correct)


#: Parameters of JRC's comparison.
JRC = RssParameters()
#: Parameters that Intel published with `ad-rss`.
INTEL = RssParameters(1.0, 3.5, 4.0, 8.0, 3.0, 0.2, 0.8, 0.3)


def same_direction(rear: ArrayLike, front: ArrayLike, parameters: RssParameters = JRC) -> Floats:
    """Safe distance behind a vehicle of the same direction [m], from the speeds of both [m/s]; not negative.

    Args:
        rear: Speeds of the vehicle behind [m/s], broadcast against those of the other.
        front: Speeds of the vehicle ahead [m/s].
        parameters: Reaction and braking of both.

    Raises:
        InputError: A speed is negative or not finite, or the shapes do not fit.
    """
    return _core.rss_longitudinal(parameters._along, *_speeds(rear=rear, front=front), opposite=False)


def opposite_direction(in_lane: ArrayLike, other: ArrayLike, parameters: RssParameters = JRC) -> Floats:
    """Safe distance between oncoming vehicles [m], from their speeds without sign [m/s].

    Args:
        in_lane: Speeds of the vehicle in its own lane [m/s], broadcast against those of the other.
        other: Speeds of the oncoming vehicle [m/s].
        parameters: Reaction and braking of both.

    Raises:
        InputError: A speed is negative or not finite, or the shapes do not fit.
    """
    return _core.rss_longitudinal(parameters._along, *_speeds(in_lane=in_lane, other=other), opposite=True)


def lateral(left: ArrayLike, right: ArrayLike, parameters: RssParameters = JRC) -> Floats:
    """Safe sideways distance of two vehicles [m], from their speeds to the right [m/s].

    Args:
        left: Speeds of the vehicle on the left to the right [m/s], broadcast against those of the other.
        right: Speeds of the vehicle on the right to the right [m/s].
        parameters: Reaction and braking of both.

    Raises:
        InputError: A speed is not finite, or the shapes do not fit.
    """
    chosen = (
        parameters.response,
        parameters.lateral_acceleration,
        parameters.lateral_braking,
        parameters.fluctuation,
    )
    return _core.rss_lateral(chosen, *_pair(left=left, right=right))


def _speeds(**given: ArrayLike) -> tuple[Floats, Floats]:
    found = _pair(**given)
    for name, values in zip(given, found, strict=True):
        if (values < 0.0).any():
            raise InputError(f"{name}: a speed must not be negative, is {values[values < 0.0][0]:g}")
    return found


def _pair(**given: ArrayLike) -> tuple[Floats, Floats]:
    try:
        first, second = np.broadcast_arrays(*(np.asarray(one, dtype=np.float64) for one in given.values()))
    except (TypeError, ValueError) as error:
        raise InputError(f"{' and '.join(given)}: no speeds that fit each other: {error}") from None
    for name, values in zip(given, (first, second), strict=True):
        if not np.isfinite(values).all():
            raise InputError(f"{name}: a speed must be finite, is {values[~np.isfinite(values)].flat[0]:g}")
    return np.ascontiguousarray(np.atleast_1d(first).ravel()), np.ascontiguousarray(np.atleast_1d(second).ravel())
