"""`lawful` drives as fast as limits, curves and traffic allow, whatever time its goal has, and obeys the rules."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import interdrive as idr
from interdrive.scenario import StopLine, TrafficLight
from interdrive.testing import Car, bend, problem, straight_road, world

#: No driver is just in time here: 150 m have 60 s.
RELAXED = (0, 600)


def road(*, limit=np.nan, velocity=5.0, cars=(), length=400.0, goal=250.0, steps=100, **more):
    """One lane along x with a speed limit [m/s] and an agent whose goal lies at 250 m."""
    lanelets = straight_road(length)
    lanelets = replace(lanelets, speed_limit=np.full_like(lanelets.speed_limit, limit))
    agent = problem(100, 20.0, velocity=velocity, goal=(goal, 0.0), time_step=RELAXED)
    return world(lanelets, cars=cars, problems=[agent], steps=steps, **more)


def drive(scenario, planner="lawful", **options):
    run = idr.simulate(
        scenario, agents="problems", planner=planner, predictor="constant_velocity", threads=1, **options
    )
    return run, run.states.velocity[np.searchsorted(run.states.participant_id, 100)]


def test_on_a_free_road_it_reaches_the_limit_though_its_goal_has_time():
    run, speed = drive(road(limit=13.0))
    assert run.outcomes.outcome == ("goal_reached",)
    assert 12.3 < np.nanmax(speed) <= 13.0, "m/s"
    _, just_in_time = drive(road(limit=13.0), "idm")
    assert np.nanmax(just_in_time) < 8.0, "m/s"


def test_a_factor_scales_the_lawful_speed():
    _, speed = drive(road(limit=12.0), idr.Lawful(speed_factor=0.5))
    assert np.nanmax(speed) == pytest.approx(6.0, abs=0.1), "m/s"


def test_without_a_limit_it_keeps_the_speed_at_which_it_entered_or_that_of_what_moves_its_way():
    _, alone = drive(road(velocity=9.0))
    assert np.nanmax(alone) == pytest.approx(9.0, abs=0.1), "m/s"
    _, slow = drive(road(velocity=1.0))
    assert 4.5 < np.nanmax(slow) <= 5.0, "m/s"
    _, among_others = drive(road(velocity=9.0, cars=[Car(7, 60.0, 0.0, 14.0)]))
    assert 12.0 < np.nanmax(among_others) <= 14.0, "m/s"
    _, oncoming = drive(road(velocity=9.0, cars=[Car(7, 390.0, 30.0, 14.0, np.pi)]))
    assert np.nanmax(oncoming) == pytest.approx(9.0, abs=0.1), "m/s"


def test_it_takes_curves_with_its_lateral_acceleration():
    lanelets = bend(radius=30.0, arm=60.0)
    lanelets = replace(lanelets, speed_limit=np.full_like(lanelets.speed_limit, 20.0))
    agent = problem(100, -55.0, velocity=8.0, goal=(30.0, 80.0), goal_size=(3.5, 10.0), time_step=RELAXED)
    run, speed = drive(world(lanelets, problems=[agent]))
    assert run.outcomes.outcome == ("goal_reached",)
    turning = np.abs(run.states.yaw_rate[0]) > 0.1
    assert np.nanmax((speed * np.abs(run.states.yaw_rate[0]))[turning]) == pytest.approx(4.0, abs=0.5), "m/s²"
    assert np.nanmax(speed) > 13.0, "m/s"


def test_it_stops_for_a_red_light_and_drives_on_when_it_is_green():
    line = StopLine(1, np.array([[100.0, 1.75], [100.0, -1.75]]), ((1, (5,)),))
    light = TrafficLight(5, (("red", 200), ("green", 300)))
    scenario = replace(road(limit=10.0), traffic_lights=(light,), stop_lines=(line,))
    run, speed = drive(scenario)
    row = int(np.searchsorted(run.states.participant_id, 100))
    front = run.states.x[row] + 0.5 * run.states.length[row]
    assert np.nanmax(front[:200]) < 100.0, "m"
    assert np.nanmin(speed[:200]) < 0.1, "m/s"
    assert run.outcomes.outcome == ("goal_reached",)
    assert not len(run.violations.rule)


def test_it_follows_a_standing_vehicle_with_the_gap_of_its_law():
    run, speed = drive(road(limit=13.0, cars=[Car(7, 120.0)], steps=700))
    row = np.searchsorted(run.states.participant_id, 100)
    last = 600
    assert speed[last] < 0.01, "m/s"
    gap = 120.0 - run.states.x[row, last] - 0.5 * (run.states.length[row] + 4.5)
    assert gap == pytest.approx(2.0, abs=0.5), "m"
