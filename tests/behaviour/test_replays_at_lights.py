"""Replayed vehicles before red lights: an agent drives along x on green, a replayed car comes from the right, on red.

Both have 100 m before the junction at the origin; the line of the car is at y = -4 m.
"""

from __future__ import annotations

import numpy as np
import pytest
from tests.support import commonroad_documents as cr

import interdrive as idr
from interdrive.files import read_scenario

#: Half the length of a car [m], and where the line of the replayed one is [m].
HALF, LINE = 2.25, -4.0


def crossing(tmp_path, ys, *, light="red"):
    """The agent is 40 m before the junction with 10 m/s; the centre of the car is at these `ys` [m], every 0.1 s."""
    lanelets = (
        cr.lanelet(
            1, left=((-100, 2), (-4, 2)), right=((-100, -2), (-4, -2)),
            more='<successor ref="2"/><trafficLightRef ref="7"/>',
        )
        + cr.lanelet(2, left=((-4, 2), (100, 2)), right=((-4, -2), (100, -2)), more='<predecessor ref="1"/>')
        + cr.lanelet(
            3, left=((-2, -100), (-2, LINE)), right=((2, -100), (2, LINE)),
            more='<successor ref="4"/><trafficLightRef ref="8"/>',
        )
        + cr.lanelet(4, left=((-2, LINE), (-2, 100)), right=((2, LINE), (2, 100)), more='<predecessor ref="3"/>')
    )  # fmt: skip
    lights = cr.traffic_light(7, ("green", 5000)) + cr.traffic_light(8, (light, 5000))
    speeds = np.gradient(ys, 0.1)
    north = np.pi / 2
    states = [
        cr.state(k, 0.0, y, orientation=north, velocity=v) for k, (y, v) in enumerate(zip(ys, speeds, strict=True))
    ]
    car = cr.car(30, cr.initial(0.0, ys[0], velocity=speeds[0], orientation=north), states[1:])
    area = cr.rectangle_at(60, 0, length=30, width=4)
    start = cr.initial(-40, velocity=10.0, yawRate=0.0, slipAngle=0.0)
    problem = cr.planning_problem(1, cr.goal(position=area, time=(0, 300)), start=start)
    text = cr.document(lights + car + problem, lanelets=lanelets)
    return read_scenario(cr.saved(tmp_path, text.replace("ZAM_Test", "DEU_Test")))


def coming(until, speed, seconds=20.0):
    """From y = -20 m on with a speed [m/s]; it brakes with 1.5 m/s² and stands with its centre at a place [m]."""
    ys = [-20.0]
    for _ in range(round(seconds / 0.1)):
        ys.append(ys[-1] + 0.1 * min(speed, float(np.sqrt(3.0 * max(0.0, until - ys[-1])))))
    return np.array(ys)


@pytest.mark.parametrize("light", ["red", "yellow"])
@pytest.mark.parametrize("planner", ["rollout", "idm"])
def test_an_agent_on_green_is_not_held_by_a_car_that_comes_to_a_red_light(tmp_path, planner, light):
    scenario = crossing(tmp_path, coming(LINE - HALF - 0.5, 4.0), light=light)
    run = idr.simulate(scenario, agents="problems", planner=planner, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    assert len(run.orders.kind) == 0, "nobody tells it to wait"
    if planner == "rollout":
        row = run.states.participant_id.tolist().index(1)
        assert run.states.velocity[row, run.states.x[row] < 5.0].min() >= 9.0, "m/s"


def test_it_is_held_by_a_car_that_is_too_fast_to_stop(tmp_path):
    # 10 m before the line with 12 m/s: it would have to brake with 7 m/s².
    scenario = crossing(tmp_path, -16.0 + 12.0 * (np.arange(0.0, 20.0, 0.1) - 2.0))
    run = idr.simulate(scenario, agents="problems", threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    assert "yield" in run.orders.kind, "it is told to wait"


def test_it_is_held_by_a_car_that_has_green_too(tmp_path):
    run = idr.simulate(crossing(tmp_path, coming(60.0, 4.0), light="green"), agents="problems", threads=1)
    assert "yield" in run.orders.kind, "who comes from the right goes first"
