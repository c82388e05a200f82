"""Orders of cars of 5.0 by 1.8 m before junctions, to the centimetre and the hundredth of a second.

Straight lanes through the origin with a limit of 10 m/s: the area of two of them reaches from -1.1 to 1.1 m, a front
waits at -1.4 m at the latest, a rear has left at 1.4 m. An agent has the footprint of a recorded car at its start.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from typing import Any

import numpy as np
import pytest
from tests.behaviour.test_meetings_at_junctions import turning, wide_cross
from tests.behaviour.test_right_of_way import ARMS, EAST_WAY, MOUTH, NORTH, NORTH_WAY, RULES, lanes, limited

import interdrive as idr
from interdrive.scenario import Shape
from interdrive.scenario.control import Priorities, StopLine
from interdrive.simulation import Simulation
from interdrive.testing.worlds import Car, crossing, problem, world

LENGTH, WIDTH = 5.0, 1.8
FREE = (np.inf, np.inf, None)


def car(agent_id, way, before_mouth, velocity=10.0, mouth=MOUTH):
    """An agent whose front is so far before its first mouth [m]; it wants to get 60 m beyond the origin."""
    direction, place = np.array(way[0]), np.array(way[1])
    x, y = place + (mouth - before_mouth - 0.5 * LENGTH) * direction
    heading = float(np.arctan2(direction[1], direction[0]))
    goal = {"goal": tuple(place + 60.0 * direction), "goal_size": (20.0, 3.5), "goal_orientation": heading}
    return problem(agent_id, x, y, velocity, heading, **goal, time_step=(0, 300))


def meeting(lanelets, *problems, cars=(), **changes):
    """A world in which all vehicles are 5.0 m long and 1.8 m wide."""
    starts = [one.initial_state for one in problems]
    own = [
        Car(one.id, start.x, start.y, start.velocity, start.orientation)
        for one, start in zip(problems, starts, strict=True)
    ]
    made = world(lanelets, cars=[*own, *cars], problems=problems)
    shapes = (Shape("rectangle", LENGTH, WIDTH),) * len(made.obstacles.ids)
    return replace(made, obstacles=replace(made.obstacles, shapes=shapes), **changes)


def order(simulation, agent):
    """Distance from the front of an agent to where it has to stop [m], for how long [s], and for which vehicle."""
    ego = simulation.world.view(simulation.world.scene(), agent).ego
    assert (ego.vehicle.length, ego.vehicle.width) == (LENGTH, WIDTH)
    front = float(ego.route.project(np.array([ego.x]), np.array([ego.y]))[0][0]) + 0.5 * LENGTH
    return (
        pytest.approx(ego.stop_s - front, abs=0.02),
        pytest.approx(ego.stop_release, abs=0.01),
        ego.stop_by,
    )


def told(scenario):
    """Agent -> its order at the first time step."""
    agents = [one.id for one in scenario.planning_problems]
    simulation = Simulation(scenario, agents=agents, settings=RULES, threads=1)
    return {agent: order(simulation, agent) for agent in agents}


def test_of_two_that_arrive_together_the_left_one_may_enter_after_308_hundredths_of_a_second():
    # The other one has left after 20 + 2.8 + 5.0 m at 10 m/s, 0.3 s more are kept.
    scenario = meeting(limited(crossing()), car(1, EAST_WAY, 20.0), car(2, NORTH_WAY, 20.0))
    assert told(scenario) == {1: (20.0, 3.08, 2), 2: FREE}


def test_a_car_of_five_metres_takes_a_gap_that_is_large_enough():
    # It has left after 1.5 + 0.78 s, 1 s before the other one comes.
    scenario = meeting(limited(crossing()), car(1, EAST_WAY, 15.0), car(2, NORTH_WAY, 60.0))
    assert told(scenario) == {1: FREE, 2: FREE}


@pytest.mark.parametrize(
    ("velocity", "metres", "release"),
    [
        (10.0, 20.0, 3.43),  # The second area of the others is free after 20 + 6.3 + 5.0 m, 0.3 s more are kept.
        (0.0, 0.1, 4.45),  # From rest it takes 0.3 s and 11.1 m with 1.5 m/s².
    ],
)
def test_of_four_at_a_cross_the_pair_with_the_least_id_goes_however_ids_are_distributed(velocity, metres, release):
    for ids in permutations((1, 2, 3, 4)):
        problems = [car(number, way, metres, velocity, mouth=-3.15) for number, way in zip(ids, ARMS, strict=True)]
        orders = told(meeting(lanes(*ARMS), *problems))
        first = next(pair for pair in ({ids[0], ids[2]}, {ids[1], ids[3]}) if 1 in pair)
        assert {number for number in ids if orders[number] == FREE} == first, ids
        assert all(orders[number][:2] == (metres, release) for number in set(ids) - first), ids


@pytest.mark.parametrize(("rear", "kinds"), [(5.9, ("exit",)), (6.1, ())])
def test_the_order_to_wait_for_room_behind_a_junction_says_so(rear, kinds):
    # 5.0 m and 1 m more are needed behind 1.4 m.
    standing = Car(9, 1.4 + rear + 0.5 * LENGTH)
    scenario = meeting(limited(crossing()), car(1, EAST_WAY, 10.0, 8.0), cars=[standing])
    assert told(scenario)[1] == ((10.0, np.inf, 9) if kinds else FREE)
    run = idr.simulate(scenario, agents=[1], settings=RULES | {"step.max_steps": 5}, threads=1)
    assert (() if run.orders is None else run.orders.kind) == kinds


def test_while_one_waits_for_room_behind_a_junction_the_lane_across_is_granted():
    standing = Car(9, 1.4 + 5.9 + 0.5 * LENGTH)
    problems = [car(1, EAST_WAY, 10.0, 8.0), car(2, NORTH_WAY, 12.0)]
    scenario = meeting(limited(crossing()), *problems, cars=[standing])
    assert told(scenario) == {1: (10.0, np.inf, 9), 2: FREE}
    # With left before right it would go first if there was room.
    mirrored = replace(scenario, priorities=Priorities(priority_side="left"))
    assert told(mirrored) == {1: (10.0, np.inf, 9), 2: FREE}


class Keeps:
    """Keeps its speed, but is asked like one that obeys."""

    obeys_rules = True

    def plan(self, view: Any, predictions: Any) -> idr.Trajectory:
        ego, n = view.ego, 31
        way = ego.velocity * view.dt * np.arange(n)
        x, y = ego.x + way * np.cos(ego.orientation), ego.y + way * np.sin(ego.orientation)
        return idr.Trajectory(x, y, np.full(n, ego.orientation), np.full(n, ego.velocity))


def at_a_stop_sign(stood, metres, **settings):
    """The order of one that has stood so long [s], as another one at 10 m/s is so far before its mouth [m]."""
    line = StopLine(1, np.array([[-1.5, 1.75], [-1.5, -1.75]]), has_stop_sign=True)
    problems = [car(1, EAST_WAY, 0.5, 0.0), car(2, NORTH_WAY, metres + 10.0 * stood)]
    signs = Priorities(ranks=((1, (1, 1, 1)),))
    scenario = meeting(limited(crossing(arm=250.0)), *problems, stop_lines=(line,), priorities=signs)
    simulation = Simulation(scenario, agents=[1, 2], planner=Keeps, settings=RULES | settings, threads=1)
    for _ in range(round(10.0 * stood)):
        simulation.step()
    return order(simulation, 1)


# From rest it needs 0.3 s and 8.0 m with 1.5 m/s², 3.57 s. Behind a sign 1.5 s more are wanted, after 1 s 1.42 s.
@pytest.mark.parametrize(("metres", "goes"), [(50.2, True), (49.6, False)])
def test_from_a_stop_sign_a_gap_of_five_seconds_is_taken(metres, goes):
    # The other one has left 7.8 m beyond its mouth, 0.3 s more are kept.
    assert at_a_stop_sign(1.0, metres) == (FREE if goes else (0.5, 0.1 * (metres + 7.8) + 0.3, 2))
    assert at_a_stop_sign(0.9, 80.0) == (0.4, np.inf, None), "before it has stood for a second it waits at the line"


# After 10 s it is content with 0.75 s.
@pytest.mark.parametrize(("metres", "goes"), [(43.5, True), (42.9, False)])
def test_after_ten_seconds_of_standing_a_smaller_gap_is_taken(metres, goes):
    patient = {"rules.stop_duration": 10.0}
    assert (at_a_stop_sign(10.0, metres, **patient) == FREE) == goes
    assert at_a_stop_sign(10.0, 48.0, **patient, **{"rules.impatience": np.inf})[2] == 2, "it is patient"


@pytest.mark.parametrize("planner", ["rollout", "idm"])
def test_a_left_turn_waits_in_the_junction_before_the_lane_of_oncoming_traffic(planner):
    # The left edge of its strip, 15.65 m around (-15, 15), meets y = 0.65 m after 23.53 degrees of the turn.
    mouth = 65.0 + np.arccos(14.35 / 15.65) * 16.75 - 0.3
    oncoming = [turning(2 + k, 32.0 + 13.0 * k, 1.75, np.pi, (-60.0, 1.75), np.pi) for k in range(3)]
    scenario = world(wide_cross(), problems=[turning(1, -40.0, -1.75, 0.0, (1.75, 50.0), NORTH), *oncoming])
    simulation = Simulation(scenario, settings=RULES, threads=1)
    ego = simulation.world.view(simulation.world.scene(), 1).ego
    assert ego.stop_s == pytest.approx(mouth, abs=0.05) and ego.stop_by == 2
    run = idr.simulate(scenario, planner=planner, settings=RULES, threads=1)
    stands = run.states.valid[0] & (run.states.velocity[0] < 0.1)
    fronts = ego.route.project(run.states.x[0], run.states.y[0])[0][stands] + 2.25
    assert len(fronts) > 0 and mouth - 1.0 < fronts.min() and fronts.max() < mouth, "m"
