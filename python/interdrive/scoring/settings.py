"""What scores are made of: bounds, weights, reactions."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Annotated

from interdrive.errors import InputError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def _check(owner: DataclassInstance, *, may_be_zero: bool) -> None:
    """Raises InputError unless all numbers of a record are positive (or 0)."""
    for item in fields(owner):
        value = getattr(owner, item.name)
        if isinstance(value, float) and not (math.isfinite(value) and (value > 0.0 or (may_be_zero and value == 0.0))):
            kind = "must not be negative" if may_be_zero else "must be positive"
            raise InputError(item.name, f"{kind}, is {value}")


@dataclass(frozen=True)
class ComfortBounds:
    """Largest values of a comfortable drive; the defaults are those of nuPlan.

    Attributes:
        acceleration: Longitudinal acceleration.
        deceleration: Longitudinal deceleration.
        lateral_acceleration: Speed times yaw rate, either way.
        yaw_rate: Either way.
        yaw_acceleration: Either way.
        longitudinal_jerk: Either way.
        jerk: Of the size of the acceleration, either way.
    """

    acceleration: Annotated[float, "m/s²"] = 2.40
    deceleration: Annotated[float, "m/s²"] = 4.05
    lateral_acceleration: Annotated[float, "m/s²"] = 4.89
    yaw_rate: Annotated[float, "rad/s"] = 0.95
    yaw_acceleration: Annotated[float, "rad/s²"] = 1.93
    longitudinal_jerk: Annotated[float, "m/s³"] = 4.13
    jerk: Annotated[float, "m/s³"] = 8.37

    def __post_init__(self) -> None:
        """Checks the ranges."""
        _check(self, may_be_zero=False)


@dataclass(frozen=True)
class ScoreWeights:
    """Weights of the terms in the mean.

    Attributes:
        progress: Of the progress along the route.
        ttc: Of the time to contact straight on.
        speed: Of speed limits.
        comfort: Of comfort.
    """

    progress: float = 5.0
    ttc: float = 5.0
    speed: float = 4.0
    comfort: float = 2.0

    def __post_init__(self) -> None:
        """Checks the ranges."""
        _check(self, may_be_zero=True)
        if not self.progress + self.ttc > 0.0:
            raise InputError("progress", "progress and ttc must not both be 0: the other terms may be absent")


@dataclass(frozen=True)
class PanelWeights:
    """Weights of the terms in the mean of the score against a panel.

    Attributes:
        ttc: Of the time to contact straight on.
        hindrance: Of what others lose.
        comfort: Of comfort.
    """

    ttc: float = 5.0
    hindrance: float = 5.0
    comfort: float = 2.0

    def __post_init__(self) -> None:
        """Checks the ranges."""
        _check(self, may_be_zero=True)
        if not self.ttc + self.hindrance + self.comfort > 0.0:
            raise InputError("ttc", "ttc, hindrance and comfort must not all be 0")


@dataclass(frozen=True)
class ReactionSettings:
    """In how much room a driver reacts: a delay, then a deceleration.

    Attributes:
        delay: Of the agent. deceleration: Of the agent.
        others_delay: Of the others. others_deceleration: Of the others.
    """

    delay: Annotated[float, "s"] = 0.25
    deceleration: Annotated[float, "m/s²"] = 6.0
    others_delay: Annotated[float, "s"] = 0.75
    others_deceleration: Annotated[float, "m/s²"] = 4.0

    def __post_init__(self) -> None:
        """Checks the ranges."""
        _check(self, may_be_zero=False)


@dataclass(frozen=True)
class ScoringSettings:
    """Settings of scores; docs/reference/scoring.md explains them.

    Attributes:
        comfort: Bounds of comfort.
        weights: Weights of the terms.
        panel: Weights of the terms of the score against a panel.
        reaction: What drivers are expected to do before a contact.
        ttc_bound: Bound above which the time to contact straight on must stay.
        ttc_horizon: Time ahead within which contacts count.
        overspeed: Constant excess of the speed limit at which the speed term is 0.
        progress_min: Progress below which the score is 0.
        yield_time: Time before a contact at a crossing within which disregarding a light, a stop sign or right of way
            decides whose fault it is.
    """

    comfort: ComfortBounds = field(default_factory=ComfortBounds)
    weights: ScoreWeights = field(default_factory=ScoreWeights)
    panel: PanelWeights = field(default_factory=PanelWeights)
    reaction: ReactionSettings = field(default_factory=ReactionSettings)
    ttc_bound: Annotated[float, "s"] = 0.95
    ttc_horizon: Annotated[float, "s"] = 3.0
    overspeed: Annotated[float, "m/s"] = 2.23
    progress_min: float = 0.2
    yield_time: Annotated[float, "s"] = 10.0

    def __post_init__(self) -> None:
        """Checks the ranges."""
        _check(self, may_be_zero=False)
        if self.ttc_bound >= self.ttc_horizon:
            raise InputError("ttc_bound", f"must be less than ttc_horizon ({self.ttc_horizon}), is {self.ttc_bound}")
