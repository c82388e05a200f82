"""What the words of a study say about the speed of the other vehicle, compared with its recording."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from drivers import Straight

from interdrive import simulate
from interdrive.studies.reading import _reaction, _slowness
from interdrive.testing import Car, straight_road, world


def reaction(recorded, *driven):
    """Car 7 was recorded with a constant speed and drives with others [m/s], one after the other."""
    scenario = world(straight_road(300.0), cars=[Car(7, 20.0, velocity=recorded)], steps=50)
    run = simulate(scenario, agents=[7], planner=Straight, threads=1)
    velocity = run.states.velocity.copy()
    there = np.flatnonzero(run.states.valid[0])
    velocity[0, there] = np.interp(np.linspace(0.0, 1.0, len(there)), np.linspace(0.0, 1.0, len(driven)), driven)
    run = replace(run, states=replace(run.states, velocity=velocity))
    return _reaction(SimpleNamespace(agent=1, other=7), run)


@pytest.mark.parametrize(
    ("recorded", "driven", "words"),
    [
        (12.0, (12.0, 8.0, 12.0), "slows to 8.0 m/s (recorded: 12.0 m/s)"),
        (12.0, (12.0, 11.4), "slows to 11.4 m/s (recorded: 12.0 m/s)"),
        (12.0, (12.1, 13.0), "drives at least 12.1 m/s (recorded: 12.0 m/s)"),
        (12.0, (12.0, 15.0), "drives at least 12.0 m/s, as in its recording"),
        (12.0, (12.04, 12.0), "drives at least 12.0 m/s, as in its recording"),
        (12.0, (11.6, 12.0), "drives at least 11.6 m/s (recorded: 12.0 m/s)"),
        (12.0, (13.0, 14.0), "does not slow below 13.0 m/s (recorded: 12.0 m/s)"),
        (12.0, (12.0, 0.0), "stops (recorded: 12.0 m/s)"),
        (12.0, (12.0, 0.3), "slows to 0.3 m/s (recorded: 12.0 m/s)"),
    ],
)
def test_only_a_lower_speed_than_recorded_is_called_slowing(recorded, driven, words):
    assert reaction(recorded, *driven) == f"; vehicle 7 {words}"


@pytest.mark.parametrize("slowest", [0.0, 0.1, 0.15])
def test_a_vehicle_that_stops_as_recorded_does_so(slowest):
    assert _slowness(slowest, 0.0) == "stops, as in its recording"
