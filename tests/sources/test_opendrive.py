"""Small OpenDRIVE roads become the lanelets that follow from their formulas."""

import math
import time

import numpy as np
import opendrive_documents as xodr
import pytest

import interdrive as idr

LINE = "<line/>"
BOTH = xodr.section(xodr.lane(1), xodr.lane(0), xodr.lane(-1))


@pytest.fixture
def read(tmp_path):
    def reader(*parts, header="", name="map.xodr", **options):
        path = tmp_path / name
        path.write_text(xodr.document(*parts, header=header))
        return idr.read_source(path, **options)

    return reader


def lanelet(scenario, key):
    """Bounds and row of a lanelet by road/section/lane."""
    row = scenario.source.keys.index(key)
    return scenario.lanelets.left[row], scenario.lanelets.right[row], row


def test_a_straight_road_has_a_lanelet_per_lane_each_in_its_driving_direction(read):
    scenario = read(xodr.road(1, xodr.geometry(LINE, 20.0), BOTH, length=20.0))
    assert scenario.source.keys == ("1/0/1", "1/0/-1"), "from left to right"
    left, right, row = lanelet(scenario, "1/0/-1")
    np.testing.assert_allclose(left[[0, -1]], [[0, 0], [20, 0]], atol=1e-4)
    np.testing.assert_allclose(right[[0, -1]], [[0, -3.5], [20, -3.5]], atol=1e-4)
    other_left, _, other = lanelet(scenario, "1/0/1")
    np.testing.assert_allclose(other_left[[0, -1]], [[20, 0], [0, 0]], atol=1e-4)
    assert scenario.lanelets.adjacent_left[row] == other + 1
    assert not scenario.lanelets.adjacent_left_same_direction[row]
    assert not scenario.priorities.left_hand
    assert scenario.benchmark_id == "ZAM_map-1_1_T-1"


def test_on_roads_with_left_hand_traffic_lanes_run_the_other_way(read):
    scenario = read(xodr.road(1, xodr.geometry(LINE, 20.0), BOTH, length=20.0, rule="LHT"))
    left, _, row = lanelet(scenario, "1/0/1")
    np.testing.assert_allclose(left[[0, -1]], [[0, 3.5], [20, 3.5]], atol=1e-4)
    assert scenario.lanelets.adjacent_right[row] == 2
    assert scenario.priorities.left_hand


def test_left_hand_traffic_that_the_lanelets_do_not_show_needs_a_country(read):
    one_way = xodr.road(1, xodr.geometry(LINE, 20.0), xodr.section(xodr.lane(1), xodr.lane(0)), length=20.0, rule="LHT")
    assert "give --country, e.g. GBR" in read(one_way).notes[0]
    scenario = read(one_way, country="GBR")
    assert scenario.priorities.left_hand
    assert not scenario.notes


def test_a_reversed_lane_runs_against_its_side(read):
    lanes = xodr.section(xodr.lane(0), xodr.lane(-1), xodr.lane(-2, direction="reversed"))
    scenario = read(xodr.road(1, xodr.geometry(LINE, 20.0), lanes, length=20.0))
    left, _, row = lanelet(scenario, "1/0/-2")
    np.testing.assert_allclose(left[[0, -1]], [[20, -7], [0, -7]], atol=1e-4)
    assert scenario.lanelets.adjacent_right[row] == 1
    assert not scenario.lanelets.adjacent_right_same_direction[row]


def test_an_arc_bends_with_the_radius_of_each_border(read):
    scenario = read(xodr.road(1, xodr.geometry('<arc curvature="0.01"/>', 100.0), BOTH, length=100.0))
    left, right, _ = lanelet(scenario, "1/0/-1")
    for border, radius in ((left, 100.0), (right, 103.5)):
        np.testing.assert_allclose(np.hypot(border[:, 0], border[:, 1] - 100.0), radius, atol=2e-4)
        middle = 0.5 * (border[1:] + border[:-1])
        assert radius - np.hypot(middle[:, 0], middle[:, 1] - 100.0).min() < 0.05, "chords are close to the curve"


def test_a_spiral_turns_by_its_mean_curvature(read):
    scenario = read(xodr.road(1, xodr.geometry('<spiral curvStart="0" curvEnd="0.02"/>', 80.0), BOTH, length=80.0))
    left, right, _ = lanelet(scenario, "1/0/-1")
    across = left[-1] - right[-1]
    assert math.atan2(-across[0], across[1]) == pytest.approx(0.8, abs=1e-4)
    s = np.linspace(0.0, 80.0, 200001)
    heading = 0.02 / 80.0 * s**2 / 2.0
    end = [np.trapezoid(np.cos(heading), s), np.trapezoid(np.sin(heading), s)]
    np.testing.assert_allclose(left[-1], end, atol=1e-3)


