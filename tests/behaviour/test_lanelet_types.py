"""For which kinds lanelets are lanes: routes, lane changes, passing and derived goals keep to them.

Two lanelets along x, 3.5 m wide: 1 about y = 0, 2 to its left about y = 3.5 m. A car stands or drives slowly ahead.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import interdrive as idr
from interdrive.scenario.lanes import USERS_BY_TYPE, lane_users
from interdrive.testing.worlds import Car, problem, straight_road, world

SLOW = Car(9, 80.0, 0.0, 4.0)


def typed(*types, users=(), length=500.0):
    """Lanelets side by side, the right one first, each of one or several types."""
    kinds = tuple((one,) if isinstance(one, str) else one for one in types)
    return replace(straight_road(length, lanes=len(types)), types=kinds, users=users)


def drive(lanelets, *, planner="idm_mobil", cars=(SLOW,), start=(30.0, 0.0), goal=(300.0, 0.0), steps=700):
    """The agent's places y [m] and its outcome; at first it drives 10 m/s."""
    agent = problem(1, *start, 10.0, goal=goal, goal_size=(20.0, 3.0), time_step=(0, steps))
    run = idr.simulate(world(lanelets, cars=list(cars), problems=[agent], steps=steps), agents=[1], planner=planner)
    row = list(run.states.participant_id).index(1)
    return run.states.y[row, run.states.valid[row]], run.outcomes.outcome[0]


def admits(lanelets, kind):
    return [kind in users for users in lane_users(lanelets)]


@pytest.mark.parametrize("kind", sorted(USERS_BY_TYPE))
def test_no_car_changes_to_a_lanelet_that_is_no_lane_for_cars(kind):
    y, _ = drive(typed("urban", kind), steps=300)
    assert np.abs(y).max() < 0.9, "m from the middle of its lane"


@pytest.mark.parametrize("kind", ["urban", "highway", "unknown", "driveWay", "accessRamp", "intersection"])
def test_on_any_other_lanelet_it_overtakes(kind):
    y, outcome = drive(typed("urban", kind))
    assert y.max() > 3.0 and outcome == "goal_reached"


def test_a_lanelet_without_type_is_a_lane():
    y, _ = drive(replace(straight_road(500.0, lanes=2), types=((), ())))
    assert y.max() > 3.0


def test_a_sidewalk_on_the_right_is_none_either():
    slow = Car(9, 80.0, 3.5, 4.0)
    y, _ = drive(typed("sidewalk", "urban"), start=(30.0, 3.5), goal=(300.0, 3.5), cars=[slow], steps=300)
    assert y.min() > 2.6


@pytest.mark.parametrize("planner", ["rollout", "idm_mobil", "idm"])
def test_nobody_passes_a_standing_car_on_the_sidewalk(planner):
    y, _ = drive(typed("urban", "sidewalk"), planner=planner, cars=[Car(9, 120.0)], steps=250)
    assert y.max() < 1.75, "its middle stays in its lane"


@pytest.mark.parametrize("planner", ["rollout", "idm_mobil", "idm"])
@pytest.mark.parametrize("y", [0.0, 0.9])
def test_an_agent_that_starts_on_the_shoulder_drives_on(planner, y):
    lanelets = typed("shoulder", "highway")
    _, outcome = drive(lanelets, planner=planner, cars=[], start=(30.0, y), goal=(300.0, 3.5))
    assert outcome == "goal_reached"


@pytest.mark.parametrize("planner", ["rollout", "idm_mobil", "idm"])
def test_a_goal_in_a_parking_lane_is_reached(planner):
    _, outcome = drive(typed("urban", "parking"), planner=planner, cars=[], goal=(300.0, 3.5))
    assert outcome == "goal_reached"


@pytest.mark.parametrize("types", [("parking", "parking"), ("unknown", "unknown"), ("bicycleLane", "busLane")])
def test_a_map_on_which_nothing_is_a_lane_for_cars_is_driven_as_if_it_had_no_types(types):
    assert admits(typed(*types), "car") == [True, True]
    y, outcome = drive(typed(*types))
    assert y.max() > 3.0 and outcome == "goal_reached"


def test_whom_types_admit():
    lanelets = typed("urban", "bicycleLane", "busLane", "sidewalk", ("urban", "border"), ())
    assert admits(lanelets, "car") == [True, False, False, False, False, True]
    assert admits(lanelets, "bicycle") == [True, True, False, False, False, True]
    assert admits(lanelets, "bus") == [True, False, True, False, False, True]
    assert admits(lanelets, "taxi") == [True, False, True, False, False, True]


def test_whom_stated_users_admit():
    users = (("vehicle",), ("pedestrian",), ("bicycle", "pedestrian"), ("bus",), ("car",), ())
    lanelets = typed(*("urban",) * 6, users=users)
    assert admits(lanelets, "car") == [True, False, False, False, True, True]
    assert admits(lanelets, "bicycle") == [True, False, True, False, True, True]
    assert admits(lanelets, "truck") == [True, False, False, False, True, True], "a car's lane is one for trucks"


def test_a_crosswalk_between_lanes_is_a_piece_of_road_and_one_across_them_is_none():
    lanelets = typed("urban", ("urban", "crosswalk"), "urban", "crosswalk")
    lanelets = replace(lanelets, successors=((2,), (3,), (), ()))
    assert admits(lanelets, "car") == [True, True, True, False]
    walkway = replace(lanelets, types=(("sidewalk",), ("crosswalk",), ("sidewalk",), ("urban",)))
    assert admits(walkway, "car") == [False, False, False, True]


def test_recorded_vehicles_on_a_crosswalk_within_a_junction_are_driven_to_their_goals():
    whole = straight_road(300.0)
    x = whole.left[0][:, 0]

    def cut(bounds):
        return tuple(bounds[0][(x >= low) & (x <= high)] for low, high in ((0, 100), (100, 120), (120, 300)))

    lanelets = replace(
        whole, ids=np.array([1, 2, 3]), left=cut(whole.left), right=cut(whole.right), successors=((2,), (3,), ()),
        predecessors=((), (1,), (2,)), speed_limit=np.full(3, np.nan), types=(("urban",), ("crosswalk",), ("urban",)),
        **{f"adjacent_{side}": np.full(3, -1) for side in ("left", "right")},
        **{f"adjacent_{side}_same_direction": np.zeros(3, dtype=bool) for side in ("left", "right")},
    )  # fmt: skip
    ends_on_it, begins_on_it = Car(1, 40.0, 0.0, 10.0, last=70), Car(2, 112.0, 0.0, 10.0, last=90)
    run = idr.simulate(world(lanelets, cars=[ends_on_it, begins_on_it], steps=100), agents="all")
    assert list(run.outcomes.outcome) == ["goal_reached", "goal_reached"]


def test_the_goal_of_a_recorded_vehicle_is_derived_in_the_lane_beside_the_shoulder():
    scenario = world(typed("shoulder", "highway"), cars=[Car(1, 20.0, 1.2, 10.0)], steps=100)
    agent = idr.simulate(scenario, agents="all").agents[0]
    assert min(area.vertices[:, 1].min() for area in agent.goal[0].areas) == pytest.approx(1.75)


def test_the_drivable_area_is_that_of_all_lanelets():
    _, outcome = drive(typed("urban", "sidewalk"), planner="idm", cars=[], start=(30.0, 1.0))
    assert outcome == "goal_reached", "with its wheels on the sidewalk at first"
