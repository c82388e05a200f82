"""CommonRoad's reactive planner for any car.

Wuersching and Althoff, "Sampling-based optimal trajectory generation for autonomous vehicles using reachable sets",
ITSC 2021; after Werling et al., ICRA 2010. PyPI `commonroad-reactive-planner` 2025.1, an optional library:
`pip install interdrive[reactive]`. Samples, costs, limits and the search for the cheapest trajectory without contact
are those of the library. It gets start state, reference path, desired speed, obstacles and the edges of the road from
the view. docs/reference/planners_third_party.md lists its limitations and the differences from `frenet`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from interdrive import _core
from interdrive.errors import MissingExtraError, check_between
from interdrive.planners.arrival import arrival_velocity, braking_along_arc
from interdrive.planners.contract import Trajectory

try:
    from commonroad.common.util import Interval
    from commonroad.geometry.shape import Polygon
    from commonroad.planning.goal import GoalRegion
    from commonroad.planning.planning_problem import PlanningProblem
    from commonroad.scenario.scenario import Scenario
    from commonroad.scenario.state import CustomState, InitialState
    from commonroad_clcs.config import CLCSParams
    from commonroad_dc import pycrcc
    from commonroad_dc.collision.collision_detection.pycrcc_collision_dispatch import create_collision_object
    from commonroad_rp.reactive_planner import ReactivePlanner
    from commonroad_rp.state import ReactivePlannerState
    from commonroad_rp.utility.config import ReactivePlannerConfiguration
    from commonroad_rp.utility.utils_coordinate_system import CoordinateSystem
except ImportError:  # reported when a planner is made, so that its settings can be listed without the library
    ReactivePlanner = None

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive._core import Ego, Predictions, View

#: Edges of the road are boxes of this half width [m].
_EDGE = 0.005
#: The acceleration at the start is limited to this share of the limit: the library tests it, too, and would find no way
#: out of full braking.
_START_SHARE = 0.95


@dataclass
class Reactive:
    """CommonRoad's reactive planner (PyPI `commonroad-reactive-planner` 2025.1) with its own samples, costs and limits.

    Attributes:
        level: Finest sampling, 1 to 3; finer levels are tried only as long as there is no trajectory without contact.
        horizon: Length of a plan; beyond the end of the predictions the way is free.
        t_min: Shortest time in which a manoeuvre ends.
        d_max: Largest lateral distance of end positions from the reference path.
        low_velocity: Below this speed lateral motion is planned over arc length instead of time.
        deceleration_ratio: Speeds are sampled down to the speed that braking at this share of the largest deceleration
            leaves after the horizon; twice the library's value, whose horizon is twice as long.
        collision_mode_probability: Smallest probability of a predicted mode that a plan must not hit; the most probable
            mode always counts.
        arrive_in_time: Aim for the speed that brings the agent to its goal in time; false: for the middle of the goal's
            speeds, as the library does.
        arrival_reserve: The agent aims to reach its goal in the middle of the goal's time interval, but no earlier than
            this before its end.
        replan_every: Number of calls from one plan to the next; in between the last plan is followed unchecked.
        path_spacing: Distance between the vertices of the reference path for the library.
    """

    level: int = 3
    horizon: Annotated[float, "s"] = 3.0
    t_min: Annotated[float, "s"] = 0.4
    d_max: Annotated[float, "m"] = 3.0
    low_velocity: Annotated[float, "m/s"] = 4.0
    deceleration_ratio: float = 0.25
    collision_mode_probability: float = 0.2
    arrive_in_time: bool = True
    arrival_reserve: Annotated[float, "s"] = 2.0
    replan_every: int = 3
    path_spacing: Annotated[float, "m"] = 1.0

    #: Every agent has its own object, and objects share no state.
    parallel = True

    def __post_init__(self) -> None:
        """Checks the library and the ranges."""
        if ReactivePlanner is None:
            raise MissingExtraError("planner reactive needs the extra: pip install interdrive[reactive]")
        for name, low, high in (
            ("level", 1, 3),
            ("horizon", 1.2, 10.0),
            ("t_min", 0.2, self.horizon),
            ("d_max", 0.1, 10.0),
            ("low_velocity", 0.1, 10.0),
            ("deceleration_ratio", 0.01, 1.0),
            ("collision_mode_probability", 0.0, 1.0),
            ("arrival_reserve", 0.0, float("inf")),
            ("replan_every", 1, 20),
            ("path_spacing", 0.1, 5.0),
        ):
            check_between(name, getattr(self, name), low, high)
        self._planner: Any = None
        self._last: tuple[int, Trajectory] | None = None

    def plan(self, view: View, predictions: Predictions) -> Trajectory:
        """Returns the rest of the previous plan, the library's choice, or a stop."""
        rest = self._rest(view)
        if rest is not None:
            return rest
        if view.ego.velocity < -_core.STANDSTILL_SPEED:
            # The library plans forwards only.
            return braking_along_arc(view, round(self.horizon / view.dt) + 1, view.ego.vehicle.acceleration_max)
        if self._planner is None:
            self._planner = self._new_planner(view)
        planner, ego = self._planner, view.ego
        # The library converts the start state in the mode of the previous plan and plans in the mode of this one.
        planner._low_vel_mode = ego.velocity < self.low_velocity
        planner.reset(
            initial_state_cart=_rear_axle_state(view),
            collision_checker=self._obstacles(view, predictions),
            coordinate_system=planner.coordinate_system or _coordinates(ego, self.path_spacing),
        )
        desired = arrival_velocity(view, self.arrival_reserve) if self.arrive_in_time else None
        planner.set_desired_velocity(desired_velocity=desired, current_speed=max(ego.velocity, 1e-3))
        found = _asked(planner)
        if found is not None and ego.velocity <= _core.STANDSTILL_SPEED and not planner.infeasible_count_collision:
            found = self._start_off(planner, found)
        n = round(self.horizon / view.dt) + 1
        if found is not None:
            plan = _in_world(found[0].state_list, ego)
        elif ego.velocity <= _core.STANDSTILL_SPEED:
            plan = braking_along_arc(view, n, ego.velocity / view.dt)
        else:
            plan = braking_along_arc(view, n, ego.vehicle.acceleration_max)
        self._last = view.time_step, plan
        return plan

    def _start_off(self, planner: Any, found: Any) -> Any:  # noqa: ANN401 - ReactivePlanner and what it returns
        """The same plan, or one with finer samples if it only stands although the way is free.

        The library takes finer samples only if it finds no plan, and standing is a plan; but none of the coarse samples
        may steer gently enough to start off.
        """
        for level in range(2, self.level + 1):
            if found[0].state_list[-1].velocity > _core.STANDSTILL_SPEED or planner.infeasible_count_collision:
                break
            found = _asked(planner, level) or found
        return found

    def _rest(self, view: View) -> Trajectory | None:
        """The rest of the previous plan, if it is still valid and the agent follows it."""
        if self._last is None:
            return None
        made, plan = self._last
        passed, ego = view.time_step - made, view.ego
        if not 0 < passed < min(self.replan_every, len(plan.x) - 1):
            return None
        there = (plan.x[passed] - ego.x, plan.y[passed] - ego.y, plan.velocity[passed] - ego.velocity)
        if np.abs(there).max() > 1e-6:
            return None
        left = [None if part is None else part[passed:] for part in (plan.acceleration, plan.yaw_rate)]
        return Trajectory(plan.x[passed:], plan.y[passed:], plan.orientation[passed:], plan.velocity[passed:], *left)

    def _new_planner(self, view: View) -> Any:  # noqa: ANN401 - ReactivePlanner
        """The library's planner with the agent's limits; the roads reach it as edges, so its scenario is empty."""
        vehicle = view.ego.vehicle
        configuration = ReactivePlannerConfiguration()
        body = configuration.vehicle
        body.length, body.width, body.wb_rear_axle = vehicle.length, vehicle.width, vehicle.rear_axle_to_center
        body.wb_front_axle = vehicle.wheelbase - vehicle.rear_axle_to_center
        body.a_max, body.v_switch = vehicle.acceleration_max, vehicle.velocity_switch
        body.delta_min, body.delta_max = -vehicle.steering_angle_max, vehicle.steering_angle_max
        body.v_delta_min, body.v_delta_max = -vehicle.steering_rate_max, vehicle.steering_rate_max
        body.__post_init__()
        planning, sampling, debug = configuration.planning, configuration.sampling, configuration.debug
        planning.dt, planning.time_steps_computation = view.dt, round(self.horizon / view.dt)
        planning.low_vel_mode_threshold = self.low_velocity
        sampling.num_sampling_levels, sampling.t_min = self.level + 1, self.t_min
        sampling.d_min, sampling.d_max = -self.d_max, self.d_max
        sampling.max_deceleration_ratio = self.deceleration_ratio
        debug.multiproc, debug.logging_level = False, "CRITICAL"
        configuration.update(scenario=Scenario(view.dt), planning_problem=_planning_problem(view))
        return ReactivePlanner(configuration)

    def _obstacles(self, view: View, predictions: Predictions) -> Any:  # noqa: ANN401 - pycrcc.CollisionChecker
        """Collision objects: other participants at present and predicted positions, and the edges of the road."""
        checker = pycrcc.CollisionChecker()
        checker.add_collision_object(_edges(view))
        rows = {participant: row for row, participant in enumerate(predictions.ids.tolist())}
        for seen, participant in enumerate(view.ids.tolist()):
            if view.is_static[seen]:
                for outline in view.outlines(participant):
                    checker.add_collision_object(create_collision_object(Polygon(np.array(outline))))
                continue
            now = (view.orientation[seen, -1], view.x[seen, -1], view.y[seen, -1])
            size = 0.5 * view.length[seen], 0.5 * view.width[seen]
            row = rows.get(participant)
            probability = np.ones(1) if row is None else predictions.probability[row]
            for mode in range(len(probability)):
                if mode != int(np.argmax(probability)) and probability[mode] < self.collision_mode_probability:
                    continue
                moving = pycrcc.TimeVariantCollisionObject(view.time_step)
                moving.append_obstacle(pycrcc.RectOBB(*size, *now))
                for k in range(0 if row is None else predictions.x.shape[2]):
                    if not predictions.valid[row, mode, k]:
                        break
                    pose = (table[row, mode, k] for table in (predictions.orientation, predictions.x, predictions.y))
                    moving.append_obstacle(pycrcc.RectOBB(*size, *pose))
                checker.add_collision_object(moving)
        return checker


