"""Scenes of the Waymo Open Motion Dataset: lanes made of centre lines, on which the recorded vehicles are."""

import json

import foreign_files as ff
import numpy as np
import pytest
from matplotlib.path import Path

import interdrive as idr
from interdrive.files.sources.centre_lines import CentreLine, lanes_of
from interdrive.files.sources.notes import Notes
from interdrive.scenario.map_defects import map_defects


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(ff.womd()))
    return path


def test_parallel_lanes_meet_in_the_middle_and_end_at_the_edge_of_the_road(scene):
    scenario = idr.read_source(scene)
    lanelets = scenario.lanelets
    assert scenario.source.keys == ("1", "2", "3")
    assert lanelets.successors == ((3,), (), ())
    assert lanelets.adjacent_left.tolist() == [2, -1, -1]
    assert lanelets.adjacent_left_same_direction[0]
    np.testing.assert_allclose(lanelets.left[0][[0, 20], 1], 3.5, atol=1e-6)
    np.testing.assert_allclose(lanelets.right[0][[0, 20], 1], 0.0, atol=1e-6)
    np.testing.assert_allclose(lanelets.left[0][-1], lanelets.left[2][0])
    assert np.diff(lanelets.left[0][:, 0]).min() > 0.6


def test_objects_have_ids_by_their_position_and_long_vehicles_are_lorries(scene):
    scenario = idr.read_source(scene)
    obstacles = scenario.obstacles
    assert obstacles.ids.tolist() == [100000, 100001, 100003]
    assert obstacles.kinds == ("car", "pedestrian", "truck")
    assert obstacles.shapes[1].radius == 0.3
    np.testing.assert_allclose(obstacles.velocity[:, 10], [10.0, 1.4, 9.0], atol=1e-9)
    assert scenario.notes[:2] == (
        "left out: 1 bike lanes, 1 stop signs beside no end of a lane, 1 never valid objects",
        "the recording vehicle is 100000; tracks to predict are 100003",
    )


def test_lanes_for_bicycles_are_read_where_they_are_kept(scene):
    assert ("bicycleLane",) in idr.read_source(scene, keep="bike").lanelets.types


def line(x, y, key="a"):
    return CentreLine(key, np.column_stack((np.arange(x[0], x[1] + 0.25, 0.5), np.full(int(2 * (x[1] - x[0])) + 1, y))))


def test_a_lane_is_cut_where_a_parallel_one_begins_beside_it():
    roads = lanes_of([line((0, 100), 0.0), line((40, 100), 3.5, "b")], [], "map", Notes())
    assert [lane.key for lane in roads.lanes] == ["a", "a/2", "b"]
    assert roads.links == [(0, 1)]
    assert roads.lanes[1].left_neighbour == (2, True)
    assert roads.lanes[2].right_neighbour == (1, True)
    assert roads.lanes[1].left[0, 0] == pytest.approx(40.0)


def test_lanes_that_part_share_their_borders_where_they_begin():
    arc = np.linspace(0.0, 0.5, 61)
    bend = np.column_stack((60 + 60 * np.sin(arc), 60 - 60 * np.cos(arc)))
    roads = lanes_of([line((0, 60), 0.0), line((60, 100), 0.0, "on"), CentreLine("off", bend)], [], "map", Notes())
    assert roads.links == [(0, 1), (0, 2)]
    for _, after in roads.links:
        np.testing.assert_allclose(roads.lanes[0].left[-1], roads.lanes[after].left[0], atol=1e-12)
        np.testing.assert_allclose(roads.lanes[0].right[-1], roads.lanes[after].right[0], atol=1e-12)


def test_opposite_lanes_are_neighbours_and_lanes_alone_have_the_usual_width():
    back = CentreLine("back", line((0, 60), 3.5).points[::-1].copy())
    roads = lanes_of([line((0, 60), 0.0), back], [], "map", Notes())
    assert [lane.left_neighbour for lane in roads.lanes] == [(1, False), (0, False)]
    np.testing.assert_allclose(roads.lanes[0].right[:, 1], -1.75)


@pytest.mark.parametrize("apart", [5.6, 7.0, 7.9])
def test_lanes_far_apart_share_the_ground_between_them_as_far_as_lanes_are_wide(apart):
    back = CentreLine("back", line((0, 60), apart).points[::-1].copy())
    roads = lanes_of([line((0, 60), 0.0), back], [], "map", Notes())
    np.testing.assert_allclose(roads.lanes[0].left[:, 1], 2.6)
    np.testing.assert_allclose(roads.lanes[1].left[:, 1], apart - 2.6)
    assert roads.lanes[0].left_neighbour is None


def test_lanes_that_draw_apart_have_borders_without_a_jump():
    x = np.arange(0.0, 120.25, 0.5)
    bent = CentreLine("b", np.column_stack((x, 4.0 + 3.0 * x / 120.0)))
    roads = lanes_of([line((0, 120), 0.0), bent], [], "map", Notes())
    borders = [lane.left[:, 1] for lane in roads.lanes if lane.key.startswith("a")]
    assert max(np.abs(np.diff(border)).max() for border in borders) < 0.06
    assert borders[-1][-1] == pytest.approx(2.6, abs=0.05)


