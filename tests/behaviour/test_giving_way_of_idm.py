"""Whom `idm` and `idm_mobil` let be: what only the middle of the lane would touch, and who stands and can wait."""

from dataclasses import replace

import numpy as np
import pytest

import interdrive as idr
from interdrive.testing import Car, crossing, problem, straight_road, world


def _hardest(run, until):
    """The hardest braking of agent 1 in the first time steps [m/s²]."""
    row = run.states.participant_id.tolist().index(1)
    return np.nanmin(run.states.acceleration[row, :until])


@pytest.mark.parametrize(
    ("own", "passes"), [("idm,lateral_kept=1", True), ("idm_mobil,lateral_kept=1", True), ("idm", False)]
)
def test_who_keeps_to_the_side_of_its_lane_passes_what_stands_on_the_other_side(own, passes):
    # The lane is 5 m wide; the parked car ends 1 m to the right of the middle.
    agent = problem(1, 10.0, 1.0, 10.0, goal=(190.0, 0.0), goal_size=(10.0, 5.0), time_step=(0, 250))
    scenario = world(straight_road(200.0, lane_width=5.0), cars=[Car(11, 90.0, -1.9)], problems=[agent], steps=250)
    run = idr.simulate(scenario, planner=own, threads=1)
    assert (run.outcomes.outcome[0] == "goal_reached") == passes


@pytest.mark.parametrize("planner", ["idm", "idm_mobil", "lawful"])
def test_who_could_not_stop_comfortably_goes_before_a_vehicle_that_stands(planner):
    # The other one comes from the right and starts after a second; everybody knows it. To stop takes 5 m/s².
    agent = problem(1, -18.0, 0.0, 12.0, goal=(80.0, 0.0), time_step=(0, 150))
    scenario = world(crossing(), cars=[Car(11, 0.0, -5.0, orientation=0.5 * np.pi)], problems=[agent], steps=150)
    y, velocity = scenario.obstacles.y.copy(), scenario.obstacles.velocity.copy()
    y[0, 10:], velocity[0, 10:] = -5.0 + 0.3 * np.arange(141), 3.0
    scenario = replace(scenario, obstacles=replace(scenario.obstacles, y=y, velocity=velocity))
    settings = {"rules.enabled": False}
    run = idr.simulate(scenario, planner=planner, predictor="ground_truth", settings=settings, threads=1)
    assert _hardest(run, 9) > -1.5
