"""Tables of INTERACTION, SinD, highD, inD and their kind are read as their projects describe them."""

import json

import foreign_files as ff
import numpy as np
import pytest

import interdrive as idr
from interdrive.files.sources.projection import utm


def first_and_last(scenario, number):
    """Step, x, y and heading at the first and the last time step of an obstacle."""
    row = scenario.obstacles.ids.tolist().index(number)
    steps = np.flatnonzero(scenario.obstacles.valid[row])[[0, -1]]
    obstacles = scenario.obstacles
    return np.column_stack([steps, *(one[row, steps] for one in (obstacles.x, obstacles.y, obstacles.orientation))])


def test_vehicles_and_pedestrians_of_interaction_are_read_together(tmp_path):
    folder = ff.saved(
        tmp_path / "place",
        {"vehicle_tracks_003.csv": ff.INTERACTION, "pedestrian_tracks_003.csv": ff.INTERACTION_PEDESTRIANS},
    )
    for path in (folder, folder / "vehicle_tracks_003.csv", folder / "pedestrian_tracks_003.csv"):
        scenario = idr.read_source(path, map=ff.neutral_map(tmp_path))
        assert sorted(scenario.obstacles.kinds) == ["bicycle", "car", "car", "pedestrian"], "at 5 m/s one rides"
    (folder / "vehicle_tracks_004.csv").write_text(ff.INTERACTION)
    with pytest.raises(idr.InputError, match=r"holds 2 recordings \(004, 003\); give a file of one"):
        idr.read_source(folder, map=ff.neutral_map(tmp_path))


def test_one_case_of_a_prediction_file_is_read(tmp_path):
    header, *rows = ff.INTERACTION.splitlines()
    text = [f"case_id,{header}", *(f"{case},{row}" for case in (4, 9) for row in rows)]
    path = tmp_path / "cases.csv"
    path.write_text("\n".join(text))
    roads = ff.neutral_map(tmp_path)
    assert len(idr.read_source(path, map=roads).obstacles.ids) == 2
    assert len(idr.read_source(path, map=roads, case=9).obstacles.ids) == 2
    with pytest.raises(idr.InputError, match=r"has no case 5 \(found: 4, 9\); choose another with --case"):
        idr.read_source(path, map=roads, case=5)


def test_the_boxes_of_highd_are_moved_to_their_centres_and_its_markings_are_lanes(tmp_path):
    scenario = idr.read_source(ff.saved(tmp_path / "highd", ff.HIGHD), dt=0.04)
    car, truck = (first_and_last(scenario, number) for number in (10001, 10002))
    np.testing.assert_allclose(car, [[0, 302.4, -10.5, np.pi], [50, 242.4, -10.5, np.pi]], atol=1e-9)
    np.testing.assert_allclose(truck, [[0, 56.0, -23.0, 0.0], [50, 96.0, -23.0, 0.0]], atol=1e-9)
    lanelets = scenario.lanelets
    assert [left[0, 1] for left in lanelets.left] == [-16.5, -12.5, -21.0], "the left border in driving direction"
    assert [np.sign(left[-1, 0] - left[0, 0]) for left in lanelets.left] == [-1, -1, 1]
    assert lanelets.adjacent_right.tolist() == [2, -1, -1]
    assert lanelets.left_marking == ("solid", "dashed", "solid")
    np.testing.assert_allclose(lanelets.speed_limit, 36.11)
    assert lanelets.left[0][0, 0] == pytest.approx(302.4 + 50.0), "50 m beyond the vehicles"


def test_headings_of_ind_pass_through_north_and_boxes_without_size_get_one(tmp_path):
    folder = ff.saved(tmp_path / "ind", ff.IND)
    scenario = idr.read_source(folder / "00_tracks.csv", map=ff.neutral_map(tmp_path), dt=0.04)
    car, walker, rider = (first_and_last(scenario, number) for number in (10001, 10002, 10003))
    np.testing.assert_allclose(car[:, 3], np.radians([-5.0, 5.0]), atol=1e-9)
    assert walker[0, 3] == pytest.approx(np.pi / 2)
    assert rider[1, 1] == pytest.approx(60 - 0.16 * 50)
    shapes = scenario.obstacles.shapes
    assert (shapes[1].radius, shapes[2].length, shapes[2].width) == (0.3, 2.0, 0.7)


