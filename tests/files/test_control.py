"""Traffic lights, stop lines and signs as they are read, and what is derived where a file leaves them out."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support import commonroad_documents as cr

from interdrive import _core
from interdrive.files import read_scenario
from interdrive.native_settings import RoadSettings
from interdrive.scenario import SIGNALS
from interdrive.scenario.control import GOING_SIGNALS, shown_at_lines, shown_together
from interdrive.scenario.native import core_road, core_scenario
from interdrive.scenario.signs import GREEN_ARROW_NUMBER, PRIORITY_SIGNS, SIGN_KINDS, sign_of

STOP_LINE = "<stopLine>{}<lineMarking>solid</lineMarking>{}</stopLine>"

#: Lanelet 1 leads east to (100, 0); from there 2 straight on, 3 in a quarter circle of 10 m to the left.
ANGLES = np.linspace(-np.pi / 2, 0.0, 12)
LEFT_TURN = {
    side: [(100 + radius * np.cos(angle), 10 + radius * np.sin(angle)) for angle in ANGLES]
    for side, radius in (("left", 8.0), ("right", 12.0))
}


def junction(more="", content=""):
    """The document with more of lanelet 1 and more content."""
    lanelets = (
        cr.lanelet(1, more='<successor ref="2"/><successor ref="3"/>' + more)
        + cr.lanelet(2, left=((100, 2), (150, 2)), right=((100, -2), (150, -2)), more='<predecessor ref="1"/>')
        + cr.lanelet(3, **LEFT_TURN, more='<predecessor ref="1"/>')
    )
    return cr.document(content, lanelets=lanelets)


#: Lanelet 5 leads from there in a quarter circle of 10 m to the right.
RIGHT_TURN = {
    side: [(100 + radius * np.cos(angle), -10 + radius * np.sin(angle)) for angle in -ANGLES]
    for side, radius in (("left", 12.0), ("right", 8.0))
}


def with_right_turn(*lights):
    """The document with a third way to the right, and lights 7, 8, ... before the ways."""
    refs = "".join(f'<trafficLightRef ref="{7 + k}"/>' for k in range(len(lights)))
    turn = cr.lanelet(5, **RIGHT_TURN, more='<predecessor ref="1"/>')
    text = junction('<successor ref="5"/>' + refs, "".join(lights))
    return text.replace("</commonRoad>", turn + "</commonRoad>")


def corner(x, y, first, last, radii):
    """Bounds of a quarter circle around a point, from one direction to another [degrees]."""
    angles = np.radians(np.linspace(first, last, 12))
    return {
        side: [(x + radius * np.cos(angle), y + radius * np.sin(angle)) for angle in angles]
        for side, radius in zip(("left", "right"), radii, strict=True)
    }


def t_junction(version="2020a"):
    """Arms to the west, east and north. Lanelets 1, 2, 3 come from there, 6, 5, 7 lead there.

    From the west 11 leads straight on and 12 left, from the east 21 straight on and 22 right, from the north 31 left
    and 32 right. What the file says to be left of what names lanelets, and is wrong.
    """
    ways = {
        1: ({"left": [(-80, 0), (-12, 0)], "right": [(-80, -3.5), (-12, -3.5)]}, (11, 12)),
        2: ({"left": [(80, 0), (12, 0)], "right": [(80, 3.5), (12, 3.5)]}, (21, 22)),
        3: ({"left": [(0, 80), (0, 12)], "right": [(-3.5, 80), (-3.5, 12)]}, (31, 32)),
        5: ({"left": [(12, 0), (80, 0)], "right": [(12, -3.5), (80, -3.5)]}, ()),
        6: ({"left": [(-12, 0), (-80, 0)], "right": [(-12, 3.5), (-80, 3.5)]}, ()),
        7: ({"left": [(0, 12), (0, 80)], "right": [(3.5, 12), (3.5, 80)]}, ()),
        11: ({"left": [(-12, 0), (12, 0)], "right": [(-12, -3.5), (12, -3.5)]}, (5,)),
        12: (corner(-12, 12, -90, 0, (12.0, 15.5)), (7,)),
        21: ({"left": [(12, 0), (-12, 0)], "right": [(12, 3.5), (-12, 3.5)]}, (6,)),
        22: (corner(12, 12, -90, -180, (12.0, 8.5)), (7,)),
        31: (corner(12, 12, 180, 270, (12.0, 15.5)), (5,)),
        32: (corner(-12, 12, 0, -90, (12.0, 8.5)), (6,)),
    }
    lanelets = ""
    for number, (bounds, successors) in ways.items():
        before = [other for other, (_, following) in ways.items() if number in following]
        more = "".join(f'<predecessor ref="{other}"/>' for other in before)
        more += "".join(f'<successor ref="{other}"/>' for other in successors)
        lanelets += cr.lanelet(number, **bounds, more=more)
    incomings = ""
    for number, left_of, turns in (
        (1, 3, ("Straight", 11, "Left", 12)),
        (2, 1, ("Right", 22, "Straight", 21)),
        (3, 2, ("Right", 32, "Left", 31)),
    ):
        stated = "".join(f'<successors{turns[k]} ref="{turns[k + 1]}"/>' for k in (0, 2))
        incomings += f'<incoming id="{100 + number}"><incomingLanelet ref="{number}"/>{stated}'
        incomings += f'<isLeftOf ref="{left_of}"/></incoming>'
    content = f'<intersection id="100">{incomings}</intersection>' if version == "2020a" else ""
    return cr.document(content, version=version, lanelets=lanelets)


@pytest.fixture
def read(tmp_path):
    return lambda text: read_scenario(cr.saved(tmp_path, text))


def test_a_light_shows_the_phase_of_its_cycle(read):
    light = cr.traffic_light(7, ("green", 170), ("yellow", 30), ("red", 800), offset=790)
    scenario = read(junction('<trafficLightRef ref="7"/>', light))
    shown = scenario.traffic_lights[0].signals(1800)
    steps = (0, 789, 790, 959, 960, 989, 990, 1790)
    expected = ["red", "red", "green", "green", "yellow", "yellow", "red", "green"]
    assert [SIGNALS[shown[step]] for step in steps] == expected


def test_red_and_yellow_is_red_and_an_inactive_phase_or_light_is_dark(read):
    light = cr.traffic_light(7, ("redYellow", 2), ("inactive", 3), ("green", 1))
    scenario = read(junction('<trafficLightRef ref="7"/>', light))
    assert [SIGNALS[code] for code in scenario.traffic_lights[0].signals(6)] == ["red"] * 2 + ["dark"] * 3 + ["green"]
    off = cr.traffic_light(7, ("red", 10), active="false")
    assert set(read(junction('<trafficLightRef ref="7"/>', off)).traffic_lights[0].signals(20)) == {0}


@pytest.mark.parametrize(
    ("direction", "straight", "left"),
    [("all", (7,), (7,)), ("left", (), (7,)), ("straightRight", (7,), ()), ("leftStraight", (7,), (7,))],
)
def test_a_light_counts_for_the_ways_of_its_direction(read, direction, straight, left):
    light = cr.traffic_light(7, ("red", 10), direction=direction)
    line = read(junction('<trafficLightRef ref="7"/>', light)).stop_lines[0]
    assert dict(line.light_ids) == {2: straight, 3: left}


def test_of_two_lights_for_one_way_green_counts_more_than_red_and_dark_does_not_count(read):
    lights = cr.traffic_light(7, ("red", 2), ("inactive", 2)) + cr.traffic_light(8, ("green", 1), ("yellow", 3))
    refs = '<trafficLightRef ref="7"/><trafficLightRef ref="8"/>'
    shown = shown_together(list(read(junction(refs, lights)).traffic_lights), 4)
    assert [SIGNALS[code] for code in shown] == ["green", "yellow", "yellow", "yellow"]


@pytest.mark.parametrize(
    ("main", "arrow", "straight", "right"),
    [
        (("red", "straightRight"), "green", "red", "green"),
        (("red", "straightRight"), "inactive", "red", "red"),
        (("inactive", "straightRight"), "inactive", "dark", "dark"),
        (("yellow", "all"), "green", "yellow", "green"),
    ],
)
def test_a_light_for_the_right_turn_counts_beside_one_for_all(read, main, arrow, straight, right):
    lights = cr.traffic_light(7, (main[0], 10), direction=main[1]), cr.traffic_light(8, (arrow, 10), direction="right")
    scenario = read(with_right_turn(*lights))
    by_way = dict(scenario.stop_lines[0].light_ids)
    known = {light.id: light for light in scenario.traffic_lights}
    shown = [SIGNALS[shown_together([known[i] for i in by_way[way]], 1)[0]] for way in (2, 5)]
    assert shown == [straight, right]


def test_a_line_lies_where_its_points_are_and_otherwise_at_the_end_of_its_lanelet(read):
    light, ref = cr.traffic_light(7, ("red", 10)), '<trafficLightRef ref="7"/>'
    points = cr.point(95, 2) + cr.point(95, -2)
    stated = read(junction(STOP_LINE.format(points, ref), light)).stop_lines[0]
    np.testing.assert_array_equal(stated.ends, [[95, 2], [95, -2]])
    without = read(junction(STOP_LINE.format("", ref), light)).stop_lines[0]
    np.testing.assert_array_equal(without.ends, [[100, 2], [100, -2]])
    derived = read(junction(ref, light)).stop_lines[0]
    np.testing.assert_array_equal(derived.ends, [[100, 2], [100, -2]])
    assert stated.is_stated and without.is_stated and not derived.is_stated


def test_a_stop_sign_counts_at_the_end_of_its_lanelet_and_a_yield_sign_does_not(read):
    scenario = read(junction('<trafficSignRef ref="7"/>', cr.sign(7, "206")))
    assert [(line.lanelet_id, line.has_stop_sign) for line in scenario.stop_lines] == [(1, True)]
    assert read(junction('<trafficSignRef ref="7"/>', cr.sign(7, "205"))).stop_lines == ()


def test_the_sign_of_a_town_is_a_limit_of_50_km_per_hour_where_there_is_no_other(read):
    refs = '<trafficSignRef ref="7"/>'
    assert read(junction(refs, cr.sign(7, "310"))).lanelets.speed_limit[0] == pytest.approx(50 / 3.6)
    both = refs + '<trafficSignRef ref="8"/>'
    assert read(junction(both, cr.sign(7, "310") + cr.speed_sign(8, 20.0))).lanelets.speed_limit[0] == 20.0
    zone = cr.speed_sign(7, 8.0).replace(">274<", ">274.1<")
    assert read(junction(refs, zone)).lanelets.speed_limit[0] == 8.0


@pytest.mark.parametrize(("country", "code", "limit"), [("USA", "R2-1", 13.4112), ("CHN", "274", 13.8889)])
def test_limits_are_metres_per_second_in_every_country(read, country, code, limit):
    sign = cr.speed_sign(7, limit).replace(">274<", f">{code}<")
    text = junction('<trafficSignRef ref="7"/>', sign).replace("ZAM_Test", f"{country}_Test")
    assert read(text).lanelets.speed_limit[0] == limit


@pytest.mark.parametrize(("limit", "n"), [(45.0, 0), (50.0, 1)])
def test_a_limit_that_is_probably_in_km_per_hour_is_kept_and_noted(read, limit, n):
    scenario = read(junction('<trafficSignRef ref="7"/>', cr.speed_sign(7, limit)))
    assert scenario.lanelets.speed_limit[0] == limit
    assert sum("probably km/h" in note and note.endswith(" 7") for note in scenario.notes) == n


@pytest.mark.parametrize(("own", "limit"), [(8.0, 8.0), (12.0, 10.0)])
def test_of_a_sign_and_the_limit_of_a_lanelet_in_2018b_the_lower_one_counts(read, own, limit):
    text = junction(f'<trafficSignRef ref="7"/><speedLimit>{own}</speedLimit>', cr.speed_sign(7, 10.0))
    text = text.replace('commonRoadVersion="2020a"', 'commonRoadVersion="2018b"')
    assert read(text).lanelets.speed_limit[0] == limit


def test_a_line_whose_ways_have_different_lights_is_divided_among_them(read):
    lights = cr.traffic_light(7, ("red", 10), direction="left") + cr.traffic_light(
        8, ("green", 3), ("yellow", 7), direction="straight"
    )
    scenario = read(junction('<trafficLightRef ref="7"/><trafficLightRef ref="8"/>', lights))
    ends, shown = shown_at_lines(scenario.traffic_lights, scenario.stop_lines, 2, 3)
    np.testing.assert_array_equal(ends, [[[100, 2], [100, 0]], [[100, 0], [100, -2]]])
    straight, left = ([SIGNALS[code] for code in row] for row in shown)
    assert (straight, left) == (["green", "yellow", "yellow"], ["red"] * 3)


@pytest.mark.parametrize(
    ("country", "sign", "rank"),
    [
        ("DEU", "205", (2, 2, 2)),
        ("DEU", "206", (1, 1, 1)),
        ("DEU", "306", (4, 5, 4)),
        ("DEU", "301", (4, 5, 4)),
        ("USA", "R1-2", (2, 2, 2)),
        ("USA", "R3-4", None),
        ("DEU", "102", None),
    ],
)
def test_a_sign_of_priority_counts_at_the_end_of_its_lanelet(read, country, sign, rank):
    text = junction('<trafficSignRef ref="7"/>', cr.sign(7, sign)).replace("ZAM_Test", f"{country}_Test")
    assert text.count(f"{country}_Test") == 1
    assert dict(read(text).priorities.ranks) == ({} if rank is None else {1: rank})


@pytest.mark.parametrize("sign", PRIORITY_SIGNS, ids=lambda sign: sign.name)
def test_the_numbers_of_a_sign_of_priority_count_in_every_country(read, sign):
    for number in sign.numbers:
        for country in ("DEU", "FRA"):
            text = junction('<trafficSignRef ref="7"/>', cr.sign(7, number)).replace("ZAM_Test", f"{country}_Test")
            assert dict(read(text).priorities.ranks) == {1: sign.ranks}, (country, number)


def test_without_a_sign_a_way_is_worth_more_than_with_one_to_give_way_and_less_than_with_priority():
    stop, give_way, priority = (sign_of(kind).ranks for kind in SIGN_KINDS)
    for turn in range(3):
        assert stop[turn] < give_way[turn] < _core.RANK_WITHOUT_SIGN < priority[turn]
    assert stop == (_core.STOP_RANK,) * 3


def test_a_number_is_that_of_one_sign():
    numbers = [number for sign in PRIORITY_SIGNS for number in sign.numbers]
    assert len(numbers) == len(set(numbers)) and GREEN_ARROW_NUMBER not in numbers


def test_green_and_dark_lights_let_go():
    assert {SIGNALS[code] for code in GOING_SIGNALS} == {"green", "dark"}


def test_the_side_of_driving_follows_from_neighbours_and_else_from_the_country(read):
    beside = cr.lanelet(
        4, left=((200, 2), (0, 2)), right=((200, 6), (0, 6)), more='<adjacentLeft ref="1" drivingDir="opposite"/>'
    )
    for country, right_hand, side in (("DEU", False, "right"), ("JPN", True, "left"), ("GBR", True, "none")):
        text = junction().replace("ZAM_Test", f"{country}_Test")
        found = read(text).priorities
        assert (found.left_hand, found.priority_side) == (right_hand, side)
        assert not read(text.replace("</commonRoad>", beside + "</commonRoad>")).priorities.left_hand


def test_driveways_are_minor_roads_and_main_roads_are_derived_in_america(read):
    found = read(junction("<laneletType>driveWay</laneletType>")).priorities
    assert found.minor == (1,) and not found.derives_main_road
    assert read(junction().replace("ZAM_Test", "USA_Test")).priorities.derives_main_road


def test_main_roads_are_derived_in_files_of_2018b(read):
    assert read(cr.document(version="2018b")).priorities.derives_main_road
    assert not read(cr.document(version="2020a")).priorities.derives_main_road


def goes_first(scenario):
    """Of every two lanelets that share an area the one whose vehicles go first."""
    areas = core_scenario(scenario, core_road(scenario, RoadSettings())).junctions()
    pairs = zip(areas["lanelet"].tolist(), areas["first"].tolist(), strict=True)
    return {tuple(pair): pair[first] for pair, first in pairs if first >= 0}


def test_at_a_t_junction_angles_decide_whatever_is_said_to_be_left_of_what(read):
    found = goes_first(read(t_junction()))
    # The left turn from the west waits for the east, the east for the north, the north for the west.
    crossing = {(12, 21): 21, (12, 22): 22, (21, 31): 31, (21, 32): 32, (11, 31): 11, (12, 31): 12}
    assert found == crossing
    # SUMO's traffic in files of 2018b ran by the class of roads: the north waits for both.
    assert goes_first(read(t_junction("2018b"))) == crossing | {(21, 31): 21, (21, 32): 21}


def test_the_old_name_of_a_turn_leads_to_the_new_one():
    with pytest.raises(ImportError, match=r"Way is now called interdrive\.scenario\.Turn"):
        from interdrive.scenario import Way  # noqa: F401
