"""Agents whose own recording reaches their goal: which they are, and runs of them alone."""

import pytest

from interdrive import InputError, simulate
from interdrive.simulation import reachable_agents
from interdrive.testing import Car, straight_road, world

#: Car 2 runs into car 3 after 3.9 s.
CRASH = [Car(2, 60.0, velocity=10.0), Car(3, 100.0, velocity=1.5)]


def test_recordings_that_collide_are_not_reachable():
    scenario = world(straight_road(), cars=[Car(1, 10.0, velocity=3.0), *CRASH])
    assert reachable_agents(scenario) == [1]
    run = simulate(scenario, agents="reachable", threads=1)
    assert run.outcomes.agent_id.tolist() == [1]
    assert run.settings["agents"] == "reachable"


def test_a_scenario_without_reachable_agents_is_refused():
    with pytest.raises(InputError, match="reachable"):
        simulate(world(straight_road(), cars=CRASH), agents="reachable", threads=1)
