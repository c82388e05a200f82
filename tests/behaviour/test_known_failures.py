"""What other simulators are known to get wrong, each named after the behaviour."""

import numpy as np
import pytest

from interdrive import simulate
from interdrive.testing import Car, problem, straight_road, world

PREDICTORS = ["constant_velocity", "lane_following", "neural", "ground_truth"]


def track(run, agent_id):
    """x and velocity of an agent while it is there."""
    row = int(np.searchsorted(run.states.participant_id, agent_id))
    there = run.states.valid[row]
    return run.states.x[row, there], run.states.velocity[row, there]


@pytest.mark.parametrize("velocity", [2.0, 8.0, 15.0, 25.0, 35.0])
@pytest.mark.parametrize("predictor", PREDICTORS)
def test_a_vehicle_standing_in_the_lane_ahead_is_not_hit(predictor, velocity):
    # As far ahead as comfortable braking takes (3 m/s²), and as much again, so that the agent first drives freely.
    distance = velocity**2 / 3.0 + 20.0
    # There is a recording for as long as the agent may take: 1.7 times its time limit.
    limit = int(10.0 * (distance / velocity + 10.0))
    scenario = world(
        straight_road(distance + 300.0),
        cars=[Car(7, 20.0 + distance)],
        problems=[
            problem(100, 20.0, velocity=velocity, goal=(100.0 + distance, 0.0), time_step=(0, limit)),
        ],
        steps=int(1.7 * limit) + 5,
    )
    run = simulate(scenario, agents=[100], predictor=predictor, threads=1)
    x, now = track(run, 100)
    assert run.outcomes.outcome == ("time_limit",)
    assert now[-1] < 0.3
    gap = 20.0 + distance - x[-1] - 0.5 * (4.508 + 4.5)
    assert 0.0 < gap < 12.0


@pytest.mark.parametrize("predictor", PREDICTORS)
def test_a_vehicle_that_is_parked_for_good_is_not_hit(predictor):
    scenario = world(
        straight_road(300.0),
        cars=[Car(7, 120.0)],
        problems=[problem(100, 20.0, velocity=15.0, goal=(200.0, 0.0), time_step=(0, 100))],
        steps=175,
    )
    obstacles = scenario.obstacles
    parked = type(obstacles)(**{**obstacles.__dict__, "kinds": ("parked_vehicle",), "is_static": np.array([True])})
    scenario = type(scenario)(**{**scenario.__dict__, "obstacles": parked})
    run = simulate(scenario, agents=[100], predictor=predictor, threads=1)
    x, now = track(run, 100)
    assert run.outcomes.outcome == ("time_limit",)
    assert now[-1] < 0.3
    assert x[-1] < 120.0 - 0.5 * (4.508 + 4.5)


@pytest.mark.parametrize("predictor", PREDICTORS)
def test_an_agent_drives_into_a_goal_area_that_another_agent_reached_and_left_before(predictor):
    problems = [
        problem(100, 60.0, velocity=10.0, goal=(90.0, 0.0), time_step=(0, 60)),
        problem(200, 20.0, velocity=10.0, goal=(90.0, 0.0), time_step=(0, 120)),
    ]
    alone = simulate(world(straight_road(), problems=problems[1:]), predictor=predictor, threads=1)
    run = simulate(world(straight_road(), problems=problems), predictor=predictor, threads=1)
    assert run.outcomes.outcome == ("goal_reached", "goal_reached")
    first, second = run.outcomes.time_step.tolist()
    assert first < second
    assert abs(second - alone.outcomes.time_step[0]) <= 2
    x, velocity = track(run, 200)
    assert x[-1] > 85.0 - 1e-6
    # From the moment when the other one is gone, it drives as if there had been none.
    undisturbed = track(alone, 200)[1]
    both = slice(first + 10, min(len(velocity), len(undisturbed)))
    assert np.abs(velocity[both] - undisturbed[both]).max() < 0.3


@pytest.mark.parametrize(("x", "velocity"), [(0.0, 0.0), (0.0, 5.0), (100.0, 0.0), (100.0, 5.0)])
def test_an_agent_that_starts_at_the_very_edge_of_a_lanelet_starts_at_once(x, velocity):
    # Two lanelets, one after the other, that meet at x = 100 m.
    road = straight_road(200.0)
    left, right = road.left[0], road.right[0]
    middle = len(left) // 2
    parts = {
        "ids": np.array([1, 2]),
        "left": (left[: middle + 1], left[middle:]),
        "right": (right[: middle + 1], right[middle:]),
        "predecessors": ((), (1,)),
        "successors": ((2,), ()),
        "adjacent_left": np.array([-1, -1]),
        "adjacent_left_same_direction": np.array([False, False]),
        "adjacent_right": np.array([-1, -1]),
        "adjacent_right_same_direction": np.array([False, False]),
        "speed_limit": np.array([np.nan, np.nan]),
        "types": ((), ()),
    }
    assert left[middle, 0] == 100.0
    start = problem(100, x, velocity=velocity, goal=(x + 50.0, 0.0), time_step=(0, 120))
    run = simulate(world(type(road)(**parts), problems=[start]), threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    driven, now = track(run, 100)
    assert now[10] > max(0.5, 0.8 * velocity), "m/s after a second"
    assert (np.diff(driven) > 0.0).all()


@pytest.mark.parametrize("y", [1.75, -1.75, 5.25])
@pytest.mark.parametrize("velocity", [0.0, 5.0])
def test_an_agent_that_starts_on_the_side_of_a_lanelet_starts_at_once(y, velocity):
    # On the border between two lanes, and on the outer borders, where half the vehicle is off the road.
    goal = (80.0, 0.0 if y < 3.0 else 3.5)
    start = problem(100, 20.0, y, velocity=velocity, goal=goal, goal_size=(10.0, 3.5), time_step=(0, 150))
    run = simulate(world(straight_road(lanes=2), problems=[start]), threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    driven, now = track(run, 100)
    assert now[10] > max(0.5, 0.8 * velocity), "m/s after a second"
    assert (np.diff(driven) > 0.0).all()
