"""Documents that commonroad-io refuses although they mean something, and what of it remains."""

import math

import numpy as np
import pytest
from commonroad.scenario.traffic_sign import SupportedTrafficSignCountry, TrafficSignIDCountries
from commonroad_documents import (
    RECTANGLE,
    car,
    document,
    driven,
    goal,
    initial,
    lanelet,
    planning_problem,
    point,
    rectangle_at,
    saved,
    sign,
    speed_sign,
    state,
    traffic_light,
)

import interdrive as idr
from interdrive import read_scenario

LINE = f"<stopLine>{point(100, 2)}{point(100, -2)}<lineMarking>solid</lineMarking></stopLine>"
LIT = lanelet(1, more=f'<successor ref="2"/>{LINE}<trafficLightRef ref="7"/>') + lanelet(
    2, left=((100, 2), (200, 2)), right=((100, -2), (200, -2)), more='<predecessor ref="1"/>'
)


@pytest.fixture
def read(tmp_path):
    return lambda text: read_scenario(saved(tmp_path, text))


@pytest.mark.parametrize("cycle", ["", "<cycle/>", "<cycle><timeOffset>3</timeOffset></cycle>"])
def test_a_light_without_a_cycle_is_dark_and_noted(read, cycle):
    light = f'<trafficLight id="7">{cycle}<position>{point(0, 0)}</position><active>true</active></trafficLight>'
    scenario = read(document(light, lanelets=LIT))
    assert scenario.traffic_lights[0].phases == ()
    assert "traffic lights without a cycle are dark: 7" in scenario.notes


def test_a_light_that_is_switched_off_is_dark_and_noted(read):
    light = traffic_light(7, ("red", 10), ("green", 10)).replace("<active>true", "<active>false")
    scenario = read(document(light, lanelets=LIT))
    assert scenario.traffic_lights[0].phases == ()
    assert "traffic lights that are switched off are dark: 7" in scenario.notes


def test_a_light_with_a_cycle_is_not_noted(read):
    assert read(document(traffic_light(7, ("red", 10), ("green", 10)), lanelets=LIT)).notes == ()


@pytest.mark.parametrize(
    ("phases", "note"),
    [
        ((("red", 10), ("green", 0)), "phases without a positive duration left out, traffic lights: 7"),
        ((("red", 10), ("green", -5)), "phases without a positive duration left out, traffic lights: 7"),
        ((("red", 10), ("red", 5)), "traffic lights that are always red: 7"),
        ((("red", 10), ("green", 0)), "traffic lights that are always red: 7"),
        ((("red", 10), ("yellow", 5)), "traffic lights that are never green: 7"),
        ((("yellow", 5), ("green", -1)), "traffic lights that are never green: 7"),
        ((("inactive", 5),), "traffic lights that never show a colour are dark: 7"),
        ((("red", 0), ("green", 0)), "traffic lights that never show a colour are dark: 7"),
    ],
)
def test_a_light_that_cannot_work_is_noted(read, phases, note):
    assert note in read(document(traffic_light(7, *phases), lanelets=LIT)).notes


@pytest.mark.parametrize(
    ("x", "y", "is_noted"), [(100, 0, False), (101.5, 0, False), (150, 0, True), (50, 9, True), (-5, 0, True)]
)
def test_a_stop_line_away_from_its_lanelet_is_noted(read, x, y, is_noted):
    line = f"<stopLine>{point(x, y + 2)}{point(x, y - 2)}<lineMarking>solid</lineMarking></stopLine>"
    lit = LIT.replace(LINE, line)
    notes = read(document(traffic_light(7, ("red", 10), ("green", 10)), lanelets=lit)).notes
    assert ("stop lines more than 2 m from their lanelet, lanelets: 1" in notes) == is_noted


@pytest.mark.parametrize(
    ("ends", "note"),
    [
        (((100, 2), (100, -2)), None),
        (((98, 2), (100, -2)), None),
        (((100, 0), (100, 0)), "stop lines without a length, lanelets: 1"),
        (((100, 0.04), (100, 0)), "stop lines without a length, lanelets: 1"),
        (((90, 0), (100, 0)), "stop lines along their lanelet instead of across it, lanelets: 1"),
        (((100, -2), (92, 2)), "stop lines along their lanelet instead of across it, lanelets: 1"),
    ],
)
def test_a_stop_line_that_nobody_crosses_is_noted(read, ends, note):
    line = f"<stopLine>{point(*ends[0])}{point(*ends[1])}<lineMarking>solid</lineMarking></stopLine>"
    lit = LIT.replace(LINE, line)
    notes = read(document(traffic_light(7, ("red", 10), ("green", 10)), lanelets=lit)).notes
    assert notes == (() if note is None else (note,))


