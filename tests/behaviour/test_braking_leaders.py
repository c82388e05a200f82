"""A recorded car brakes to a stop ahead of an agent that follows it on a straight lane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import interdrive as idr
from interdrive.testing import CAR
from interdrive.testing.worlds import Car, problem, straight_road, world

DT = 0.1
ONSET = 20
#: Length of the agent, from the middle to the bumper of both [m].
HALVES = 0.5 * (4.508 + CAR.length)


def driven(speed, time_gap, deceleration):
    """Gap [m] and acceleration of the agent [m/s²] over time; the car ahead brakes from 2 s on."""
    leader = Car(50, 60.0 + speed * time_gap + HALVES, 0.0, speed)
    agent = problem(1, 60.0, 0.0, speed, goal=(800.0, 0.0), time_step=(0, 300))
    scenario = world(straight_road(900.0), cars=[leader], problems=[agent], steps=150)
    obstacles = scenario.obstacles
    time = np.maximum(0.0, DT * (np.arange(obstacles.x.shape[1]) - ONSET))
    braking = np.minimum(time, speed / deceleration)
    scenario = replace(
        scenario,
        obstacles=replace(
            obstacles,
            x=obstacles.x - speed * (time - braking) - 0.5 * deceleration * braking**2,
            velocity=np.maximum(0.0, obstacles.velocity - deceleration * time),
        ),
    )
    run = idr.simulate(scenario, agents=[1], threads=1)
    row = run.states.valid.all(axis=0)
    x = run.states.x[:, row]
    return run, x[1] - x[0] - HALVES, run.states.acceleration[0, row]


@pytest.mark.parametrize("speed", [10.0, 15.0, 30.0])
@pytest.mark.parametrize("time_gap", [0.4, 1.2])
@pytest.mark.parametrize("deceleration", [4.0, 8.0])
def test_an_agent_brakes_about_as_hard_as_the_car_ahead_and_does_not_touch_it(speed, time_gap, deceleration):
    run, gap, acceleration = driven(speed, time_gap, deceleration)
    assert run.outcomes.outcome[0] != "collision"
    assert gap.min() > 0.5, "m"
    assert acceleration.min() > -1.1 * deceleration, "m/s²"


def test_an_agent_begins_to_brake_within_half_a_second_of_the_car_ahead():
    _, gap, acceleration = driven(15.0, 1.2, 4.0)
    assert np.flatnonzero(acceleration < -1.0)[0] <= ONSET + 6, "time steps"
    assert 0.8 < gap[-1] < 2.5, "m, at rest"


@pytest.mark.parametrize("quantity", ["velocity", "x"])
def test_noise_of_a_recording_is_no_braking(quantity):
    """Positions that are off by 0.1 m, or speeds by 0.2 m/s, of a car that keeps 15 m/s."""
    scenario = world(
        straight_road(900.0),
        cars=[Car(50, 60.0 + 15.0 + HALVES, 0.0, 15.0)],
        problems=[problem(1, 60.0, 0.0, 15.0, goal=(800.0, 0.0), time_step=(0, 300))],
        steps=200,
    )
    obstacles = scenario.obstacles
    size = {"velocity": 0.2, "x": 0.1}[quantity]
    noise = np.random.default_rng(1).normal(0.0, size, obstacles.x.shape)
    noisy = replace(obstacles, **{quantity: getattr(obstacles, quantity) + noise})
    run = idr.simulate(replace(scenario, obstacles=noisy), agents=[1], threads=1)
    both = run.states.valid.all(axis=0)
    assert run.states.acceleration[0, both].min() > -1.0, "m/s²"
