"""SUMO nets become lanelets that meet; counts of real nets are those that sumolib gives."""

import gzip

import numpy as np
import pytest

import interdrive as idr
from interdrive.files import scenario_document
from interdrive.files.scenario_file import losses
from interdrive.scenario.map_defects import map_defects

CROSSROADS = """<net version="1.20">
  <location netOffset="10.00,0.00"/>
  <edge id=":b_0" function="internal">
    <lane id=":b_0_0" index="0" speed="8.0" length="6" shape="100.00,-1.60 106.00,-1.60"/>
  </edge>
  <edge id=":b_w0" function="walkingarea"><lane id=":b_w0_0" index="0" speed="1" length="5" shape="0,9 5,9"/></edge>
  <edge id="in" from="a" to="b">
    <lane id="in_0" index="0" speed="13.9" length="100" width="2.0" allow="bicycle" shape="0.00,-7.40 100.00,-7.40"/>
    <lane id="in_1" index="1" speed="13.9" length="100" shape="0.00,-4.80 100.00,-4.80"/>
    <lane id="in_2" index="2" speed="13.9" length="100" shape="0.00,-1.60 100.00,-1.60"/>
  </edge>
  <edge id="back" from="b" to="a">
    <lane id="back_0" index="0" speed="13.9" length="100" shape="100.00,1.60 0.00,1.60"/>
  </edge>
  <edge id="out" from="b" to="c">
    <lane id="out_0" index="0" speed="16.7" length="94" shape="106.00,-1.60 200.00,-1.60"/>
  </edge>
  <connection from="in" to="out" fromLane="2" toLane="0" via=":b_0_0" dir="s" state="M"/>
  <connection from=":b_0" to="out" fromLane="0" toLane="0" dir="s" state="M"/>
</net>
"""


@pytest.fixture
def net(tmp_path):
    path = tmp_path / "crossroads.net.xml"
    path.write_text(CROSSROADS)
    return path


def test_lanes_of_a_net_are_linked_through_the_junction_and_lie_beside_each_other(net):
    scenario = idr.read_source(net)
    ids = dict(zip(scenario.source.keys, scenario.lanelets.ids.tolist(), strict=True))
    assert list(ids) == [":b_0_0", "in_2", "in_1", "back_0", "out_0"], "by edge, from left to right"
    row = {key: number - 1 for key, number in ids.items()}
    lanelets = scenario.lanelets
    assert lanelets.successors[row["in_2"]] == (ids[":b_0_0"],)
    assert lanelets.predecessors[row["out_0"]] == (ids[":b_0_0"],)
    assert lanelets.adjacent_right[row["in_2"]] == ids["in_1"]
    assert lanelets.adjacent_left[row["in_2"]] == ids["back_0"]
    assert not lanelets.adjacent_left_same_direction[row["in_2"]]
    assert lanelets.speed_limit[row["out_0"]] == 16.7
    np.testing.assert_allclose(lanelets.left[row["in_2"]], [[0, 0], [100, 0]], atol=1e-9)
    assert scenario.notes == (
        "left out: 1 closed to passenger vehicles, 1 walkingarea lanes",
        "coordinates are those of the net, whose netOffset is 10.00,0.00",
    )


def test_lanes_for_bicycles_are_read_where_they_are_kept(net):
    scenario = idr.read_source(net, keep="bike")
    assert scenario.lanelets.types[scenario.source.keys.index("in_0")] == ("bicycleLane",)


def test_a_packed_net_gives_the_same_file_as_a_plain_one(net, tmp_path):
    packed = tmp_path / "packed" / "crossroads.net.xml.gz"
    packed.parent.mkdir()
    packed.write_bytes(gzip.compress(net.read_bytes()))
    plain, other = idr.read_scenario(net), idr.read_scenario(packed)
    text = scenario_document(plain)
    assert scenario_document(other).replace(b".net.xml.gz", b".net.xml") == text
    assert plain.source.format == "SUMO net"
    assert plain.source.files != other.source.files


def test_a_scenario_from_a_net_is_read_again_from_its_file_as_the_same(net, tmp_path):
    scenario = idr.read_scenario(net)
    assert losses(scenario, scenario_document(scenario)) == ()
    idr.write_scenario(scenario, tmp_path / "written.xml")
    assert idr.read_scenario(tmp_path / "written.xml").lanelets.successors == scenario.lanelets.successors


@pytest.mark.parametrize(
    ("name", "lanes", "links", "length"),
    [
        ("4lane", 36, 36, 1525.1),
        ("lefthand", 48, 52, 1750.9),  # of 56, 4 turn back too sharply for their borders to meet
        ("merge", 13, 12, 854.8),
        ("roundabout", 20, 8, 527.0),
        ("us101", 30, 24, 3739.1),
    ],
)
def test_real_nets_have_the_lanes_and_links_that_sumolib_finds(inputs_folder, name, lanes, links, length):
    scenario = idr.read_source(inputs_folder / "sumo" / f"{name}.net.xml")
    lanelets = scenario.lanelets
    assert (len(lanelets.ids), sum(map(len, lanelets.successors))) == (lanes, links)
    middles = [0.5 * (left + right) for left, right in zip(lanelets.left, lanelets.right, strict=True)]
    assert sum(np.hypot(*np.diff(middle, axis=0).T).sum() for middle in middles) == pytest.approx(length, rel=2e-3)
    assert scenario.priorities.left_hand == (name == "lefthand")
    assert not [line for line in map_defects(lanelets) if "link" in line]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (CROSSROADS[:300], "line 6, column"),
        (CROSSROADS.replace("<net", "<!DOCTYPE net><net"), "has a document type"),
        ("<net/>", "has no lane that vehicles may drive"),
    ],
)
def test_what_is_no_net_is_refused_in_one_line(tmp_path, text, words):
    path = tmp_path / "broken.net.xml"
    path.write_text(text)
    with pytest.raises(idr.InputError, match=words) as refused:
        idr.read_source(path)
    assert str(refused.value).startswith(str(path))
    assert "\n" not in str(refused.value)


def test_an_option_that_is_not_known_is_refused(net):
    with pytest.raises(idr.InputError, match="speed: no option of sources; there are map, dt"):
        idr.read_source(net, speed=3)