def with_first_record(form, length):
    records = xodr.geometry(form, length) + xodr.geometry("<line/>", 20.0, s=20.0, x=20.0, y=1.3, heading=0.2)
    return xodr.road(1, records, BOTH, length=40.0)


@pytest.mark.parametrize(
    ("form", "of_whole"),
    [
        ('<spiral curvStart="0" curvEnd="{end}"/>', lambda length: {"end": 0.001 * length}),
        ('<arc curvature="0.01"/>', lambda _: {}),
        ('<poly3 a="0" b="0" c="0.002" d="0"/>', lambda _: {}),
    ],
)
def test_a_record_that_is_far_longer_than_its_road_is_read_as_far_as_it_is_used(read, form, of_whole):
    short, long = (with_first_record(form.format(**of_whole(length)), length) for length in (20.0, 2e7))
    expected = lanelet(read(short), "1/0/-1")[0]
    begun = time.process_time()
    found = lanelet(read(long), "1/0/-1")[0]
    assert time.process_time() - begun < 1.0  # a table of all of it took 8 s and 1.5 GB
    np.testing.assert_allclose(found[[0, -1]], expected[[0, -1]], atol=1e-3)
    if "poly3" not in form:  # whose table is as fine as its record is short
        np.testing.assert_allclose(found, expected, atol=1e-3)


def test_cubic_curves_are_followed_by_arc_length(read):
    def end_of(form, length):
        return lanelet(read(xodr.road(1, xodr.geometry(form, length), BOTH, length=length)), "1/0/-1")[0][-1]

    u = np.linspace(0.0, 40.0, 400001)
    along = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(u), np.diff(0.005 * u**2)))))
    place = np.interp(30.0, along, u)
    np.testing.assert_allclose(
        end_of('<poly3 a="0" b="0" c="0.005" d="0"/>', 30.0), [place, 0.005 * place**2], atol=1e-3
    )
    normalised = '<paramPoly3 aU="0" bU="40" cU="0" dU="0" aV="0" bV="0" cV="8" dV="0"/>'
    np.testing.assert_allclose(end_of(normalised, along[-1]), [40.0, 8.0], atol=1e-3)
    by_length = '<paramPoly3 pRange="arcLength" aU="0" bU="1" cU="0" dU="0" aV="0" bV="0" cV="0.005" dV="0"/>'
    np.testing.assert_allclose(end_of(by_length, 30.0), [30.0, 4.5], atol=1e-3)


def test_offset_and_width_change_along_the_road_up_to_the_end_of_a_section(read):
    widths = '<width sOffset="0" a="3" b="0.1" c="0" d="0"/>'
    lanes = (
        '<laneOffset s="0" a="1" b="0" c="0" d="0"/><laneOffset s="10" a="-5" b="0" c="0" d="0"/>'
        + xodr.section(xodr.lane(0), xodr.lane(-1, width=widths))
        + xodr.section(xodr.lane(0), xodr.lane(-1), s=10.0)
    )
    scenario = read(xodr.road(1, xodr.geometry(LINE, 20.0), lanes, length=20.0))
    left, right, _ = lanelet(scenario, "1/0/-1")
    np.testing.assert_allclose(left[-1], [10, 1], atol=1e-4, err_msg="the offset from s = 10 on is the next section's")
    np.testing.assert_allclose(right[-1], [10, -3], atol=1e-4)
    np.testing.assert_allclose(lanelet(scenario, "1/1/-1")[0][0], [10, -5], atol=1e-4)


def test_borders_count_where_lanes_have_no_width(read):
    lanes = xodr.section(
        xodr.lane(0),
        xodr.lane(-1, width='<border sOffset="0" a="-3" b="0" c="0" d="0"/>'),
        xodr.lane(-2, width='<border sOffset="0" a="-7" b="0" c="0" d="0"/>'),
    )
    scenario = read(xodr.road(1, xodr.geometry(LINE, 20.0), lanes, length=20.0))
    left, right, _ = lanelet(scenario, "1/0/-2")
    np.testing.assert_allclose([left[0], right[0]], [[0, -3], [0, -7]], atol=1e-4)


