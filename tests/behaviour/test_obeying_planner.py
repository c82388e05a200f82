"""Planners in Python that obey the rules of the road, as in examples/08_obeying_planner.py, and one that does not."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from obeying import Obeys
from tests.behaviour.test_crosswalks import driven, meeting
from tests.behaviour.test_right_of_way import ARMS, lanes
from tests.behaviour.test_right_of_way import car as arriving

import interdrive as idr
from interdrive.scenario import StopLine, TrafficLight
from interdrive.scenario.control import Priorities
from interdrive.simulation import Simulation
from interdrive.testing import check_planner
from interdrive.testing.worlds import Car, crossing, problem, straight_road, world

HALF = 2.25
RULES = {"rules.precedence": True}


class Ignores:
    """Keeps its speed, whatever it is told."""

    def plan(self, view: Any, predictions: Any) -> idr.Trajectory:
        ego, n = view.ego, 31
        way = ego.velocity * view.dt * np.arange(n)
        heading = np.full(n, ego.orientation)
        x, y = ego.x + way * np.cos(heading), ego.y + way * np.sin(heading)
        return idr.Trajectory(x, y, heading, np.full(n, ego.velocity))


def car(agent_id, direction, before, velocity=10.0):
    """An agent whose front is so far before the origin [m]; it wants to get 60 m beyond it."""
    heading = float(np.arctan2(direction[1], direction[0]))
    x, y = -(before + HALF) * np.array(direction)
    goal = tuple(60.0 * np.array(direction, dtype=float))
    return problem(
        agent_id, x, y, velocity, heading, goal=goal, goal_size=(20.0, 3.5), goal_orientation=heading,
        time_step=(0, 200),
    )  # fmt: skip


def met(*cars, **changes):
    """Two lanes that cross at the origin."""
    return replace(world(crossing(), problems=cars), **changes)


def enters(run, number):
    """Time at which the front of an agent is 1.1 m before the origin [s]."""
    row = run.states.participant_id.tolist().index(number)
    along = np.where(run.states.valid[row], run.states.x[row] + run.states.y[row], -np.inf)
    return 0.1 * float(np.argmax(along + HALF > -1.1))


class Reads(Ignores):
    """Keeps its speed, and what its view says about barriers at the first step."""

    obeys_rules = True
    seen: tuple[Any, ...] = ()

    def plan(self, view: Any, predictions: Any) -> idr.Trajectory:
        type(self).seen = type(self).seen or (view.ego,)
        return super().plan(view, predictions)


def test_a_planner_is_told_of_every_barrier_and_of_the_hardest_one():
    """It gives way at a crossing, behind which a light is red; both are seen from the same place."""

    class Reader(Reads):
        pass

    scenario = met(car(1, (0, 1), 38.0, 8.0), car(2, (1, 0), 30.0), priorities=Priorities(ranks=((1, (2, 2, 2)),)))
    line = StopLine(1, np.array([[20.0, 1.75], [20.0, -1.75]]), ((1, (7,)),))
    red = (TrafficLight(7, (("red", 900), ("green", 100))),)
    scenario = replace(scenario, stop_lines=(line,), traffic_lights=red)
    idr.simulate(scenario, agents="all", planner={1: "rollout", 2: Reader()}, settings=RULES, threads=1)
    ego = Reader.seen[0]
    found = ego.barriers
    front = ego.s + ego.vehicle.rear_axle_to_center + HALF
    assert (len(found), found.reason, found.by_id.tolist()) == (2, ("yield", "light"), [1, -1])
    assert found.s - front == pytest.approx([30.0 - 0.4 - 1.75 + 0.9, 50.0], abs=1.0)
    assert found.until[0] < 6.0 and np.isinf(found.until[1])
    assert (ego.stop_s, ego.stop_by) == (found.s[0], 1)


def light(*phases):
    """A light at x = 100 m and an agent that comes with 10 m/s from 60 m before it."""
    agent = problem(1, 40.0 - HALF, goal=(150.0, 0.0), goal_size=(20.0, 3.5), time_step=(0, 250))
    line = StopLine(1, np.array([[100.0, 1.75], [100.0, -1.75]]), ((1, (7,)),))
    return replace(
        world(straight_road(), problems=[agent]), traffic_lights=(TrafficLight(7, phases),), stop_lines=(line,)
    )


def test_of_two_that_arrive_together_the_right_one_goes_first():
    run = idr.simulate(met(car(1, (1, 0), 21.0), car(2, (0, 1), 21.0)), planner=Obeys, settings=RULES, threads=1)
    assert run.outcomes.outcome == ("goal_reached", "goal_reached")
    assert enters(run, 2) < enters(run, 1) - 1.0, "s"


def test_a_sign_to_give_way_turns_the_order_around():
    scenario = met(car(1, (1, 0), 21.0), car(2, (0, 1), 21.0), priorities=Priorities(ranks=((2, (2, 2, 2)),)))
    run = idr.simulate(scenario, planner=Obeys, settings=RULES, threads=1)
    assert run.outcomes.outcome == ("goal_reached", "goal_reached")
    assert enters(run, 1) < enters(run, 2) - 1.0, "s"


def test_it_stops_at_red_and_goes_on_at_green():
    run = idr.simulate(light(("red", 120), ("green", 900)), planner=Obeys, threads=1)
    front = run.states.x[0] + HALF
    assert 98.0 < front[119] < 100.0, "m"
    assert run.outcomes.outcome == ("goal_reached",)
    assert run.violations.rule == ()


def test_at_yellow_it_stops_if_it_is_not_too_near():
    # It keeps below 10 m/s, for which 16.7 m are needed with 3 m/s².
    for green, stops in [(38, True), (55, False)]:
        phases = (("green", green), ("yellow", 30), ("red", 900))
        run = idr.simulate(light(*phases), planner=partial(Obeys, 10.0), threads=1)
        assert (np.nanmax(run.states.x[0]) + HALF < 100.0) == stops
        assert "red_light" not in run.violations.rule


def test_nobody_hits_a_planner_that_does_not_obey():
    scenario = met(car(1, (1, 0), 21.0), car(2, (0, 1), 21.0))
    planner = {"default": Obeys, 1: Ignores}
    run = idr.simulate(scenario, agents="all", planner=planner, settings=RULES, threads=1)
    assert run.outcomes.outcome == ("goal_reached", "goal_reached")
    assert enters(run, 1) < enters(run, 2) - 0.5, "the other one goes first by precedence, but waits"


@pytest.mark.parametrize("ignoring", [None, 1, 3])
def test_four_get_through_a_cross_whether_all_obey_or_one_does_not(ignoring):
    problems = [arriving(number, way, 20.0, mouth=-3.15) for number, way in enumerate(ARMS, start=1)]
    scenario = world(lanes(*ARMS), problems=problems)
    planner = {"default": Obeys} | ({} if ignoring is None else {ignoring: Ignores})
    run = idr.simulate(scenario, planner=planner, settings=RULES, threads=1)
    assert all(outcome.startswith("goal_reached") for outcome in run.outcomes.outcome), run.outcomes.outcome


def test_the_check_warns_of_a_planner_that_breaks_its_word():
    class Promises(Ignores):
        obeys_rules = True

    with pytest.warns(UserWarning, match="obeys_rules") as caught:
        check_planner(Promises)
    texts = [str(warning.message) for warning in caught]
    assert texts[0].startswith("a red light") and texts[0].endswith("breaks red_light")
    assert texts[1].startswith("a red light behind a lane change") and texts[1].endswith("breaks red_light")
    assert texts[2].startswith("a sign to give way") and texts[2].endswith("breaks right_of_way")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_planner(Obeys)


def test_the_check_looks_at_the_planner_that_a_factory_makes():
    class Promises(Ignores):
        obeys_rules = True

        def __init__(self, number):
            self.number = number

    with pytest.warns(UserWarning, match="obeys_rules"):
        check_planner(partial(Promises, 1))


def test_it_stands_at_a_stop_sign_and_goes_on():
    line = StopLine(1, np.array([[100.0, 1.75], [100.0, -1.75]]), has_stop_sign=True)
    run = idr.simulate(replace(light(("green", 900)), stop_lines=(line,)), planner=Obeys, threads=1)
    front, speed = run.states.x[0] + HALF, run.states.velocity[0]
    assert 98.0 < front[speed < 0.1].max() < 100.0, "m"
    assert run.outcomes.outcome == ("goal_reached",)
    assert run.violations.rule == ()


def test_it_keeps_to_a_lower_limit_ahead():
    agent = problem(1, 40.0, goal=(150.0, 0.0), goal_size=(20.0, 3.5), time_step=(0, 400))
    road = replace(straight_road(), speed_limit=np.array([6.0]))
    run = idr.simulate(world(road, problems=[agent]), planner=Obeys, threads=1)
    assert np.nanmax(run.states.velocity[0, 60:]) < 6.1, "m/s, 6 s after it came with 10 m/s"


def test_it_waits_for_a_person_on_a_crosswalk():
    x, velocity, run = driven(meeting(-5.0, 0.8, goal=300), Obeys)
    # The person has left the lane by 2 m at y = 3.75 m, after 10.9 s.
    assert 97.0 < x[105] < 98.0 and velocity[105] < 0.1, "m before the edge at 98 m, m/s"
    assert run.outcomes.outcome == ("goal_reached",)


@pytest.mark.parametrize(("heading", "speed"), [(0.0, 6.0), (np.pi, 6.0), (0.5 * np.pi, 6.0)])
def test_only_a_vehicle_that_drives_along_the_path_is_expected_to_make_room(heading, speed):
    # 25 m from bumper to bumper, or to the middle of one that crosses.
    agent = problem(1, 40.0, goal=(150.0, 0.0), goal_size=(20.0, 3.5), time_step=(0, 400))
    scenario = world(straight_road(), cars=[Car(9, 40.0 + 25.0 + 2 * HALF, 0.0, speed, heading)], problems=[agent])
    simulation = Simulation(scenario, agents=[1], threads=1)
    scene = simulation.world.scene()
    plan = Obeys().plan(simulation.world.view(scene, 1), None)
    assert (plan.velocity[-1] < 4.0) == (heading != 0.0), f"{plan.velocity[-1]} m/s after 3 s"
