"""Predictors: one call per step predicts all participants, from present and past alone.

A predictor is any object with a method `predict(scene) -> Predictions`. Native predictors are plain records of
settings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from interdrive import _core
from interdrive.errors import InputError
from interdrive.predictors.neural import network

if TYPE_CHECKING:
    from interdrive._core import Predictions, Scene

__all__ = [
    "NATIVE",
    "RECORDS",
    "ConstantVelocity",
    "GroundTruth",
    "LaneFollowing",
    "Neural",
    "Predictor",
    "PredictorSettings",
    "native",
    "native_name",
]


@runtime_checkable
class Predictor(Protocol):
    """Contract of a predictor.

    `predict` gets a scene (all present participants with their past) and returns `Predictions` for the same time step:
    any number of modes with probabilities, means and 2x2 covariances of the centre per step (step `k` is `(k + 1) * dt`
    from now), and a validity mask. Participants that are left out are assumed to go straight on.
    """

    def predict(self, scene: Scene) -> Predictions:
        """Predictions for the participants of the scene."""
        ...


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not 0 < value < math.inf:
            raise InputError(name, f"must be a positive number, not {value}")


@dataclass(frozen=True)
class ConstantVelocity:
    """Straight on with the present velocity; stationary participants remain stationary.

    Attributes:
        position_sigma: Standard deviation of the position now [m].
        acceleration_sigma: Standard deviation of the acceleration along the heading [m/s²]; the spread along the
            heading grows with the square of time.
        lateral_rate: Growth of the standard deviation across the heading [m/s].
    """

    position_sigma: float = 0.15
    acceleration_sigma: float = 0.8
    lateral_rate: float = 0.25

    def __post_init__(self) -> None:
        """Checks the ranges."""
        _positive(
            position_sigma=self.position_sigma,
            acceleration_sigma=self.acceleration_sigma,
            lateral_rate=self.lateral_rate,
        )


@dataclass(frozen=True)
class LaneFollowing:
    """Along every lane that fits the pose (one mode each), at constant speed, slower in curves; otherwise straight.

    Attributes:
        position_sigma: Standard deviation of the position now [m].
        acceleration_sigma: Standard deviation of the acceleration along the heading [m/s²].
        lateral_rate: Growth of the standard deviation across the heading [m/s].
        modes_max: Largest number of lanes to follow (1 to 8).
        lateral_acceleration: Vehicles take curves up to this lateral acceleration without slowing down [m/s²].
        deceleration: Deceleration before curves [m/s²].
        return_time: Time in which an offset from the lane's centre decays [s].
    """

    position_sigma: float = 0.15
    acceleration_sigma: float = 0.8
    lateral_rate: float = 0.15
    modes_max: int = 3
    lateral_acceleration: float = 3.0
    deceleration: float = 2.0
    return_time: float = 4.0

    def __post_init__(self) -> None:
        """Checks the ranges."""
        _positive(
            position_sigma=self.position_sigma,
            acceleration_sigma=self.acceleration_sigma,
            lateral_rate=self.lateral_rate,
            lateral_acceleration=self.lateral_acceleration,
            deceleration=self.deceleration,
            return_time=self.return_time,
        )
        if not 1 <= self.modes_max <= 8:
            raise InputError("modes_max", f"must be 1 to 8, not {self.modes_max}")


@dataclass(frozen=True)
class GroundTruth:
    """The recorded future of vehicles that replay it; agents are expected to follow their lanes.

    For studies only, because no real planner could know it. Vehicles that leave the recording are not predicted after
    that.
    """


@dataclass(frozen=True)
class Neural:
    """A network trained on recorded traffic: speed, offset and choice of path from past, neighbours and lanes.

    Several modes, each with covariances. Pedestrians and vehicles that drive backwards go straight on; stationary
    participants may stay exactly or go. Source: `training/`.

    Attributes:
        modes_max: Largest number of paths (1 to 8); the most probable ones are kept. The wide mode of the shipped
            weights is one more.
        weights: File with your own weights, as written by `training/`; empty for the shipped ones.
    """

    modes_max: int = 4
    weights: str = ""

    def __post_init__(self) -> None:
        """Checks the ranges."""
        if not 1 <= self.modes_max <= 8:
            raise InputError("modes_max", f"must be 1 to 8, not {self.modes_max}")


@dataclass(frozen=True)
class PredictorSettings:
    """Settings of all native predictors.

    Attributes:
        horizon: Length of predictions [s].
        constant_velocity: Settings of `constant_velocity`.
        lane_following: Settings of `lane_following`, and of `ground_truth` for agents.
        neural: Settings of `neural`.
    """

    horizon: float = 3.0
    constant_velocity: ConstantVelocity = field(default_factory=ConstantVelocity)
    lane_following: LaneFollowing = field(default_factory=LaneFollowing)
    neural: Neural = field(default_factory=Neural)

    def __post_init__(self) -> None:
        """Checks the ranges."""
        if not 0 < self.horizon <= 30:
            raise InputError("horizon", f"must be more than 0 and at most 30 s, not {self.horizon}")


#: The record of each native predictor.
RECORDS: dict[str, type] = {
    "constant_velocity": ConstantVelocity,
    "lane_following": LaneFollowing,
    "neural": Neural,
    "ground_truth": GroundTruth,
}

#: Names of the native predictors, each with one line of explanation.
NATIVE = {
    "constant_velocity": "straight on with the present velocity",
    "lane_following": "along every lane that fits, at constant speed, slower in curves",
    "neural": "a network trained on recorded traffic: several modes with covariances",
    "ground_truth": "the recorded future of vehicles that replay it (for studies only)",
}


def native_name(record: object) -> str | None:
    """The name of a native record; None for anything else."""
    return next((name for name, kind in RECORDS.items() if type(record) is kind), None)


def native(record: object, settings: PredictorSettings, recorded: _core.Scenario) -> _core.Predictor | None:
    """The core's predictor for a native record; None for one written in Python.

    Raises:
        InputError: Weights of a network that are not installed or cannot be used; the text says what to do.
    """
    if isinstance(record, Neural):
        return _core.Predictor.neural(network(record.weights), record.modes_max)
    if isinstance(record, ConstantVelocity):
        return _core.Predictor.constant_velocity(record.position_sigma, record.acceleration_sigma, record.lateral_rate)
    if isinstance(record, LaneFollowing | GroundTruth):
        lanes = record if isinstance(record, LaneFollowing) else settings.lane_following
        return _core.Predictor.lane_following(
            lanes.position_sigma,
            lanes.acceleration_sigma,
            lanes.lateral_rate,
            lanes.modes_max,
            lanes.lateral_acceleration,
            lanes.deceleration,
            lanes.return_time,
            recorded if isinstance(record, GroundTruth) else None,
        )
    return None
