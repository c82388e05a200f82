"""Signs, traffic lights and crosswalks of other formats are those of a scenario, and survive being written."""

import dataclasses
import json

import foreign_files as ff
import numpy as np
import opendrive_documents as xodr
import pytest

import interdrive as idr
from interdrive.files import scenario_document
from interdrive.files.scenario_file import losses
from interdrive.scenario import GoalState, InitialState, PlanningProblem, Shape

ALL = frozenset(("left", "straight", "right"))
STOP, YIELD = (1, 1, 1), (2, 2, 2)

NET = """<net>
  <edge id=":b_0" function="internal"><lane id=":b_0_0" index="0" speed="8" shape="100,-1.6 112,-1.6"/></edge>
  <edge id=":b_1" function="internal"><lane id=":b_1_0" index="0" speed="8" shape="100,-1.6 102,-2.1 103,-6"/></edge>
  <edge id=":b_2" function="internal">
    <lane id=":b_2_0" index="0" speed="8" shape="104.6,-20 105,-8 107,-4 112,-1.6"/>
  </edge>
  <edge id=":b_c0" function="crossing"><lane id=":b_c0_0" index="0" speed="1" width="4" shape="96,2 96,-4"/></edge>
  <edge id="in" from="a" to="b"><lane id="in_0" index="0" speed="13.9" shape="0,-1.6 100,-1.6"/></edge>
  <edge id="minor" from="d" to="b"><lane id="minor_0" index="0" speed="13.9" shape="104.6,-60 104.6,-20"/></edge>
  <edge id="out" from="b" to="c"><lane id="out_0" index="0" speed="13.9" shape="112,-1.6 200,-1.6"/></edge>
  <edge id="down" from="b" to="e"><lane id="down_0" index="0" speed="13.9" shape="103,-6 103,-60"/></edge>
  {parts}
  <connection from="in" to="out" fromLane="0" toLane="0" via=":b_0_0" dir="s" {first}/>
  <connection from="in" to="down" fromLane="0" toLane="0" via=":b_1_0" dir="r" {second}/>
  <connection from="minor" to="out" fromLane="0" toLane="0" via=":b_2_0" dir="r" {third}/>
  <connection from=":b_0" to="out" fromLane="0" toLane="0"/>
  <connection from=":b_1" to="down" fromLane="0" toLane="0"/>
  <connection from=":b_2" to="out" fromLane="0" toLane="0"/>
</net>
"""
PROGRAM = """<tlLogic id="b" type="static" programID="0" offset="5">
  <phase duration="30" state="GGr"/><phase duration="3" state="yGr"/><phase duration="27" state="rrs"/>
</tlLogic>"""


@pytest.fixture
def net(tmp_path):
    def written(parts="", first='state="M"', second='state="M"', third='state="m"', **options):
        path = tmp_path / "crossroads.net.xml"
        path.write_text(NET.format(parts=parts, first=first, second=second, third=third))
        return whole(path, **options)

    return written


def whole(path, **options):
    """The scenario of a source, from whose file nothing is lost."""
    scenario = idr.read_source(path, raw=True, **options)
    assert losses(scenario, scenario_document(scenario)) == ()
    return scenario


def by_key(scenario):
    return dict(zip(scenario.source.keys, scenario.lanelets.ids.tolist(), strict=True))


def line_at(scenario, key):
    return next(line for line in scenario.stop_lines if line.lanelet_id == by_key(scenario)[key])


def outline(scenario, key):
    row = scenario.source.keys.index(key)
    return [tuple(map(float, point)) for side in ("left", "right") for point in getattr(scenario.lanelets, side)[row]]


# SUMO


def test_lights_of_a_net_show_what_the_program_says_at_their_links(net):
    links = (f'tl="b" linkIndex="{index}" state="o"' for index in range(3))
    scenario = net(PROGRAM, *links, dt=0.5)
    shown = {light.directions: (light.phases, light.offset) for light in scenario.traffic_lights}
    assert shown == {
        frozenset(("straight",)): ((("green", 60), ("yellow", 6), ("red", 54)), 10),
        frozenset(("right",)): ((("green", 66), ("red", 54)), 10),
        ALL: ((("red", 120),), 10),
    }, "one for each way of the first edge, one for the other edge"
    numbers = by_key(scenario)
    light = {light.directions: light.id for light in scenario.traffic_lights}
    assert dict(line_at(scenario, "in_0").light_ids) == {
        numbers[":b_0_0"]: (light[frozenset(("straight",))],),
        numbers[":b_1_0"]: (light[frozenset(("right",))],),
    }
    assert line_at(scenario, "minor_0").turns_on_red == (numbers[":b_2_0"],), "the letter s is a green arrow"
    assert not scenario.priorities.ranks


