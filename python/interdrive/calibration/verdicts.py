"""Whether a population may be called realistic at a place: never where it was fitted."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.traffic_realism import Realism
    from interdrive.traffic_realism.summary import Row

#: What is asked of realistic drivers: area under the curve of the classifier along the road and of gaps; of 100
#: vehicles those that collide in short and long drives, and those that find no room to enter; spread, persistence, and
#: the error after 5 s over that of recorded vehicles in a like situation.
AUC_MAX, COLLISIONS_MAX, LONG_COLLISIONS_MAX, NOT_ADMITTED_MAX = 0.70, 0.3, 1.0, 2.0
SPREAD_MIN, PERSISTENCE_MIN, ANALOG_RATIO_MAX = 0.42, 0.55, 1.2
#: Spread and persistence count if so many vehicles show them.
PERSISTENCE_VEHICLES_MIN = 20


@dataclass(frozen=True)
class PlaceVerdict:
    """What is said of a population at a place.

    Attributes:
        place: Its name.
        is_realistic: Whether it may be called realistic; None: nothing can be said.
        reasons: Why not.
    """

    place: str
    is_realistic: bool | None
    reasons: tuple[str, ...] = ()

    def __str__(self) -> str:
        said = {True: "realistic", False: "not realistic", None: "not judged"}[self.is_realistic]
        return said + (f": {'; '.join(self.reasons)}" if self.reasons else "")


def verdict(place: str, found: Realism | None, planner: str, fitted: Sequence[str]) -> PlaceVerdict:
    """Judges a population at a place.

    Args:
        place: Its name.
        found: Measured there.
        planner: Name of the row.
        fitted: Places that the population was fitted on.
    """
    if place in fitted:
        return PlaceVerdict(place, None, ("the population was fitted on this place",))
    rows = {row.planner: row for row in found.rows if row.place == place} if found is not None else {}
    if planner not in rows:
        return PlaceVerdict(place, None, ("no vehicle was measured there",))
    row = rows[planner]
    if not row.is_claim:
        return PlaceVerdict(place, None, (f"{row.windows} windows and {row.vehicles} vehicles are too few",))
    analog = rows.get("analog")
    asked = _asked(row, math.nan if analog is None else analog.energy[5])
    unknown = tuple(f"{name} is not known" for name, value, bound, _ in asked if math.isnan(value + bound))
    if unknown:
        return PlaceVerdict(place, None, unknown)
    reasons = tuple(
        f"{name} {value:.2f}, {'at most' if sign > 0 else 'at least'} {bound:.2f} is asked for"
        for name, value, bound, sign in asked
        if sign * value > sign * bound
    )
    return PlaceVerdict(place, not reasons, reasons)


def _asked(row: Row, analog: float) -> list[tuple[str, float, float, float]]:
    """Names, values, bounds, and 1 where less is better, -1 where more is."""
    found = [
        ("energy after 5 s [m]", row.energy[5], ANALOG_RATIO_MAX * analog, 1.0),
        ("classifier along the road", row.auc["lon_gap"], AUC_MAX, 1.0),
        ("collisions per 100", row.collisions, COLLISIONS_MAX, 1.0),
        ("collisions per 100 in long drives", row.long_collisions, LONG_COLLISIONS_MAX, 1.0),
        ("not admitted per 100", 100.0 * row.not_admitted, NOT_ADMITTED_MAX, 1.0),
    ]
    # Where vehicles are seen for a short time only, nobody knows whether they keep their headway.
    if row.persistence.n_vehicles >= PERSISTENCE_VEHICLES_MIN:
        found += [
            ("spread of headways", row.persistence.spread, SPREAD_MIN, -1.0),
            ("persistence of headways", row.persistence.persistence, PERSISTENCE_MIN, -1.0),
        ]
    return found
