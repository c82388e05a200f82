"""Turns that agents show before a fork, on a cross of four arms with turns; the junction begins 12 m before the origin.

Cars are 4.5 m long. Agent 1 comes from the west: lanelet 11 leads it straight on, 12 left, 13 right.
"""

from __future__ import annotations

import numpy as np
import pytest
from parallel_drivers import Telling, TellingHere
from tests.support.junction_lanes import cross_with_turns

import interdrive as idr
from interdrive.simulation import Simulation
from interdrive.testing.worlds import Car, problem, world

HALF = 2.25
FORK = -12.0
#: Where the way from the west leads: goals 40 m from the origin.
GOALS = {"left": (1.75, 40.0), "straight": (40.0, -1.75), "right": (-1.75, -40.0)}
SIDES = {"left": 1.0, "straight": 0.0, "right": -1.0}


def coming(turn, to_fork, velocity=8.0):
    """Agent 1, its front so far before the fork [m]."""
    x = FORK - to_fork - HALF
    return problem(1, x, -1.75, velocity, goal=GOALS[turn], goal_size=(8.0, 8.0), time_step=(0, 300))


def watching():
    """Agent 2 comes from the east and goes straight on."""
    return problem(2, 20.0, 1.75, 8.0, np.pi, goal=(-40.0, 1.75), time_step=(0, 300))


def simulation(turn, to_fork, velocity=8.0, **options):
    problems = [coming(turn, to_fork, velocity), watching()]
    cars = [Car(9, 40.0, 1.75, orientation=np.pi, velocity=8.0)]
    return Simulation(world(cross_with_turns(), cars=cars, problems=problems), agents=[1, 2], threads=1, **options)


def shown(drive):
    """What agent 2 sees of agent 1 and of the recorded car."""
    view = drive.world.view(drive.world.scene(), 2)
    return dict(zip(view.ids.tolist(), view.turn.tolist(), strict=True))


@pytest.mark.parametrize("turn", ["left", "straight", "right"])
def test_an_agent_shows_its_turn_from_30_m_before_the_fork_on(turn):
    assert shown(simulation(turn, 29.9))[1] == SIDES[turn]
    assert np.isnan(shown(simulation(turn, 30.1))[1])
    # Or from 3 s before it on.
    assert shown(simulation(turn, 44.0, 15.0))[1] == SIDES[turn]


@pytest.mark.parametrize("to_fork", [20.0, -3.0])
def test_an_agent_that_reverses_before_or_behind_the_fork_shows_none_and_one_that_stands_there_does(to_fork):
    assert np.isnan(shown(simulation("left", to_fork, -1.5))[1])
    assert shown(simulation("left", to_fork, 0.0))[1] == SIDES["left"]


def test_replayed_vehicles_and_agents_with_blinkers_switched_off_show_none():
    assert np.isnan(shown(simulation("left", 20.0))[9])
    for rules in ({"blinkers": False}, {"enabled": False}):
        assert np.isnan(shown(simulation("left", 20.0, rules={1: rules}))[1])


def test_predictions_take_the_way_that_is_shown():
    """Lane by lane: `lane_following` expects each way with the same probability."""
    for blinkers in (True, False):
        # Otherwise agent 1 is expected to wait.
        settings = {"rules.blinkers": blinkers, "rules.precedence": False}
        drive = simulation("left", 5.0, predictor="lane_following", settings=settings)
        expected = drive.progress.begin_step().predictions.of(np.array([1]))
        used = expected.probability[0] > 0.0
        ends = np.column_stack([expected.x[0, used, 29], expected.y[0, used, 29]])
        assert expected.probability.sum() == pytest.approx(1.0)
        if blinkers:
            assert len(ends) == 1 and ends[0, 1] > 4.0, "to the north"
        else:
            assert len(ends) == 3


@pytest.mark.parametrize("planner", [Telling, TellingHere])
def test_planners_in_python_see_turns_in_processes_of_their_own_too(planner):
    made = world(cross_with_turns(), problems=[coming("left", 15.0), watching()])
    run = idr.simulate(made, planner={1: "idm", 2: planner}, threads=2)
    assert "turns [1.0]" in run.outcomes.message[1]
