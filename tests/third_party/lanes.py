"""Small worlds for planners from outside."""

from __future__ import annotations

import dataclasses

import numpy as np

from interdrive import Simulation
from interdrive.scenario import Lanelets, Scenario
from interdrive.testing import Car, problem, straight_road, world

AGENT = 100


def westwards(length: float) -> Lanelets:
    """One lane towards -x, from x = length to 0."""
    east = straight_road(length)
    (left,), (right,) = east.left, east.right
    return dataclasses.replace(east, left=(right[::-1].copy(),), right=(left[::-1].copy(),))


def drive_along(lanelets: Lanelets, start: float, heading: float, goal: float, y: float = 0.0) -> Scenario:
    """One agent on one lane with an easy goal."""
    asked = problem(AGENT, start, y, 10.0, heading, goal=(goal, 0.0), goal_orientation=heading, time_step=(0, 120))
    return world(lanelets, problems=[asked])


def behind_a_standing_car() -> Scenario:
    """One lane, a car standing in it 60 m ahead, and the goal beyond: it cannot be reached."""
    asked = problem(AGENT, 20.0, goal=(150.0, 0.0), time_step=(0, 80))
    return world(straight_road(300.0), cars=[Car(1, 80.0)], problems=[asked])


def first_view(scenario: Scenario):
    """What the agent sees at the first step, and the predictions for it."""
    simulation = Simulation(scenario, agents=[AGENT], threads=1)
    scene = simulation.world.scene()
    predictor = simulation.progress.predict(scene)
    return simulation.world.view(scene, AGENT), predictor


def travelled(run) -> np.ndarray:
    """Way of the agent since its start, shape (time_steps,) [m]."""
    row = run.states.participant_id.tolist().index(AGENT)
    x, y = run.states.x[row], run.states.y[row]
    x, y = x[np.isfinite(x)], y[np.isfinite(y)]
    return np.hypot(x - x[0], y - y[0])
