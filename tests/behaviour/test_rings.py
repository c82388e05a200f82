"""Roads that close: rings of one to twelve lanelets, a lanelet that leads to itself, places behind the seam."""

import math
from dataclasses import replace

import commonroad_documents as cr
import numpy as np
import pytest
from rings import circling, ring, trip

from interdrive import read_scenario, simulate
from interdrive.criticality import evaluate
from interdrive.testing import world

NUMBERS = (1, 2, 3, 4, 7, 12)
RADII = (10.0, 20.0, 40.0, 80.0)


def traffic(n, radius, cars, lanes=1, steps=3):
    scenario = world(ring(n, radius, lanes), steps=0)
    return replace(scenario, obstacles=circling(cars, radius, steps=steps))


@pytest.mark.parametrize("n", NUMBERS)
@pytest.mark.parametrize("radius", RADII)
def test_headway_and_times_count_along_the_arc_wherever_the_ring_begins(n, radius):
    around = 2.0 * math.pi * radius
    gap = min(20.0, around / 3.0)
    for seam in (2.0, 0.5 * gap, gap - 2.0, -30.0):
        cars = {1: (around - seam, 8.0), 2: (around - seam + gap, 4.0)}
        found = evaluate(traffic(n, radius, cars), threads=1)
        headway = gap - 4.5
        # The centre line is a polygon with sides of a metre.
        assert found["hw"][0, 0] == pytest.approx(headway, abs=0.15)
        assert found["ttc"][0, 0] == pytest.approx(headway / 4.0, abs=0.05)
        assert found["thw"][0, 0] == pytest.approx(headway / 8.0, abs=0.05)


@pytest.mark.parametrize("n", NUMBERS)
def test_the_car_in_front_has_the_other_one_in_front_once_around(n):
    around = 2.0 * math.pi * 12.0
    found = evaluate(traffic(n, 12.0, {1: (1.0, 5.0), 2: (21.0, 5.0)}), threads=1)
    assert found["hw"][0, 0] == pytest.approx(20.0 - 4.5, abs=0.15)
    assert found["hw"][1, 0] == pytest.approx(around - 20.0 - 4.5, abs=0.5)


@pytest.mark.parametrize("n", [1, 4])
@pytest.mark.parametrize("laps", [0, 1, 3])
def test_a_leader_that_is_laps_ahead_is_as_near_as_it_stands(n, laps):
    around = 2.0 * math.pi * 12.0
    cars = {7: (5.0, 8.0), 8: (25.0 + laps * around, 4.0)}
    found = evaluate(traffic(n, 12.0, cars), threads=1)
    assert found["hw"][0] == pytest.approx([15.5, 15.1, 14.7, 14.3], abs=0.12)
    moment = found.most_critical("ttc")
    assert (moment.participant_id, moment.partner_id) == (7, 8)
    assert moment.value == pytest.approx(14.3 / 4.0, abs=0.05)


@pytest.mark.parametrize("n", [1, 4])
def test_in_a_ring_of_two_lanes_only_the_car_in_the_own_lane_is_in_front(n):
    cars = {1: (5.0, 8.0), 2: (40.0, 4.0)}
    scenario = traffic(n, 40.0, cars, lanes=2)
    found = evaluate(scenario, threads=1)
    assert found["hw"][0, 0] == pytest.approx(35.0 - 4.5, abs=0.15)
    assert found.most_critical("ttc").partner_id == 2


@pytest.mark.parametrize("n", [1, 4])
def test_headway_changes_evenly_over_the_seam(n):
    cars = {1: (2.0 * math.pi * 20.0 - 10.0, 8.0), 2: (2.0 * math.pi * 20.0 + 10.0, 4.0)}
    headway = evaluate(traffic(n, 20.0, cars, steps=30), threads=1)["hw"][0]
    np.testing.assert_allclose(np.diff(headway), -0.4, atol=0.05)


def test_a_car_in_the_lane_beside_is_not_in_front():
    inner = circling({2: (30.0, 4.0)}, 36.5, steps=3)
    outer = circling({1: (5.0, 8.0)}, 40.0, steps=3)
    both = {
        name: np.concatenate([getattr(outer, name), getattr(inner, name)])
        for name in (
            "ids", "is_static", "x", "y", "orientation", "velocity", "acceleration", "yaw_rate", "valid",
        )
    }  # fmt: skip
    obstacles = replace(outer, kinds=("car", "car"), shapes=outer.shapes * 2, **both)
    found = evaluate(replace(world(ring(1, 40.0, 2), steps=0), obstacles=obstacles), threads=1)
    assert np.isinf(found["hw"][0, 0])


@pytest.mark.parametrize("planner", ["rollout", "idm"])
@pytest.mark.parametrize("lanes", [1, 2])
@pytest.mark.parametrize("n", [1, 2, 3, 12])
def test_a_goal_behind_the_seam_and_one_behind_the_start_are_reached(n, lanes, planner):
    radius = 20.0
    around = 2.0 * math.pi * radius
    for start, goal in ((around - 6.0, 8.0), (8.0, 3.0)):
        scenario = world(ring(n, radius, lanes), problems=[trip(100, radius, start, goal)], steps=0)
        run = simulate(scenario, agents=[100], planner=planner, threads=1)
        assert run.outcomes.outcome == ("goal_reached",)


@pytest.mark.parametrize("radius", [10.0, 80.0])
def test_small_and_large_rings_are_driven_over_the_seam(radius):
    start, goal = 2.0 * math.pi * radius - 6.0, 12.0
    problem = trip(100, radius, start, goal, velocity=4.0)
    run = simulate(world(ring(3, radius), problems=[problem], steps=0), agents=[100], threads=1)
    assert run.outcomes.outcome == ("goal_reached",)


def closed_lanelet(turn=2.0 * math.pi, n=60):
    angles = np.linspace(0.0, turn, n + 1)
    left, right = ([(round(r * math.cos(a), 6), round(r * math.sin(a), 6)) for a in angles] for r in (28.0, 32.0))
    return cr.lanelet(1, left=left, right=right, more='<predecessor ref="1"/><successor ref="1"/>')


@pytest.mark.parametrize("turn", [2.0 * math.pi, 2.05 * math.pi, 1.97 * math.pi, -2.0 * math.pi])
def test_a_closed_lanelet_can_be_a_goal(turn, tmp_path):
    lanelet = closed_lanelet(turn) if turn > 0.0 else closed_lanelet(turn).replace("leftBound", "swap")
    if turn < 0.0:
        lanelet = lanelet.replace("rightBound", "leftBound").replace("swap", "rightBound")
    start = cr.initial(0.0, 30.0, orientation=math.pi if turn > 0.0 else 0.0, velocity=5.0, yawRate=0.0, slipAngle=0.0)
    goal = cr.goal(position='<lanelet ref="1"/>', time=(20, 60))
    scenario = read_scenario(
        cr.saved(tmp_path, cr.document(cr.planning_problem(60, goal, start=start), lanelets=lanelet))
    )
    run = simulate(scenario, agents=[60], threads=1)
    assert (run.outcomes.outcome, run.outcomes.time_step.tolist()) == (("goal_reached",), [20])
