"""Footprints that are made elsewhere than at the position of their states give what those at the position give."""

import math

import commonroad_documents as cr
import numpy as np
import pytest
from drivers import Straight

from interdrive import read_scenario, score, simulate
from interdrive.criticality import MEASURES, evaluate
from interdrive.files import run_document
from interdrive.results import outcome_table
from interdrive.scenario import Shape
from interdrive.scenario.shape import centred


def rectangle(length=4.0, width=2.0, *, center=None, orientation=None):
    turn = "" if orientation is None else f"<orientation>{orientation}</orientation>"
    at = "" if center is None else f"<center><x>{center[0]}</x><y>{center[1]}</y></center>"
    return f"<rectangle><length>{length}</length><width>{width}</width>{turn}{at}</rectangle>"


def polygon(*points):
    return f"<polygon>{''.join(cr.point(*one) for one in points)}</polygon>"


def corners(x, y, heading=0.0, length=4.0, width=2.0):
    cos, sin = math.cos(heading), math.sin(heading)
    half = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    return [
        (x + cos * a * length / 2 - sin * b * width / 2, y + sin * a * length / 2 + cos * b * width / 2)
        for a, b in half
    ]


def parked(number, shape, x=0.0, y=0.0, orientation=0.0, *, version="2020a"):
    start = cr.state(0, x, y, tag="initialState", orientation=orientation)
    if version == "2018b":
        inside = f"<role>static</role><type>parkedVehicle</type><shape>{shape}</shape>{start}"
        return f'<obstacle id="{number}">{inside}</obstacle>'
    return f'<staticObstacle id="{number}"><type>parkedVehicle</type><shape>{shape}</shape>{start}</staticObstacle>'


def driving(number, shape, x, y=0.0, *, orientation=0.0, velocity=4.0, steps=60):
    step = 0.1 * velocity
    at = [(x + step * i * math.cos(orientation), y + step * i * math.sin(orientation)) for i in range(steps + 1)]
    states = [cr.state(i, *at[i], orientation=orientation, velocity=velocity) for i in range(1, steps + 1)]
    return cr.car(number, cr.initial(*at[0], orientation=orientation, velocity=velocity), states, shape=shape)


def scenario(tmp_path, *obstacles, version="2020a", name="test.xml"):
    lanelet = cr.lanelet(1, left=((0, 2), (150, 2)), right=((0, -2), (150, -2)))
    start = cr.initial(10.0, yawRate=0.0, slipAngle=0.0)
    area = cr.rectangle_at(120, 0, length=10, width=4)
    problem = cr.planning_problem(60, cr.goal(position=area, time=(0, 200)), start=start)
    text = cr.document("".join(obstacles) + problem, lanelets=lanelet, version=version)
    return read_scenario(cr.saved(tmp_path, text, name))


def numbers(found):
    """Everything that a run of the scenario says: states, reasons, harm, criticality, views."""
    seen = []

    class Watching(Straight):
        def plan(self, view, predictions):
            seen.append([view.x[:, -1], view.y[:, -1], view.orientation[:, -1], view.length, view.width])
            return super().plan(view, predictions)

    run = simulate(found, agents=[60], planner=Watching, threads=1)
    measures = evaluate(run, threads=1)
    values = {measure.name: measures[measure.name] for measure in MEASURES}
    states = {name: getattr(run.states, name) for name in ("x", "y", "orientation", "velocity", "length", "width")}
    table = outcome_table(run).to_pydict()
    return run.outcomes.reason, {**states, **values, "seen": np.array(seen)}, table, score(run)


def assert_same(one, other):
    (reasons, arrays, table, points), (other_reasons, other_arrays, other_table, other_points) = one, other
    assert reasons == other_reasons
    for name, values in arrays.items():
        np.testing.assert_allclose(values, other_arrays[name], atol=1e-9, err_msg=name)
    for name, values in table.items():
        assert values == pytest.approx(other_table[name], abs=1e-9, nan_ok=True), name
    assert str(points) == str(other_points)


HEADING = 0.3
STANDING = {
    "a polygon in world coordinates": (parked(5, polygon(*corners(70, 0))), 70.0, 0.0, 0.0),
    "its vertices clockwise": (parked(5, polygon(*reversed(corners(70, 0)))), 70.0, 0.0, 0.0),
    "a rectangle with a centre": (parked(5, rectangle(center=(70, 0.5))), 70.0, 0.5, 0.0),
    "a centre beside the state": (parked(5, rectangle(center=(1.5, 0)), 68.5), 70.0, 0.0, 0.0),
    "a centre in a turned body frame": (
        parked(5, rectangle(center=(2.0, 0)), 70 - 2 * math.cos(HEADING), -2 * math.sin(HEADING), HEADING),
        70.0,
        0.0,
        HEADING,
    ),
    "a turned rectangle with a centre": (parked(5, rectangle(center=(70, 0), orientation=HEADING)), 70.0, 0.0, HEADING),
    "a turned rectangle at its state": (parked(5, rectangle(orientation=HEADING), 70.0), 70.0, 0.0, HEADING),
    "a turned polygon in world coordinates": (parked(5, polygon(*corners(70, 0, HEADING))), 70.0, 0.0, HEADING),
    "a polygon across the road": (parked(5, polygon(*corners(70, 0, math.pi / 2))), 70.0, 0.0, math.pi / 2),
    "far from the origin of the body frame, with large numbers": (
        parked(5, polygon(*corners(70 - 4e5, 5e6)), 4e5, -5e6),
        70.0,
        0.0,
        0.0,
    ),
    "in 2018b": (None, 70.0, 0.0, 0.0),
}


