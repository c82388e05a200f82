"""Lanelet2 maps become lanelets; counts of real maps are those of two other libraries, where these read them."""

import collections
import json

import foreign_files as ff
import numpy as np
import pytest

import interdrive as idr
from interdrive.files.sources.lanelet2 import read
from interdrive.files.sources.opening import SourceFile
from interdrive.scenario import SourceOptions


@pytest.fixture
def road(tmp_path):
    path = tmp_path / "road.osm"
    path.write_text(ff.lanelet2())
    return path


def test_lanelets_share_borders_and_go_on_where_both_borders_end(road):
    scenario = idr.read_source(road)
    lanelets, keys = scenario.lanelets, scenario.source.keys
    assert keys == ("201", "202", "203", "204"), "in the order of the file"
    assert lanelets.successors == ((4,), (), (), ())
    assert lanelets.adjacent_left.tolist() == [2, 3, 2, -1]
    assert lanelets.adjacent_left_same_direction.tolist() == [True, False, False, False]
    assert lanelets.adjacent_right.tolist() == [-1, 1, -1, -1]
    np.testing.assert_allclose(lanelets.left[2][[0, -1]], [[60.0, 7.0], [0.0, 7.0]], atol=1e-9)
    assert scenario.notes == (
        "left out: 1 bus_lane lanes",
        "lanelets without one left and one right border left out: 206",
    )


def test_every_point_of_both_borders_stays(road):
    left, right = (sides[3] for sides in (idr.read_source(road).lanelets.left, idr.read_source(road).lanelets.right))
    np.testing.assert_allclose(left, [[60.0, 3.5], [80.0, 3.6], [100.0, 3.5]], atol=1e-4)
    np.testing.assert_allclose(right, [[60.0, 0.0], [80.0, 0.0], [100.0, 0.0]], atol=1e-2)


def test_limits_come_from_signs_and_tags_with_their_units(road):
    np.testing.assert_allclose(idr.read_source(road).lanelets.speed_limit, [50 / 3.6, 10.0, np.nan, np.nan])


def test_double_lines_are_turned_with_the_lanelet(road):
    lanelets = idr.read_source(road).lanelets
    assert lanelets.left_marking == ("dashed", "solid_dashed", "dashed_solid", "unknown")
    assert lanelets.right_marking == ("curb", "dashed", "no_marking", "broad_solid")


def test_lanes_for_buses_are_read_where_they_are_kept(road):
    scenario = idr.read_source(road, keep="bus")
    assert scenario.lanelets.types[scenario.source.keys.index("205")] == ("busLane",)


def test_geographic_coordinates_are_projected_about_the_first_node_or_as_chosen(tmp_path):
    path = tmp_path / "road.osm"
    path.write_text(ff.lanelet2(local=False))
    near = idr.read_source(path)
    assert near.lanelets.right[0][0] == pytest.approx([0.0, 0.0])
    assert near.source.location.startswith("+proj=tmerc +lat_0=48.0 +lon_0=11.0")
    assert near.notes[1] == "projected by transverse Mercator about latitude 48.00000000, longitude 11.00000000"
    scaled = idr.read_source(path, projection="utm")
    assert np.ptp(scaled.lanelets.left[0], axis=0)[0] < np.ptp(near.lanelets.left[0], axis=0)[0]
    moved = idr.read_source(path, origin="48.001,11")
    assert moved.lanelets.right[0][0] == pytest.approx([0.0, -111.2], abs=0.1)
    with pytest.raises(idr.InputError, match="not every node has local_x and local_y"):
        idr.read_source(path, projection="local")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('v="lanelet"', 'v="multipolygon"'), "is an OpenStreetMap file without lanelets; only Lanelet2 maps are read"),
        (('<way id="102">', '<way id="101">'), "two ways have the id 101; give each its own"),
        (("<osm", "<!DOCTYPE osm><osm"), "has a document type, which may expand without end; remove it"),
        (("</osm>", ""), "line .*, column .*: no element found; give a whole file"),
        (("way", "wey"), "has no lane"),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_line(road, change, words):
    road.write_text(road.read_text().replace(*change))
    with pytest.raises(idr.InputError, match=f"^{road}: {words}") as refused:
        idr.read_source(road)
    assert "\n" not in str(refused.value)


def test_a_border_with_an_unknown_node_leaves_out_its_lanelets(road):
    road.write_text(road.read_text().replace('<node id="11"', '<node id="12"'))
    assert "lanelets without one left and one right border left out: 204, 206" in idr.read_source(road).notes


def test_real_maps_have_the_lanelets_links_and_neighbours_that_lanelet2_finds(inputs_folder):
    expected = json.loads((inputs_folder / "expected_misc.json").read_text())["lanelet2"]
    assert len(expected) == 11
    for name, values in expected.items():
        path = inputs_folder / "osm" / name
        scenario, wanted = idr.read_source(path), values["prototype"]
        lanelets = scenario.lanelets
        beside = lanelets.adjacent_left >= 0
        found = {
            "lanelets": len(ff.driven(lanelets)),
            "links": sum(map(len, lanelets.successors)),
            "left_same": int((beside & lanelets.adjacent_left_same_direction).sum()),
            "left_opposite": int((beside & ~lanelets.adjacent_left_same_direction).sum()),
        }
        if name == "SinD_Tianjin.osm":  # 2 of these borders belong to two lanelets in one direction: only one is mutual
            wanted["left_opposite"] -= 2
        assert found == {count: wanted[count] for count in found}, name
        if name not in ("rounD_0.osm", "SinD_Changchun.osm"):  # of which the libraries drop lanelets
            middles = [0.5 * (lanelets.left[row] + lanelets.right[row]) for row in ff.driven(lanelets)]
            length = sum(np.hypot(*np.diff(middle, axis=0).T).sum() for middle in middles)
            assert length == pytest.approx(values["length"], rel=5e-3), name


def test_real_maps_in_utm_have_their_borders_where_lanelet2_has_them(inputs_folder):
    expected = json.loads((inputs_folder / "expected_misc.json").read_text())["lanelet2"]
    for name, values in expected.items():
        one = values["example"]
        source = read(SourceFile(inputs_folder / "osm" / name), SourceOptions(projection="utm"))
        lane = next(lane for lane in source.roads.lanes if lane.key == str(one["id"]))
        np.testing.assert_allclose(lane.left[[0, -1]], one["left"], atol=2e-3, err_msg=name)
        np.testing.assert_allclose(lane.right[[0, -1]], one["right"], atol=2e-3, err_msg=name)


def test_real_limits_are_those_of_the_files(inputs_folder):
    def limits(name):
        stated = idr.read_source(inputs_folder / "osm" / name).lanelets.speed_limit
        return collections.Counter(np.round(stated[np.isfinite(stated)], 2).tolist())

    assert limits("kashiwanoha.osm") == {2.78: 77}
    assert limits("traffic_speed_limit_utm.osm") == {13.89: 1}
    assert not limits("rounD_0.osm")
