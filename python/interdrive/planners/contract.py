"""The contract of planners: one method from a view and predictions to a trajectory, and the checks of its result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from interdrive.errors import InputError
from interdrive.scenario import STATE_FIELDS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive._core import Predictions, View


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

    Every agent and every run has its own object, so a planner may keep state. `plan` gets a view (the agent's state,
    limits, route and goal under `view.ego`, and the visible participants with their past as arrays) and the predictions
    for these participants and the agent. It returns a trajectory of at least two points that starts at the present
    state, never jumps, and does not exceed the speed of the vehicle. Its arguments are read-only. If it raises an
    exception or returns an invalid trajectory, only its own agent ends, with outcome `planner_error`.

    Set `parallel = True` in a class if its objects are independent of each other: they run in separate processes when a
    run has more than one thread, with the same results. Set `obeys_rules = True` if your planner stops where
    `view.ego.stop_s` says: its agents then get orders at junctions (`rules.precedence`), and others count on it.
    """

    def plan(self, view: View, predictions: Predictions) -> Trajectory:
        """The trajectory to drive.

        Args:
            view: What the agent sees now, read-only.
            predictions: For the participants in view and for the agent itself, read-only.

        Returns:
            At least two points, `view.dt` apart. Only the first step is driven.
        """
        ...


def stated(trajectory: object) -> Any:  # noqa: ANN401 - the last two may be None
    """The arrays of a trajectory, for `Plans.set`: x, y, orientation, velocity, acceleration, yaw_rate.

    Raises:
        InputError: The object is not a trajectory, or a field does not hold real numbers.
    """
    if not isinstance(trajectory, Trajectory):
        raise InputError(f"it returned a {type(trajectory).__name__}, a Trajectory is expected")
    arrays = []
    for name in STATE_FIELDS:
        values = getattr(trajectory, name)
        if values is None and name in STATE_FIELDS[:4]:
            raise InputError(f"{name} is missing")
        if values is not None:
            try:
                values = np.asarray(values, dtype=np.float64)
            except (TypeError, ValueError) as error:
                raise InputError(f"{name} is not an array of numbers ({error})") from None
        arrays.append(values)
    return tuple(arrays)
