"""Disturbed worlds: what is changed, which may have come about, who is at fault in them, what is left of them."""

from dataclasses import replace

import drivers
import numpy as np
import pytest
from braking_leader import AGENT, LEADER, scenario

import interdrive as idr
from interdrive.failure_search import Space
from interdrive.failure_search.disturbances import Disturbance, Error
from interdrive.failure_search.disturbed_worlds import disturbed
from interdrive.failure_search.evaluation import Drivers, drive_of, in_disturbed, judged
from interdrive.failure_search.pairs import pairs
from interdrive.failure_search.plausibility import implausible
from interdrive.failure_search.shrinking import shrunk
from interdrive.failure_search.spaces import disturbance, undisturbed
from interdrive.native_settings import RoadSettings
from interdrive.scenario.native import core_road
from interdrive.testing import Car, straight_road, world


def test_a_leader_brakes_and_drives_on():
    changed = disturbed(
        scenario(), Disturbance({LEADER: 0.0}, {LEADER: 1.0}, Error("brakes", LEADER, 1.0, 5.0, 1.0), None)
    )
    speed = changed.obstacles.velocity[1]
    assert speed[:10] == pytest.approx(12.0)
    assert speed[20] == pytest.approx(7.0, abs=0.51), "m/s, after 1 s of 5 m/s²"
    assert speed[60] == pytest.approx(12.0), "m/s"
    way = np.diff(changed.obstacles.x[1, :70])
    assert way == pytest.approx(0.1 * speed[:69], abs=0.06), "m per step"


def test_a_vehicle_drifts_and_keeps_its_offset():
    changed = disturbed(
        scenario(), Disturbance({LEADER: 0.0}, {LEADER: 1.0}, Error("drifts", LEADER, 1.0, 0.8, 2.0), None)
    )
    assert changed.obstacles.y[1, [0, 10, 30, 60]] == pytest.approx([0.0, 0.0, 0.8, 0.8]), "m"


def test_disturbed_worlds_are_on_one_road():
    original = scenario()
    changed = disturbed(original, Disturbance({LEADER: 1.0}, {LEADER: 1.1}, None, None))
    road = core_road(original, RoadSettings())
    assert core_road(changed, RoadSettings()) is road
    assert core_road(changed, RoadSettings(open_end_length=0.0)) is not road
    assert core_road(scenario(), RoadSettings()) is not road


def test_starts_move_along_the_recording():
    changed = disturbed(scenario(), Disturbance({LEADER: -1.5}, {LEADER: 0.8}, None, None))
    assert changed.obstacles.x[1, 0] == pytest.approx(50.0 - 18.0), "m: 1.5 s at 12 m/s"
    assert changed.obstacles.velocity[1, 0] == pytest.approx(9.6), "m/s"
    assert np.array_equal(changed.obstacles.x[0], scenario().obstacles.x[0], equal_nan=True)


def test_what_cannot_have_come_about_is_not_driven():
    original = scenario()

    def why(time, speed=1.0):
        changed = disturbed(original, Disturbance({LEADER: time}, {LEADER: speed}, None, None))
        return implausible(original, changed, {LEADER})

    assert why(0.5) == ""
    assert why(-2.4) == "102 and 101 overlap at the start"
    assert why(-1.9, 0.5).startswith("102 or 101 has to brake with ")
    assert why(-6.0) == "102 starts off every lanelet"
    assert why(100.0) == "102 has no way left"


def test_a_car_three_metres_ahead_of_who_drives_15_metres_per_second_is_not_plausible():
    cars = [Car(AGENT, 20.0, velocity=15.0), Car(LEADER, 80.0, velocity=8.0)]
    original = world(straight_road(400.0), cars=cars, steps=80)
    length = original.obstacles.shapes[1].length
    back = (60.0 - length - 3.0) / 8.0
    changed = disturbed(original, Disturbance({LEADER: -back}, {LEADER: 1.0}, None, None))
    assert changed.obstacles.x[1, 0] - changed.obstacles.x[0, 0] == pytest.approx(length + 3.0), "m"
    assert implausible(original, changed, {LEADER}) == "102 or 101 has to brake with 8.2 m/s² at the start"
    alone = world(straight_road(400.0), cars=[cars[0], replace(cars[1], x=20.0 + length + 3.0)], steps=80)
    assert implausible(alone, alone, {LEADER}) == "", "as recorded"


@pytest.mark.parametrize(("more", "failure"), [(-0.5, ""), (0.5, "ran_into")])
def test_who_is_cut_off_is_at_fault_only_if_it_had_the_room_to_brake(more, failure):
    # 6 m/s faster, it reacts within 0.25 s and brakes with 6 m/s².
    room, step, length = 6.0 * 0.25 + 6.0**2 / (2.0 * 6.0), 10, scenario().obstacles.shapes[0].length
    ahead = 20.0 + 1.2 * step + length + room + more
    cars = [Car(AGENT, 20.0, velocity=12.0), Car(LEADER, ahead - 0.6 * step, 3.5, velocity=6.0)]
    made = world(straight_road(400.0, lanes=2), cars=cars, steps=80)
    y = made.obstacles.y.copy()
    y[1, step:] = 1.0
    made = replace(made, obstacles=replace(made.obstacles, y=y))
    run = idr.simulate(made, agents=[AGENT], planner=drivers.Straight, predictor="constant_velocity", threads=1)
    found = judged(run, AGENT)
    assert (found.outcome, found.partner_id, found.failure) == ("collision", LEADER, failure)
    assert f"{room + more:.1f} m left, {room:.1f} m needed" in found.words


