"""The native predictors: the core predicts all participants in one call."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, TypeAlias

from interdrive import _core
from interdrive.errors import InputError
from interdrive.native_settings import ConstantVelocity, LaneFollowing
from interdrive.predictors.neural import network


@dataclass(frozen=True)
class GroundTruth:
    """The recorded future of vehicles that replay it; agents are expected to follow their lanes.

    For studies only, because no real planner could know it. Vehicles are not predicted beyond the end of their
    recording.
    """


@dataclass(frozen=True)
class Neural:
    """A network trained on recorded traffic: speed, offset and choice of path from past, neighbours and lanes.

    Several modes, each with covariances. Pedestrians and vehicles that drive backwards go straight on; stationary
    participants may stay exactly or go. Source: `training/`.

    Attributes:
        modes_max: Largest number of paths (1 to 8), the most probable first. The wide mode of the shipped weights comes
            on top.
        weights: File with your own weights, as written by `training/`; empty: the shipped weights.
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
        horizon: Length of predictions.
        constant_velocity: Settings of `constant_velocity`.
        lane_following: Settings of `lane_following`, and of `ground_truth` for agents.
        neural: Settings of `neural`.
    """

    horizon: Annotated[float, "s"] = 3.0
    constant_velocity: ConstantVelocity = field(default_factory=ConstantVelocity)
    lane_following: LaneFollowing = field(default_factory=LaneFollowing)
    neural: Neural = field(default_factory=Neural)

    def __post_init__(self) -> None:
        """Checks the ranges."""
        if not 0 < self.horizon <= 30:
            raise InputError("horizon", f"must be more than 0 and at most 30 s, not {self.horizon}")


#: A record that is a choice of a native predictor.
NativePredictor: TypeAlias = ConstantVelocity | LaneFollowing | GroundTruth | Neural

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


def native_predictor(record: object, settings: PredictorSettings, recorded: _core.Scenario) -> _core.Predictor | None:
    """The core's predictor for a native record; None for one written in Python.

    Raises:
        InputError: Weights of a network that are not installed or cannot be used; the text says what to do.
    """
    if isinstance(record, Neural):
        return _core.Predictor.neural(network(record.weights), record.modes_max)
    if isinstance(record, ConstantVelocity):
        return _core.Predictor.constant_velocity(record)
    if isinstance(record, LaneFollowing):
        return _core.Predictor.lane_following(record)
    if isinstance(record, GroundTruth):
        return _core.Predictor.ground_truth(recorded, settings.lane_following)
    return None
