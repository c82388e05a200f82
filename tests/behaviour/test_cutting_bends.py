"""Agents that take the line of least curvature within their lane (`planner.rollout.cut_bends`)."""

import numpy as np
import pytest

from interdrive import InputError, simulate
from interdrive.testing import bend, problem, straight_road, world

CUTTING, MIDDLE = ({"planner.rollout.cut_bends": choice} for choice in (True, False))


def driven(lanelets, goal, velocity, **settings):
    """One agent on an empty road; its positions [m], headings [rad] and speeds [m/s]."""
    agent = problem(100, **velocity, goal=goal, goal_size=(4.0, 3.5), time_step=(0, 300))
    run = simulate(world(lanelets, problems=[agent], steps=0), agents=[100], settings=settings, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    there = run.states.valid[0]
    return [np.asarray(getattr(run.states, name)[0, there], float) for name in ("x", "y", "orientation", "velocity")]


def in_a_bend(**settings):
    """Distances from the centre of a left turn of 15 m, in its middle half [m]; the largest acceleration across."""
    agent = {"x": -30.0, "velocity": 6.0}
    x, y, heading, speed = driven(bend(15.0, 40.0, 3.5), (15.0, 50.0), agent, **settings)
    away = np.hypot(x, y - 15.0)
    angle = np.arctan2(x, 15.0 - y)
    across = np.abs(np.gradient(np.unwrap(heading), 0.1) * speed)
    inner = (angle > np.pi / 8) & (angle < 3 * np.pi / 8)
    return away[inner], float(across.max())


def test_a_bend_is_cut_within_the_lane_where_the_setting_asks_for_it():
    middle, across = in_a_bend(**MIDDLE)
    cut, gentler = in_a_bend(**CUTTING)
    assert np.abs(middle - 15.0).max() < 0.3, "m"
    # The lane is 3.5 m wide, the vehicle 1.61 m, and 0.3 m are kept to the edge: its rear axle may be 0.645 m
    # inside, its middle is 0.07 m further outside.
    assert 15.0 - cut.max() > 0.4, "m"
    assert 15.0 - cut.min() + 0.07 == pytest.approx(0.645, abs=0.1), "m"
    assert gentler < across, "m/s²"


def test_the_body_stays_in_the_lane_around_a_tight_bend():
    agent = {"x": -30.0, "velocity": 6.0}
    x, y, heading, _ = driven(bend(8.0, 40.0, 3.0), (8.0, 43.0), agent, **CUTTING)
    for ahead in np.linspace(-2.254, 2.254, 9):
        for aside in (-0.805, 0.805):
            px = x + ahead * np.cos(heading) - aside * np.sin(heading)
            py = y + ahead * np.sin(heading) + aside * np.cos(heading)
            turning = (px > 0.0) & (py < 8.0)
            beside = np.where(turning, np.hypot(px, py - 8.0) - 8.0, np.where(px <= 0.0, -py, px - 8.0))
            assert np.abs(beside).max() < 1.5, f"{ahead} m ahead, {aside} m to the left"


def test_an_agent_that_starts_in_the_middle_of_the_lane_is_not_drawn_to_the_outside_of_a_bend():
    agent = {"x": -6.0, "velocity": 2.0}
    x, y, heading, _ = driven(bend(15.0, 40.0, 3.5), (15.0, 50.0), agent, **CUTTING)
    before = x < 0.0
    right_front = y + 2.254 * np.sin(heading) - 0.805 * np.cos(heading)
    assert right_front[before].min() > -1.25, "m, where the lane ends at -1.75 m"


def test_a_straight_lane_is_driven_as_without_it():
    agent = {"x": 20.0, "velocity": 10.0}
    drives = [driven(straight_road(200.0), (150.0, 0.0), agent, **settings) for settings in (CUTTING, MIDDLE)]
    for cutting, without in zip(*drives, strict=True):
        assert cutting == pytest.approx(without, abs=0.02)


def test_the_same_bits_for_one_and_four_threads():
    agents = [problem(100 + k, x=-12.0 * k, velocity=6.0, goal=(15.0, 50.0), time_step=(0, 300)) for k in range(3)]
    scenario = world(bend(15.0, 60.0), problems=agents, steps=0)
    digests = {simulate(scenario, settings=CUTTING, threads=threads).digest for threads in (1, 4)}
    assert len(digests) == 1


def test_another_value_than_true_or_false_is_refused_in_one_line():
    agent = problem(100, x=20.0, velocity=10.0, goal=(150.0, 0.0), time_step=(0, 300))
    with pytest.raises(InputError, match=r"planner\.rollout\.cut_bends"):
        simulate(world(straight_road(200.0), problems=[agent]), settings={"planner.rollout.cut_bends": "often"})
