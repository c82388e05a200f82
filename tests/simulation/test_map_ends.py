"""Where vehicles leave the map: at its edge, on lanes for them, and neither in bays nor in drive ways."""

from dataclasses import replace

import numpy as np
import pytest

from interdrive.config.schema import SimulationSettings
from interdrive.scenario import KINDS
from interdrive.scenario.known_goals import MapEnds
from interdrive.scenario.native import core_road
from interdrive.testing import straight_road, world

CAR, BICYCLE = KINDS.index("car"), KINDS.index("bicycle")


def with_lane(lanelets, points, *, types=(), after=()):
    """The lanelets and another one, 3 m wide, over points (x, y) from id 100 on; some of them lead to it."""
    line = np.array(points, dtype=float)
    heading = np.gradient(line, axis=0)
    across = 1.5 * np.column_stack([-heading[:, 1], heading[:, 0]]) / np.hypot(*heading.T)[:, None]
    number = max(99, int(lanelets.ids[-1])) + 1
    followed = [
        (*ids, number) if own in after else ids
        for own, ids in zip(lanelets.ids.tolist(), lanelets.successors, strict=True)
    ]
    return replace(
        lanelets,
        ids=np.append(lanelets.ids, number),
        left=(*lanelets.left, line + across),
        right=(*lanelets.right, line - across),
        predecessors=(*lanelets.predecessors, tuple(after)),
        successors=(*followed, ()),
        adjacent_left=np.append(lanelets.adjacent_left, -1),
        adjacent_left_same_direction=np.append(lanelets.adjacent_left_same_direction, False),
        adjacent_right=np.append(lanelets.adjacent_right, -1),
        adjacent_right_same_direction=np.append(lanelets.adjacent_right_same_direction, False),
        speed_limit=np.append(lanelets.speed_limit, np.nan),
        types=(*lanelets.types, tuple(types)),
    )


def ends_of(lanelets, user=CAR, last=1):
    """Middles of the places where a car of 4 m leaves the map at 10 m/s [m]."""
    scenario = world(lanelets, steps=0)
    areas = MapEnds(scenario, core_road(scenario, SimulationSettings().road)).areas_anywhere(last, 4.0, 10.0, user)
    return sorted(tuple(np.round(area.vertices.mean(axis=0)).tolist()) for area in areas)


def side_road(length):
    """From the road at x = 80 m to the left, over a bend."""
    return [(80.0, 1.75), (85.0, 4.0), (88.0, 8.0), (88.0, 8.0 + length)]


ROAD_END = (196.0, 0.0)


def test_the_own_way_leads_out_and_so_does_another_road_to_the_edge():
    lanelets = with_lane(straight_road(200.0), side_road(60.0))
    assert ends_of(lanelets) == [(88.0, 64.0), ROAD_END]


def test_a_drive_way_that_ends_in_front_of_another_road_does_not():
    lanelets = with_lane(straight_road(200.0), side_road(30.0))
    lanelets = with_lane(lanelets, [(0.0, 60.0), (100.0, 60.0), (200.0, 60.0)])
    assert ends_of(lanelets) == [ROAD_END, (196.0, 60.0)]


def test_a_drive_way_at_the_edge_of_the_map_does_not_either():
    lanelets = with_lane(straight_road(200.0), side_road(30.0), types=("driveWay",))
    assert ends_of(lanelets) == [ROAD_END]


@pytest.mark.parametrize(("length", "leads_out"), [(2.0, False), (30.0, True)])
def test_a_bay_beside_the_road_does_not_for_its_length_alone(length, leads_out):
    lanelets = with_lane(straight_road(200.0), side_road(length), after=(1,))
    lanelets = with_lane(lanelets, [(200.0, 0.0), (260.0, 0.0)], after=(1,))
    found = ends_of(lanelets, last=101)
    assert ((256.0, 0.0) in found, len(found)) == (True, 2 if leads_out else 1)


def test_a_bicycle_lane_leads_out_for_bicycles_alone():
    lanelets = with_lane(straight_road(200.0), [(0.0, -4.0), (100.0, -4.0), (200.0, -4.0)], types=("bicycleLane",))
    assert ends_of(lanelets) == [ROAD_END]
    assert ends_of(lanelets, BICYCLE) == [(196.0, -4.0), ROAD_END]


def test_where_the_own_way_does_not_lead_out_there_are_no_ends():
    lanelets = with_lane(straight_road(200.0), [(200.0, 0.0), (260.0, 0.0)], after=(1,))
    assert ends_of(lanelets, last=1) == []


def test_the_end_of_the_own_way_counts_wherever_it_is():
    lanelets = with_lane(straight_road(200.0), side_road(2.0), types=("driveWay",))
    assert len(ends_of(lanelets, last=100)) == 2


def test_a_short_lane_into_which_two_roads_merge_leads_out():
    lanelets = with_lane(straight_road(200.0), [(0.0, 60.0), (200.0, 60.0)])
    lanelets = with_lane(lanelets, [(140.0, -60.0), (180.0, -20.0), (200.0, 0.0)])
    lanelets = with_lane(lanelets, [(200.0, 0.0), (208.0, 0.0)], after=(1, 101))
    assert ends_of(lanelets, last=100) == [(196.0, 60.0), (204.0, 0.0)]


def short_lanes(length):
    """Two ways of 4 m leave a road and meet in a lane, 102; a road beside that begins at the edge of the map, 103."""
    lanelets = with_lane(straight_road(200.0), [(200.0, 1.75), (204.0, 1.75)], after=(1,))
    lanelets = with_lane(lanelets, [(200.0, 1.75), (202.0, 1.5), (204.0, 1.75)], after=(1,))
    lanelets = with_lane(lanelets, [(204.0, 1.75), (204.0 + length, 1.75)], after=(100, 101))
    return with_lane(lanelets, [(100.0, -1.25), (204.0 + length, -1.25)])


@pytest.mark.parametrize(("length", "leads_out"), [(9.0, False), (13.0, True)])
def test_a_bay_with_two_ways_into_it_counts_from_the_fork(length, leads_out):
    own, bay = (200.0 + length, -1.0), (200.0 + length, 2.0)
    assert ends_of(short_lanes(length), last=103) == sorted([own, *([bay] if leads_out else [])])


def test_a_short_lane_beside_one_that_leads_out_does_so_too():
    lanelets = short_lanes(9.0)
    on_the_left, on_the_right = lanelets.adjacent_left.copy(), lanelets.adjacent_right.copy()
    rows = {number: row for row, number in enumerate(lanelets.ids.tolist())}
    on_the_left[rows[103]], on_the_right[rows[102]] = 102, 103
    same_left, same_right = on_the_left >= 0, on_the_right >= 0
    lanelets = replace(
        lanelets,
        adjacent_left=on_the_left,
        adjacent_left_same_direction=same_left,
        adjacent_right=on_the_right,
        adjacent_right_same_direction=same_right,
    )
    own_road = with_lane(lanelets, [(0.0, 60.0), (200.0, 60.0)])
    assert ends_of(own_road, last=104) == [(196.0, 60.0), (209.0, -1.0), (209.0, 2.0)]
