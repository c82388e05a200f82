"""Pairs are ranked by which vehicle is in the way: on the driven path, along it, where bodies would meet."""

import numpy as np
import pytest
from junction_lanes import left_turn, network, right_turn, straight
from recorded_drives import driving, recorded, steady

from interdrive.criticality import evaluate
from interdrive.testing import Car, straight_road, world

#: Where the junction begins [m].
MOUTH = -20.0


def two_turns(gap=3.5):
    """Two lanes from the west that both turn left; from each a lanelet leads straight on, across the other turn."""
    centers = {
        10: straight((-80.0, 0.0), (MOUTH, 0.0)),
        11: left_turn(24.0, (MOUTH, 0.0)),
        12: straight((MOUTH, 0.0), (30.0, 0.0)),
        20: straight((-80.0, -gap), (MOUTH, -gap)),
        21: left_turn(24.0 + gap, (MOUTH, -gap)),
        22: straight((MOUTH, -gap), (30.0, -gap)),
    }
    return network(centers, {10: (11, 12), 20: (21, 22)}, {20: 10})


def pairs(found, name="ttc"):
    return [{one.participant_id, one.partner_id} for one in found.most_critical_pairs(name, 99)]


def side_by_side(gap=3.5, inner=9.0, outer=6.0, start=50.0):
    """A car that turns left, and a slower one ahead on the turn beside it, which the straight way crosses."""
    own = np.vstack([straight((-80.0, 0.0), (MOUTH, 0.0))[:-1], left_turn(24.0, (MOUTH, 0.0))])
    other = np.vstack([straight((-80.0, -gap), (MOUTH, -gap))[:-1], left_turn(24.0 + gap, (MOUTH, -gap))])
    drives = {1: driving(own, 30.0, steady(inner, 50)), 2: driving(other, start, steady(outer, 50))}
    return evaluate(recorded(two_turns(gap), drives))


@pytest.mark.parametrize(("inner", "outer", "start"), [(9.0, 6.0, 50.0), (12.0, 8.0, 45.0), (8.0, 8.0, 42.0)])
def test_cars_that_turn_side_by_side_are_no_critical_pair(inner, outer, start):
    found = side_by_side(inner=inner, outer=outer, start=start)
    assert pairs(found) == pairs(found, "btn") == []
    assert found.most_critical("ttc") is None
    assert found.most_critical("stn") is None


def test_the_tables_hold_what_lies_on_paths_that_nobody_drives():
    assert np.isfinite(side_by_side()["ttc"]).any()


def test_the_car_ahead_in_the_own_turn_is():
    own = np.vstack([straight((-80.0, 0.0), (MOUTH, 0.0))[:-1], left_turn(24.0, (MOUTH, 0.0))])
    drives = {1: driving(own, 30.0, steady(9.0, 40)), 2: driving(own, 50.0, steady(6.0, 40))}
    found = evaluate(recorded(two_turns(), drives))
    moment = found.most_critical("ttc")
    assert (moment.participant_id, moment.partner_id) == (1, 2)
    assert moment.value == pytest.approx((20.0 - 4.5 - 4.0 * 3.0) / 3.0, abs=0.1)
    assert moment.path.startswith("11") or moment.path.startswith("10 > 11")


def test_who_takes_the_other_branch_is_left_out_and_who_takes_the_same_one_is_not():
    lanelets = network(
        {
            1: straight((-80.0, 0.0), (0.0, 0.0)),
            2: straight((0.0, 0.0), (80.0, 0.0)),
            3: right_turn(20.0, (0.0, 0.0)),
        },
        {1: (2, 3)},
    )
    ahead = straight((-80.0, 0.0), (80.0, 0.0))
    off = np.vstack([straight((-80.0, 0.0), (0.0, 0.0))[:-1], right_turn(20.0, (0.0, 0.0))])

    def found(way):
        drives = {1: driving(ahead, 60.0, steady(10.0, 20)), 2: driving(way, 86.0, steady(1.0, 20))}
        return evaluate(recorded(lanelets, drives))

    assert pairs(found(ahead)) == [{1, 2}]
    turned = found(off)
    assert turned["ttc"][0].min() < 1.0  # "1 > 3" leads there
    moment = turned.most_critical("ttc")
    assert moment is None or moment.path == "1 > 2"


def test_bodies_beside_each_other_in_a_wide_lane_do_not_meet():
    wide = straight_road(200.0, lane_width=7.0)
    beside = evaluate(world(wide, cars=[Car(1, 20.0, -1.5, 12.0), Car(2, 40.0, 1.5, 5.0)], steps=10))
    assert np.isfinite(beside["ttc"][0]).all() and pairs(beside) == []
    behind = evaluate(world(wide, cars=[Car(1, 20.0, 1.0, 12.0), Car(2, 40.0, 1.5, 5.0)], steps=10))
    assert pairs(behind) == [{1, 2}]


def test_a_partner_that_others_hide_in_the_tables_is_still_found():
    wide = straight_road(200.0, lane_width=7.0)
    cars = [Car(1, 20.0, -1.5, 12.0), Car(2, 32.0, 1.5, 2.0), Car(3, 60.0, -1.5, 8.0)]
    found = evaluate(world(wide, cars=cars, steps=5), [1])
    assert set(found.series["ttc"].partner_id[0]) == {2}
    assert pairs(found) == [{1, 3}]


def test_who_cuts_in_is_in_the_way_before_it_is_in_line():
    wide = straight_road(200.0, lane_width=7.0)
    cars = [Car(1, 20.0, -1.0, 12.0), Car(2, 40.0, 1.5, 6.0, orientation=-0.2)]
    assert pairs(evaluate(world(wide, cars=cars, steps=1))) == [{1, 2}]


def test_wrong_way_traffic_in_the_own_lane_is_in_the_way():
    cars = [Car(1, 20.0, 0.0, 10.0), Car(2, 70.0, 0.0, 10.0, orientation=np.pi)]
    moment = evaluate(world(straight_road(200.0), cars=cars, steps=10)).most_critical("ttc")
    assert moment.value == pytest.approx((50.0 - 20.0 - 4.5) / 20.0)


def test_who_crosses_is_ranked_by_what_measures_crossings():
    lanes = network({1: straight((-80.0, 0.0), (80.0, 0.0)), 2: straight((0.0, -80.0), (0.0, 80.0))}, {})
    drives = {
        1: driving(straight((-80.0, 0.0), (80.0, 0.0)), 40.0, steady(10.0, 60)),
        2: driving(straight((0.0, -80.0), (0.0, 80.0)), 50.0, steady(10.0, 60)),
    }
    found = evaluate(recorded(lanes, drives))
    assert pairs(found) == []
    assert pairs(found, "dce") == [{1, 2}]
    stands = drives | {2: driving(straight((0.0, -80.0), (0.0, 80.0)), 80.0, steady(0.0, 60))}
    assert pairs(evaluate(recorded(lanes, stands))) == [{1, 2}]


@pytest.mark.parametrize(("overlap", "is_contact"), [(0.02, False), (0.25, False), (0.35, True)])
def test_recorded_boxes_that_graze_each_other_did_not_collide(overlap, is_contact):
    lanes = straight_road(200.0, lanes=2)
    cars = [Car(1, 20.0, 0.0, 12.0), Car(2, 30.0, 1.8 - overlap, 6.0)]
    found = evaluate(world(lanes, cars=cars, steps=30))
    assert found["ttc"].min() == 0.0
    assert bool(np.nanmin(found.in_the_way["ttc"].value) == 0.0) == is_contact