def test_an_edge_of_a_net_from_which_all_ways_give_way_has_signs(net):
    signed = '<junction id="b" type="priority"/>'
    assert net(signed).priorities.ranks == ((by_key(net(signed))["minor_0"], YIELD),)
    scenario = net('<junction id="b" type="priority_stop"/>', third='state="s"')
    assert scenario.priorities.ranks == ((by_key(scenario)["minor_0"], STOP),)
    assert line_at(scenario, "minor_0").has_stop_sign
    np.testing.assert_allclose(line_at(scenario, "minor_0").ends, [[103.0, -20.0], [106.2, -20.0]], atol=1e-4)
    assert not net('<junction id="b" type="right_before_left"/>').priorities.ranks


def test_a_lane_of_a_net_may_have_a_light_and_a_sign(net):
    scenario = net(PROGRAM + '<junction id="b" type="priority"/>', 'tl="b" linkIndex="0" state="o"', 'state="m"')
    number = by_key(scenario)["in_0"]
    assert dict(scenario.priorities.ranks)[number] == YIELD
    assert len(scenario.traffic_lights) == 1


def test_a_crossing_of_a_net_is_a_crosswalk(net):
    scenario = net()
    assert scenario.crosswalks == (by_key(scenario)[":b_c0"],)
    assert outline(scenario, ":b_c0") == [(98.0, 2.0), (98.0, -4.0), (94.0, 2.0), (94.0, -4.0)]
    assert not any(scenario.crosswalks[0] in following for following in scenario.lanelets.successors)


def test_a_light_without_a_usable_program_is_noted(net):
    scenario = net('<tlLogic id="b"><phase duration="x" state="G"/></tlLogic>', 'tl="b" linkIndex="0"')
    assert not scenario.traffic_lights
    assert "traffic lights without a program left out: b" in scenario.notes


# OpenDRIVE


def crossing_roads(*signals, objects="", more=""):
    lanes = xodr.section(xodr.lane(1), xodr.lane(0), xodr.lane(-1))
    parts = f"<signals>{''.join(signals)}</signals><objects>{objects}</objects>"
    return xodr.document(
        xodr.road(1, xodr.geometry("<line/>", 60.0), lanes, length=60.0, more=parts),
        xodr.road(2, xodr.geometry("<line/>", 60.0, y=50.0), lanes, length=60.0, more=more),
    )


def signal(number, *, s=55.0, orientation="+", validity="", more=""):
    return (
        f'<signal id="{number}{s}" s="{s}" t="-4" orientation="{orientation}" type="{number}" dynamic="no" {more}>'
        f"{validity}</signal>"
    )


@pytest.fixture
def road(tmp_path):
    def written(*signals, **parts):
        path = tmp_path / "map.xodr"
        path.write_text(crossing_roads(*signals, **parts))
        return whole(path)

    return written


def test_signs_of_a_road_are_for_the_lanes_that_they_face(road):
    scenario = road(signal(206), signal(205, s=5.0, orientation="-"))
    numbers = by_key(scenario)
    assert dict(scenario.priorities.ranks) == {numbers["1/0/-1"]: STOP, numbers["1/0/1"]: YIELD}
    [line] = scenario.stop_lines
    assert (line.lanelet_id, line.has_stop_sign) == (numbers["1/0/-1"], True)
    np.testing.assert_allclose(line.ends, [[60.0, 0.0], [60.0, -3.5]], atol=1e-4)


def test_a_stop_line_beside_a_stop_sign_is_where_vehicles_stop(road):
    [line] = road(signal(206), signal(294, s=57.0)).stop_lines
    np.testing.assert_allclose(line.ends, [[57.0, 0.0], [57.0, -3.5]], atol=1e-4)


def test_lanes_that_a_signal_or_a_reference_names_count_rather_than_its_orientation(road):
    scenario = road(signal(206, validity='<validity fromLane="1" toLane="1"/>'))
    assert dict(scenario.priorities.ranks) == {by_key(scenario)["1/0/1"]: STOP}
    refers = '<signals><signalReference id="20655.0" s="50" t="0" orientation="-"/></signals>'
    scenario = road(signal(206, validity='<validity fromLane="0" toLane="0"/>'), more=refers)
    assert dict(scenario.priorities.ranks) == {by_key(scenario)["2/0/1"]: STOP}


