"""A vehicle parked partly or wholly in an agent's lane, passed over another lane of the same direction.

Two lanes towards +x, 3.5 m wide, with a limit of 30 m/s; the parked car is 4.5 m long and 1.8 m wide, the agent 1.61 m
wide.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import interdrive as idr
from interdrive.testing.worlds import Car, problem, straight_road, world

PARKED = 200.0
#: Half of the agent's width and of the parked car's [m].
HALVES = 0.5 * 1.61 + 0.9
#: What is kept beside others at rest [m], and more for each m/s [s]: the defaults of `rollout`.
MARGIN = (0.1, 0.02)


def driven(y, speed, marking="dashed", cars=()):
    """A run with a car parked at an offset [m] and an agent 160 m before it."""
    lanes = straight_road(600.0, lanes=2)
    lanes = replace(
        lanes, speed_limit=np.full(2, 30.0), left_marking=(marking, "solid"), right_marking=("solid", marking)
    )
    agent = problem(1, 40.0, 0.0, speed, goal=(500.0, 0.0), time_step=(0, 900))
    scenario = world(lanes, cars=[Car(50, PARKED, y), *cars], problems=[agent], steps=900)
    kinds = tuple("parked_vehicle" if number == 50 else "car" for number in scenario.obstacles.ids)
    scenario = replace(scenario, obstacles=replace(scenario.obstacles, kinds=kinds))
    run = idr.simulate(scenario, agents=[1], threads=1)
    row = run.states.valid[0]
    return run, run.states.x[0, row], run.states.y[0, row], run.states.velocity[0, row]


@pytest.mark.parametrize("speed", [8.0, 14.0, 20.0])
@pytest.mark.parametrize("y", [-1.6, -1.0, -0.6, -0.2])
def test_a_parked_car_is_passed_with_the_margin_for_the_speed_and_without_braking(y, speed):
    run, x, offset, velocity = driven(y, speed)
    beside = np.abs(x - PARKED) < 4.5
    assert run.outcomes.outcome == ("goal_reached",)
    assert (offset[beside] - y).min() - HALVES >= MARGIN[0] + MARGIN[1] * speed - 0.1, "m of room, 0.1 m short at most"
    assert velocity[x < PARKED].min() >= 0.9 * speed, "m/s"


@pytest.mark.parametrize("y", [-1.2, -1.1, -1.0])
def test_where_a_lane_leaves_less_than_the_margin_an_agent_keeps_most_of_it(y):
    # The line must not be crossed; at 20 m/s the margin is 0.5 m.
    left = 1.75 - y - 0.9 - 1.61
    run, x, offset, _ = driven(y, 20.0, "solid")
    assert run.outcomes.outcome == ("goal_reached",)
    assert (offset[np.abs(x - PARKED) < 4.5] - y).min() - HALVES >= 0.7 * left, "m of room"


@pytest.mark.parametrize(("behind", "is_passed_first"), [(30.0, False), (60.0, False), (150.0, True)])
def test_a_car_that_comes_from_behind_in_the_other_lane_goes_first_unless_it_is_far(behind, is_passed_first):
    # It is 10 m/s faster and does not react; where the agent begins to move over it is 0, 30 and 120 m behind.
    overtaking = Car(60, 40.0 - behind, 3.5, 25.0)
    run, x, offset, _ = driven(-0.2, 15.0, cars=[overtaking])
    assert run.outcomes.outcome == ("goal_reached",), run.outcomes.reason
    entered = np.flatnonzero(offset > 1.75 - 0.5 * 1.61)[0]
    ahead = x[entered] - (overtaking.x + overtaking.velocity * 0.1 * entered)
    assert (ahead > 0.0) == is_passed_first, "m ahead of the other car"
    # Braking with 4 m/s² from a second after the agent is in its lane, it need not touch the agent.
    assert ahead < 0.0 or ahead - 4.5 > 10.0 + 10.0**2 / (2 * 4.0), "m"


@pytest.mark.parametrize(("marking", "is_passed"), [("dashed", True), ("solid", False), ("broad_solid", False)])
def test_a_line_between_two_lanes_of_a_direction_is_not_crossed_where_it_is_solid(marking, is_passed):
    run, x, offset, _ = driven(0.0, 10.0, marking)
    assert (x[400] > PARKED) == is_passed, "m, after 40 s"
    assert is_passed or np.abs(offset).max() < 0.5 * (3.5 - 1.61), "m, within its lane"
    assert run.violations.rule == ()


@pytest.mark.parametrize("behind", [45.0, 60.0, 70.0, 80.0, 100.0])
def test_an_agent_is_not_hit_by_faster_cars_that_do_not_react_in_the_lane_that_it_passes_on(behind):
    run, *_ = driven(-0.2, 12.0, cars=[Car(60, 100.0 - behind, 3.5, 20.0)])
    assert run.outcomes.outcome == ("goal_reached",), run.outcomes.reason


@pytest.mark.parametrize("distance", [8.0, 12.0, 16.0])
def test_the_tail_does_not_swing_into_a_parked_car_when_the_agent_turns_to_pass_the_next_one(distance):
    first, second = Car(50, PARKED, -0.9), Car(51, PARKED + distance, 0.9)
    lane = straight_road(600.0, lane_width=4.8)
    agent = problem(1, 100.0, 0.0, 8.0, goal=(500.0, 0.0), time_step=(0, 900))
    scenario = world(lane, cars=[first, second], problems=[agent], steps=900)
    kinds = ("parked_vehicle",) * len(scenario.obstacles.ids)
    run = idr.simulate(replace(scenario, obstacles=replace(scenario.obstacles, kinds=kinds)), agents=[1], threads=1)
    assert run.outcomes.outcome[0] != "collision", run.outcomes.reason
