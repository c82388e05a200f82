"""Lines between lanes that must not be crossed: two lanes along x of 3.5 m, with the line at y = 1.75 m."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.support import commonroad_documents as cr
from tests.support.drivers import Straight

import interdrive as idr
from interdrive.files import read_scenario
from interdrive.testing.worlds import Car, problem, straight_road, world


def changes(left_of_lane_1, right_of_lane_2, y, heading):
    """Values of the violations of a car that drives from y [m] with 10 m/s at an angle to the lanes [rad]."""
    lanelets = replace(
        straight_road(lanes=2), left_marking=(left_of_lane_1, "solid"), right_marking=("solid", right_of_lane_2)
    )
    agent = problem(1, 150.0, 0.0, 1.0, goal=(190.0, 0.0), time_step=(0, 60))
    scenario = world(lanelets, cars=[Car(2, 10.0, y, 10.0, heading, last=35)], problems=[agent])
    found = idr.simulate(scenario, planner=Straight, agents=[1], threads=1).violations
    return [(rule, float(value)) for rule, value in zip(found.rule, found.value, strict=True)]


@pytest.mark.parametrize(
    ("left_of_lane_1", "right_of_lane_2", "up", "down"),
    [
        ("solid", "solid", 1, 1),
        ("dashed", "dashed", 0, 0),
        ("no_marking", "unknown", 0, 0),
        ("broad_solid", "broad_solid", 1, 1),
        # Double lines are named from left to right: the dashed one is on the side of lane 1.
        ("solid_dashed", "solid_dashed", 0, 1),
        ("dashed_solid", "dashed_solid", 1, 0),
    ],
)
def test_a_solid_line_must_not_be_crossed_from_the_side_on_which_it_is(left_of_lane_1, right_of_lane_2, up, down):
    # The left front wheel is 0.2 m across with the centre at 0.94 m, the right rear wheel no longer at 2.59 m: 16.5 m.
    row = [("solid_line", pytest.approx(16.5, abs=1.01))]
    assert changes(left_of_lane_1, right_of_lane_2, 0.0, 0.1) == up * row
    assert changes(left_of_lane_1, right_of_lane_2, 3.5, -0.1) == down * row


@pytest.mark.parametrize(("y", "rows"), [(1.04, 0), (1.06, 1)])
def test_wheels_may_be_twenty_centimetres_across_a_line(y, rows):
    # Half a car's width and 0.2 m beyond the line: y = 1.75 + 0.2 - 0.9 m.
    assert [rule for rule, _ in changes("solid", "solid", y, 0.0)] == rows * ["solid_line"]


def test_lines_are_read_from_files(tmp_path):
    marking = "<lineMarking>{}</lineMarking>"
    text = cr.document(cr.planning_problem(50, cr.goal(position=cr.rectangle_at(60, 0, length=9, width=4))))
    text = text.replace("</leftBound>", marking.format("solid") + "</leftBound>", 1)
    text = text.replace("</rightBound>", marking.format("broad_dashed") + "</rightBound>", 1)
    lanelets = read_scenario(cr.saved(tmp_path, text)).lanelets
    assert (lanelets.left_marking, lanelets.right_marking) == (("solid",), ("broad_dashed",))
    assert np.array_equal(lanelets.ids, [1])