def test_a_signed_limit_counts_for_lanes_that_state_none(road):
    scenario = road(signal(274, s=0.0, more='value="50" unit="km/h"'))
    limits = dict(zip(scenario.source.keys, scenario.lanelets.speed_limit.tolist(), strict=True))
    assert limits["1/0/-1"] == pytest.approx(50 / 3.6)
    assert np.isnan(limits["1/0/1"])


def test_lights_and_other_signs_of_a_road_are_counted(road):
    lights = '<signal id="9" s="50" t="0" orientation="+" type="1000001" dynamic="yes"/>'
    scenario = road(lights, signal(283), signal(206, more='country="CHN"'), objects='<object id="4" type="tree"/>')
    assert not scenario.traffic_lights
    assert scenario.notes == ("left out: 1 objects, 1 traffic lights, whose cycles are unknown, 2 other signs",)


def test_crosswalks_of_a_road_have_the_corners_of_their_objects(road):
    corners = "".join(f'<cornerLocal u="{u}" v="{v}"/>' for u, v in ((4, 1), (4, -1), (-4, -1), (-4, 1), (4, 1)))
    local = (
        f'<object id="7" type="crosswalk" s="30" t="0" hdg="1.5707963267948966"><outline>{corners}</outline></object>'
    )
    placed = "".join(f'<cornerRoad s="{s}" t="{t}"/>' for s, t in ((10, 5), (13, 5), (13, -5), (10, -5)))
    on_road = f'<object id="8" type="crosswalk" s="11" t="0"><outlines><outline>{placed}</outline></outlines></object>'
    sized = '<object id="9" type="crosswalk" s="50" t="0" length="2" width="8"/>'
    scenario = road(objects=local + on_road + sized + '<object id="10" type="crosswalk" s="3" t="0"/>')
    assert len(scenario.crosswalks) == 3
    found = {key: {tuple(np.round(p, 4)) for p in outline(scenario, f"crosswalk {key}")} for key in (7, 8, 9)}
    assert found == {
        7: {(29.0, 4.0), (31.0, 4.0), (31.0, -4.0), (29.0, -4.0)},
        8: {(10.0, 5.0), (13.0, 5.0), (13.0, -5.0), (10.0, -5.0)},
        9: {(51.0, 4.0), (51.0, -4.0), (49.0, -4.0), (49.0, 4.0)},
    }
    assert scenario.notes == ("left out: 1 objects",), "the one without a size"


# Lanelet2


def osm(elements, of_first="", of_second=""):
    """Two lanelets of 50 m, one behind the other, with further ways and relations."""
    nodes = {1: (0, 3.5), 2: (50, 3.5), 3: (100, 3.5), 4: (0, 0), 5: (50, 0), 6: (100, 0)}
    nodes |= {7: (48, 0.2), 8: (48, 3.4), 9: (47, -2), 10: (47, -3)}
    nodes |= {11: (40, -4), 12: (40, 6), 13: (43, -4), 14: (43, 6)}
    places = "".join(
        f'<node id="{key}" lat="0" lon="0"><tag k="local_x" v="{x}"/><tag k="local_y" v="{y}"/></node>'
        for key, (x, y) in nodes.items()
    )
    ways = {101: (1, 2), 102: (2, 3), 103: (4, 5), 104: (5, 6), 105: (7, 8), 106: (9, 10), 107: (11, 12), 108: (13, 14)}
    kinds = {105: "stop_line", 106: "traffic_sign"}
    lines = "".join(
        f'<way id="{key}"><nd ref="{a}"/><nd ref="{b}"/><tag k="type" v="{kinds.get(key, "virtual")}"/>'
        + ('<tag k="subtype" v="de206"/>' if key == 106 else "")
        + "</way>"
        for key, (a, b) in ways.items()
    )
    sides = {201: (101, 103), 202: (102, 104)}
    lanelets = "".join(lanelet(key, *pair, of_first if key == 201 else of_second) for key, pair in sides.items())
    return f"<osm>{places}{lines}{lanelets}{elements}</osm>"


def lanelet(number, left, right, members="", kind="road"):
    return relation(
        number, {"type": "lanelet", "subtype": kind}, member("left", left) + member("right", right) + members
    )


def member(role, number, kind="way"):
    return f'<member type="{kind}" role="{role}" ref="{number}"/>'


