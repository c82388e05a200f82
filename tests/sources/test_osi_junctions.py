"""Junctions of OSI traces, which have no boundaries, are crossed as their pairings of lanes say."""

import foreign_files as ff
import numpy as np
import pytest

import interdrive as idr
from interdrive.scenario.map_defects import map_defects

JUNCTION = 60
#: Borders of lanes in driving direction: from the west, to the east, to the south; 3.5 m wide.
LANES = {
    1: (((0, 3.5), (50, 3.5)), ((0, 0), (50, 0))),
    2: (((70, 3.5), (120, 3.5)), ((70, 0), (120, 0))),
    3: (((60, -10), (60, -60)), ((56.5, -10), (56.5, -60))),
}


def trace(folder, pairs, backwards=(), ahead=(1,), behind=(2, 3)):
    """A trace with a car on the lane from the west; `backwards`: lanes with centre lines against their direction."""
    import betterosi as osi

    def ids(*numbers):
        return [osi.Identifier(value=number) for number in numbers]

    def pairing(before, after):
        named = {"antecessor_lane_id": before, "successor_lane_id": after}
        return osi.Lane.Classification.LanePairing(
            **{name: osi.Identifier(value=number) for name, number in named.items() if number is not None}
        )

    kinds, lanes, boundaries = osi.Lane.Classification.Type, [], []
    for number, sides in LANES.items():
        for side, border in enumerate(sides):
            points = [osi.Vector3d(x=float(x), y=float(y), z=0.0) for x, y in border]
            boundaries.append(
                osi.LaneBoundary(
                    id=osi.Identifier(value=10 * number + side),
                    boundary_line=[osi.LaneBoundary.BoundaryPoint(position=point) for point in points],
                )
            )
        middle = np.mean(sides, axis=0)
        ends = (None, JUNCTION) if number in ahead else (JUNCTION, None) if number in behind else (None, None)
        if number in backwards:
            middle, ends = middle[::-1], ends[::-1]
        classification = osi.Lane.Classification(
            type=kinds.DRIVING,
            centerline=[osi.Vector3d(x=float(x), y=float(y), z=0.0) for x, y in middle],
            centerline_is_driving_direction=number not in backwards,
            left_lane_boundary_id=ids(10 * number),
            right_lane_boundary_id=ids(10 * number + 1),
            lane_pairing=[pairing(*ends)],
        )
        lanes.append(osi.Lane(id=osi.Identifier(value=number), classification=classification))
    area = osi.Lane.Classification(type=kinds.INTERSECTION, lane_pairing=[pairing(*pair) for pair in pairs])
    lanes.append(osi.Lane(id=osi.Identifier(value=JUNCTION), classification=area))
    messages = ff.osi_messages(91, with_lanes=False)
    messages[0].lane, messages[0].lane_boundary = lanes, boundaries
    path = folder / "drive.osi"
    path.write_bytes(ff.osi_trace(messages))
    return path


def ways(scenario):
    return {
        key: [scenario.source.keys[one - 1] for one in after]
        for key, after in zip(scenario.source.keys, scenario.lanelets.successors, strict=True)
    }


def test_each_pair_of_lanes_is_a_way_through_with_links_at_both_ends(tmp_path):
    scenario = idr.read_source(trace(tmp_path, [(1, 2), (1, 3)]))
    assert ways(scenario) == {"1": ["60/1-2", "60/1-3"], "2": [], "3": [], "60/1-2": ["2"], "60/1-3": ["3"]}
    assert "junctions without boundaries crossed as their pairings of lanes say: 60" in scenario.notes
    assert map_defects(scenario.lanelets) == ()


def test_ways_through_are_straight_or_nearly_round_and_as_wide_as_the_lanes(tmp_path):
    lanelets = idr.read_source(trace(tmp_path, [(1, 2), (1, 3)])).lanelets
    np.testing.assert_allclose(lanelets.left[3][:, 1], 3.5, atol=1e-3)
    np.testing.assert_allclose(lanelets.right[3][:, 1], 0.0, atol=1e-3)
    width = np.hypot(*(lanelets.left[4] - lanelets.right[4]).T)
    assert 3.4 < width.min() < width.max() < 5.0
    middle = 0.5 * (lanelets.left[4] + lanelets.right[4])
    turns = np.diff(np.unwrap(np.arctan2(*np.diff(middle, axis=0).T[::-1])))
    assert turns.max() <= 1e-6, "to the right all along"
    assert np.abs(turns).max() < 0.25


def test_centre_lines_may_run_against_the_direction_of_driving(tmp_path):
    plain, turned = (idr.read_source(trace(tmp_path, [(1, 2), (1, 3)], backwards=lanes)) for lanes in ((), (1, 3)))
    assert ways(turned) == ways(plain)
    for one, other in zip(plain.lanelets.left, turned.lanelets.left, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-3)


@pytest.mark.parametrize(
    ("pairs", "more"),
    [
        ([(2, 3)], {}),  # 2 does not lead to the junction
        ([(1, 1)], {}),  # 1 does not lead out of it
        ([(1, 9), (None, 2), (1, None)], {}),
        ([(1, 2)], {"ahead": ()}),  # whose pairing does not name the junction
        ([], {}),
    ],
)
def test_pairs_that_do_not_lead_through_are_left_out(tmp_path, pairs, more):
    scenario = idr.read_source(trace(tmp_path, pairs, **more))
    assert ways(scenario) == {"1": [], "2": [], "3": []}
    assert "left out: 1 without two boundaries lanes" in scenario.notes


def test_a_pair_that_is_stated_twice_is_one_way(tmp_path):
    assert len(idr.read_source(trace(tmp_path, [(1, 2), (1, 2)])).lanelets.ids) == 4


def test_an_agent_drives_through_such_a_junction(tmp_path):
    run = idr.simulate(trace(tmp_path, [(1, 2), (1, 3)]), agents="all")
    assert run.outcomes.outcome[0] == "goal_reached"
    assert np.nanmax(run.states.x) > 85.0


def test_the_crossroads_of_a_real_trace_has_the_ways_of_its_map(inputs_folder):
    scenario = idr.read_source(inputs_folder / "osi" / "pedestrian.osi")
    roads = idr.read_source(inputs_folder / "xodr" / "fabriksgatan.xodr").lanelets
    assert len(scenario.lanelets.ids) == len(roads.ids) == 20
    assert sum(map(len, scenario.lanelets.successors)) == sum(map(len, roads.successors)) == 24
