"""FRENETIX for any car: the published C++ trajectory handler, with the loop of its own planner around it.

Trauth, Moller, Wuersching, Betz, "FRENETIX", IEEE Access 2024, doi 10.1109/ACCESS.2024.3436835; PyPI `frenetix` 0.4
(LGPL), an optional library: `pip install interdrive[frenetix]`. The library computes trajectories, costs and limits of
samples. This module adds what is left to its users: the samples, the desired speed, the choice, the tests of the chosen
trajectory against others and the road (done by the core), and the fallback if no sample is left.
docs/reference/planners_third_party.md lists its limitations and the differences from `frenet`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from interdrive import _core
from interdrive.errors import MissingExtraError, check_between
from interdrive.native_settings import FrenetWeights
from interdrive.planners.arrival import arrival_velocity, braking_along_arc
from interdrive.planners.contract import Trajectory

try:
    import frenetix
    from frenetix.trajectory_functions import (
        ComputeInitialState,
        FillCoordinates,
        cost_functions,
        feasability_functions,
    )
except ImportError:  # reported when a planner is made, so that its settings can be listed without the library
    frenetix = None

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from interdrive._core import Ego, Predictions, View

    _Floats = NDArray[np.float64]

#: The path that samples can reach ahead, and a little behind the agent [m]; there the heading must not be wrapped.
_BEHIND, _AHEAD = 10.0, 120.0
#: Headings are passed to the library within this angle of its x axis [rad]; it wraps them at half a turn.
_HEADING_MAX = 2.6
#: The library considers participants nearer than this to the agent's box [m] (squared: 50 m²).
_COST_REACH = 7.1
#: The largest sampled end speed [m/s].
_VELOCITY_MAX = 36.0
#: Columns of the sampling matrix: start and end time; start (s, s', s''), end s' and s''; start and end (d, d', d'').
_END_TIME, _START_S, _END_S_DOT, _START_D, _END_D, _COLUMNS = 1, 2, 5, 7, 10, 13


@dataclass
class Frenetix:
    """The FRENETIX trajectory handler (PyPI `frenetix` 0.4) with the sampling, costs and checks of its own planner.

    Attributes:
        level: Fineness of the sampling, 0 to 4: 48, 180, 800, 3564, 12716 samples.
        horizon: Length of a plan.
        t_min: Shortest time in which a manoeuvre ends.
        d_max: Largest lateral distance of end positions from the reference path.
        low_velocity: Below this speed lateral motion is planned over arc length instead of time.
        prediction_margin_length: Total length added to predicted participants.
        prediction_margin_width: Total width added to predicted participants.
        rear_cone_angle: Opening angle of the cone behind the agent ...
        rear_cone_distance: ... in which participants further away than this are not considered at all.
        arrival_reserve: The agent aims to reach its goal in the middle of the goal's time interval, but no earlier than
            this before its end; inf: in the middle, however long the interval, as in the published planner.
        replan_every: Number of calls from one plan to the next; in between the last plan is followed unchecked.
        carry_state: Begin a plan at the Frenet state that the library stated for this point of the previous plan, as
            its own planner does; false: compute it from the agent's state.
        path_spacing: Distance between the vertices of the reference path for the library.
        weights: Weights of the cost.
    """

    level: int = 2
    horizon: Annotated[float, "s"] = 3.0
    t_min: Annotated[float, "s"] = 1.1
    d_max: Annotated[float, "m"] = 3.0
    low_velocity: Annotated[float, "m/s"] = 2.0
    prediction_margin_length: Annotated[float, "m"] = 0.5
    prediction_margin_width: Annotated[float, "m"] = 0.2
    rear_cone_angle: Annotated[float, "rad"] = 0.3490658503988659
    rear_cone_distance: Annotated[float, "m"] = 6.0
    arrival_reserve: Annotated[float, "s"] = 2.0
    replan_every: int = 3
    carry_state: bool = True
    path_spacing: Annotated[float, "m"] = 1.0
    weights: FrenetWeights = field(default_factory=FrenetWeights)

    #: Every agent has its own object, and objects share no state.
    parallel = True

    def __post_init__(self) -> None:
        """Checks the library and the ranges."""
        if frenetix is None:
            raise MissingExtraError("planner frenetix needs the extra: pip install interdrive[frenetix]")
        for name, low, high in (
            ("level", 0, 4),
            ("horizon", 0.5, 10.0),
            ("t_min", 0.3, self.horizon),
            ("d_max", 0.0, 10.0),
            ("low_velocity", 0.1, 10.0),
            ("arrival_reserve", 0.0, float("inf")),
            ("replan_every", 1, 20),
            ("path_spacing", 0.1, 5.0),
        ):
            check_between(name, getattr(self, name), low, high)
        self._frame: _Frame | None = None
        self._last: _Plan | None = None

    def plan(self, view: View, predictions: Predictions) -> Trajectory:
        """Returns the rest of the previous plan, the cheapest admissible sample, or a stop."""
        ego = view.ego
        if ego.velocity < -_core.STANDSTILL_SPEED:
            # The library plans forwards only.
            return braking_along_arc(view, round(self.horizon / view.dt) + 1, ego.vehicle.acceleration_max)
        last, passed = self._last, 0 if self._last is None else view.time_step - self._last.time_step
        if last is not None and not last.leads_to(ego, passed):
            last = None
        if last is not None and passed < self.replan_every and passed + 2 <= len(last.x):
            return last.rest(passed)
        self._frame = frame = _Frame.around(self._frame, ego, self.path_spacing)
        low = ego.velocity < self.low_velocity
        carried = last.curvilinear_at(passed, low) if last is not None and self.carry_state else None
        start = frame.start_of(ego, low) if carried is None else carried
        considered = predictions.of(view.ids[~self._in_rear_cone(view)])
        handler = self._evaluated(view, considered, frame, start, low)
        plans = (_Plan.of(sample, view, frame, low) for sample in _feasible(handler))
        self._last = self._chosen(view, considered, plans, float(start[3]))
        return self._last.rest(0)

    def _evaluated(
        self, view: View, predictions: Predictions, frame: _Frame, start: _Floats, low: bool
    ) -> frenetix.TrajectoryHandler:
        """All samples with their costs and limits."""
        ego, vehicle = view.ego, view.ego.vehicle
        handler = frenetix.TrajectoryHandler(dt=view.dt)
        handler.add_function(FillCoordinates(low, frame.heading(ego.orientation), frame.system, self.horizon))
        checks = feasability_functions
        for check in (
            checks.CheckYawRateConstraint(vehicle.steering_angle_max, vehicle.wheelbase, False),
            checks.CheckAccelerationConstraint(vehicle.velocity_switch, vehicle.acceleration_max, False),
            checks.CheckCurvatureConstraint(vehicle.steering_angle_max, vehicle.wheelbase, False),
            checks.CheckCurvatureRateConstraint(vehicle.wheelbase, vehicle.steering_rate_max, False),
        ):
            handler.add_feasability_function(check)
        for cost in self._costs(view, predictions, frame):
            handler.add_cost_function(cost)
        handler.generate_trajectories(self.samples(view, start), low)
        handler.evaluate_all_current_functions(True)
        return handler

    def samples(self, view: View, start: _Floats) -> _Floats:
        """The library's sampling matrix, shape (samples, 13), for a Frenet start state (s, s', s'', d, d', d'')."""
        vehicle, v = view.ego.vehicle, view.ego.velocity
        n, step = 2 ** (self.level + 1) + 1, 0.1 * (10 // (self.level + 1))
        times = np.append(np.round(np.arange(self.t_min, self.horizon + view.dt, step), 2), self.horizon)
        reach = vehicle.acceleration_max * self.horizon
        fastest = max(min(v + reach / 6.0, _VELOCITY_MAX, vehicle.velocity_max), 0.001)
        speeds = np.append(np.linspace(max(0.001, v - reach), fastest, n), start[1])
        offsets = np.append(np.linspace(-self.d_max, self.d_max, n), start[3])
        axes = (np.unique(times[times <= self.horizon]), np.unique(speeds), np.unique(offsets))
        ends = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        rows = np.zeros((len(ends), _COLUMNS))
        rows[:, _START_S : _START_S + 3] = start[:3]
        rows[:, _START_D : _START_D + 3] = start[3:]
        rows[:, [_END_TIME, _END_S_DOT, _END_D]] = ends
        return rows

    def _costs(self, view: View, predictions: Predictions, frame: _Frame) -> Iterator[Any]:
        """The cost terms of the library with their weights."""
        ego, weights = view.ego, self.weights
        desired = arrival_velocity(view, self.arrival_reserve)
        plain = {
            "distance_to_reference": cost_functions.CalculateDistanceToReferencePathCost,
            "lateral_jerk": cost_functions.CalculateLateralJerkCost,
            "longitudinal_jerk": cost_functions.CalculateLongitudinalJerkCost,
            "acceleration": cost_functions.CalculateAccelerationCost,
            "jerk": cost_functions.CalculateJerkCost,
            "lateral_velocity": cost_functions.CalculateLateralVelocityCost,
            "lateral_acceleration": cost_functions.CalculateLateralAccelerationCost,
            "longitudinal_velocity": cost_functions.CalculateLongitudinalVelocityCost,
            "longitudinal_acceleration": cost_functions.CalculateLongitudinalAccelerationCost,
            "orientation_offset": cost_functions.CalculateOrientationOffsetCost,
        }
        for name, cost in plain.items():
            if getattr(weights, name) > 0:
                yield cost(name, getattr(weights, name))
        if weights.velocity_offset > 0:
            yield cost_functions.CalculateVelocityOffsetCost(
                "velocity_offset", weights.velocity_offset, desired, view.dt, self.t_min, False, 2
            )
        if weights.distance_to_obstacles > 0 and len(view.ids):
            centers = frame.points(np.column_stack([view.x[:, -1], view.y[:, -1]]))
            yield cost_functions.CalculateDistanceToObstacleCost(
                "distance_to_obstacles", weights.distance_to_obstacles, centers
            )
        expected = self._expected(view, predictions, frame) if weights.prediction > 0 else {}
        if expected:
            vehicle = ego.vehicle
            yield cost_functions.CalculateCollisionProbabilityFast(
                "prediction", weights.prediction, expected, vehicle.length, vehicle.width, vehicle.rear_axle_to_center
            )

    def _expected(self, view: View, predictions: Predictions, frame: _Frame) -> dict[int, Any]:
        """The most probable modes of all participants within reach of a sample, in the format of the library."""
        ego, margin = view.ego, (self.prediction_margin_length, self.prediction_margin_width)
        steps = min(predictions.x.shape[2], round(self.horizon / view.dt))
        farthest = (
            1.5 * (ego.velocity + 6.0) * view.dt * np.arange(1, steps + 1) + 2.0 * self.d_max + 20.0 + _COST_REACH
        )
        found = {}
        for row, participant in enumerate(predictions.ids.tolist()):
            mode = int(np.argmax(predictions.probability[row]))
            x, y = predictions.x[row, mode, :steps], predictions.y[row, mode, :steps]
            until = int(np.argmin(np.append(predictions.valid[row, mode, :steps], False)))
            if not (np.hypot(x[:until] - ego.x, y[:until] - ego.y) < farthest[:until]).any():
                continue
            seen = int(np.searchsorted(view.ids, participant))
            mean = frame.points(np.column_stack([x[:until], y[:until]]))
            half = 0.5 * (predictions.orientation[row, mode, :until] - frame.turn)
            covariance = frame.covariances(predictions.covariance[row, mode, :until])
            poses = []
            for k in range(until):
                whole = np.zeros((6, 6), order="F")
                whole[:2, :2] = covariance[k]
                turn = np.array([0.0, 0.0, np.sin(half[k]), np.cos(half[k])])
                poses.append(frenetix.PoseWithCovariance(np.array([mean[k, 0], mean[k, 1], 0.0]), turn, whole))
            size = float(view.length[seen]) + margin[0], float(view.width[seen]) + margin[1]
            found[participant] = frenetix.PredictedObject(participant, poses, *size)
        return found

    def _in_rear_cone(self, view: View) -> NDArray[np.bool_]:
        """Whether a participant is behind and far enough away to keep the distance."""
        ego = view.ego
        dx, dy = view.x[:, -1] - ego.x, view.y[:, -1] - ego.y
        distance = np.hypot(dx, dy)
        behind = -(dx * np.cos(ego.orientation) + dy * np.sin(ego.orientation))
        cone: NDArray[np.bool_] = behind >= distance * np.cos(0.5 * self.rear_cone_angle)
        return cone & (distance > self.rear_cone_distance)

    def _chosen(self, view: View, predictions: Predictions, plans: Iterable[_Plan], offset: float) -> _Plan:
        """The cheapest plan without contact that stays on the road; otherwise a stop."""
        margins = self.prediction_margin_length, self.prediction_margin_width
        refused = []
        for plan in plans:
            drive = plan.x, plan.y, plan.orientation
            if view.first_contact(*drive, predictions, *margins) is None and view.on_road(*drive):
                return plan
            refused.append(plan)
        n = round(self.horizon / view.dt) + 1
        if view.ego.velocity <= _core.STANDSTILL_SPEED:
            return _Plan.braking(view, n, view.ego.velocity / view.dt)
        if refused:  # the slowest, soonest, straightest one, even if it leads to a contact: "stopping" in the original
            return min(refused, key=lambda plan: (plan.ends[1], plan.ends[0], abs(plan.ends[2] - offset)))
        return _Plan.braking(view, n, view.ego.vehicle.acceleration_max)


@dataclass(frozen=True)
class _Frame:
    """The reference path as the library's coordinate system, turned by `turn` [rad] against the world.

    The library wraps every heading at half a turn and treats the jump as a yaw rate; on a road that leads west it would
    refuse nearly all samples. Turning the world so that the road ahead leads along x changes nothing else.
    """

    system: Any
    turn: float

    @staticmethod
    def around(before: _Frame | None, ego: Ego, spacing: float) -> _Frame:
        """The previous frame if the headings of the path ahead still fit, otherwise a new one."""
        route = ego.route
        heading = route.reference_orientation
        scale = (len(heading) - 1) / route.length
        first, last = (int(np.clip(scale * (ego.s + by), 0, len(heading) - 1)) for by in (-_BEHIND, _AHEAD))
        low, high = float(heading[first : last + 1].min()), float(heading[first : last + 1].max())
        if before is not None and max(high - before.turn, before.turn - low) < _HEADING_MAX:
            return before
        frame = _Frame(None, 0.5 * (low + high))
        knots = np.linspace(0.0, route.length, len(heading))
        s = np.arange(0.0, route.length, spacing)
        path = np.column_stack([np.interp(s, knots, route.reference_path[:, axis]) for axis in (0, 1)])
        return _Frame(frenetix.CoordinateSystemWrapper(np.array(frame.points(path), order="C")), frame.turn)

    def points(self, points: _Floats) -> _Floats:
        """World to frame, shape (points, 2)."""
        cos, sin = np.cos(self.turn), np.sin(self.turn)
        turned: _Floats = points @ np.array([[cos, -sin], [sin, cos]])
        return turned

    def world(self, x: _Floats, y: _Floats) -> tuple[_Floats, _Floats]:
        """Frame to world."""
        cos, sin = np.cos(self.turn), np.sin(self.turn)
        return cos * x - sin * y, sin * x + cos * y

    def covariances(self, covariances: _Floats) -> _Floats:
        """World to frame, shape (points, 2, 2); exactly symmetric, as the library requires."""
        cos, sin = np.cos(self.turn), np.sin(self.turn)
        back = np.array([[cos, sin], [-sin, cos]])
        turned: _Floats = back @ covariances @ back.T
        return 0.5 * (turned + turned.transpose(0, 2, 1))

    def heading(self, orientation: float) -> float:
        """World to frame, within half a turn."""
        return float(np.angle(np.exp(1j * (orientation - self.turn))))

    def start_of(self, ego: Ego, low: bool) -> _Floats:
        """(s, s', s'', d, d', d'') of the rear axle, by the library; d by arc length if `low`, else by time."""
        vehicle, back = ego.vehicle, ego.vehicle.rear_axle_to_center
        rear = np.array([[ego.x - back * np.cos(ego.orientation), ego.y - back * np.sin(ego.orientation)]])
        x, y = self.points(rear)[0].tolist()
        steering = float(np.arctan2(vehicle.wheelbase * ego.yaw_rate, ego.velocity))
        sample = frenetix.TrajectorySample(x, y, self.heading(ego.orientation), ego.acceleration, ego.velocity)
        ComputeInitialState(self.system, vehicle.wheelbase, steering, low).evaluate_trajectory(sample)
        c = sample.curvilinear
        return np.array([array[0] for array in (c.s, c.s_dot, c.s_ddot, c.d, c.d_dot, c.d_ddot)])


@dataclass(frozen=True)
class _Plan:
    """A plan in the world: footprint centres, made at `time_step`.

    Attributes:
        curvilinear: (s, s', s'', d, d', d'') of all points from the library, shape (6, points); None for other plans.
        low: Whether the lateral derivatives are by arc length.
        ends: Time [s], speed [m/s] and offset [m] at the end of the manoeuvre.
    """

    time_step: int
    x: _Floats
    y: _Floats
    orientation: _Floats
    velocity: _Floats
    curvilinear: _Floats | None = None
    low: bool = False
    ends: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @staticmethod
    def of(sample: Any, view: View, frame: _Frame, low: bool) -> _Plan:  # noqa: ANN401 - frenetix.TrajectorySample
        """Converts from the rear axle in the library's frame to the centre in the world."""
        points, curve, parameters = sample.cartesian, sample.curvilinear, sample.sampling_parameters
        theta = np.unwrap(np.asarray(points.theta) + frame.turn)
        theta += 2.0 * np.pi * np.round((view.ego.orientation - theta[0]) / (2.0 * np.pi))
        x, y = frame.world(np.asarray(points.x), np.asarray(points.y))
        back = view.ego.vehicle.rear_axle_to_center
        return _Plan(
            time_step=view.time_step,
            x=x + back * np.cos(theta),
            y=y + back * np.sin(theta),
            orientation=theta,
            velocity=np.array(points.v),
            curvilinear=np.array([curve.s, curve.s_dot, curve.s_ddot, curve.d, curve.d_dot, curve.d_ddot]),
            low=low,
            ends=(float(parameters[_END_TIME]), float(parameters[_END_S_DOT]), float(parameters[_END_D])),
        )

    @staticmethod
    def braking(view: View, n_points: int, deceleration: float) -> _Plan:
        """Braking along the present arc until the agent stands."""
        drive = braking_along_arc(view, n_points, deceleration)
        return _Plan(view.time_step, drive.x, drive.y, drive.orientation, drive.velocity)

    def leads_to(self, ego: Ego, point: int) -> bool:
        """Whether the agent is where this plan has it at a point."""
        if not 0 < point < len(self.x):
            return False
        there = (self.x[point] - ego.x, self.y[point] - ego.y, self.velocity[point] - ego.velocity)
        return bool(np.abs(there).max() < 1e-6)

    def rest(self, point: int) -> Trajectory:
        """The plan from a point on."""
        return Trajectory(self.x[point:], self.y[point:], self.orientation[point:], self.velocity[point:])

    def curvilinear_at(self, point: int, low: bool) -> _Floats | None:
        """The Frenet state of a point; lateral derivatives are converted to the other variable if necessary."""
        if self.curvilinear is None:
            return None
        s, s_dot, s_ddot, d, by_first, by_second = self.curvilinear[:, point].tolist()
        if low and not self.low:
            prime = by_first / s_dot if s_dot > 1e-3 else 0.0
            by_first, by_second = prime, (by_second - prime * s_ddot) / s_dot**2 if s_dot > 1e-3 else 0.0
        elif self.low and not low:
            by_first, by_second = s_dot * by_first, s_ddot * by_first + s_dot**2 * by_second
        return np.array([s, s_dot, s_ddot, d, by_first, by_second])


def _feasible(handler: Any) -> list[Any]:  # noqa: ANN401 - frenetix.TrajectoryHandler
    """Samples within all limits, the cheapest first; equal ones in the order of their ends."""
    samples = [sample for sample in handler.get_sorted_trajectories() if sample.valid and sample.feasible]
    return sorted(
        samples, key=lambda sample: (sample.cost, *sample.sampling_parameters[[_END_TIME, _END_S_DOT, _END_D]])
    )
