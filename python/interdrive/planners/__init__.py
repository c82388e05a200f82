"""Planners: where does an agent want to be over the next seconds?

A planner is anything with one method, `plan(view, predictions) -> Trajectory`. Native ones are plain records of
settings; all agents that use them are planned in one call of the core.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from interdrive import _core
from interdrive.errors import InputError
from interdrive.plugins import find, made
from interdrive.settings import flatten

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive._core import Plans, Predictions, View

__all__ = [
    "NATIVE",
    "Frenet",
    "FrenetComfort",
    "FrenetWeights",
    "Planner",
    "PlannerSettings",
    "Trajectory",
    "name_of",
    "native_planner",
    "resolve",
    "write_plan",
]


@dataclass(frozen=True)
class Trajectory:
    """A plan: point 0 is the present state, point `i` is `i * dt` later. All arrays have shape (points,).

    Attributes:
        x: Footprint centre [m], world frame.
        y: Footprint centre [m], world frame.
        orientation: Heading [rad].
        velocity: Speed along the heading [m/s].
        acceleration: [m/s²]; derived from the speed if None.
        yaw_rate: [rad/s]; derived from the heading if None.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    orientation: NDArray[np.float64]
    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64] | None = None
    yaw_rate: NDArray[np.float64] | None = None


@runtime_checkable
class Planner(Protocol):
    """Contract of a planner.

    Every agent and every run has its own object, so a planner may remember things. `plan` gets a view (the agent's own
    state, limits, route and goal under `view.ego`; the participants it sees with their past as arrays) and the
    predictions for everybody, and returns a trajectory of at least two points that starts at the present state. If it
    raises or returns garbage, only its own agent leaves the run, with outcome `planner_error`.
    """

    def plan(self, view: View, predictions: Predictions) -> Trajectory:
        """The trajectory to drive."""
        ...


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


#: A plan's point 0 may differ from the present heading [rad] and speed [m/s] by this much: planners with models of
#: their own smooth the start.
_START_TURN_MAX, _START_VELOCITY_MAX = 0.2, 1.0

#: Names of the native planners, each with one line of explanation.
NATIVE = {"frenet": "samples trajectories in the Frenet frame of the reference path and takes the cheapest safe one"}


def native_planner(record: object) -> _core.FrenetSettings | None:
    """The core's parameter record; None for a planner written in Python."""
    return _core.FrenetSettings(flatten(record)) if isinstance(record, Frenet) else None


def resolve(planner: object, settings: PlannerSettings) -> object:
    """A native record or an object with `plan` from a name, `module:object`, record, object or factory.

    Raises:
        InputError: Unknown name (with the nearest valid one), or something that is no planner.
    """
    if isinstance(planner, str):
        if planner in NATIVE:
            return getattr(settings, planner)
        planner = find(planner, tuple(NATIVE), "planner")
    if not isinstance(planner, Frenet):
        planner = made(planner, "plan", "planner")
    if isinstance(planner, Frenet | Planner):
        return planner
    raise InputError(f"{planner!r} is no planner: it has no method plan(view, predictions)")


def name_of(choice: object) -> str:
    """Name of a planner or predictor for tables and for repeating a run."""
    if isinstance(choice, str):
        return choice
    if isinstance(choice, Frenet):
        return "frenet"
    named: Any = choice if isinstance(choice, type) or hasattr(choice, "__qualname__") else type(choice)
    return f"{named.__module__}:{named.__qualname__}"


def _check_start(arrays: dict[str, NDArray[np.float64]], view: View) -> None:
    """The plan starts at the present state and never claims a speed that the vehicle does not have."""
    ego = view.ego
    gap = float(np.hypot(arrays["x"][0] - ego.x, arrays["y"][0] - ego.y))
    if gap > 0.1:
        raise InputError(f"the plan starts {gap:.2f} m away from the agent")
    turn = float(np.angle(np.exp(1j * (arrays["orientation"][0] - ego.orientation))))
    if abs(turn) > _START_TURN_MAX:
        raise InputError(f"the plan starts with a heading {turn:.2f} rad off the agent's")
    change = float(arrays["velocity"][0] - ego.velocity)
    if abs(change) > _START_VELOCITY_MAX:
        raise InputError(f"the plan starts {change:.2f} m/s off the agent's speed")
    fastest = float(np.abs(arrays["velocity"]).max())
    if fastest > 1.1 * ego.vehicle.velocity_max:
        raise InputError(f"the plan claims {fastest:.1f} m/s, the vehicle reaches {ego.vehicle.velocity_max:.1f} m/s")


def write_plan(plans: Plans, agent_id: int, trajectory: object, view: View) -> None:
    """Checks a trajectory from outside and writes it into the table of plans.

    Raises:
        InputError: No trajectory, arrays of different shapes, fewer than two points, values that are not numbers, or
            a start elsewhere than at the present state.
    """
    if not isinstance(trajectory, Trajectory):
        raise InputError(f"a {type(trajectory).__name__} was returned, a Trajectory is expected")
    fields = {name: getattr(trajectory, name) for name in ("x", "y", "orientation", "velocity")}
    arrays = {name: np.ascontiguousarray(values, dtype=np.float64) for name, values in fields.items()}
    shape = arrays["x"].shape
    if len(shape) != 1 or shape[0] < 2:
        raise InputError(f"x has shape {shape}, at least two points in one dimension are expected")
    dt = view.dt
    derived = {
        "acceleration": (trajectory.acceleration, arrays["velocity"]),
        "yaw_rate": (trajectory.yaw_rate, arrays["orientation"]),
    }
    for name, (given, source) in derived.items():
        values = given if given is not None else (np.gradient(source, dt) if source.shape == shape else source)
        arrays[name] = np.ascontiguousarray(values, dtype=np.float64)
    for name, array in arrays.items():
        if array.shape != shape:
            raise InputError(f"{name} has shape {array.shape}, x has {shape}")
        if not np.isfinite(array).all():
            raise InputError(f"{name} has values that are not numbers")
    _check_start(arrays, view)
    plans.set(agent_id, **arrays)