def relation(number, tags, members):
    return (
        f'<relation id="{number}">{members}{"".join(f"""<tag k="{k}" v="{v}"/>""" for k, v in tags.items())}</relation>'
    )


def rule(kind, members):
    return relation(300, {"type": "regulatory_element", "subtype": kind}, members)


@pytest.fixture
def lanelets(tmp_path):
    def written(*parts):
        path = tmp_path / "map.osm"
        path.write_text(osm(*parts))
        return whole(path)

    return written


def test_a_light_of_lanelets_is_dark_at_its_line(lanelets):
    scenario = lanelets(rule("traffic_light", member("ref_line", 105)), member("regulatory_element", 300, "relation"))
    [light], [line] = scenario.traffic_lights, scenario.stop_lines
    assert light.phases == ()
    assert line.light_ids == ((2, (light.id,)),)
    assert line.lanelet_id == 1
    assert line.is_stated
    np.testing.assert_allclose(line.ends, [[48.0, 3.4], [48.0, 0.2]])
    assert "the cycles of traffic lights are unknown, so that they are dark: 1" in scenario.notes


def test_a_light_that_no_lanelet_names_is_for_those_that_end_at_its_line(lanelets):
    assert [line.lanelet_id for line in lanelets(rule("traffic_light", member("ref_line", 105))).stop_lines] == [1]


def test_a_light_at_the_start_of_a_lanelet_is_for_those_that_lead_there(lanelets):
    names = member("regulatory_element", 300, "relation")
    assert [
        line.lanelet_id for line in lanelets(rule("traffic_light", member("ref_line", 105)), "", names).stop_lines
    ] == [1]


def test_who_gives_way_has_the_sign_that_is_nearest(lanelets):
    both = member("yield", 201, "relation") + member("ref_line", 105)
    scenario = lanelets(rule("right_of_way", both + member("refers", 106)))
    assert scenario.priorities.ranks == ((1, STOP),)
    assert [line.has_stop_sign for line in scenario.stop_lines] == [True]
    scenario = lanelets(rule("right_of_way", both))
    assert scenario.priorities.ranks == ((1, YIELD),)
    assert not scenario.stop_lines


def test_a_crosswalk_of_lanelets_is_read_and_others_are_counted(lanelets):
    scenario = lanelets(lanelet(203, 107, 108, kind="crosswalk") + rule("right_of_way", member("yield", 9, "relation")))
    assert scenario.crosswalks == (3,)
    assert scenario.lanelets.types[2] == ("crosswalk",)
    assert scenario.notes[0] == (
        "left out: 1 right of way regulatory elements of no lane that is read, 1 stop lines without sign or light"
    )


# Waymo


@pytest.fixture
def scene(tmp_path):
    def written(**parts):
        document = ff.womd()
        document["roads"] += parts.pop("roads", [])
        path = tmp_path / "scene.json"
        path.write_text(json.dumps({**document, **parts}))
        return whole(path)

    return written


def part(kind, points):
    return {"type": kind, "geometry": [{"x": float(x), "y": float(y), "z": 0.0} for x, y in points], "id": 50}


def test_a_stop_sign_of_a_scene_is_for_the_ends_of_lanes_beside_it(scene):
    scenario = scene(roads=[part("stop_sign", [(59.0, -1.0)])])
    numbers = by_key(scenario)
    assert dict(scenario.priorities.ranks) == {numbers["1"]: STOP, numbers["2"]: STOP}, "also for the lane beside"
    assert [line.has_stop_sign for line in scenario.stop_lines] == [True, True]
    assert not scene(roads=[part("stop_sign", [(68.0, 1.0)])]).stop_lines, "ahead of all ends"


def test_lights_of_a_scene_show_their_states_and_then_the_last_one(scene):
    words = ["unknown"] * 3 + ["arrow_stop"] * 10 + ["unknown"] * 2 + ["go"] * 5 + ["caution"]
    state = {"state": words, "time_index": list(range(len(words))), "x": [60.0], "y": [1.75], "z": [0.0]}
    scenario = scene(tl_states={"3": state, "77": state})
    [light] = scenario.traffic_lights
    shown = light.signals(200)
    np.testing.assert_array_equal(shown[:22], [3] * 15 + [1] * 5 + [2] * 2)
    assert (shown[20:] == 2).all(), "the last one lasts"
    numbers = by_key(scenario)
    [line] = scenario.stop_lines
    assert (line.lanelet_id, line.light_ids) == (numbers["1"], ((numbers["3"], (light.id,)),))
    assert "1 traffic lights without a known state or lane" in scenario.notes[0]


