"""Turning right on red: a road along x with a red light at x = 100 m, and one without lights southwards at 110 m."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support import commonroad_documents as cr

import interdrive as idr
from interdrive.files import read_scenario

#: Half the length of a car [m].
HALF = 2.25
BEND = np.linspace(np.pi / 2, 0.0, 12)
RED = cr.traffic_light(7, ("red", 5000))
#: An arrow to the right that stays red.
ARROW = RED.replace("<direction>all<", "<direction>right<")


def junction(tmp_path, *, country="USA", light=RED, refs="", content="", other=None):
    """Agent 1 comes from the west with 10 m/s and turns right; agent 2 comes from the north, `other` [m] away."""
    quarter = {
        side: [(100 + radius * np.cos(angle), -10 + radius * np.sin(angle)) for angle in BEND]
        for side, radius in (("left", 12.0), ("right", 8.0))
    }
    lanelets = (
        cr.lanelet(1, more='<successor ref="2"/><successor ref="3"/><trafficLightRef ref="7"/>' + refs)
        + cr.lanelet(2, left=((100, 2), (200, 2)), right=((100, -2), (200, -2)), more='<predecessor ref="1"/>')
        + cr.lanelet(3, **quarter, more='<predecessor ref="1"/><successor ref="4"/>')
        + cr.lanelet(
            4,
            left=((112, -10), (112, -150)),
            right=((108, -10), (108, -150)),
            more='<predecessor ref="3"/><predecessor ref="5"/>',
        )
        + cr.lanelet(5, left=((112, 150), (112, -10)), right=((108, 150), (108, -10)), more='<successor ref="4"/>')
    )
    south = {"yawRate": 0.0, "slipAngle": 0.0}
    area = cr.rectangle_at(110, -70, length=4, width=30)
    problems = cr.planning_problem(
        1, cr.goal(position=area, time=(0, 300)), start=cr.initial(60, velocity=10.0, **south)
    )
    if other is not None:
        start = cr.initial(110, other, velocity=10.0, orientation=-np.pi / 2, **south)
        problems += cr.planning_problem(2, cr.goal(position=area, time=(0, 300)), start=start)
    text = cr.document(light + content + problems, lanelets=lanelets)
    return read_scenario(cr.saved(tmp_path, text.replace("ZAM_Test", f"{country}_Test")))


def stand_before_the_line(run):
    """How long agent 1 stands with its front at most 2 m before the line [s]."""
    x = run.states.x[0] + HALF
    return 0.1 * np.count_nonzero((x >= 98.0) & (x <= 100.0) & (np.abs(run.states.velocity[0]) <= 0.1))


def broken(run):
    return [rule for rule, source in zip(run.violations.rule, run.violations.source, strict=True) if source == "agent"]


@pytest.mark.parametrize("planner", ["rollout", "frenet", "idm", "idm_mobil"])
def test_in_america_an_agent_turns_right_on_red_after_it_has_stood_before_the_line(tmp_path, planner):
    run = idr.simulate(junction(tmp_path), planner=planner, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    assert 1.0 <= stand_before_the_line(run) <= 2.0
    assert broken(run) == []


@pytest.mark.parametrize(
    ("world", "settings", "turns"),
    [
        ({"country": "DEU"}, {}, False),
        ({"country": "DEU", "refs": '<trafficSignRef ref="9"/>', "content": cr.sign(9, "720")}, {}, True),
        ({"light": RED + ARROW.replace('"7"', '"8"'), "refs": '<trafficLightRef ref="8"/>'}, {}, False),
        ({}, {"rules.right_on_red": False}, False),
    ],
    ids=["Germany", "Germany with a green arrow sign", "red arrow", "switched off"],
)
def test_elsewhere_it_takes_a_sign_and_a_red_arrow_forbids_it(tmp_path, world, settings, turns):
    run = idr.simulate(junction(tmp_path, **world), settings=settings, threads=1)
    assert run.outcomes.outcome == (("goal_reached",) if turns else ("time_limit",))
    assert turns or 98.0 < np.nanmax(run.states.x[0]) + HALF < 100.0, "m: it stands before the line"
    assert broken(run) == []


@pytest.mark.parametrize("planner", ["rollout", "frenet", "idm", "idm_mobil"])
def test_who_turns_on_red_waits_for_all_others_even_on_a_road_with_priority(tmp_path, planner):
    # Agent 2 is some metres before the merge when agent 1 has stood for a second.
    scenario = junction(tmp_path, refs='<trafficSignRef ref="9"/>', content=cr.sign(9, "306"), other=75.0)
    run = idr.simulate(scenario, planner=planner, threads=1)
    assert set(run.outcomes.outcome) == {"goal_reached"}
    first, second = (np.flatnonzero(run.states.y[row] < -20.0)[0] for row in (1, 0))
    assert first < second, "the other one comes first"
    assert np.nanmin(run.states.acceleration[1]) >= -1.5, "it is not held up"
    assert broken(run) == []


def test_who_turns_on_red_waits_for_recorded_cars_that_would_have_to_wait_for_others(tmp_path):
    # By the sign the car would wait; it replays its recording, with 10 m/s from 75 m away on.
    states = [cr.state(k, 110, 75.0 - k, orientation=-np.pi / 2, velocity=10.0) for k in range(1, 140)]
    car = cr.car(30, cr.initial(110, 75.0, velocity=10.0, orientation=-np.pi / 2), states)
    scenario = junction(tmp_path, refs='<trafficSignRef ref="9"/>', content=cr.sign(9, "306") + car)
    run = idr.simulate(scenario, agents=[1], threads=1)
    rows = run.states.participant_id.tolist()
    first, second = (np.flatnonzero(run.states.y[rows.index(number)] < -20.0)[0] for number in (30, 1))
    assert run.outcomes.outcome == ("goal_reached",)
    assert first < second, "the car comes first"


def test_passing_the_red_light_without_stopping_is_a_violation_everywhere(tmp_path):
    run = idr.simulate(junction(tmp_path), settings={"rules.lights": False}, threads=1)
    assert broken(run) == ["red_light"]


def test_the_lanes_onto_which_one_may_turn_on_red_are_read(tmp_path):
    assert [line.turns_on_red for line in junction(tmp_path).stop_lines] == [(3,)]
    assert [line.turns_on_red for line in junction(tmp_path, country="DEU").stop_lines] == [()]
    assert [line.turns_on_red for line in junction(tmp_path, light=ARROW).stop_lines] == [()]