def test_superelevation_makes_lanes_narrower_in_plan(read):
    banked = '<lateralProfile><superelevation s="0" a="0.5" b="0" c="0" d="0"/></lateralProfile>'
    scenario = read(xodr.road(1, xodr.geometry(LINE, 20.0), BOTH, length=20.0, more=banked))
    assert lanelet(scenario, "1/0/-1")[1][0, 1] == pytest.approx(-3.5 * math.cos(0.5), abs=1e-4)


def two_sections(**more):
    return xodr.section(xodr.lane(0), xodr.lane(-1, after=-1), xodr.lane(-2, after=-2)) + xodr.section(
        xodr.lane(0), xodr.lane(-1, before=-1), xodr.lane(-2, before=-2, **more), s=30.0
    )


def test_lanes_lead_from_section_to_section_and_from_road_to_road(read):
    first = xodr.road(
        1, xodr.geometry(LINE, 60.0), two_sections(), length=60.0,
        after='elementType="road" elementId="2" contactPoint="end"',
    )  # fmt: skip
    against = xodr.section(xodr.lane(2, after=-2), xodr.lane(1, after=-1), xodr.lane(0))
    second = xodr.road(
        2, xodr.geometry(LINE, 40.0, x=100.0, heading=math.pi), against, length=40.0,
        after='elementType="road" elementId="1" contactPoint="end"',
    )  # fmt: skip
    scenario = read(first, second)
    keys = scenario.source.keys
    links = {(keys[row], keys[after - 1]) for row, ids in enumerate(scenario.lanelets.successors) for after in ids}
    assert links == {
        ("1/0/-1", "1/1/-1"), ("1/0/-2", "1/1/-2"), ("1/1/-1", "2/0/1"), ("1/1/-2", "2/0/2"),
    }  # fmt: skip


def test_the_order_of_roads_decides_about_ids_alone(read):
    one_lane = xodr.section(xodr.lane(0), xodr.lane(-1, before=-1, after=-1))
    first = xodr.road(
        1, xodr.geometry(LINE, 30.0), one_lane, length=30.0,
        after='elementType="road" elementId="2" contactPoint="start"',
    )  # fmt: skip
    second = xodr.road(2, xodr.geometry(LINE, 20.0, x=30.0), one_lane, length=20.0)
    one, other = read(first, second), read(second, first)
    assert one.source.keys == ("1/0/-1", "2/0/-1")
    assert other.source.keys == ("2/0/-1", "1/0/-1")
    assert one.lanelets.successors == ((2,), ())
    assert other.lanelets.successors == ((), (1,))
    np.testing.assert_array_equal(one.lanelets.left[0], other.lanelets.left[1])


@pytest.mark.parametrize("kind", ["default", "direct"])
def test_junctions_lead_from_a_road_into_another(read, kind):
    one_lane = xodr.section(xodr.lane(0), xodr.lane(-1))
    incoming = xodr.road(
        1, xodr.geometry(LINE, 30.0), one_lane, length=30.0, after='elementType="junction" elementId="9"',
        more='<type s="0" type="town"><speed max="50" unit="km/h"/></type>',
    )  # fmt: skip
    inside = xodr.road(2, xodr.geometry(LINE, 20.0, x=30.0), one_lane, length=20.0, junction=9)
    named = "connectingRoad" if kind == "default" else "linkedRoad"
    junction = (
        f'<junction id="9" type="{kind}"><connection id="0" incomingRoad="1" {named}="2" contactPoint="start">'
        '<laneLink from="-1" to="-1"/></connection></junction>'
    )
    scenario = read(incoming, inside, junction)
    assert scenario.lanelets.successors == ((2,), ())
    np.testing.assert_allclose(scenario.lanelets.speed_limit, 50 / 3.6, err_msg="junctions have the limit before them")


def test_limits_of_lanes_come_before_those_of_roads(read):
    limits = xodr.section(
        xodr.lane(0),
        xodr.lane(-1, more='<speed sOffset="0" max="30" unit="mph"/>'),
        xodr.lane(-2, more='<speed sOffset="0" max="no limit"/>'),
        xodr.lane(-3),
    )
    scenario = read(
        xodr.road(
            1,
            xodr.geometry(LINE, 20.0),
            limits,
            length=20.0,
            more='<type s="0" type="motorway"><speed max="25"/></type>',
        )
    )
    np.testing.assert_allclose(scenario.lanelets.speed_limit, [30 * 0.44704, np.nan, 25.0])
    assert scenario.lanelets.types == (("highway",),) * 3