def test_a_crosswalk_of_a_scene_has_its_outline(scene):
    scenario = scene(roads=[part("crosswalk", [(40, -1), (43, -1), (43, 8), (40, 8)])])
    [key] = [key for key in scenario.source.keys if "crosswalk" in key]
    assert set(outline(scenario, key)) == {(40.0, -1.0), (43.0, -1.0), (43.0, 8.0), (40.0, 8.0)}
    bent = scene(roads=[part("crosswalk", [(40, -1), (43, -1), (43, 4), (43, 8), (40, 8)])])
    assert set(outline(bent, key)) == {(40.0, -1.0), (43.0, -1.0), (43.0, 8.0), (40.0, 8.0)}, "the rectangle around it"


# OSI


def test_bulbs_of_a_trace_are_lights_of_their_lane_over_time(tmp_path):
    messages = ff.osi_control(ff.osi_messages())
    path = tmp_path / "trace.osi"
    path.write_bytes(ff.osi_trace(messages))
    scenario = whole(path)
    [light], [line] = scenario.traffic_lights, scenario.stop_lines
    np.testing.assert_array_equal(light.signals(40), [3] * 10 + [1] * 30)
    assert line.light_ids == ((2, (light.id,)),)
    assert line.has_stop_sign
    assert line.lanelet_id == 1
    assert set(outline(scenario, "crosswalk 51")) == {(48.5, -2.0), (51.5, -2.0), (51.5, 6.0), (48.5, 6.0)}


# What agents do, and other maps


def test_agents_stop_for_a_stop_sign_of_a_road(road):
    scenario = road(signal(206, s=30.0))
    start = InitialState(0, 5.0, -1.75, 0.0, 8.0)
    area = Shape("rectangle", length=4.0, width=3.0, center=(58.0, -1.75))
    problem = PlanningProblem(900, start, (GoalState((area,), (), (0, 2000)),))
    ahead = np.array([[40.0, 0.0], [40.0, -3.5]])
    line = dataclasses.replace(scenario.stop_lines[0], ends=ahead)
    scenario = dataclasses.replace(scenario, planning_problems=(problem,), stop_lines=(line,))
    run = idr.simulate(scenario, agents="problems", planner="idm")
    assert run.states.velocity[0][run.states.valid[0]].min() < 0.1


def test_lights_of_a_map_keep_their_times_in_the_steps_of_a_recording(net, tmp_path):
    links = (f'tl="b" linkIndex="{index}" state="o"' for index in range(3))
    net(PROGRAM, *links)
    path = tmp_path / "tracks.csv"
    path.write_text(ff.tracks(ff.car(dt=0.04)))
    scenario = whole(path, map=str(tmp_path / "crossroads.net.xml"), dt=0.04)
    lights = {light.directions: light for light in scenario.traffic_lights}
    assert lights[ALL].phases == (("red", 1500),)
    assert lights[frozenset(("straight",))].phases == (("green", 750), ("yellow", 75), ("red", 675))
    assert lights[frozenset(("straight",))].offset == 125


def test_crosswalks_and_stop_signs_of_real_maps_are_all_there(inputs_folder):
    for name, n_crosswalks, n_stops in (("Town03", 73, 0), ("Town04", 27, 0), ("Town10HD", 16, 3)):
        scenario = idr.read_source(inputs_folder / "xodr" / f"{name}.xodr.gz")
        stops = [line for line in scenario.stop_lines if line.has_stop_sign]
        assert (len(scenario.crosswalks), len(stops)) == (n_crosswalks, n_stops), name
    for name, n_crosswalks, n_lights in (("SinD_Tianjin", 4, 4), ("kashiwanoha", 4, 1), ("rounD_0", 7, 0)):
        scenario = idr.read_source(inputs_folder / "osm" / f"{name}.osm")
        assert (len(scenario.crosswalks), len(scenario.traffic_lights)) == (n_crosswalks, n_lights), name
        assert name != "SinD_Tianjin" or len(scenario.stop_lines) == 10, "as many as lanes that lead to its 4 lines"
    for name in ("4lane", "lefthand"):
        scenario = idr.read_source(inputs_folder / "sumo" / f"{name}.net.xml")
        assert sum(steps for _, steps in scenario.traffic_lights[0].phases) == 900, "a cycle of 90 s"
        assert len(scenario.stop_lines) == 8
