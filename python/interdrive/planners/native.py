"""The native planners: plain records of settings; all agents that use them are planned in one call of the core."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from interdrive import _core
from interdrive.settings import flatten


@dataclass(frozen=True)
class FrenetWeights:
    """How much each part of the cost counts; zero switches a part off. Every part is zero or positive.

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
    """What the agent finds comfortable; the desired speed respects it, the limits of feasibility do not know it.

    Attributes:
        time_gap: Time gap to a leader [s].
        standstill_gap: Distance kept to a standing leader [m].
        deceleration: Deceleration before leaders, curves and the goal [m/s²].
        lateral_acceleration: Lateral acceleration in curves [m/s²].
        velocity_step: Desired and present speed differ by at most this [m/s].
        cruise_velocity_min: Least speed of an agent whose goal says nothing about where or how fast [m/s].
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
        d_max: Lateral end positions lie within this distance of the reference path [m].
        low_velocity: Below this speed lateral motion is planned over arc length instead of time [m/s].
        prediction_margin_length: Predicted participants are longer by this, in all [m].
        prediction_margin_width: Predicted participants are wider by this, in all [m].
        rear_cone_angle: Opening angle of the cone behind the agent [rad] ...
        rear_cone_distance: ... in which participants further away than this are left to keep their distance [m].
        collision_mode_probability: Modes with at least this probability must not be hit; the most probable one
            always counts.
        stop_targets: Also sample stops behind the leader and before the end of the goal area.
        lazy: Find the best sample with as little work as possible; False evaluates all. The choice is the same.
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
    stop_targets: bool = True
    lazy: bool = True
    weights: FrenetWeights = field(default_factory=FrenetWeights)
    comfort: FrenetComfort = field(default_factory=FrenetComfort)

    def __post_init__(self) -> None:
        """Checks the ranges (in the core, which names the field)."""
        native_planner(self)


@dataclass(frozen=True)
class PlannerSettings:
    """Settings of all native planners.

    Attributes:
        frenet: Settings of `frenet`.
    """

    frenet: Frenet = field(default_factory=Frenet)


#: Names of the native planners, each with one line of explanation.
NATIVE = {"frenet": "samples trajectories in the Frenet frame of the reference path and takes the cheapest safe one"}


#: The record of each native planner.
RECORDS: dict[str, type] = {"frenet": Frenet}


def native_name(record: object) -> str | None:
    """The name of a native record; None for anything else."""
    return next((name for name, kind in RECORDS.items() if type(record) is kind), None)


def native_record(name: str, settings: PlannerSettings) -> Any:  # noqa: ANN401 - one of RECORDS
    """The record of a native planner as the settings have it; one without settings is made."""
    return getattr(settings, name, None) or RECORDS[name]()


def native_planner(record: object) -> _core.FrenetSettings | None:
    """The core's parameter record; None for a planner written in Python."""
    return _core.FrenetSettings(flatten(record)) if isinstance(record, Frenet) else None
