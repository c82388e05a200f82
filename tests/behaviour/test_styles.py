"""Driving styles: how gently the same agent drives in the same small world."""

import numpy as np
import pytest

from interdrive import STYLES, simulate
from interdrive.native_settings import Comfort
from interdrive.testing import Car, bend, problem, straight_road, world

AGENT = 100


def limit(style, name, default):
    """What a style finds comfortable."""
    return STYLES[style].get(f"planner.rollout.comfort.{name}", default)


@pytest.fixture(scope="module", params=["calm", "normal", "brisk"])
def drives(request):
    """A style, its drive through a bend of 20 m radius, and its drive from 12 m/s up to a car that stands."""
    style = request.param
    there = problem(AGENT, -75.0, velocity=10.0, goal=(20.0, 90.0), goal_size=(4.0, 10.0), time_step=(0, 400))
    turn = world(bend(20.0, 80.0), problems=[there])
    stop = world(
        straight_road(250.0),
        cars=[Car(7, 150.0, velocity=0.0)],
        problems=[problem(AGENT, 10.0, velocity=12.0, goal=(230.0, 0.0), time_step=(0, 200))],
        steps=300,
    )
    runs = [simulate(one, agents=[AGENT], settings=STYLES[style], threads=1) for one in (turn, stop)]
    return style, *(run.states for run in runs)


def test_a_bend_is_taken_at_the_comfortable_lateral_acceleration(drives):
    style, turn, _ = drives
    velocity = turn.velocity[0]
    across = np.abs(velocity * np.gradient(np.unwrap(turn.orientation[0]), 0.1))
    most = limit(style, "lateral_acceleration", Comfort().lateral_acceleration)
    assert 0.7 * most < np.nanmax(across) < 1.5 * most, "m/s²"


def test_an_agent_brakes_for_what_stands_as_its_style_says(drives):
    style, _, stop = drives
    velocity = stop.velocity[stop.participant_id == AGENT][0]
    assert np.nanmin(velocity) < 0.1, "m/s"
    hardest = -np.nanmin(np.diff(velocity) / 0.1)
    comfortable = limit(style, "deceleration", Comfort().deceleration)
    assert 0.6 * comfortable < hardest < 1.6 * comfortable, "m/s²"
