"""Settings of agents and of the goals that are derived from recordings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, get_args

from interdrive.errors import InputError, check_between
from interdrive.scenario.known_goals import (
    Information,
)

if TYPE_CHECKING:
    pass


@dataclass(frozen=True)
class AgentSettings:
    """Which recorded vehicles can become agents, and what planning problems drive.

    Attributes:
        min_displacement: Smallest distance that a vehicle must get away from its start.
        vehicle_type: CommonRoad vehicle type of planning problems: 1 (Ford Escort), 2 (BMW 320i), 3 (VW Vanagon), 4
            (truck). 0: the recorded vehicle at their start, otherwise type 2.
        plan_from: From when on recorded vehicles plan, counted from the first time step; until then they replay.
            Vehicles that enter later plan from then on, vehicles that have left by then only replay. What planning
            problems drive starts as they state.
    """

    min_displacement: Annotated[float, "m"] = 10.0
    vehicle_type: int = 0
    plan_from: Annotated[float, "s"] = 0.0

    def __post_init__(self) -> None:
        """Checks the ranges."""
        check_between("vehicle_type", self.vehicle_type, 0, 4)
        if not 0.0 <= self.plan_from <= 1e5:
            raise InputError("plan_from", f"must be at least 0 and at most 100000, not {self.plan_from}")


@dataclass(frozen=True)
class GoalSettings:
    """Goals derived from recordings: the section of lane around the last recorded state.

    Attributes:
        length_before: Length of the section before the last recorded position.
        length_after: Length of the section after the last recorded position.
        time_early: How much earlier than recorded the agent may arrive; inf: at any time.
        time_late: How much later than recorded the agent may arrive without being late.
        velocity_tolerance: Allowed difference from the last recorded speed.
        limit_share: Largest share of the local speed limit that a goal may demand, whatever `rules.speed_factor` and
            the recorded speed; inf: no bound.
        orientation_tolerance: Allowed difference from the direction of the lane.
        information: What an agent knows of its recording. timed: where it ends, when and how fast. place: where it
            ends. route: the recorded lanelets. turns: the recorded turns at forks, but no lane changes. Without the
            time it wants to be as fast as the traffic around its start, and drives until the recording is over.
    """

    length_before: Annotated[float, "m"] = 5.0
    length_after: Annotated[float, "m"] = 5.0
    time_early: Annotated[float, "s"] = math.inf
    time_late: Annotated[float, "s"] = 1.0
    velocity_tolerance: Annotated[float, "m/s"] = 5.0
    limit_share: float = 0.9
    orientation_tolerance: Annotated[float, "rad"] = 0.5
    information: Information = "timed"

    def __post_init__(self) -> None:
        """Checks the ranges."""
        if self.information not in get_args(Information):
            raise InputError(
                "information", f"must be one of {', '.join(get_args(Information))}, not {self.information!r}"
            )
        for name in ("length_before", "length_after", "time_early", "time_late"):
            if not getattr(self, name) >= 0:
                raise InputError(name, f"must not be negative, is {getattr(self, name)}")
        for name in ("length_before", "length_after", "time_late"):
            if not getattr(self, name) <= 1e5:
                raise InputError(name, f"must be at most 100000, not {getattr(self, name)}")
        for name in ("velocity_tolerance", "limit_share", "orientation_tolerance"):
            if not getattr(self, name) > 0:
                raise InputError(name, f"must be positive, is {getattr(self, name)}")
