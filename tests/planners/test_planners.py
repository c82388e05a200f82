"""Native planner records, and planners written by users."""

import math

import numpy as np
import pytest
from drivers import Straight

from interdrive import Frenet, InputError, Trajectory
from interdrive.planners import FrenetWeights, native_planner
from interdrive.testing import PlannerContractError, check_planner


def test_an_impossible_setting_is_refused_by_its_name():
    with pytest.raises(InputError, match=r"level: must be 0 to 4"):
        Frenet(level=9)
    with pytest.raises(InputError, match=r"weights\.jerk"):
        Frenet(weights=FrenetWeights(jerk=-1.0))


def test_a_planner_in_python_has_no_native_record():
    assert native_planner(Straight()) is None


def test_a_planner_that_keeps_the_contract_passes_the_check():
    ends = check_planner(Straight)
    assert ends["an empty road"] == "goal_reached"
    assert ends["a standing car ahead"] == "collision"


def test_the_check_has_a_bar_to_wait_before_and_a_car_that_another_agent_reports():
    told = set()

    class Listening(Straight):
        def plan(self, view, predictions):
            told.update(zip(view.via.tolist(), view.ids.tolist(), strict=True))
            return super().plan(view, predictions)

    check_planner(Listening)
    assert (3, -1) in told, "a bar"
    assert (2, 3) in told, "the hidden car, by a message of a third agent"


class Leaping(Straight):
    def plan(self, view, predictions):
        plan = super().plan(view, predictions)
        return Trajectory(plan.x + np.linspace(0, 300, 31), plan.y, plan.orientation, plan.velocity)


class Random(Straight):
    def plan(self, view, predictions):
        plan = super().plan(view, predictions)
        jitter = np.random.default_rng().random()
        return Trajectory(plan.x + np.linspace(0, 0.1, 31) * jitter, plan.y, plan.orientation, plan.velocity)


class Pirouetting(Straight):
    def plan(self, view, predictions):
        plan = super().plan(view, predictions)
        return Trajectory(plan.x, plan.y, plan.orientation + np.linspace(0, 4 * math.pi, 31), plan.velocity)


class Turntable(Straight):
    """Straight on; a standing vehicle turns around the rear axle."""

    rate = 0.3

    def plan(self, view, predictions):
        plan = super().plan(view, predictions)
        if view.ego.velocity > 0.0:
            return plan
        heading = plan.orientation + self.rate * view.dt * np.arange(31)
        back = view.ego.vehicle.rear_axle_to_center
        x = plan.x + back * (np.cos(heading) - np.cos(plan.orientation))
        y = plan.y + back * (np.sin(heading) - np.sin(plan.orientation))
        return Trajectory(x, y, heading, plan.velocity)


class Trembling(Turntable):
    rate = 0.05


class Swerving(Straight):
    """Stands and trembles for two seconds, then takes a curve of twice the curvature that the vehicle can drive."""

    def plan(self, view, predictions):
        plan = super().plan(view, predictions)
        if view.ego.velocity > 0.0:
            return plan
        time = view.dt * np.arange(31)
        velocity = 3.0 * np.maximum(time - 2.0, 0.0)
        way = velocity**2 / 6.0
        curvature = 2.0 * view.ego.vehicle.curvature_max
        heading = plan.orientation + 0.05 * np.minimum(time, 2.0) + curvature * way
        back = view.ego.vehicle.rear_axle_to_center
        x = plan.x + np.sin(curvature * way) / curvature + back * (np.cos(heading) - np.cos(plan.orientation))
        y = plan.y + (1.0 - np.cos(curvature * way)) / curvature + back * (np.sin(heading) - np.sin(plan.orientation))
        return Trajectory(x, y, heading, velocity)


class Nothing:
    def plan(self, view, predictions):
        return None


class Broken:
    def plan(self, view, predictions):
        return 1 / 0


@pytest.mark.parametrize(
    ("planner", "words"),
    [
        (Leaping, "an empty road, time step 0: the plan jumps by 11.00 m"),
        (Random, "made different plans for the same view"),
        (
            Pirouetting,
            r"time step 0: the plan moves 0.\d m sideways in 0.1 s but states 10.0 m/s \(points \d+ to \d+\)",
        ),
        (Turntable, "a start from standstill, time step 0: the plan turns by 0.30 rad/s on the spot"),
        (Swerving, "standstill, time step 0: the plan turns by 1.41 rad per metre, the vehicle by 0.70 at most"),
        (Nothing, "NoneType"),
        (Broken, "ZeroDivisionError"),
    ],
)
def test_a_planner_that_breaks_the_contract_fails_the_check(planner, words):
    with pytest.raises(PlannerContractError, match=words):
        check_planner(planner)


def test_a_planner_that_trembles_where_it_stands_passes_the_check():
    assert check_planner(Trembling)["a start from standstill"] != "planner_error"
