"""A vehicle parked in an agent's lane, passed over the lane of the other direction.

Lanes along x, 3.5 m wide; the parked car reaches from y = -1.5 m to 0.3 m: a car 1.8 m wide needs an offset of 1.5 m.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import interdrive as idr
from interdrive.scenario import Lanelets, StopLine, TrafficLight
from interdrive.scenario.control import Priorities
from interdrive.testing import CAR
from interdrive.testing.worlds import Car, problem, world

PARKED = 100.0
SHIFT = 1.5


def street(marking):
    """Lanelet 1 towards +x at y = 0, lanelet 2 towards -x at y = 3.5 m, with a line between them."""
    x = np.linspace(0.0, 300.0, 61)

    def bound(y, ahead):
        return np.column_stack([x if ahead else x[::-1], np.full_like(x, y)])

    return Lanelets(
        ids=np.array([1, 2]),
        left=(bound(1.75, True), bound(1.75, False)),
        right=(bound(-1.75, True), bound(5.25, False)),
        predecessors=((), ()),
        successors=((), ()),
        adjacent_left=np.array([2, 1]),
        adjacent_left_same_direction=np.zeros(2, dtype=bool),
        adjacent_right=np.full(2, -1),
        adjacent_right_same_direction=np.zeros(2, dtype=bool),
        speed_limit=np.full(2, 10.0),
        types=((), ()),
        left_marking=(marking, marking),
        right_marking=("solid", "solid"),
    )


def mirrored(lanelets):
    """The same street for traffic on the left: lanelet 2 at y = -3.5 m."""
    turned = [tuple(bound * [1.0, -1.0] for bound in bounds) for bounds in (lanelets.right, lanelets.left)]
    return replace(
        lanelets,
        left=turned[0],
        right=turned[1],
        adjacent_left=lanelets.adjacent_right,
        adjacent_right=lanelets.adjacent_left,
        left_marking=lanelets.right_marking,
        right_marking=lanelets.left_marking,
    )


def blocked(marking="dashed", cars=(), problems=(), y=-0.6, kind="parked_vehicle", lanelets=None):
    """The street with the parked car and an agent 60 m before it; cars with ids from 50 to 59 are parked."""
    agent = problem(1, 40.0, 0.0, 8.0, goal=(250.0, 0.0), time_step=(0, 500))
    lanelets = street(marking) if lanelets is None else lanelets
    scenario = world(lanelets, cars=[Car(50, PARKED, y), *cars], problems=[agent, *problems], steps=900)
    kinds = tuple(kind if number < 60 else "car" for number in scenario.obstacles.ids)
    return replace(scenario, obstacles=replace(scenario.obstacles, kinds=kinds))


def driven(scenario, agents=(1,), **settings):
    run = idr.simulate(scenario, agents=list(agents), settings=settings, threads=1)
    return run, run.states.x[0, run.states.valid[0]], run.states.y[0, run.states.valid[0]]


@pytest.mark.parametrize("marking", ["dashed", "broad_dashed", "no_marking", "unknown", "lowered_curb", "solid_dashed"])
def test_a_parked_car_is_passed_over_a_lane_whose_line_may_be_crossed(marking):
    run, x, y = driven(blocked(marking))
    assert run.outcomes.outcome == ("goal_reached",)
    assert np.interp(PARKED, x, y) == pytest.approx(SHIFT, abs=0.2), "m, beside it"
    assert abs(np.interp(PARKED + 2.25 + 30.0, x, y)) <= 0.3, "m, 30 m behind it"
    assert len(run.violations.rule) == 0


@pytest.mark.parametrize("marking", ["solid", "broad_solid", "curb", "dashed_solid"])
def test_an_agent_waits_behind_a_parked_car_where_the_line_must_not_be_crossed(marking):
    run, x, y = driven(blocked(marking))
    assert run.outcomes.outcome != ("goal_reached",)
    assert x.max() < PARKED - 4.5 and np.abs(y).max() < 0.3, "m"
    assert run.violations.rule == ()


def test_passing_can_be_switched_off_per_agent():
    _, x, _ = driven(blocked(), **{"rules.passing": False})
    assert x.max() < PARKED - 4.5, "m"


@pytest.mark.parametrize("y", [-0.6, -0.3, 0.0, 0.2, 0.4])
def test_passing_breaks_no_rule_however_far_the_parked_car_stands_in_the_lane(y):
    run, x, offset = driven(blocked(y=y))
    assert run.outcomes.outcome == ("goal_reached",)
    assert np.interp(PARKED, x, offset) == pytest.approx(y + 0.9 + 0.3 + 0.9, abs=0.3), "m, beside it"
    assert run.violations.rule == ()


def test_traffic_on_the_left_passes_on_the_right():
    scenario = blocked(y=0.6, lanelets=mirrored(street("dashed")))
    run, x, y = driven(replace(scenario, priorities=Priorities(left_hand=True, priority_side="left")))
    assert run.outcomes.outcome == ("goal_reached",)
    assert np.interp(PARKED, x, y) == pytest.approx(-SHIFT, abs=0.2), "m, beside it"
    assert run.violations.rule == ()


@pytest.mark.parametrize("kind", ["pedestrian", "bicycle"])
def test_people_who_stand_in_the_lane_are_not_passed_over_the_other_lane(kind):
    _, x, y = driven(blocked(kind=kind))
    assert x.max() < PARKED - 4.5 and np.abs(y).max() < 0.3, "m"


@pytest.mark.parametrize("gap", [1.0, 3.0, 5.0])
def test_an_agent_that_has_to_stop_beside_a_parked_car_waits_behind_it(gap):
    line = PARKED + 2.25 + gap
    light = TrafficLight(7, (("red", 250), ("green", 2000)))
    stop = StopLine(1, np.array([[line, 1.75], [line, -1.75]]), ((1, (7,)),))
    run, x, y = driven(replace(blocked(), traffic_lights=(light,), stop_lines=(stop,)))
    assert x[:250].max() < PARKED - 4.5 and np.abs(y[:250]).max() < 0.3, "m, while it is red"
    assert run.outcomes.outcome == ("goal_reached",)
    assert run.violations.rule == ()


@pytest.mark.parametrize("start", [175.0, 185.0, 195.0])
def test_an_oncoming_car_that_would_be_met_leaves_first(start):
    oncoming = Car(60, start, 3.5, 10.0, np.pi, last=int(start) - 5)
    run, x, y = driven(blocked(cars=[oncoming]))
    assert run.outcomes.outcome == ("goal_reached",)
    met = int(np.argmax(x > start - np.arange(len(x))))
    assert x[met] < PARKED - 4.5, "m: it waits until the other one is past"
    assert np.abs(y[:met]).max() + 0.5 * CAR.width < 1.75, "m: in its own lane"


def test_a_queue_is_not_passed():
    cars = [Car(51, 120.0, -0.6), Car(52, 127.0, -0.6)]
    scenario = world(
        street("dashed"), cars=cars, problems=[problem(1, 40.0, 0.0, 8.0, goal=(250.0, 0.0), time_step=(0, 300))],
        steps=600,
    )  # fmt: skip
    _, x, y = driven(scenario)
    assert x.max() < 120.0 - 4.5 and np.abs(y).max() < 0.3, "m"


def test_a_queue_before_a_red_light_is_not_passed():
    light = TrafficLight(7, (("red", 250), ("green", 5000)))
    stop = StopLine(1, np.array([[150.0, 1.75], [150.0, -1.75]]), ((1, (7,)),))
    problems = [
        problem(k + 1, x, 0.0, 8.0, goal=(250.0, 0.0), time_step=(0, 600)) for k, x in enumerate((60.0, 100.0, 115.0))
    ]
    scenario = replace(world(street("dashed"), problems=problems), traffic_lights=(light,), stop_lines=(stop,))
    run = idr.simulate(scenario, threads=1)
    places = run.states.x[:, 240]
    assert (np.diff(places) > 4.5).all() and 136.0 < places[1] < 143.0, "m: the second one stands behind the first"
    assert np.nanmax(np.abs(run.states.y)) < 0.3, "m"
    assert run.outcomes.outcome == ("goal_reached",) * 3
    assert run.violations.rule == ()


@pytest.mark.parametrize("start", [150.0, 170.0, 190.0, 210.0, 230.0, 250.0])
@pytest.mark.parametrize("velocity", [4.0, 10.0])
def test_two_agents_meet_at_a_parked_car_without_contact(start, velocity):
    other = problem(
        2, start, 3.5, velocity, np.pi, goal=(20.0, 3.5), goal_orientation=np.pi, time_step=(0, 500)
    )  # fmt: skip
    run, _, _ = driven(blocked(problems=[other]), agents=(1, 2))
    assert run.outcomes.outcome == ("goal_reached", "goal_reached")


def test_passing_does_not_depend_on_threads():
    other = problem(2, 170.0, 3.5, 10.0, np.pi, goal=(20.0, 3.5), goal_orientation=np.pi, time_step=(0, 500))
    runs = [idr.simulate(blocked(problems=[other]), agents=[1, 2], threads=threads) for threads in (1, 2)]
    assert runs[0].digest == runs[1].digest


def parked_on_both_sides(gap, start):
    other = problem(
        2, start + gap, 3.5, 8.0, np.pi, goal=(20.0, 3.5), goal_orientation=np.pi, time_step=(0, 600)
    )  # fmt: skip
    scenario = blocked(cars=[Car(51, PARKED + gap, 4.1, 0.0, np.pi)], problems=[other])
    return driven(scenario, agents=(1, 2))[0]


@pytest.mark.parametrize("gap", [-10.0, -6.0, 0.0, 6.0, 10.0, 15.0, 20.0])
@pytest.mark.parametrize("start", [160.0, 175.0])
def test_two_agents_with_parked_cars_on_both_sides_pass_one_after_the_other(gap, start):
    run = parked_on_both_sides(gap, start)
    assert run.outcomes.outcome == ("goal_reached", "goal_reached")
    assert run.outcomes.time_step.max() < 600, "60 s"
    assert run.violations.rule == ()


@pytest.mark.parametrize(("start", "waits"), [(130.0, 1), (175.0, 2)])
def test_the_agent_that_comes_second_is_told_to_wait_for_the_first(start, waits):
    orders = parked_on_both_sides(0.0, start).orders
    assert set(zip(orders.agent_id.tolist(), orders.by_id.tolist(), strict=True)) == {(waits, 3 - waits)}
    reached = {1: orders.stop_s[0], 2: 300.0 - orders.stop_s[0]}[waits]
    assert abs(reached - PARKED) == pytest.approx(0.5 * CAR.length + 10.0 + 0.3, abs=0.1), "m, room for its return"


def test_an_agent_does_not_wait_for_ever_for_one_that_cannot_pass():
    other = problem(
        2, 160.0, 3.5, 8.0, np.pi, goal=(20.0, 3.5), goal_orientation=np.pi, time_step=(0, 500)
    )  # fmt: skip
    scenario = blocked(cars=[Car(51, PARKED + 6.0, 4.1, 0.0, np.pi)], problems=[other])
    run = idr.simulate(scenario, agents=[1, 2], rules={2: {"passing": False}}, threads=1)
    assert run.outcomes.outcome[0] == "goal_reached"