@pytest.mark.parametrize("name", STANDING)
def test_what_stands_gives_the_same_numbers_however_its_footprint_is_stated(name, tmp_path):
    stated, x, y, heading = STANDING[name]
    version = "2018b" if stated is None else "2020a"
    if stated is None:
        stated = parked(5, polygon(*corners(70, 0)), version=version)
    found = scenario(tmp_path, stated, version=version)
    control = scenario(tmp_path, parked(5, rectangle(), x, y, heading, version=version), version=version)
    assert_same(numbers(found), numbers(control))


def test_a_polygon_in_world_coordinates_is_run_into_from_behind(tmp_path):
    found = scenario(tmp_path, parked(5, polygon(*corners(70, 0))))
    run = simulate(found, agents=[60], planner=Straight, threads=1)
    assert run.outcomes.reason == ("ran into 5 from behind at 10.0 m/s, which is static",)
    assert found.obstacles.x[0, 0] == 70.0
    assert outcome_table(run).to_pylist()[0]["harm"] == pytest.approx(0.031, abs=5e-4)


@pytest.mark.parametrize(
    ("shape", "offset"),
    [
        (rectangle(center=(1.5, 0.2)), (1.5, 0.2)),
        (rectangle(2.0, 4.0, center=(-3.0, 0.0), orientation=math.pi / 2), (-3.0, 0.0)),
        (polygon(*corners(2.0, -0.3)), (2.0, -0.3)),
        (f"<shape>{rectangle(center=(1.0, 0.0))}</shape>", (1.0, 0.0)),
    ],
    ids=["a centre", "length and width exchanged", "a polygon", "a group of one"],
)
def test_a_moving_vehicle_is_where_its_footprint_is(shape, offset, tmp_path):
    ahead, left = offset
    found = scenario(tmp_path, driving(5, shape, 30.0 - ahead, -left))
    control = scenario(tmp_path, driving(5, rectangle(), 30.0, 0.0))
    assert_same(numbers(found), numbers(control))


def test_an_offset_turns_with_a_moving_vehicle(tmp_path):
    heading, ahead, left = 2.0, 1.5, -0.5
    cos, sin = math.cos(heading), math.sin(heading)
    x, y = 40.0 - (ahead * cos - left * sin), -8.0 - (ahead * sin + left * cos)
    found = scenario(tmp_path, driving(5, rectangle(center=(ahead, left)), x, y, orientation=heading))
    control = scenario(tmp_path, driving(5, rectangle(), 40.0, -8.0, orientation=heading))
    np.testing.assert_allclose(found.obstacles.x, control.obstacles.x, atol=1e-9)
    np.testing.assert_allclose(found.obstacles.y, control.obstacles.y, atol=1e-9)


def test_a_circle_and_a_group_are_brought_to_the_position():
    circle, offset, turn = centred(Shape("circle", radius=1.0, center=(3.0, 4.0)), stands=True)
    assert (circle.center, circle.radius, offset, turn) == ((0.0, 0.0), 1.0, (3.0, 4.0), 0.0)
    parts = (Shape("rectangle", 4.0, 2.0, center=(50.0, 1.0)), Shape("circle", radius=1.0, center=(53.0, 1.0)))
    group, offset, turn = centred(Shape("group", members=parts), stands=False)
    # From 48 to 54 m.
    assert (offset, turn) == ((51.0, 1.0), 0.0)
    assert [member.center for member in group.members] == [(-1.0, 0.0), (2.0, 0.0)]


def test_a_footprint_at_its_position_stays_as_it_is():
    for shape in (Shape("rectangle", 4.0, 2.0), Shape("polygon", vertices=np.array([[2.0, 0], [-2, 1], [-2, -1]]))):
        assert centred(shape, stands=False)[0] is shape


def test_headway_and_time_to_collision_count_from_the_footprint(tmp_path):
    def following(shape, x):
        leader = driving(5, shape, x, velocity=4.0)
        return evaluate(scenario(tmp_path, leader, driving(6, rectangle(), 20.0, velocity=10.0)), threads=1)

    found, control = following(rectangle(center=(-8.0, 0.0)), 58.0), following(rectangle(), 50.0)
    # Of 30 m between the centres 26 m are between the cars, which close at 6 m/s.
    assert (found["hw"][1, 0], found["ttc"][1, 0]) == pytest.approx((26.0, 26.0 / 6.0))
    for measure in MEASURES:
        np.testing.assert_allclose(found[measure.name], control[measure.name], atol=1e-9, err_msg=measure.name)


def test_a_written_scenario_keeps_where_the_footprint_is(tmp_path):
    run = simulate(scenario(tmp_path, parked(5, polygon(*corners(70, 0, HEADING)))), agents=[60], threads=1)
    again = read_scenario(cr.saved(tmp_path, run_document(run), "again.xml")).obstacles
    row = again.ids.tolist().index(5)
    assert (again.x[row, 0], again.orientation[row, 0]) == pytest.approx((70.0, HEADING))
    assert again.shapes[row].length == pytest.approx(4.0)
