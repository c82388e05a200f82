"""Priority at junctions on the page of a run: signs beside lanes, and ways that wait for others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from packed import unpacked

from interdrive.report.contents import run_contents
from interdrive.report.packing import Packer
from interdrive.report.priorities import pack_priorities, signs, waiting_ways
from interdrive.scenario import StopLine, TrafficLight
from interdrive.scenario.control import Priorities
from interdrive.scenario.signs import SIGN_KINDS
from interdrive.simulation import simulate
from interdrive.testing import crossing, problem, straight_road, world

EAST, NORTH = 1, 2


def cross(**priorities):
    """Lanes to the east (1) and to the north (2) through the origin, 3.5 m wide, 200 m long."""
    agent = problem(7, -40.0, 0.0, 5.0, goal=(40.0, 0.0), time_step=(0, 60))
    return replace(world(crossing(), problems=[agent]), priorities=Priorities(**priorities))


def kinds_of(scenario):
    return [SIGN_KINDS[code] for code in signs(scenario)[1]]


def test_without_signs_the_way_from_the_left_has_teeth_where_the_area_begins():
    np.testing.assert_allclose(waiting_ways(cross()), [[-1.1, 0.0, 0.0]], atol=0.02)


def test_a_way_with_priority_has_a_sign_and_the_other_one_the_teeth():
    scenario = cross(ranks=((EAST, (4, 5, 4)),))
    np.testing.assert_allclose(waiting_ways(scenario), [[0.0, -1.1, np.pi / 2]], atol=0.02)
    assert kinds_of(scenario) == ["priority"]


@pytest.mark.parametrize(("left_hand", "y"), [(False, -2.95), (True, 2.95)])
def test_signs_stand_on_the_side_of_driving_beside_the_end_of_their_lane(left_hand, y):
    scenario = cross(ranks=((EAST, (1, 1, 1)), (NORTH, (2, 2, 2))), left_hand=left_hand)
    assert kinds_of(scenario) == ["stop", "yield"]
    np.testing.assert_allclose(signs(scenario)[0][0], [100.0, y], atol=1e-9)


def test_two_crossing_ways_with_lights_have_no_teeth():
    scenario = cross()
    lights = tuple(TrafficLight(number, (("green", 10), ("red", 10)), offset) for number, offset in ((5, 0), (6, 10)))
    lines = tuple(StopLine(way, np.zeros((2, 2)), ((way, (light,)),)) for way, light in ((EAST, 5), (NORTH, 6)))
    assert len(waiting_ways(replace(scenario, traffic_lights=lights, stop_lines=lines))) == 0


def test_a_page_holds_signs_and_teeth_relative_to_its_origin():
    packer = Packer()
    pack_priorities(packer, cross(ranks=((EAST, (2, 2, 2)),)), np.array([50.0, 1.0]))
    found = unpacked(packer.header, packer.text())
    np.testing.assert_allclose(found["sign_xy"], [[50.0, -3.95]], atol=0.01)
    np.testing.assert_array_equal(found["sign_kind"], [SIGN_KINDS.index("yield")])
    np.testing.assert_allclose(found["wait_xy"], [[-51.1, -1.0]], atol=0.02)
    np.testing.assert_allclose(found["wait_heading"], [0.0], atol=0.001)


def test_a_page_without_a_junction_has_neither(tmp_path):
    made = world(straight_road(100.0), problems=[problem(7, 20.0, goal=(60.0, 0.0), time_step=(0, 60))])
    arrays = run_contents(simulate(made, agents=[7], threads=1).save(tmp_path / "run")).header["arrays"]
    assert not {"sign_xy", "wait_xy"} & arrays.keys()
