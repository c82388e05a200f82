"""A street of 40 m in which two cars cannot meet, with room at both ends; agents obey `rules.precedence`.

Two lanes of 3 m lie on each other between x = -20 and 20 m, and beside each other beyond 32 m; the limit is 10 m/s.
"""

from __future__ import annotations

import numpy as np
import pytest

import interdrive as idr
from interdrive.scenario import Lanelets
from interdrive.simulation import Simulation
from interdrive.testing.worlds import problem, world

HALF = 2.25
RULES = {"rules.precedence": True}
#: Each agent starts at this distance from the middle [m].
START = 70.0


def street(half=20.0, taper=12.0):
    """Lanelet 1 to the east, lanelet 2 to the west."""

    def lane(sign):
        x = np.linspace(-150.0, 150.0, 301)
        u = np.clip((np.abs(x) - half) / taper, 0.0, 1.0)
        middle = np.column_stack([sign * x, -sign * 1.75 * u**2 * (3.0 - 2.0 * u)])
        aside = 1.5 * np.array([0.0, sign])
        return middle + aside, middle - aside

    (left1, right1), (left2, right2) = lane(1.0), lane(-1.0)
    none, no = np.full(2, -1), np.zeros(2, dtype=bool)
    limit, ids = np.full(2, 10.0), np.array([1, 2])
    return Lanelets(ids, (left1, left2), (right1, right2), ((), ()), ((), ()), none, no, none, no, limit, ((), ()))


def car(agent_id, sign, start=START, velocity=8.0):
    """An agent that comes from the west (1.0) or from the east (-1.0)."""
    heading = 0.0 if sign > 0 else np.pi
    return problem(
        agent_id, -sign * start, -sign * 1.75, velocity, heading, goal=(sign * 90.0, -sign * 1.75),
        goal_size=(20.0, 3.5), goal_orientation=heading, time_step=(0, 900),
    )  # fmt: skip


def driven(problems, planner, lanelets=None):
    """The run, and per agent the distances of its front and its rear beyond its own mouth over time [m]."""
    scenario = world(lanelets or street(), problems=problems)
    run = idr.simulate(scenario, planner=planner, settings=RULES, threads=1)
    simulation = Simulation(scenario, settings=RULES, threads=1)
    scene = simulation.world.scene()
    mouth = run.orders.stop_s.max()
    fronts = []
    for row, number in enumerate(run.outcomes.agent_id.tolist()):
        route = simulation.world.view(scene, number).ego.route
        fronts.append(route.project(run.states.x[row], run.states.y[row])[0] + HALF - mouth)
    return run, fronts


def length_of_the_street(run):
    """From mouth to mouth [m]."""
    return 2.0 * (150.0 - run.orders.stop_s.max()) + 0.6


@pytest.mark.parametrize("planner", ["rollout", "idm"])
def test_the_one_with_the_lower_id_passes_and_the_other_one_waits_before_the_mouth(planner):
    run, (first, second) = driven([car(1, 1.0), car(2, -1.0)], planner)
    assert run.outcomes.outcome == ("goal_reached", "goal_reached")
    left = int(np.argmax(first - 2 * HALF > length_of_the_street(run)))
    assert -1.0 < second[left - 20 : left - 5].max() < -0.1, "m"
    speed = run.states.velocity[1]
    assert speed[left - 20] < 0.1 < speed[left + 10], "it moves at most 1 s after the first one has left"


@pytest.mark.parametrize("planner", ["rollout", "idm"])
def test_a_third_one_that_arrives_later_waits_for_the_one_at_the_other_end(planner):
    run, fronts = driven([car(1, 1.0), car(2, -1.0), car(3, 1.0, START + 9.5)], planner)
    assert all(outcome.startswith("goal_reached") for outcome in run.outcomes.outcome)
    entered = [int(np.argmax(front > 0.0)) for front in fronts]
    assert entered[0] < entered[1] < entered[2]


@pytest.mark.parametrize("planner", ["rollout", "idm"])
def test_a_third_one_follows_the_first_through_if_the_one_at_the_other_end_arrives_later(planner):
    run, fronts = driven([car(1, 1.0), car(2, -1.0, START + 25.0), car(3, 1.0, START + 9.5)], planner)
    assert run.outcomes.outcome == ("goal_reached",) * 3
    entered = [int(np.argmax(front > 0.0)) for front in fronts]
    assert entered[0] < entered[2] < entered[1]
    length = length_of_the_street(run)
    assert fronts[2][entered[1]] - 2 * HALF > length, "m: the other one enters when both have left"


def test_a_street_that_cannot_be_seen_through_is_approached_slowly():
    # At 80 m the cars see each other when neither could stop any more.
    run, fronts = driven([car(1, 1.0), car(2, -1.0)], "rollout", street(half=20.0, taper=16.0))
    assert run.outcomes.outcome == ("goal_reached", "goal_reached")
    length = length_of_the_street(run)
    assert 58.0 < length < 62.0, "m: it is seen through before the mouth, but not from 5 m before it"
    inside = [(front > 0.0) & (front - 2 * HALF < length) for front in fronts]
    assert not (inside[0] & inside[1]).any(), "never both in the street"
    for row, front in enumerate(fronts):
        speed = [run.states.velocity[row, np.argmax(front > -before)] for before in (20.0, 8.0)]
        assert speed[0] < 8.0 and speed[1] < 5.0, "m/s at 20 and 8 m before the mouth; the limit is 10 m/s"


@pytest.mark.parametrize("half", [21.3, 21.4])
@pytest.mark.parametrize(("velocity", "waits"), [(0.0, False), (0.5, True)])
def test_an_agent_that_stands_before_a_street_does_not_wait_for_nobody(half, velocity, waits):
    # Of these streets it sees the other end from 0.8 m before the mouth, where agents stand, but not yet from 1.2 m.
    mouth = half + 9.57
    agent = car(1, 1.0, mouth + 1.2 + HALF, velocity)
    simulation = Simulation(world(street(half=half, taper=16.0), problems=[agent]), settings=RULES, threads=1)
    ego = simulation.world.view(simulation.world.scene(), 1).ego
    assert np.isfinite(ego.stop_s) == waits
