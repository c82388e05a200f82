"""Safe distances of Responsibility-Sensitive Safety: Shalev-Shwartz, Shammah, Shashua, arXiv 1708.06374.

Formulas and names of the parameters are those of `ad-rss`, the library that Intel published.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from interdrive import _core

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from interdrive.array_types import Floats


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

    @property
    def _along(self) -> tuple[float, float, float, float, float]:
        return (self.response, self.acceleration, self.braking_min, self.braking_max, self.braking_correct)


#: Parameters of JRC's comparison.
JRC = RssParameters()
#: Parameters that Intel published with `ad-rss`.
INTEL = RssParameters(1.0, 3.5, 4.0, 8.0, 3.0, 0.2, 0.8, 0.3)


def same_direction(rear: ArrayLike, front: ArrayLike, parameters: RssParameters = JRC) -> Floats:
    """Safe distance behind a vehicle of the same direction [m], from the speeds of both [m/s]; not negative."""
    return _core.rss_longitudinal(parameters._along, *_pair(rear, front), opposite=False)


def opposite_direction(in_lane: ArrayLike, other: ArrayLike, parameters: RssParameters = JRC) -> Floats:
    """Safe distance between oncoming vehicles [m], from their speeds without sign [m/s]; the first is in its lane."""
    return _core.rss_longitudinal(parameters._along, *_pair(in_lane, other), opposite=True)


def lateral(left: ArrayLike, right: ArrayLike, parameters: RssParameters = JRC) -> Floats:
    """Safe sideways distance of two vehicles [m], from the speeds to the right of the left and the right one [m/s]."""
    chosen = (
        parameters.response,
        parameters.lateral_acceleration,
        parameters.lateral_braking,
        parameters.fluctuation,
    )
    return _core.rss_lateral(chosen, *_pair(left, right))


def _pair(first: ArrayLike, second: ArrayLike) -> tuple[Floats, Floats]:
    a, b = np.broadcast_arrays(np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64))
    return np.ascontiguousarray(np.atleast_1d(a).ravel()), np.ascontiguousarray(np.atleast_1d(b).ravel())
