"""Broken rules of the road are gates of the score, whatever else happens: tiny worlds, and the shipped junction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.behaviour.test_crosswalks import meeting
from tests.support.drivers import Straight

import interdrive as idr
from interdrive.adversaries.drivers import Bully
from interdrive.scenario import StopLine, TrafficLight
from interdrive.testing import Car, crossing, problem, straight_road, world

RED = TrafficLight(5, (("red", 900), ("green", 100)))
ENDS = np.array([[100.0, 1.75], [100.0, -1.75]])


def road(*cars, steps=120):
    """A straight road with an agent at 60 m, 10 m/s, whose goal is at 150 m."""
    agent = problem(1, 60.0, velocity=10.0, goal=(150.0, 0.0), time_step=(0, 110))
    return world(straight_road(), cars=cars, problems=[agent], steps=steps)


def red_light(*cars):
    return replace(road(*cars), traffic_lights=(RED,), stop_lines=(StopLine(1, ENDS, ((1, (5,)),)),))


def stop_sign(*cars):
    return replace(road(*cars), stop_lines=(StopLine(1, ENDS, (), has_stop_sign=True),))


def crosswalk():
    return meeting(-3.2, 0.5, x=20.0, velocity=10.0)


def right_of_way():
    """The agent comes from the left of a car that goes first, and leaves it less than a second."""
    agent = problem(1, -23.35, velocity=10.0, goal=(60.0, 0.0), time_step=(0, 110))
    return world(crossing(), cars=[Car(2, 0.0, -36.0, 10.0, np.pi / 2)], problems=[agent], steps=120)


def wrong_way():
    """The agent leaves its lane for the oncoming one at 5 m/s."""
    agent = problem(1, 60.0, 0.0, 5.0, 0.3, goal=(150.0, 0.0), time_step=(0, 110))
    east = straight_road(200.0)
    west = {side: (getattr(east, side)[0], turned(getattr(east, side)[0])) for side in ("left", "right")}
    both = replace(east, ids=np.array([1, 2]), **west, predecessors=((), ()), successors=((), ()), types=((), ()),
        speed_limit=np.array([np.nan, np.nan]),
        **{f"adjacent_{side}": np.array([-1, -1]) for side in ("left", "right")},
        **{f"adjacent_{side}_same_direction": np.array([False, False]) for side in ("left", "right")},
    )  # fmt: skip
    return world(both, problems=[agent], steps=120)


def turned(bound):
    """A bound of the lane to the left, whose direction is the other one."""
    return np.column_stack([bound[::-1, 0], 3.5 - bound[::-1, 1]])


class Changes:
    """Moves to the left of the road within 3 s, and drives on there."""

    def plan(self, view, predictions):
        ego, time = view.ego, np.arange(31) * view.dt
        wanted = np.clip(0.5 * (3.5 - ego.y), -0.3, 0.3)
        heading = ego.orientation + np.clip(wanted - ego.orientation, -0.3 * time, 0.3 * time)
        step = ego.velocity * view.dt
        x = ego.x + step * np.concatenate([[0.0], np.cumsum(np.cos(heading[:-1]))])
        y = ego.y + step * np.concatenate([[0.0], np.cumsum(np.sin(heading[:-1]))])
        return idr.Trajectory(x, y, heading, np.full(31, ego.velocity))


@pytest.mark.parametrize(
    ("scenario", "planner", "gate", "value"),
    [
        (red_light, Straight, "red_light", 0.0),
        (crosswalk, Straight, "crosswalk", 0.0),
        (stop_sign, Straight, "stop_sign", 0.5),
        (right_of_way, Straight, "right_of_way", 0.5),
        (wrong_way, Changes, "direction", 0.5),
    ],
)
def test_every_broken_rule_is_a_gate(scenario, planner, gate, value):
    run = idr.simulate(scenario(), agents=[1], planner=planner, predictor="constant_velocity", threads=1)
    found = idr.score(run, [1], panel="none")
    assert found.totals[0].gates[gate] <= value, found.why(1)
    assert found.score[0] <= value
    assert run.violations.participant_id[run.violations.source.index("agent")] == 1


@pytest.mark.parametrize("planner", [Straight, "idm"])
@pytest.mark.parametrize(("scenario", "gate", "value"), [(red_light, "red_light", 0.0), (stop_sign, "stop_sign", 0.5)])
def test_a_broken_rule_is_a_gate_although_another_car_runs_into_the_agent_later(scenario, gate, value, planner):
    ram = Car(9, 105.0, velocity=25.0, first=60)
    settings = {"rules.enabled": False}
    options = {"predictor": "constant_velocity", "settings": settings, "threads": 1}
    run = idr.simulate(scenario(ram), agents=[1], planner=planner, **options)
    assert run.outcomes.outcome == ("collision",)
    found = idr.score(run, [1], panel="none")
    assert "fault" not in found.facts[0].gates
    assert found.totals[0].gates[gate] == value
    assert found.score[0] <= value


def test_at_the_shipped_junction_whoever_passes_on_red_gets_nothing():
    run = idr.simulate("signals", planner=Bully, predictor="constant_velocity", threads=1)
    broken = run.violations
    red = {
        int(number)
        for rule, source, number in zip(broken.rule, broken.source, broken.participant_id, strict=True)
        if (rule, source) == ("red_light", "agent")
    }
    assert red
    found = idr.score(run, panel="none")
    gates = dict(zip(found.ids.tolist(), found.terms["gate_red_light"].tolist(), strict=True))
    assert {number for number, gate in gates.items() if gate == 0.0} == red
    assert all(found.score[found.row(number)] == 0.0 for number in red)
    assert "passed a red light at" in found.why(min(red))