def test_the_map_of_ind_is_moved_by_the_origin_that_its_recording_states(tmp_path):
    path = tmp_path / "map.osm"
    path.write_text(ff.lanelet2(local=False))
    place = utm(np.array([48.0]), np.array([11.0]), (48.0, 11.0))[0]
    origin = f"{place[0] - 40:.4f},{place[1] + 30:.4f}"
    files = {**ff.IND, "00_recordingMeta.csv": ff.IND["00_recordingMeta.csv"].replace("649000.0,5318000.0", origin)}
    scenario = idr.read_source(ff.saved(tmp_path / "ind", files), map=path)
    np.testing.assert_allclose(scenario.lanelets.right[0][0], [40.0, -30.0], atol=1e-3)


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ({"00_tracksMeta.csv": None}, "00_tracksMeta.csv: is not beside 00_tracks.csv"),
        ({"00_recordingMeta.csv": None}, "00_recordingMeta.csv: is not beside 00_tracks.csv"),
        ({"00_recordingMeta.csv": ff.IND["00_recordingMeta.csv"].replace("25", "0")}, "the frameRate is 0; it must be"),
        (
            {"00_recordingMeta.csv": ff.IND["00_recordingMeta.csv"].replace("649000.0", "9e9")},
            "xUtmOrigin must have one",
        ),
        ({"00_tracksMeta.csv": ff.IND["00_tracksMeta.csv"].replace("0,1,0", "0,5,0")}, "has no row for track 1"),
        ({"00_tracks.csv": ff.IND["00_tracks.csv"].replace("yCenter", "y")}, r"has no column yCenter \(found: rec"),
    ],
)
def test_a_recording_that_lacks_something_is_refused_in_one_line(tmp_path, files, words):
    folder = ff.saved(tmp_path / "ind", {name: text for name, text in {**ff.IND, **files}.items() if text is not None})
    with pytest.raises(idr.InputError, match=words) as refused:
        idr.read_source(folder / "00_tracks.csv", map=ff.neutral_map(tmp_path))
    assert "\n" not in str(refused.value)


def test_a_table_of_ind_with_another_name_says_what_it_should_be_called(tmp_path):
    path = tmp_path / "mine.csv"
    path.write_text(ff.IND["00_tracks.csv"])
    with pytest.raises(idr.InputError, match=r"call it NN_tracks\.csv, beside NN_tracksMeta\.csv and NN_recordingMeta"):
        idr.read_source(path)


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("scene.pkl", b"\x80\x04\x95", "pickle is not read; docs/how_to/inputs says how to get JSON or tracks.parquet"),
        ("a.tfrecord-00000-of-01000", b"\x10\x00", "TFRecord is not read; docs/how_to/inputs says"),
        ("x.csv", b"version https://git-lfs.github.com/spec/v1\n", "is a Git LFS pointer, not the data; run git lfs"),
        ("x.csv", b"", "is empty"),
    ],
)
def test_what_is_never_read_says_what_to_do(tmp_path, name, data, words):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(idr.InputError, match=words):
        idr.read_source(tmp_path / name)


def test_toys_and_samples_are_read_as_expected(inputs_folder):
    expected = json.loads((inputs_folder / "expected_misc.json").read_text())
    roads = inputs_folder / "neutral_toy" / "lanes.parquet"
    for name in ("highd", "ind"):
        scenario = idr.read_source(inputs_folder / "levelx_toy" / name, dt=0.04, map=roads)
        for order, values in enumerate(expected["levelx_toy"][name]["ids"].values()):
            found = first_and_last(scenario, 10001 + order)
            for row, stated in zip(found, (values["first"], values["last"]), strict=True):
                np.testing.assert_allclose(row[: len(stated)], stated, atol=1e-6)
            assert scenario.obstacles.kinds[order] == values["kind"]
    path = inputs_folder / "interaction" / "vehicle_tracks_000.csv"
    scenario = idr.read_source(path, map=inputs_folder / "osm" / "INTERACTION_TestScenario.osm")
    assert scenario.obstacles.valid.sum(axis=1).tolist() == [100, 70]
    np.testing.assert_allclose(first_and_last(scenario, 10002)[1, 1:], [31.0, 5.5, 3.1415])
    assert [name for name, _ in scenario.source.files] == [path.name, "INTERACTION_TestScenario.osm"]
    for name, shift, states in (
        ("CHN_Merging_incomplete", (1050, 950), 10),
        ("DEU_Merging_dummy_track", (980, 1005), 7),
    ):
        move = (-shift[0] + 50, -shift[1])
        scenario = idr.read_source(inputs_folder / "interaction" / f"{name}.csv", map=roads, shift=move)
        assert set(scenario.obstacles.valid.sum(axis=1).tolist()) == {states}
    scenario = idr.read_source(inputs_folder / "sind" / "Xian_412_m1", map=inputs_folder / "osm" / "SinD_Xian.osm")
    assert len(scenario.obstacles.ids) == expected["sind"]["Xian_412_m1/Ped_smoothed_tracks.csv"]["agents"]
    assert first_and_last(scenario, 10001)[0, 1:3] == pytest.approx((-35.469494, 32.352375))