@pytest.mark.parametrize(
    ("ends", "note"),
    [
        (((100, 2), (100, -2)), None),
        (((100, 0), (100, 0)), "stop lines without a length, lanelets: 1"),
        (((90, 0), (100, 0)), "stop lines along their lanelet instead of across it, lanelets: 1"),
        (((150, 2), (150, -2)), "stop lines more than 2 m from their lanelet, lanelets: 1"),
    ],
)
def test_a_stop_line_without_a_light_or_a_sign_is_noted_too(read, ends, note):
    line = f"<stopLine>{point(*ends[0])}{point(*ends[1])}<lineMarking>solid</lineMarking></stopLine>"
    bare = LIT.replace(LINE, line).replace('<trafficLightRef ref="7"/>', "")
    assert read(document("", lanelets=bare)).notes == (() if note is None else (note,))


def test_a_stop_line_across_a_road_that_leads_north_is_not_noted(read):
    line = f"<stopLine>{point(-2, 100)}{point(2, 100)}<lineMarking>solid</lineMarking></stopLine>"
    north = lanelet(1, left=((-2, 0), (-2, 100)), right=((2, 0), (2, 100)), more=line)
    assert read(document("", lanelets=north)).notes == ()


@pytest.mark.parametrize(
    ("direction", "is_noted"),
    [
        ("all", False),
        ("straight", False),
        ("leftStraight", False),
        ("left", True),
        ("right", True),
        ("leftRight", True),
    ],
)
def test_a_light_for_turns_that_its_lanelet_does_not_take_is_noted(read, direction, is_noted):
    """The lanelet leads straight on only."""
    light = traffic_light(7, ("red", 10), ("green", 10), direction=direction)
    note = "traffic lights whose direction fits no way of their lanelet: 7"
    assert (note in read(document(light, lanelets=LIT)).notes) == is_noted


def test_a_light_at_the_end_of_the_map_may_be_for_any_turn(read):
    end = lanelet(1, more=f'{LINE}<trafficLightRef ref="7"/>')
    light = traffic_light(7, ("red", 10), ("green", 10), direction="left")
    assert read(document(light, lanelets=end)).notes == ()


@pytest.mark.parametrize(
    "ends", [(-math.pi, math.pi), (0.0, 2.0 * math.pi), (-3.2, 3.2), (-10.0, 10.0), (-3.1415927, 3.1415927)]
)
def test_a_goal_of_a_full_turn_of_headings_is_any_heading(read, ends):
    area = rectangle_at(50, 0, length=10, width=4)
    scenario = read(document(planning_problem(9, goal(position=area, orientation=ends))))
    assert scenario.planning_problems[0].goal[0].orientation is None


def test_a_goal_of_half_a_turn_is_kept(read):
    scenario = read(document(planning_problem(9, goal(orientation=(-1.5, 1.6)))))
    assert scenario.planning_problems[0].goal[0].orientation == pytest.approx((-1.5, 1.6))


def test_a_vehicle_recorded_with_any_heading_has_that_of_its_motion(read):
    first = state(0, 10.0, tag="initialState", orientation=(-math.pi, math.pi), velocity=10.0)
    states = [state(step, 10.0 + step, step, orientation=(-4.0, 4.0), velocity=14.0) for step in (1, 2, 3)]
    found = driven(read(document(car(30, first, states))))
    assert found["orientation"][1:3] == pytest.approx([math.pi / 4] * 2)


def test_a_planning_problem_that_starts_with_any_heading_is_refused_by_name(read):
    start = state(0, 5.0, tag="initialState", orientation=(-math.pi, math.pi), velocity=5.0, yawRate=0.0, slipAngle=0.0)
    with pytest.raises(idr.InputError, match="planning problem 9 starts with any heading; state one"):
        read(document(planning_problem(9, goal(), start=start)))


@pytest.mark.parametrize("kind", ["building", "pillar", "median_strip", "unknown"])
def test_an_environment_obstacle_is_a_static_one_where_it_stands(read, kind):
    corners = "".join(point(x, y) for x, y in ((60, 5), (80, 5), (80, 15), (60, 15)))
    shape = f"<shape><polygon>{corners}</polygon></shape>"
    obstacles = read(
        document(f'<environmentObstacle id="9"><type>{kind}</type>{shape}</environmentObstacle>')
    ).obstacles
    assert (obstacles.ids.tolist(), obstacles.is_static.tolist()) == ([9], [True])
    assert obstacles.kinds == ("unknown" if kind == "unknown" else "structure",)
    assert (obstacles.x[0, 0], obstacles.y[0, 0]) == (70.0, 10.0)
    # A polygon with right angles is a rectangle.
    assert (obstacles.shapes[0].length, obstacles.shapes[0].width) == (20.0, 10.0)


