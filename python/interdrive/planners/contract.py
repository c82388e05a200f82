"""What a planner is: one method from a view and predictions to a trajectory, and the checks of what it returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from interdrive.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive._core import Plans, Predictions, View

#: A plan's point 0 may differ from the present heading [rad] and speed [m/s] by this much: planners with models of
#: their own smooth the start.
_START_TURN_MAX, _START_VELOCITY_MAX = 0.2, 1.0


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
