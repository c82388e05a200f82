"""The native planners: plain records of settings; the core plans for all their agents in one call."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

from interdrive import _core


@dataclass(frozen=True)
class FrenetWeights:
    """Weights of the terms of the cost; zero disables a term. Every term is zero or positive.

    Attributes:
        velocity_offset: Root of the summed squares of speed minus desired speed over all points [m/s].
        distance_to_reference: Root of the summed squares of the lateral offset over the last half of the points [m].
        lateral_jerk: Root of the integral of the squared lateral jerk over the horizon.
        longitudinal_jerk: Root of the integral of the squared longitudinal jerk over the horizon.
        acceleration: Integral of the squared acceleration along the heading [m²/s³].
        jerk: Integral of the squared change of that acceleration [m²/s⁵].
        lateral_velocity: Integral of the squared lateral speed [m²/s].
        lateral_acceleration: Integral of the squared lateral acceleration [m²/s³].
        longitudinal_velocity: Integral of the squared longitudinal speed [m²/s].
        longitudinal_acceleration: Integral of the squared longitudinal acceleration [m²/s³].
        orientation_offset: Heading relative to the path over the last half of the points [rad].
        distance_to_obstacles: Sum over participants of 1 / (smallest squared distance of the centres) [1/m²].
        prediction: 1000 times the probability of touching a predicted participant, summed over points.
    """

    velocity_offset: float = 1.0
    distance_to_reference: float = 5.0
    lateral_jerk: float = 0.2
    longitudinal_jerk: float = 0.2
    acceleration: float = 0.0
    jerk: float = 0.0
    lateral_velocity: float = 0.0
    lateral_acceleration: float = 0.0
    longitudinal_velocity: float = 0.0
    longitudinal_acceleration: float = 0.0
    orientation_offset: float = 0.0
    distance_to_obstacles: float = 0.0
    prediction: float = 0.2


@dataclass(frozen=True)
class FrenetComfort:
    """Comfortable driving; the desired speed respects these values, feasibility does not depend on them.

    Attributes:
        time_gap: Time gap to a leader [s].
        standstill_gap: Distance kept to a standing leader [m].
        deceleration: Deceleration before leaders, curves and the goal [m/s²].
        lateral_acceleration: Lateral acceleration in curves [m/s²].
        velocity_step: Desired and present speed differ by at most this [m/s].
        cruise_velocity_min: Lowest desired speed of an agent whose goal states neither place nor speed [m/s].
    """

    time_gap: float = 1.0
    standstill_gap: float = 2.0
    deceleration: float = 3.0
    lateral_acceleration: float = 3.0
    velocity_step: float = 5.0
    cruise_velocity_min: float = 5.0


@dataclass(frozen=True)
class Frenet:
    """Sampling in the Frenet frame of the reference path.

    Werling et al., ICRA 2010, doi 10.1109/ROBOT.2010.5509799; Trauth, Moller, Wuersching, Betz, "FRENETIX", IEEE
    Access 2024, doi 10.1109/ACCESS.2024.3436835; in a corrected form, see docs/planner.md.

    Attributes:
        level: Fineness of the sampling, 0 to 4: 48, 180, 800, 3564, 12716 samples in the grid.
        horizon: Length of a plan [s].
        t_min: Shortest time in which a manoeuvre ends [s].
        d_max: Lateral end positions are within this distance of the reference path [m].
        low_velocity: Below this speed lateral motion is planned over arc length instead of time [m/s].
        prediction_margin_length: Predicted participants are longer by this, in all [m].
        prediction_margin_width: Predicted participants are wider by this, in all [m].
        rear_cone_angle: Opening angle of the cone behind the agent [rad] ...
        rear_cone_distance: ... in which participants further away than this are expected to keep their distance [m].
        collision_mode_probability: Modes with at least this probability must not be hit; the most probable one
            always counts.
        expectation_density_min: A less probable mode has no cost at times when the density of its positions is below
            this even in the middle, because it then hardly predicts any position [1/m²].
        stop_targets: Also sample stops behind the leader and before the end of the goal area.
        lazy: Evaluate only what the choice of the best sample needs; False evaluates all. The choice is the same.
        weights: Weights of the cost.
        comfort: Comfortable driving.
    """

    level: int = 2
    horizon: float = 3.0
    t_min: float = 1.1
    d_max: float = 3.0
    low_velocity: float = 2.0
    prediction_margin_length: float = 0.5
    prediction_margin_width: float = 0.2
    rear_cone_angle: float = 0.3490658503988659
    rear_cone_distance: float = 6.0
    collision_mode_probability: float = 0.2
    expectation_density_min: float = 0.02
    stop_targets: bool = True
    lazy: bool = True
    weights: FrenetWeights = field(default_factory=FrenetWeights)
    comfort: FrenetComfort = field(default_factory=FrenetComfort)

    def __post_init__(self) -> None:
        """Checks the ranges (in the core, which names the field)."""
        native_planner(self)


@dataclass(frozen=True)
class Recorded:
    """Replays the recording state by state; beyond its end it follows the lane with the last speed."""


@dataclass(frozen=True)
class CarFollowing:
    """Parameters of the Intelligent Driver Model.

    Attributes:
        time_gap: Time gap T to a leader [s].
        minimum_gap: Gap s0 to a standing leader [m].
        acceleration: Acceleration a from standstill on a free road [m/s²].
        deceleration: Comfortable deceleration b; where necessary it brakes up to the vehicle's limit [m/s²].
        exponent: Exponent of v / v0.
    """

    time_gap: float = 1.0
    minimum_gap: float = 2.0
    acceleration: float = 1.0
    deceleration: float = 1.5
    exponent: float = 4.0

    def __post_init__(self) -> None:
        """Checks the ranges (in the core, which names the field)."""
        native_planner(self)


@dataclass(frozen=True)
class VelocityAdjusting(CarFollowing):
    """Keeps the recorded path and, where the way is free, the recorded speed.

    Behind leaders and before crossing participants it brakes with the Intelligent Driver Model: Treiber, Hennecke,
    Helbing, "Congested traffic states in empirical observations and microscopic simulations", Phys. Rev. E 62, 2000,
    doi 10.1103/PhysRevE.62.1805; defaults of Treiber and Kesting, "Traffic Flow Dynamics", 2013, table 11.2. With the
    gap s and the leader's speed vl, the desired gap is s* = s0 + max(0, v T + v (v - vl) / (2 sqrt(a b))), and the
    acceleration is at most a (1 - (s* / s)²). See docs/planners.md.

    Attributes:
        acceleration: Acceleration a with which it returns to the recorded speed [m/s²].
        exponent: Exponent of v / v0 in the acceleration a (1 - (v / v0)^exponent) back to the recorded speed v0.
    """


@dataclass(frozen=True)
class Idm(CarFollowing):
    """Drives the reference path of its route with the Intelligent Driver Model.

    Treiber, Hennecke, Helbing, "Congested traffic states in empirical observations and microscopic simulations", Phys.
    Rev. E 62, 2000, doi 10.1103/PhysRevE.62.1805; defaults and the braking above the desired speed as in
    Treiber and Kesting, "Traffic Flow Dynamics", 2013, section 11.3. With the gap s and the leader's speed vl the
    acceleration is a (1 - (v / v0)^exponent - (s* / s)²), s* = s0 + max(0, v T + v (v - vl) / (2 sqrt(a b))). The
    desired speed v0 brings it to its goal in time, within speed limits and low enough for curves. See docs/planners.md.

    Attributes:
        desired_velocity_max: Upper bound of the desired speed v0 [m/s].
        lateral_acceleration: Lateral acceleration in curves [m/s²].
    """

    desired_velocity_max: float = math.inf
    lateral_acceleration: float = 3.0


@dataclass(frozen=True)
class IdmMobil(Idm):
    """Drives with the Intelligent Driver Model, as `Idm`, and changes lanes with MOBIL.

    Kesting, Treiber, Helbing, "General lane-changing model MOBIL for car-following models", Transportation Research
    Record 1999, 2007, doi 10.3141/1999-10. A change must be safe: the new follower brakes with at most b_safe (eq. 2).
    And it must be worthwhile: own gain + p (gain of the new follower + gain of the old follower) + bias > threshold
    (eq. 3), where a gain is the acceleration of the car-following model after the change minus that before. The bias
    favours lanes that lead to the goal; it grows by up to b_safe where such a lane has to be reached soon. See
    docs/planners.md.

    Attributes:
        politeness: Politeness p: weight of the gains and losses of the followers.
        changing_threshold: A change must gain more than this [m/s²].
        safe_deceleration: The new follower must not have to brake harder than this, b_safe [m/s²].
        bias: Bias for each lane nearer to the one that leads to the goal [m/s²].
        lane_change_duration: Duration of a lane change [s].
    """

    politeness: float = 0.2
    changing_threshold: float = 0.1
    safe_deceleration: float = 4.0
    bias: float = 0.3
    lane_change_duration: float = 4.0


@dataclass(frozen=True)
class PlannerSettings:
    """Settings of all native planners.

    Attributes:
        frenet: Settings of `frenet`.
        velocity_adjusting: Settings of `velocity_adjusting`.
        idm: Settings of `idm`.
        idm_mobil: Settings of `idm_mobil`.
    """

    frenet: Frenet = field(default_factory=Frenet)
    velocity_adjusting: VelocityAdjusting = field(default_factory=VelocityAdjusting)
    idm: Idm = field(default_factory=Idm)
    idm_mobil: IdmMobil = field(default_factory=IdmMobil)


#: Names of the native planners, each with one line of explanation.
NATIVE = {
    "frenet": "samples trajectories in the Frenet frame of the reference path and takes the cheapest safe one",
    "recorded": "replays the recording",
    "velocity_adjusting": "keeps the recorded path, and the recorded speed where the way is free",
    "idm": "drives its reference path with the Intelligent Driver Model",
    "idm_mobil": "drives with the Intelligent Driver Model and changes lanes with MOBIL",
}

#: The record of each native planner.
RECORDS: dict[str, type] = {
    "frenet": Frenet,
    "recorded": Recorded,
    "velocity_adjusting": VelocityAdjusting,
    "idm": Idm,
    "idm_mobil": IdmMobil,
}

#: The core's settings of each native planner.
NativePlanner = (
    _core.FrenetSettings
    | _core.RecordedSettings
    | _core.VelocityAdjustingSettings
    | _core.IdmSettings
    | _core.IdmMobilSettings
)


def native_name(record: object) -> str | None:
    """The name of a native record; None for anything else."""
    return next((name for name, kind in RECORDS.items() if type(record) is kind), None)


def native_record(name: str, settings: PlannerSettings) -> Any:  # noqa: ANN401 - one of RECORDS
    """The record of a native planner from the settings; a new one if it has no settings."""
    return getattr(settings, name, None) or RECORDS[name]()


def native_planner(record: object) -> NativePlanner | None:
    """The core's settings of a native planner; None for a planner written in Python."""
    if isinstance(record, Frenet):
        return _core.FrenetSettings(_dotted(record))
    if isinstance(record, Recorded):
        return _core.RecordedSettings()
    if isinstance(record, VelocityAdjusting):
        return _core.VelocityAdjustingSettings(_dotted(record))
    if isinstance(record, IdmMobil):
        return _core.IdmMobilSettings(_dotted(record))
    if isinstance(record, Idm):
        return _core.IdmSettings(_dotted(record))
    return None


def _dotted(record: Any, prefix: str = "") -> dict[str, Any]:  # noqa: ANN401 - one of RECORDS
    """The fields of a record, and of records in it, by dotted names."""
    found: dict[str, Any] = {}
    for name in (item.name for item in fields(record)):
        value = getattr(record, name)
        found |= _dotted(value, f"{prefix}{name}.") if is_dataclass(value) else {f"{prefix}{name}": value}
    return found