def test_lines_are_named_in_driving_direction(read):
    def mark(kind, weight="standard"):
        return f'<roadMark sOffset="0" type="{kind}" weight="{weight}"/>'

    lanes = xodr.section(
        xodr.lane(1, more=mark("solid broken")),
        xodr.lane(0, more=mark("broken solid")),
        xodr.lane(-1, more=mark("broken", "bold")),
        xodr.lane(-2, more=mark("solid broken")),
    )
    lanelets = read(xodr.road(1, xodr.geometry(LINE, 20.0), lanes, length=20.0)).lanelets
    assert lanelets.left_marking == ("solid_dashed", "dashed_solid", "broad_dashed")
    assert lanelets.right_marking == ("solid_dashed", "broad_dashed", "solid_dashed")


def test_kinds_of_lanes_are_left_out_and_counted_unless_they_are_kept(read):
    lanes = xodr.section(
        xodr.lane(0),
        xodr.lane(-1),
        xodr.lane(-2, kind="bus"),
        xodr.lane(-3, kind="biking"),
        xodr.lane(-4, kind="sidewalk"),
    )
    world = xodr.road(1, xodr.geometry(LINE, 20.0), lanes, length=20.0)
    assert read(world).notes == ("left out: 1 biking, 1 bus, 1 sidewalk lanes",)
    kept = read(world, keep="bus,bike")
    assert kept.lanelets.types == (("urban",), ("busLane",), ("bicycleLane",))


def test_a_taper_keeps_a_width_and_a_lane_without_any_is_left_out(read):
    lanes = xodr.section(
        xodr.lane(0),
        xodr.lane(-1, width='<width sOffset="0" a="0" b="0.175" c="0" d="0"/>'),
        xodr.lane(-2, width='<width sOffset="0" a="0.2" b="0" c="0" d="0"/>'),
    )
    scenario = read(xodr.road(1, xodr.geometry(LINE, 20.0), lanes, length=20.0))
    assert scenario.source.keys == ("1/0/-1",)
    left, right, _ = lanelet(scenario, "1/0/-1")
    assert np.hypot(*(left - right).T).min() == pytest.approx(0.1, abs=1e-3)
    assert scenario.notes == ("left out: 1 narrower than 0.5 m lanes",)


def test_links_between_borders_that_do_not_meet_are_left_out(read):
    moved = two_sections(width='<width sOffset="0" a="4.2" b="0" c="0" d="0"/>')
    scenario = read(xodr.road(1, xodr.geometry(LINE, 60.0), moved, length=60.0))
    assert scenario.lanelets.successors == ((3,), (), (), ())
    assert scenario.notes == ("1 link left out, whose ends are 0.7 m apart (1/0/-2 to 1/1/-2)",)


def test_borders_that_nearly_meet_are_moved_until_they_do(read):
    moved = two_sections(width='<width sOffset="0" a="3.9" b="0" c="0" d="0"/>')
    scenario = read(xodr.road(1, xodr.geometry(LINE, 60.0), moved, length=60.0))
    right = scenario.lanelets.right
    np.testing.assert_allclose(right[1][-1], right[3][0], atol=1e-4)
    assert right[1][-1, 1] == pytest.approx(-7.2, abs=1e-3)


def test_short_sections_are_joined_to_the_next(read):
    lanes = (
        xodr.section(xodr.lane(0), xodr.lane(-1, after=-1))
        + xodr.section(xodr.lane(0), xodr.lane(-1, before=-1, after=-1), s=30.0)
        + xodr.section(xodr.lane(0), xodr.lane(-1, before=-1), s=30.3)
    )
    scenario = read(xodr.road(1, xodr.geometry(LINE, 60.0), lanes, length=60.0))
    assert scenario.source.keys == ("1/0/-1", "1/2/-1")
    assert scenario.lanelets.successors == ((2,), ())
    assert scenario.lanelets.left[1][0, 0] == pytest.approx(30.0, abs=1e-4)


def test_a_section_without_length_does_not_break_the_road(read):
    lanes = (
        xodr.section(xodr.lane(0), xodr.lane(-1, after=-1))
        + xodr.section(xodr.lane(0), xodr.lane(-1, before=-1, after=-1), s=30.0)
        + xodr.section(xodr.lane(0), xodr.lane(-1, before=-1), s=30.0)
    )
    scenario = read(xodr.road(1, xodr.geometry(LINE, 60.0), lanes, length=60.0))
    assert scenario.lanelets.successors == ((2,), ())