def test_a_median_or_a_line_beyond_reach_bounds_a_lane_as_before():
    back = CentreLine("back", line((0, 60), 7.0).points[::-1].copy())
    median = np.array([[0.0, 2.0], [60.0, 2.0]])
    roads = lanes_of([line((0, 60), 0.0), back], [median], "map", Notes())
    np.testing.assert_allclose(roads.lanes[0].left[:, 1], 2.0)
    far = CentreLine("c", line((0, 60), 8.5).points[::-1].copy())
    beyond = lanes_of([line((0, 60), 0.0), far], [], "map", Notes())
    np.testing.assert_allclose(beyond.lanes[0].left[:, 1], 1.75)


def test_lines_of_few_points_are_as_good_as_dense_ones():
    coarse = [
        CentreLine("a", np.array([[0.0, 0.0], [60.0, 0.0]])),
        CentreLine("b", np.array([[0.0, 4.0], [60.0, 4.0]])),
    ]
    roads = lanes_of(coarse, [], "map", Notes())
    np.testing.assert_allclose(roads.lanes[0].left[:, 1], 2.0)
    assert roads.lanes[0].left_neighbour == (1, True)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"roads": 3}, "roads is no list of objects; give a scene"),
        ({"objects": [1]}, "objects is no list of objects; give a scene"),
        ({"roads": []}, r"has no lane that vehicles may drive \(lanes: none\); --keep adds types"),
    ],
)
def test_a_scene_that_cannot_be_read_is_refused_in_one_line(scene, change, words):
    scene.write_text(json.dumps({**ff.womd(), **change}))
    with pytest.raises(idr.InputError, match=words) as refused:
        idr.read_source(scene)
    assert "\n" not in str(refused.value)


def test_values_of_other_types_are_absent(scene):
    document = ff.womd()
    document["objects"][0] |= {"heading": "north", "velocity": None, "length": [4.2, 4.2]}
    document["objects"][1]["position"][3]["x"] = "far"
    document["roads"][0]["geometry"][7] = None
    document["metadata"] = {"sdc_track_index": 77, "tracks_to_predict": 3}
    scene.write_text(json.dumps(document))
    obstacles = idr.read_source(scene).obstacles
    assert obstacles.shapes[0].length == 4.2
    np.testing.assert_allclose(obstacles.orientation[0, 5], 0.0, atol=1e-9)
    assert "orientation" in obstacles.derived[0]


def shares_on_lanelets(scenario):
    """Shares of the moving vehicles' centres, and of boxes with all four corners, that lie on lanelets."""
    lanelets, obstacles = scenario.lanelets, scenario.obstacles
    outlines = [Path(np.concatenate((a, b[::-1]))) for a, b in zip(lanelets.left, lanelets.right, strict=True)]
    centres, corners = [], []
    for row, (kind, shape) in enumerate(zip(obstacles.kinds, obstacles.shapes, strict=True)):
        if kind not in ("car", "truck"):
            continue
        for step in np.flatnonzero(np.abs(np.nan_to_num(obstacles.velocity[row])) > 0.5):
            x, y, heading = (table[row, step] for table in (obstacles.x, obstacles.y, obstacles.orientation))
            turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
            half = 0.5 * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]]) * (shape.length, shape.width)
            centres.append((x, y))
            corners.append(half @ turn + (x, y))
    points, boxes = np.array(centres), np.array(corners).reshape(-1, 2)
    on, inside = np.zeros(len(points), bool), np.zeros(len(boxes), bool)
    for outline in outlines:
        on |= outline.contains_points(points)
        inside |= outline.contains_points(boxes)
    return on.mean(), inside.reshape(-1, 4).all(axis=1).mean()


@pytest.mark.long
def test_in_real_scenes_lanes_are_linked_and_vehicles_are_on_them(inputs_folder):
    expected = json.loads((inputs_folder / "expected_misc.json").read_text())["womd"]
    assert len(expected) == 4
    for name, values in expected.items():
        scenario = idr.read_source(inputs_folder / "womd" / name)
        lanelets, wanted = scenario.lanelets, values["prototype"]
        found = (len(ff.driven(lanelets)), sum(map(len, lanelets.successors)), int((lanelets.adjacent_left >= 0).sum()))
        assert found == (wanted["pieces"], wanted["links"], wanted["adj"]), name
        centres, corners = shares_on_lanelets(scenario)
        assert centres >= min(0.99, values["coverage"]["W3_centre"] - 5e-4), name
        assert corners >= values["coverage"]["W3_corners"] - 5e-4, name
        assert not [line for line in map_defects(lanelets) if "link" in line], name
        first = values["sdc"]["first"]
        row = next(
            row for row, number in enumerate(scenario.obstacles.ids) if f"vehicle is {number};" in scenario.notes[1]
        )
        np.testing.assert_allclose([scenario.obstacles.x[row, 0], scenario.obstacles.y[row, 0]], first[1:], atol=1e-3)


@pytest.mark.long
def test_agents_of_real_scenes_reach_their_goals_in_time_and_none_collides(inputs_folder):
    outcomes = [
        outcome
        for path in sorted((inputs_folder / "womd").glob("*.json"))
        for outcome in idr.simulate(path, agents="all").outcomes.outcome
    ]
    assert len(outcomes) == 89
    assert outcomes.count("collision") == 0
    assert outcomes.count("goal_reached") >= 84