def _asked(planner: Any, level: int | None = None) -> Any:  # noqa: ANN401 - ReactivePlanner and what it returns
    """The library's plan; None if it has none."""
    try:
        return planner.plan(level)
    except TypeError:
        # If it stands and no sample is feasible it chooses to stay, but fails to format its own log line.
        if planner.x_0.velocity > _core.STANDSTILL_SPEED:
            raise
        return None


def _edges(view: View) -> Any:  # noqa: ANN401 - pycrcc.ShapeGroup
    """The edges of the road as thin boxes, without boxes that the agent's footprint touches at its start."""
    ego, edges = view.ego, view.ego.road_edges
    start, along = edges[:, 0], edges[:, 1] - edges[:, 0]
    middle, length = start + 0.5 * along, np.hypot(along[:, 0], along[:, 1])
    heading = np.arctan2(along[:, 1], along[:, 0])
    footprint = pycrcc.RectOBB(0.5 * ego.vehicle.length, 0.5 * ego.vehicle.width, ego.orientation, ego.x, ego.y)
    group = pycrcc.ShapeGroup()
    for k in np.flatnonzero(length > 0.0).tolist():
        box = pycrcc.RectOBB(0.5 * length[k], _EDGE, heading[k], middle[k, 0], middle[k, 1])
        if not footprint.collide(box):
            group.add_shape(box)
    return group