def test_a_ring_of_one_piece_is_cut_in_two_so_that_it_can_be_a_goal(read):
    ring = xodr.road(
        1, xodr.geometry('<arc curvature="0.02"/>', 100.0 * math.pi),
        xodr.section(xodr.lane(0), xodr.lane(-1, before=-1, after=-1)), length=100.0 * math.pi,
        before='elementType="road" elementId="1" contactPoint="end"',
        after='elementType="road" elementId="1" contactPoint="start"',
    )  # fmt: skip
    scenario = read(ring)
    assert scenario.source.keys == ("1/0/-1", "1/0/-1+")
    assert scenario.lanelets.successors == ((2,), (1,))


def test_the_inner_border_of_a_tight_bend_runs_forward(read):
    wide = xodr.section(xodr.lane(0), xodr.lane(-1, width='<width sOffset="0" a="9" b="0" c="0" d="0"/>'))
    scenario = read(xodr.road(1, xodr.geometry('<arc curvature="-0.2"/>', 8.0), wide, length=8.0))
    left, right, _ = lanelet(scenario, "1/0/-1")
    ahead = np.diff(0.5 * (left + right), axis=0)
    assert ((np.diff(right, axis=0) * ahead).sum(axis=1) > 0).all()


def test_the_offset_of_the_header_is_applied_only_if_that_is_wanted(read):
    world = xodr.road(1, xodr.geometry(LINE, 20.0), BOTH, length=20.0)
    header = '<geoReference><![CDATA[+proj=utm +zone=32]]></geoReference><offset x="100" y="-50" z="0" hdg="0"/>'
    scenario = read(world, header=header)
    assert scenario.notes == ("offset (100, -50) of the header is not applied",)
    assert scenario.source.location == "+proj=utm +zone=32"
    np.testing.assert_allclose(lanelet(scenario, "1/0/-1")[0][0], [0, 0], atol=1e-4)
    added = read(world, header=header, offset="add")
    np.testing.assert_allclose(lanelet(added, "1/0/-1")[0][0], [100, -50], atol=1e-4)


def test_a_road_that_cannot_be_used_is_left_out_and_named(read):
    good = xodr.road(1, xodr.geometry(LINE, 20.0), BOTH, length=20.0)
    broken = {
        2: xodr.road(2, "", BOTH, length=20.0),
        3: xodr.road(3, xodr.geometry(LINE, 20.0, x=math.nan), BOTH, length=20.0),
        4: xodr.road(4, xodr.geometry(LINE, 1e9), BOTH, length=1e9),
        5: xodr.road(5, '<geometry s="0" x="0" y="0" length="3"><line/></geometry>', BOTH, length=3.0),
    }
    notes = read(good, *broken.values()).notes
    assert notes == (
        "roads left out, without geometry: 2",
        "roads left out, x of <geometry> is no possible number: 3",
        "roads left out, longer than 100 km: 4",
        "roads left out, <geometry> without hdg: 5",
    )


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ((xodr.road(1, xodr.geometry(LINE, 9.0), BOTH, length=9.0),) * 2, "two roads have the id 1; give each its own"),
        (
            (xodr.road(1, xodr.geometry(LINE, 9.0), BOTH.replace("driving", "none"), length=9.0),),
            r"has no lane that vehicles may drive \(types: none 2\); --keep adds types",
        ),
        ((), r"has no lane that vehicles may drive \(types: no lanes at all\)"),
    ],
)
def test_what_holds_no_road_is_refused_in_one_line(read, parts, words):
    with pytest.raises(idr.InputError, match=words):
        read(*parts)


def test_texts_in_other_encodings_and_with_a_namespace_are_the_same_map(tmp_path):
    text = xodr.document(xodr.road(1, xodr.geometry(LINE, 20.0), BOTH, length=20.0))
    plain, wide, named = (tmp_path / name for name in ("plain.xodr", "wide.xodr", "named.xodr"))
    plain.write_text(text)
    wide.write_text(text.replace("?>", ' encoding="UTF-16"?>', 1), encoding="utf-16")
    named.write_text(text.replace("<OpenDRIVE>", '<OpenDRIVE xmlns="http://code.asam.net/simulation/standard">'))
    one, *others = (idr.read_source(path).lanelets for path in (plain, wide, named))
    for other in others:
        np.testing.assert_array_equal(one.left[0], other.left[0])