def test_what_a_building_of_the_environment_hides_is_not_seen(read):
    seen = {}

    class Looking:
        def plan(self, view, predictions):
            if view.time_step == 0:
                seen[building] = 30 in view.ids.tolist()
            ego = view.ego
            return idr.Trajectory(*(np.full(2, value) for value in (ego.x, ego.y, ego.orientation, 0.0)))

    walls = "".join(point(x, y) for x, y in ((40, 3), (50, 3), (50, 14), (40, 14)))
    for building in (False, True):
        shape = f"<type>building</type><shape><polygon>{walls}</polygon></shape>"
        wall = f'<environmentObstacle id="9">{shape}</environmentObstacle>'
        shape = f"<type>car</type><shape>{RECTANGLE}</shape>{initial(70, 12.0, velocity=None)}"
        parked = f'<staticObstacle id="30">{shape}</staticObstacle>'
        area = rectangle_at(80, 0, length=10, width=4)
        start = initial(5.0, velocity=0.0, yawRate=0.0, slipAngle=0.0)
        scenario = read(document(wall * building + parked + planning_problem(99, goal(position=area), start=start)))
        idr.simulate(scenario, agents=[99], planner=Looking, settings={"view.occlusion": True})
    assert seen == {False: True, True: False}


@pytest.mark.parametrize(
    ("shape", "x", "y"),
    [
        (rectangle_at(1.5, 0, length=4.5, width=1.8), 11.5, 0.0),
        (rectangle_at(1.5, 1.0, length=4.5, width=1.8, orientation=0.5), 11.5, 1.0),
        ("<circle><radius>1.0</radius><center><x>-2</x><y>3</y></center></circle>", 8.0, 3.0),
        (f"<polygon>{''.join(point(*p) for p in ((0, -1), (4, -1), (4, 1), (0, 1)))}</polygon>", 12.0, 0.0),
        (rectangle_at(0, 0, length=4, width=2) + rectangle_at(4, 0, length=4, width=2), 12.0, 0.0),
    ],
)
def test_a_vehicle_is_where_the_centre_of_its_footprint_is(read, shape, x, y):
    states = [state(step, 10.0 + step, orientation=0.0, velocity=10.0) for step in (1, 2)]
    scenario = read(document(car(30, initial(10.0), states, shape=shape)))
    found = driven(scenario)
    assert (found["x"][0], found["y"][0]) == pytest.approx((x, y))
    assert found["x"][2] - found["x"][0] == pytest.approx(2.0)
    assert scenario.obstacles.shapes[0].middle == pytest.approx((0.0, 0.0))


def test_a_centre_ahead_of_the_state_turns_with_the_heading(read):
    states = [state(step, 10.0, 10.0 * step, orientation=math.pi / 2, velocity=10.0) for step in (1, 2)]
    shape = rectangle_at(1.5, 0.5, length=4.5, width=1.8)
    found = driven(read(document(car(30, initial(10.0, orientation=math.pi / 2), states, shape=shape))))
    assert (found["x"][1], found["y"][1]) == pytest.approx((10.0 - 0.5, 10.0 + 1.5))


EVERY_SIGN = [
    (country.value, str(element.value))
    for country in SupportedTrafficSignCountry
    for element in TrafficSignIDCountries[country.value]
    if element.value
]


@pytest.mark.parametrize("country", sorted({country for country, _ in EVERY_SIGN}))
def test_every_sign_of_every_country_is_read(read, country):
    codes = [code for name, code in EVERY_SIGN if name == country]
    signs = "".join(sign(100 + k, code) for k, code in enumerate([*codes, "274", "no such sign"]))
    refs = "".join(f'<trafficSignRef ref="{100 + k}"/>' for k in range(len(codes) + 2))
    text = document(signs, lanelets=lanelet(1, more=refs)).replace("ZAM_Test", f"{country}_Test")
    assert read(text).benchmark_id == f"{country}_Test-1_1_T-1"


@pytest.mark.parametrize("country", [*(one.value for one in SupportedTrafficSignCountry), "GBR"])
def test_a_limit_of_2018b_and_a_sign_274_are_read_in_every_country(read, country):
    old = document(lanelets=lanelet(1, more="<speedLimit>13.5</speedLimit>"), version="2018b")
    new = document(speed_sign(9, 13.5), lanelets=lanelet(1, more='<trafficSignRef ref="9"/>'))
    for text in (old, new):
        assert read(text.replace("ZAM_Test", f"{country}_Test")).lanelets.speed_limit.tolist() == [13.5]