def _coordinates(ego: Ego, spacing: float) -> Any:  # noqa: ANN401 - CoordinateSystem
    """The reference path as the library's coordinate system; it is smooth already."""
    route = ego.route
    knots, s = np.linspace(0.0, route.length, len(route.reference_path)), np.arange(0.0, route.length, spacing)
    path = np.column_stack([np.interp(s, knots, route.reference_path[:, axis]) for axis in (0, 1)])
    return CoordinateSystem(path, preprocess_reference=False, clcs_params=CLCSParams())


def _planning_problem(view: View) -> Any:  # noqa: ANN401 - PlanningProblem
    """Start and goal; of the goal the library reads only the speeds."""
    ego = view.ego
    start = InitialState(
        time_step=view.time_step,
        position=np.array([ego.x, ego.y]),
        orientation=ego.orientation,
        velocity=ego.velocity,
        acceleration=ego.acceleration,
        yaw_rate=ego.yaw_rate,
        slip_angle=0.0,
    )
    _, (first, last), velocity, _ = max(ego.goal.states, key=lambda state: state[1][1])
    stated = {"time_step": Interval(first, last)}
    if velocity is not None:
        stated["velocity"] = Interval(*velocity)
    return PlanningProblem(ego.id, start, GoalRegion([CustomState(**stated)]))


def _rear_axle_state(view: View) -> Any:  # noqa: ANN401 - ReactivePlannerState
    ego, vehicle = view.ego, view.ego.vehicle
    back, limit = vehicle.rear_axle_to_center, _START_SHARE * vehicle.acceleration_max
    return ReactivePlannerState(
        time_step=view.time_step,
        position=np.array([ego.x - back * np.cos(ego.orientation), ego.y - back * np.sin(ego.orientation)]),
        orientation=ego.orientation,
        velocity=ego.velocity,
        acceleration=min(max(ego.acceleration, -limit), limit),
        yaw_rate=ego.yaw_rate,
        steering_angle=float(np.arctan2(vehicle.wheelbase * ego.yaw_rate, ego.velocity)),
    )


def _in_world(states: list[Any], ego: Ego) -> Trajectory:
    """Converts states of the rear axle to the footprint's centre."""
    theta: NDArray[np.float64] = np.unwrap([state.orientation for state in states])
    theta = theta + 2.0 * np.pi * np.round((ego.orientation - theta[0]) / (2.0 * np.pi))
    rear = np.array([state.position for state in states])
    back = ego.vehicle.rear_axle_to_center
    velocity = np.array([state.velocity for state in states])
    return Trajectory(rear[:, 0] + back * np.cos(theta), rear[:, 1] + back * np.sin(theta), theta, velocity)
