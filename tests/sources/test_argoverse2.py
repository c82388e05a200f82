"""Scenarios of Argoverse 2 are read from their folder: lanes one to one, tracks with ids from 10001 on."""

import json

import foreign_files as ff
import numpy as np
import pytest

import interdrive as idr


def test_lanes_and_tracks_of_a_folder_are_one_scenario(tmp_path):
    scenario = idr.read_source(ff.argoverse2(tmp_path / "a"))
    lanelets, obstacles = scenario.lanelets, scenario.obstacles
    assert scenario.source.keys == ("11", "12", "13", "crosswalk 8")
    assert lanelets.successors == ((3,), (), (), ())
    assert lanelets.adjacent_left.tolist() == [2, 1, -1, -1]
    assert lanelets.adjacent_left_same_direction.tolist() == [False, False, False, False]
    assert lanelets.left_marking[0] == "dashed"
    np.testing.assert_allclose(lanelets.right[0], [[0, 0], [20, 0], [60, 0]])
    assert scenario.crosswalks == (4,), "between both edges of a crossing"
    np.testing.assert_allclose(lanelets.left[3][[0, -1]], [[0, 3], [60, 3]])
    np.testing.assert_allclose(lanelets.right[3][[0, -1]], [[0, 0], [60, 0]])
    assert obstacles.ids.tolist() == [10001, 10002]
    assert obstacles.kinds == ("car", "pedestrian")
    assert obstacles.shapes[0].length == 4.6
    assert obstacles.velocity[1, 0] == pytest.approx(1.4)
    assert scenario.notes == (
        "left out: 1 BIKE lanes, 1 static tracks",
        "AV is 10001, focal track is 10002",
    )


def test_the_map_alone_has_no_traffic_and_lanes_for_bicycles_on_demand(tmp_path):
    path = ff.argoverse2(tmp_path / "a") / "log_map_archive_a.json"
    scenario = idr.read_source(path, keep="bike")
    assert len(scenario.obstacles.ids) == 0
    assert scenario.lanelets.types[3] == ("bicycleLane",)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('"lane_segments": {', '"lane_segments": [{'), "line 1, column .*; give a whole file"),
        (
            ('"VEHICLE"', '"PLANE"'),
            r"has no lane that vehicles may drive \(lanes: PLANE 3, BIKE 1\); --keep adds types",
        ),
    ],
)
def test_a_map_that_cannot_be_read_is_refused_in_one_line(tmp_path, change, words):
    path = ff.argoverse2(tmp_path / "a") / "log_map_archive_a.json"
    path.write_text(path.read_text().replace(*change))
    with pytest.raises(idr.InputError, match=words) as refused:
        idr.read_source(path)
    assert "\n" not in str(refused.value)


def test_a_folder_of_two_scenarios_or_none_is_refused(tmp_path):
    folder = ff.argoverse2(tmp_path / "a")
    (folder / "scenario_b.parquet").write_bytes(b"")
    with pytest.raises(idr.InputError, match="holds 2 files scenario_"):
        idr.read_source(folder)
    with pytest.raises(idr.InputError, match=r"holds no Argoverse 2 scenario .* and no tracks that are known"):
        idr.read_source(tmp_path)


def test_the_real_scenario_has_its_lanes_links_and_states(inputs_folder):
    (name, expected), *_ = json.loads((inputs_folder / "expected_misc.json").read_text())["av2"].items()
    scenario = idr.read_source(inputs_folder / "av2" / name)
    lanelets, obstacles = scenario.lanelets, scenario.obstacles
    assert (len(ff.driven(lanelets)), sum(map(len, lanelets.successors))) == (34, 33)
    assert (len(obstacles.ids), int(obstacles.valid.sum()), obstacles.n_steps) == (48, 2245, 110)
    assert [obstacles.kinds.count(kind) for kind in ("car", "pedestrian", "bicycle")] == [32, 12, 4]
    for number, values in ((10001, expected["AV"]), (10003, expected["focal"])):
        row = obstacles.ids.tolist().index(number)
        for step, *stated in (values["first"], values["last"]):
            found = [table[row, step] for table in (obstacles.x, obstacles.y, obstacles.orientation)]
            np.testing.assert_allclose(found, stated, atol=1e-5)
    roads = idr.read_source(inputs_folder / "av2" / "map_only_adcf7d18.json")
    assert len(ff.driven(roads.lanelets)) == 180
