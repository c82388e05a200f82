"""FISS and its relatives for any car: sampling in the Frenet frame, of which few samples are looked at.

Sun, Chen, Sun, Liu, Mao, Tan, Yan, Ang, "FISS: a trajectory planning framework using fast iterative search and sampling
strategy for autonomous driving", IEEE RA-L 2022, and "FISS+", IROS 2023. PyPI `fiss-planner` 1.0 (Apache-2), an
optional library: `pip install interdrive[fiss]`. Samples, costs, limits, the search and the check against others are
those of the library. It gets start state, reference path, a corridor, the desired speed and predictions from the view.
docs/reference/planners_third_party.md lists its limitations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from interdrive import _core
from interdrive.errors import InputError, MissingExtraError, check_between
from interdrive.planners.arrival import arrival_velocity, braking_along_arc
from interdrive.planners.contract import Trajectory

try:
    import fiss_planner as fiss
except ImportError:  # reported when a planner is made, so that its settings can be listed without the library
    fiss = None

if TYPE_CHECKING:
    from collections.abc import Iterator

    from interdrive._core import Ego, Predictions, View

#: The search of the library: all samples, with bounds, from neighbour to neighbour, with refinement.
METHODS = ("fop", "fop_plus", "fiss", "fiss_plus")
#: Speed limits count from this far ahead of the rear axle, in multiples of the speed [s], and at least [m].
_PREVIEW, _PREVIEW_MIN = 2.0, 10.0
#: A stop line is a standing vehicle of this length behind it [m].
_LINE_LENGTH = 4.0
#: The previous plan goes on if the agent is where it said, along and across the path [m].
_FOLLOWED = 0.05
#: Plans that begin further from the agent than this are not driven [m]; the contract of planners allows twice as much.
_OFF = 0.05


@dataclass
class Fiss:
    """The FISS planners (PyPI `fiss-planner` 1.0) with their own samples, costs, limits and check against others.

    Attributes:
        method: `fop` looks at all samples, `fop_plus` at the cheapest first, `fiss` and `fiss_plus` search among them.
        horizon: Longest time in which a manoeuvre ends.
        lane_width: Width of the corridor around the reference path.
        reach: Participants that are further away are not looked at.
        comfort_deceleration: Towards bends, limits and the goal's largest speed the desired speed falls by this.
        lateral_acceleration: Bends are taken with at most this.
        arrival_reserve: The agent aims to reach its goal in the middle of the goal's time interval, but no earlier than
            this before its end.
    """

    method: str = "fiss_plus"
    horizon: Annotated[float, "s"] = 5.0
    lane_width: Annotated[float, "m"] = 3.5
    reach: Annotated[float, "m"] = 80.0
    comfort_deceleration: Annotated[float, "m/s²"] = 1.5
    lateral_acceleration: Annotated[float, "m/s²"] = 3.0
    arrival_reserve: Annotated[float, "s"] = 2.0

    #: A plan takes less time than its way to another process.
    parallel = False
    #: It stops at what the rules of the road ask for.
    obeys_rules = True

    def __post_init__(self) -> None:
        """Checks the library, the method and the ranges."""
        if fiss is None:
            raise MissingExtraError("planner fiss needs the extra: pip install interdrive[fiss]")
        if self.method not in METHODS:
            raise InputError(f"method must be one of {', '.join(METHODS)}, is {self.method!r}")
        for name, low, high in (
            ("horizon", 3.0, 10.0),
            ("lane_width", 1.0, 20.0),
            ("reach", 1.0, 1000.0),
            ("comfort_deceleration", 0.1, 10.0),
            ("lateral_acceleration", 0.1, 10.0),
            ("arrival_reserve", 0.0, float("inf")),
        ):
            check_between(name, getattr(self, name), low, high)
        self._planner: Any = None
        self._line: Any = None
        self._corridor: Any = None
        self._next: Any = None

    def plan(self, view: View, predictions: Predictions) -> Trajectory:
        """Returns the library's choice, or a stop if it has none."""
        ego = view.ego
        n = round(self.horizon / view.dt) + 1
        if ego.velocity < -_core.STANDSTILL_SPEED:
            # The library plans forwards only.
            return braking_along_arc(view, n, ego.vehicle.acceleration_max)
        if self._planner is None:
            self._prepare(view)
        start = self._line.to_frenet(_rear_axle(ego), ego.s)
        expected, self._next = self._next, None
        if expected is not None and max(abs(expected.s - start.s), abs(expected.d - start.d)) < _FOLLOWED:
            start = expected
        others = [*self._others(view, predictions), *self._lines(view)]
        found = self._planner.plan(start, self._line, self._corridor, others, self._desired(view))
        plan = _in_world(found.trajectory, ego) if found.success else None
        # Where the path bends back the library may take the foot of another stretch of it.
        if plan is None or np.hypot(plan.x[0] - ego.x, plan.y[0] - ego.y) > _OFF:
            return braking_along_arc(view, n, ego.vehicle.acceleration_max)
        self._next = found.trajectory.frenet_state_at(1)
        return plan

    def _prepare(self, view: View) -> None:
        ego, body = view.ego, fiss.VehicleParams()
        vehicle, path = ego.vehicle, ego.route.reference_path
        body.length, body.width, body.wheelbase = vehicle.length, vehicle.width, vehicle.wheelbase
        body.rear_axle_to_center, body.max_speed = vehicle.rear_axle_to_center, vehicle.velocity_max
        body.max_steer, body.max_steer_rate = vehicle.steering_angle_max, vehicle.steering_rate_max
        body.max_decel = min(body.max_decel, vehicle.acceleration_max)
        configuration = fiss.make_config(self.method)
        configuration.sampling.dt, configuration.sampling.max_t = view.dt, self.horizon
        self._planner = fiss.make_planner(configuration, body)
        self._line = fiss.ReferenceLine(path[:, 0].tolist(), path[:, 1].tolist(), 1.0)
        half = 0.5 * self.lane_width
        self._corridor = fiss.Corridor.uniform(0.0, float(ego.route.length), -half, half)

    def _desired(self, view: View) -> float:
        """The speed for arrival in time, below limits, what bends allow, and what the goal asks for [m/s]."""
        ego, route = view.ego, view.ego.route
        s = np.linspace(0.0, route.length, len(route.reference_path))
        bend = np.sqrt(self.lateral_acceleration / np.maximum(np.abs(route.reference_curvature), 1e-6))
        most = np.fmin(ego.speed_limit, bend)
        reach = max(_PREVIEW * ego.velocity, _PREVIEW_MIN)
        ahead = (s >= ego.s) & (s <= ego.s + reach)
        allowed = np.sqrt(
            most[ahead] ** 2 + 2.0 * self.comfort_deceleration * np.maximum(s[ahead] - ego.s - ego.velocity, 0.0)
        )
        wanted = min([arrival_velocity(view, self.arrival_reserve), *allowed[np.isfinite(allowed)].tolist()])
        _, _, velocity, _ = max(ego.goal.states, key=lambda state: state[1][1])
        left = route.goal_entry_s - ego.s
        if velocity is not None and np.isfinite(left):
            slowing = 2.0 * self.comfort_deceleration * max(left - ego.velocity, 0.0)
            wanted = min(wanted, float(np.sqrt(0.25 * (velocity[0] + velocity[1]) ** 2 + slowing)))
        return max(float(wanted), 0.0)

    def _others(self, view: View, predictions: Predictions) -> Iterator[Any]:
        """Participants in reach, as the most probable mode predicts them."""
        rows = {participant: row for row, participant in enumerate(predictions.ids.tolist())}
        near = np.hypot(view.x[:, -1] - view.ego.x, view.y[:, -1] - view.ego.y) <= self.reach
        for seen in np.flatnonzero(near).tolist():
            participant = int(view.ids[seen])
            track = [[float(table[seen, -1])] for table in (view.x, view.y, view.orientation)]
            row = rows.get(participant)
            if row is not None:
                mode = int(np.argmax(predictions.probability[row]))
                known = predictions.valid[row, mode]
                tables = (predictions.x, predictions.y, predictions.orientation)
                for values, table in zip(track, tables, strict=True):
                    values.extend(table[row, mode][known].tolist())
            times = (view.dt * np.arange(len(track[0]))).tolist()
            size = float(view.length[seen]), float(view.width[seen])
            yield fiss.Obstacle.from_arrays(participant, *size, times, *track, bool(view.is_static[seen]))

    def _lines(self, view: View) -> Iterator[Any]:
        """Lines before which the rules of the road make the agent wait, as standing vehicles behind them."""
        route = view.ego.route
        knots = np.linspace(0.0, route.length, len(route.reference_path))
        heading = np.unwrap(route.reference_orientation)
        barriers = view.ego.barriers
        for number, (line, until) in enumerate(zip(barriers.s.tolist(), barriers.until.tolist(), strict=True)):
            s = line + 0.5 * _LINE_LENGTH
            axes = (route.reference_path[:, 0], route.reference_path[:, 1], heading)
            x, y, orientation = (float(np.interp(s, knots, axis)) for axis in axes)
            n = int(min(until, self.horizon) / view.dt) + 2
            times = (view.dt * np.arange(n)).tolist()
            stands = [x] * n, [y] * n, [orientation] * n
            yield fiss.Obstacle.from_arrays(-1 - number, _LINE_LENGTH, self.lane_width, times, *stands, False)


def _rear_axle(ego: Ego) -> Any:  # noqa: ANN401 - fiss_planner.EgoState
    back = ego.vehicle.rear_axle_to_center
    x, y = ego.x - back * np.cos(ego.orientation), ego.y - back * np.sin(ego.orientation)
    limit = ego.vehicle.curvature_max
    curvature = min(max(ego.yaw_rate / max(ego.velocity, 0.5), -limit), limit)
    return fiss.EgoState(x, y, ego.orientation, max(ego.velocity, 0.0), ego.acceleration, curvature)


def _in_world(found: Any, ego: Ego) -> Trajectory:  # noqa: ANN401 - fiss_planner.Trajectory
    """Converts states of the rear axle to the footprint's centre."""
    theta = np.unwrap(np.asarray(found.yaw, dtype=float))
    theta = theta + 2.0 * np.pi * np.round((ego.orientation - theta[0]) / (2.0 * np.pi))
    back = ego.vehicle.rear_axle_to_center
    x, y = np.asarray(found.x) + back * np.cos(theta), np.asarray(found.y) + back * np.sin(theta)
    return Trajectory(x, y, theta, np.maximum(np.asarray(found.v, dtype=float), 0.0))
