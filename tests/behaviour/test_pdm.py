"""`pdm` proposes car following on three paths at five speeds, scores what comes of it, and drives the best."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import interdrive as idr
from interdrive.scenario import GoalState, StopLine, TrafficLight
from interdrive.testing import Car, bend, problem, straight_road, world

#: No driver is just in time here.
RELAXED = (0, 600)


def road(*, limit=10.0, velocity=5.0, cars=(), goal=250.0, lanes=1, steps=300, dt=0.1, **more):
    """Lanes along x with a speed limit [m/s] and an agent on the lowest one whose goal lies ahead."""
    lanelets = straight_road(400.0, lanes)
    lanelets = replace(lanelets, speed_limit=np.full_like(lanelets.speed_limit, limit))
    agent = problem(100, 20.0, velocity=velocity, goal=(goal, 0.0), time_step=RELAXED)
    return world(lanelets, cars=cars, problems=[agent], steps=steps, dt=dt, **more)


def drive(scenario, planner="pdm", **options):
    run = idr.simulate(scenario, agents="problems", planner=planner, threads=1, **options)
    return run, int(np.searchsorted(run.states.participant_id, 100))


def test_on_a_free_road_it_drives_in_the_middle_of_its_lane_at_the_limit():
    run, row = drive(road(limit=10.0))
    assert run.outcomes.outcome == ("goal_reached",)
    assert 9.5 < np.nanmax(run.states.velocity[row]) <= 10.0, "m/s"
    assert np.nanmax(np.abs(run.states.y[row])) < 0.01, "m"
    unlimited, row = drive(road(limit=np.nan))
    assert 14.0 < np.nanmax(unlimited.states.velocity[row]) <= 15.0, "m/s"


def test_it_stops_behind_a_standing_vehicle_with_the_least_gap_of_its_law():
    run, row = drive(road(cars=[Car(7, 120.0)], steps=400))
    last = 350
    assert run.states.velocity[row, last] < 0.05, "m/s"
    gap = 120.0 - run.states.x[row, last] - 0.5 * (run.states.length[row] + 4.5)
    assert 0.5 < gap < 1.4, "m"


def test_it_passes_what_stands_in_its_lane_on_the_path_beside_the_middle():
    # The body reaches to 0.7 m from the middle of the lane: the middle is blocked, the path on the other side is free.
    run, row = drive(road(cars=[Car(7, 120.0, -1.6)], lanes=2))
    assert run.outcomes.outcome == ("goal_reached",)
    assert np.nanmax(run.states.y[row]) == pytest.approx(1.0, abs=0.15), "m"
    alone, row = drive(road(cars=[Car(7, 120.0, -1.6)], lanes=2), idr.Pdm(offset=0.0))
    assert np.nanmax(alone.states.x[row, :250]) < 120.0, "m"


def test_it_takes_a_bend_on_the_road_and_no_faster_than_its_lateral_acceleration():
    lanelets = bend(radius=25.0, arm=60.0)
    lanelets = replace(lanelets, speed_limit=np.full_like(lanelets.speed_limit, 20.0))
    agent = problem(100, -55.0, velocity=8.0, goal=(25.0, 70.0), goal_size=(3.5, 10.0), time_step=RELAXED)
    run, row = drive(world(lanelets, problems=[agent]))
    assert run.outcomes.outcome == ("goal_reached",)
    across = np.abs(run.states.velocity[row] * run.states.yaw_rate[row])
    assert 3.0 < np.nanmax(across) < 5.2, "m/s²"


def test_it_stops_for_a_red_light_and_drives_on_when_it_is_green():
    line = StopLine(1, np.array([[100.0, 1.75], [100.0, -1.75]]), ((1, (5,)),))
    light = TrafficLight(5, (("red", 200), ("green", 300)))
    scenario = replace(road(), traffic_lights=(light,), stop_lines=(line,))
    run, row = drive(scenario)
    front = run.states.x[row] + 0.5 * run.states.length[row]
    assert 97.0 < np.nanmax(front[:200]) < 100.0, "m"
    assert run.outcomes.outcome == ("goal_reached",)
    assert not len(run.violations.rule)


def test_it_reaches_its_goal_at_a_speed_that_is_asked_for():
    scenario = road(limit=14.0)
    (agent,) = scenario.planning_problems
    goal = replace(agent.goal[0], velocity=(2.0, 6.0))
    assert isinstance(goal, GoalState)
    run, row = drive(replace(scenario, planning_problems=(replace(agent, goal=(goal,)),)))
    assert run.outcomes.outcome == ("goal_reached",)
    assert np.nanmax(run.states.velocity[row]) > 12.0, "m/s"


def test_slow_and_too_near_it_brakes_as_the_emergency_says():
    # 4 m/s, and 4 m to what stands: no car following within 3 m/s² stops in time with its gap, 4.05 m/s² does.
    run, row = drive(road(velocity=4.0, cars=[Car(7, 20.0 + 4.5 + 3.0)], steps=60))
    assert np.nanmin(run.states.acceleration[row]) < -3.2, "m/s²"
    assert run.outcomes.outcome != ("collision",)
    fast, row = drive(road(velocity=4.0, cars=[Car(7, 20.0 + 4.5 + 3.0)], steps=60), idr.Pdm(braking_time=0.0))
    assert np.nanmin(fast.states.acceleration[row]) > -3.05, "m/s²"


def test_it_tells_what_it_chose_from():
    run, _ = drive(road(cars=[Car(7, 120.0)], steps=40), settings={"record.candidates": 15})
    found = run.candidates
    first = np.flatnonzero(found.time_step == found.time_step.min())
    assert len(first) == 15
    chosen = first[found.chosen[first]]
    assert len(chosen) == 1
    assert found.cost[chosen[0]] == found.cost[first].min()
    assert len({*np.round(found.y[first, -1])}) == 3, "paths"


@pytest.mark.parametrize("dt", [0.04, 0.2])
def test_the_time_step_of_the_run_does_not_change_what_it_does(dt):
    run, row = drive(road(cars=[Car(7, 120.0)], steps=round(30.0 / dt), dt=dt))
    waiting = run.states.x[row, : round(25.0 / dt)]
    gap = 120.0 - np.nanmax(waiting) - 0.5 * (run.states.length[row] + 4.5)
    assert 0.5 < gap < 1.4, "m"


def test_a_setting_out_of_bounds_is_one_line():
    with pytest.raises(idr.InputError, match="speeds"):
        drive(road(), "pdm,speeds=0")
