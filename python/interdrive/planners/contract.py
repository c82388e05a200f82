"""The contract of planners: one method from a view and predictions to a trajectory, and the checks of its result."""

from __future__ import annotations

from collections.abc import Sized
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from interdrive._core import PLAN_POINTS_MAX
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
    for these participants and the agent. It returns a trajectory of 2 to 10,000 points that starts at the present
    state, never jumps, moves along its headings at the speeds that it states, and does not exceed the speed of the
    vehicle. Its arguments are read-only. If it raises an
    exception or returns an invalid trajectory, only its own agent ends, with outcome `planner_error`.

    Set `parallel = True` in a class if its objects are independent of each other: they run in separate processes, as
    many at a time as the run has threads, with the same results. Set `obeys_rules = True` if your planner stops before
    `view.ego.barriers`: its agents then get orders at junctions (`rules.precedence`), and others count on it.
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


#: What arrays that are refused hold, by the kind of their type.
_KINDS = {
    "b": "truth values",
    "c": "complex numbers",
    "O": "objects",
    "S": "bytes",
    "U": "texts",
    "M": "dates",
    "m": "times",
}


def stated(trajectory: object) -> Any:  # noqa: ANN401 - the last two may be None
    """The arrays of a trajectory, for `Step.set` of the core: x, y, orientation, velocity, acceleration, yaw_rate.

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
        arrays.append(None if values is None else _real_numbers(name, values))
    return tuple(arrays)


def _real_numbers(name: str, values: object) -> NDArray[np.float64]:
    """A field as an array; numpy alone would drop imaginary parts and masks, and read numbers out of texts."""
    if isinstance(values, np.ma.MaskedArray):
        raise InputError(f"{name} is a masked array, plain numbers are expected")
    if isinstance(values, Sized) and len(values) > PLAN_POINTS_MAX:
        raise InputError(f"the plan has {len(values)} points, at most {PLAN_POINTS_MAX} are allowed")
    if isinstance(values, (list, tuple)) and any(value is np.ma.masked for value in values):
        raise InputError(f"{name} holds masked values, plain numbers are expected")
    try:
        array = np.asarray(values)
        # Before anything is copied; rows of columns are refused with their shape later.
        if array.size > PLAN_POINTS_MAX:
            raise InputError(f"{name} has {array.size} values, at most {PLAN_POINTS_MAX} are allowed")
        if array.dtype.kind in "iuf":
            return array.astype(np.float64, copy=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} is not an array of numbers ({error})") from None
    held = _KINDS.get(array.dtype.kind, f"values of type {array.dtype}")
    raise InputError(f"{name} is not an array of real numbers: it holds {held}")
