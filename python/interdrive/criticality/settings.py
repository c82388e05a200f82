"""Parameters and switches of the measures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from interdrive.errors import InputError


@dataclass(frozen=True)
class CriticalitySettings:
    """What can be chosen; the defaults are those of docs/criticality.md.

    Attributes:
        radius: Others count within this distance, centre to centre.
        ttc_threshold: Time to collision up to which a vehicle is exposed.
        deceleration: Deceleration that is available; the default is what the tyres of CommonRoad's vehicle type
            2 can do on a dry road.
        lateral_acceleration: Lateral acceleration that is available.
        oncoming_filter: Oncoming traffic counts only where its way meets that of the judged vehicle.
        opposite_angle: Heading difference beyond which traffic is oncoming.
        erosion: Lanelets are eroded by this much before their overlap is measured.
        overlap_min: Overlaps up to this size do not count.
        lead_membership: Who counts as ahead: whose center lies on the path, or whose footprint reaches into it.
        thw_mode: Time headway: normalized is headway over speed, recorded is the time until the recording reaches the
            place where the vehicle ahead is now.
        leader_stops: A braking vehicle ahead comes to rest and stays there, for the required longitudinal acceleration.
        conflict_areas: Where vehicles cross: between the connectors of stated intersections, or crossing, between all
            lanelets that cross or join.
    """

    radius: Annotated[float, "m"] = 100.0
    ttc_threshold: Annotated[float, "s"] = 2.0
    deceleration: Annotated[float, "m/s²"] = 11.5
    lateral_acceleration: Annotated[float, "m/s²"] = 8.0
    oncoming_filter: bool = True
    opposite_angle: Annotated[float, "rad"] = 0.75 * math.pi
    erosion: Annotated[float, "m"] = 0.3
    overlap_min: Annotated[float, "m²"] = 0.1
    lead_membership: Literal["center", "footprint"] = "center"
    thw_mode: Literal["normalized", "recorded"] = "normalized"
    leader_stops: bool = False
    conflict_areas: Literal["stated", "crossing"] = "stated"

    def __post_init__(self) -> None:
        """Checks the ranges."""
        for name in ("radius", "ttc_threshold", "deceleration", "lateral_acceleration", "opposite_angle"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise InputError(name, f"must be positive, not {value}")
        if self.opposite_angle > math.pi:
            raise InputError("opposite_angle", f"must be at most pi, not {self.opposite_angle}")
        for name in ("erosion", "overlap_min"):
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise InputError(name, f"must not be negative, is {value}")
