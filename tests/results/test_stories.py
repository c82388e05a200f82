"""The story of an agent at lines: a road along x with a stop line at x = 100 m and a light over it; steps of 0.1 s."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drivers import Straight

from interdrive import InputError, simulate
from interdrive.results.story import story
from interdrive.run import Violations
from interdrive.scenario import StopLine, TrafficLight
from interdrive.testing import Car, problem, straight_road, world

RED = "a red light (stop line of lanelet 1)"


def line(x=100.0, light=7, **more):
    """A line across the lane; its light counts on every way."""
    return StopLine(1, np.array([[x, 1.75], [x, -1.75]]), ((1, (light,)),), **more)


def at_a_line(*phases, cars=(), lines=None, speed=10.0, x=50.0, until=160):
    """Agent 1 comes with 10 m/s from x = 50 m and wants to get to x = 150 m."""
    agent = problem(1, x, velocity=speed, goal=(150.0, 0.0), goal_size=(20.0, 3.5), time_step=(0, until))
    return replace(
        world(straight_road(), cars=cars, problems=[agent], steps=400),
        traffic_lights=(TrafficLight(7, phases),) if phases else (),
        stop_lines=(line(),) if lines is None else lines,
    )


def told(scenario, planner="rollout", **settings):
    """The whole story of agent 1, as one text."""
    run = simulate(scenario, agents=[1], planner=planner, settings=settings, threads=1)
    return "\n".join(story(run, 1))


def test_an_agent_slows_before_a_red_light_and_stands_at_it():
    text = told(at_a_line(("red", 5000)))
    assert f"slowing before {RED}, from " in text
    assert f"standing at {RED}" in text
    assert f" at {RED}; " in text.splitlines()[0], "the reason of the time limit names it, too"


def test_an_agent_that_goes_on_at_green_stood_at_red_before():
    lines = told(at_a_line(("red", 120), ("green", 5000))).splitlines()
    assert lines[0].startswith("agent 1: goal_reached")
    assert any(f"standing at {RED}" in one for one in lines)
    assert "driving, from" in lines[-1] and "red" not in lines[-1]


def test_yellow_counts_as_red():
    assert f"standing at {RED}" in told(at_a_line(("yellow", 5000)))


def test_a_green_light_is_not_named():
    text = told(at_a_line(("green", 5000)))
    assert "goal_reached" in text and "light" not in text


def test_a_line_across_the_lane_beside_is_not_named():
    other = StopLine(1, np.array([[100.0, 5.25], [100.0, 1.75]]), ((1, (7,)),))
    assert "light" not in told(at_a_line(("red", 5000), lines=(other,)), Straight)


def test_a_stop_line_of_a_light_that_does_not_exist_is_refused_in_one_line():
    with pytest.raises(InputError, match=r"^tiny: stop line of lanelet 1: there is no traffic light 9$"):
        told(at_a_line(("red", 5000), lines=(line(light=9),)))


def test_an_agent_that_passes_a_red_light_is_told_when_and_how_long_it_was_red():
    # The front starts at x = 52.25 m and is beyond the line after 47.75 m, within the step that ends at 4.8 s.
    lines = told(at_a_line(("red", 5000)), Straight).splitlines()
    assert "  broken rule at 4.8 s: passes a light that has been red for 4.8 s" in lines
    assert not any("red light" in one for one in lines), "it does not wait there"


def test_an_agent_that_brakes_before_red_and_passes_it_is_told_both():
    class Braking(Straight):
        """Brakes by 2 m/s² down to 2 m/s."""

        def plan(self, view, predictions):
            plan, ego, time = super().plan(view, predictions), view.ego, np.arange(31) * view.dt
            plan.velocity[:] = np.maximum(ego.velocity - 2.0 * time, min(2.0, ego.velocity))
            plan.x[1:] = ego.x + np.cumsum(0.5 * (plan.velocity[1:] + plan.velocity[:-1])) * view.dt
            return plan

    text = told(at_a_line(("red", 5000), x=70.0, until=400), Braking)
    assert f"slowing before {RED}, from 10.0 to 2.0 m/s" in text
    assert "passes a light that has been red for" in text


def test_a_vehicle_beyond_the_red_light_is_not_what_an_agent_waits_for():
    text = told(at_a_line(("red", 5000), cars=[Car(9, 106.0)]))
    assert f"standing at {RED}" in text and "behind 9" not in text


def test_a_vehicle_that_stands_at_the_red_light_is_what_an_agent_waits_for():
    text = told(at_a_line(("red", 5000), cars=[Car(9, 97.0)]))
    assert "standing behind 9" in text and f"at {RED}" not in text


def test_a_vehicle_that_leaves_through_the_light_is_not_what_an_agent_waits_for_afterwards():
    text = told(at_a_line(("red", 5000), cars=[Car(9, 62.0, velocity=10.0)]))
    assert f"standing at {RED}" in text and "standing behind" not in text


def test_of_two_lights_the_red_one_is_named_though_a_green_one_is_nearer():
    scenario = at_a_line(("red", 5000), lines=(line(96.0, 8), line()))
    scenario = replace(scenario, traffic_lights=(*scenario.traffic_lights, TrafficLight(8, (("green", 5000),))))
    text = told(scenario)
    assert f"slowing before {RED}" in text and f"standing at {RED}" in text


@pytest.mark.parametrize("planner", ["rollout", "idm"])
def test_a_stop_sign_is_named(planner):
    text = told(at_a_line(lines=(replace(line(), light_ids=(), has_stop_sign=True),)), planner)
    assert "slowing before a stop sign (stop line of lanelet 1), from " in text
    assert "standing at a stop sign (stop line of lanelet 1)" in text
    assert "broken" not in text


def test_passing_a_stop_sign_is_a_broken_rule():
    text = told(at_a_line(lines=(replace(line(), light_ids=(), has_stop_sign=True),)), Straight)
    assert "broken rule at 4.8 s: passes a stop sign at 10.0 m/s or more" in text


def test_an_agent_that_has_to_wait_for_its_whole_time_stood_at_the_light_in_every_account():
    lines = told(at_a_line(("red", 5000), x=97.0, speed=0.0)).splitlines()
    assert f"at {RED}" in lines[0] and f"standing at {RED}" in lines[3]


def violations(*rows):
    """Rows of source, participant, rule, first and last time step, partner and value."""
    source, number, rule, first, last, partner, value = zip(*rows, strict=True)
    ints = [np.array(column) for column in (number, first, last, partner)]
    nowhere = np.zeros(len(rows))
    return Violations(source, ints[0], rule, ints[1], ints[2], ints[0] * 0 - 1, ints[3], nowhere, nowhere,
                      np.array(value, dtype=float))  # fmt: skip


def test_broken_rules_are_told_each_once_in_the_order_of_their_first_times():
    run = simulate(at_a_line(cars=[Car(9, 160.0)], lines=()), agents=[1], planner=Straight, threads=1)
    found = violations(
        ("agent", 1, "speeding", 40, 52, -1, 1.24),
        ("agent", 1, "right_of_way", 12, 12, 9, 0.8),
        ("agent", 1, "speeding", 20, 31, -1, 2.06),
        ("agent", 9, "wrong_way", 1, 5, -1, 3.0),
        ("replayed", 1, "keep_clear", 1, 5, -1, 3.0),
    )
    lines = [one.strip() for one in story(replace(run, violations=found), 1) if "broken" in one]
    assert lines == [
        "broken rule at 1.2 s: takes the right of way of 9, 0.8 s ahead of it",
        "broken rule from 2.0 to 3.1 s: is 2.1 m/s too fast, and 1 more time",
    ]


def test_a_run_that_does_not_record_violations_tells_none():
    text = told(at_a_line(("red", 5000)), Straight, **{"record.violations": False})
    assert "goal_reached" in text and "broken" not in text
