"""What the default planner does in small worlds."""

from dataclasses import replace

import numpy as np
import pytest

from interdrive import GroundTruth, simulate
from interdrive.testing import Car, crossing, problem, straight_road, world

PREDICTORS = ["constant_velocity", "lane_following", "neural", "ground_truth"]


def track(run, agent_id):
    """x, y, velocity of an agent while it is there."""
    row = int(np.searchsorted(run.states.participant_id, agent_id))
    there = run.states.valid[row]
    return run.states.x[row, there], run.states.y[row, there], run.states.velocity[row, there]


def test_an_agent_on_an_empty_road_arrives_in_time_in_the_middle_of_its_lane():
    scenario = world(straight_road(), problems=[problem(100, 20.0, 0.6, goal=(110.0, 0.0), time_step=(80, 100))])
    run = simulate(scenario, agents=[100], threads=1)
    x, y, velocity = track(run, 100)
    assert run.outcomes.outcome == ("goal_reached",)
    assert abs(y[-1]) < 0.1
    assert np.abs(np.diff(velocity)).max() / 0.1 < 3.0
    assert x[0] == 20.0


@pytest.mark.parametrize("predictor", PREDICTORS)
def test_a_car_standing_in_the_lane_is_not_hit_whatever_predictor_is_used(predictor):
    scenario = world(
        straight_road(300.0),
        cars=[Car(7, 120.0)],
        problems=[problem(100, 20.0, velocity=15.0, goal=(200.0, 0.0), time_step=(0, 120))],
        steps=210,  # longer than the agent may take: 1.7 * 120
    )
    run = simulate(scenario, agents=[100], predictor=predictor, threads=1)
    assert run.outcomes.outcome == ("time_limit",)
    x, _, velocity = track(run, 100)
    assert velocity[-1] < 0.3
    assert 105.0 < x[-1] < 115.5  # bumper to bumper 0 to 10 m behind it


def test_an_agent_follows_the_car_ahead_and_does_not_drive_through_it():
    scenario = world(
        straight_road(400.0),
        cars=[Car(7, 60.0, velocity=8.0)],
        problems=[problem(100, 20.0, velocity=15.0, goal=(300.0, 0.0), time_step=(0, 150))],
        steps=250,
    )
    run = simulate(scenario, agents=[100], threads=1)
    assert run.outcomes.outcome[0] != "collision"
    _, _, velocity = track(run, 100)
    assert velocity[100] == pytest.approx(8.0, abs=1.0)


def test_an_agent_lets_a_car_pass_that_it_would_meet_at_a_crossing():
    scenario = world(
        crossing(),
        cars=[Car(7, 0.0, -50.0, velocity=10.0, orientation=np.pi / 2)],
        problems=[problem(100, -50.0, goal=(60.0, 0.0), time_step=(0, 140))],
        steps=100,
    )
    run = simulate(scenario, agents=[100], threads=1)
    assert run.outcomes.outcome == ("goal_reached",)


def test_two_agents_that_would_meet_at_a_crossing_both_arrive():
    problems = [
        problem(100, -50.0, goal=(60.0, 0.0), time_step=(0, 140)),
        problem(
            200, 0.0, -47.0, orientation=np.pi / 2, goal=(0.0, 60.0), goal_orientation=np.pi / 2, time_step=(0, 140)
        ),
    ]
    run = simulate(world(crossing(), problems=problems), threads=1)
    assert run.outcomes.outcome == ("goal_reached", "goal_reached")


def test_an_agent_that_can_only_brake_brakes_as_hard_as_it_can():
    scenario = world(
        straight_road(),
        cars=[Car(7, 37.0)],
        problems=[problem(100, 20.0, velocity=15.0, goal=(150.0, 0.0), time_step=(0, 60))],
    )
    run = simulate(scenario, agents=[100], threads=1)
    # 12.5 m to the car, 15 m/s: the brakes take 0.3 s to build up, in which it drives 4.3 m, then 11.5 m/s² suffice
    # (7.9 m), and 10.5 m/s² would not.
    assert run.outcomes.outcome == ("time_limit",)
    _, _, velocity = track(run, 100)
    assert velocity[-1] == pytest.approx(0.0, abs=0.3)


def test_an_agent_starts_exactly_at_its_recorded_state():
    scenario = world(straight_road(), cars=[Car(7, 30.0, 0.4, velocity=9.0)], steps=60)
    run = simulate(scenario, agents=[7], threads=1)
    states = run.states
    assert (states.x[0, 0], states.y[0, 0], states.orientation[0, 0], states.velocity[0, 0]) == (30.0, 0.4, 0.0, 9.0)
    assert run.outcomes.outcome == ("goal_reached",)


def test_an_agent_that_reached_its_goal_is_out_of_the_way():
    problems = [
        problem(100, 60.0, velocity=10.0, goal=(80.0, 0.0), time_step=(0, 60)),
        problem(200, 20.0, velocity=10.0, goal=(80.0, 0.0), time_step=(0, 90)),
    ]
    run = simulate(world(straight_road(), problems=problems), threads=1)
    assert run.outcomes.outcome == ("goal_reached", "goal_reached")
    assert run.outcomes.time_step[0] < run.outcomes.time_step[1]


def test_an_agent_that_knows_the_future_arrives_behind_a_slow_car_that_leaves():
    scenario = world(
        straight_road(),
        cars=[Car(7, 40.0, velocity=5.0, last=30)],
        problems=[problem(100, 10.0, goal=(90.0, 0.0), time_step=(0, 90))],
    )
    run = simulate(scenario, agents=[100], predictor=GroundTruth(), threads=1)
    assert run.outcomes.outcome == ("goal_reached",)


@pytest.mark.parametrize(("limit", "earliest", "latest"), [(np.nan, 32.0, 37.0), (15.0, 27.0, 31.0), (6.0, 31.0, 35.0)])
def test_on_a_road_with_a_known_limit_an_agent_is_early_but_never_too_fast(limit, earliest, latest):
    # 200 m in 40 s take 5 m/s; the goal begins 190 m ahead.
    lanelets = replace(straight_road(300.0), speed_limit=np.array([limit]))
    agent = problem(1, 20.0, velocity=5.0, goal=(220.0, 0.0), goal_size=(20.0, 3.5), time_step=(0, 400))
    run = simulate(world(lanelets, problems=[agent], steps=400), threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    assert earliest <= 0.1 * (np.count_nonzero(run.states.valid[0]) - 1) <= latest, "s"
    assert not np.nanmax(run.states.velocity[0]) > limit + 0.05, "m/s"


@pytest.mark.parametrize("planner", ["frenet", "rollout"])
def test_an_agent_that_enters_at_a_crawl_does_not_crawl_to_its_goal(planner):
    # 60 m in 40 s take 1.5 m/s, and neither the road nor the goal says how fast it should be: 5 m/s take 12 s.
    agent = problem(1, 20.0, velocity=0.2, goal=(85.0, 0.0), goal_size=(10.0, 3.5), time_step=(0, 400))
    run = simulate(world(straight_road(), problems=[agent], steps=400), planner=planner, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    assert 0.1 * run.outcomes.time_step[0] < 16.0, "s"