def test_a_vehicle_that_crosses_too_closely_to_be_avoided_by_either_is_not_plausible():
    def crossing(gap):
        cars = [Car(AGENT, 100.0, velocity=12.0), Car(LEADER, 100.0 + gap, -gap, 12.0, np.pi / 2.0)]
        return world(straight_road(400.0, lane_width=60.0), cars=cars, steps=30)

    far, near = crossing(28.0), crossing(12.0)
    assert implausible(far, near, {LEADER}) == "102 and 101 touch, whichever brakes with 4 m/s² at the start"
    assert implausible(near, near, {LEADER}) == "", "as recorded"
    assert implausible(far, crossing(26.0), {LEADER}) == "", "one can still brake for the other"


def test_drivers_of_others_are_drawn_from_their_population_and_rare_ones_are_not_driven():
    (pair, _) = pairs(scenario(), "leader.xml", 4)
    space = Space()
    point = dict(zip(space.coordinates, undisturbed(space), strict=True))
    slow = disturbance(space, "idm", pair, list({**point, "time_gap.0": 0.9}.values()))
    assert slow.drivers[LEADER]["time_gap"] == pytest.approx(1.36, abs=0.01), (
        "90 % quantile: 1 s, 0.25 in the logarithm"
    )
    assert slow.rare is None
    assert slow.words() == "102 is driven with time_gap 1.36"
    rare = disturbance(space, "idm", pair, list({**point, "time_gap.0": 1.0, "acceleration.0": 1.0}.values()))
    assert rare.rare == LEADER
    plain = space.with_traffic("lawful")
    assert disturbance(plain, "lawful", pair, undisturbed(plain)).drivers == {}


def test_one_vehicle_does_not_look_for_a_while_and_the_agent_perceives_others_with_errors():
    pair, _ = pairs(scenario(), "leader.xml", 4)
    space = Space(errors=("inattentive",))
    point = dict(zip(space.coordinates, undisturbed(space), strict=True))
    change = disturbance(space, "idm", pair, list({**point, "error": 0.1, "error_time": 0.5}.values()))
    assert change.words() == "102 does not look for 0.5 s, 4.0 s after its start"
    way = in_disturbed(drive_of(scenario(), AGENT, Drivers("idm", "idm", "lane_following")), change)
    assert way.others == {LEADER: "idm,view.inattentive_from=4.0,view.inattentive_for=0.5"}
    assert way.agents == (AGENT, LEADER), "it drives by a planner"
    wrong = {"perception": 0.2, "delay": 1.0, "speed_error": 0.5, "error_seed": 0.5}
    change = disturbance(space, "idm", pair, list({**point, **wrong}.values()))
    assert change.words() == ("the agent perceives others 0.30 s late; the agent perceives speeds with errors of 5 %")
    way = in_disturbed(drive_of(scenario(), AGENT, Drivers("idm", "idm", "lane_following")), change)
    assert way.planners[AGENT] == "idm,view.delay=0.3,view.speed_error=0.05,view.error_seed=2147483647"
    assert disturbance(space, "idm", pair, list({**point, **wrong, "perception": 0.3}.values())).perception == {}


def test_the_undisturbed_point_changes_nothing():
    (pair, _) = pairs(scenario(), "leader.xml", 4)
    for space in (Space(), Space(start_speed=(1.0, 1.0)), replace(Space(), errors=())):
        change = disturbance(space, "idm", pair, undisturbed(space))
        assert change.words() == "nothing is disturbed"
        assert np.array_equal(disturbed(scenario(), change).obstacles.x, scenario().obstacles.x, equal_nan=True)


def test_shrinking_leaves_only_what_is_needed():
    neutral = np.full(4, 0.5)
    point = np.array([0.9, 0.1, 0.7, 0.5])
    small = shrunk(point, neutral, lambda other: other[0] >= 0.7)
    assert small[1:].tolist() == [0.5, 0.5, 0.5]
    assert 0.7 <= small[0] < 0.73


def test_shrinking_takes_back_what_chooses_among_kinds_but_makes_nothing_of_it_smaller():
    tried = []

    def still_fails(point):
        tried.append(point.tolist())
        return point[0] == 0.1

    small = shrunk(np.array([0.1, 0.2]), np.array([1.0, 0.5]), still_fails, (True, False))
    assert small.tolist() == [0.1, 0.5]
    assert tried == [[1.0, 0.2], [0.1, 0.5]]
