"""CommonRoad files in: what a document becomes, and what is refused with which words."""

import math
import subprocess
import sys
from pathlib import Path

import commonroad_documents as cr
import numpy as np
import pytest
from commonroad_documents import car, document, driven, exact, goal, initial, lanelet, planning_problem, point, state

from interdrive.errors import InputError
from interdrive.files import read_scenario, scenario_from_commonroad
from interdrive.files.read import quiet
from interdrive.files.shapes import shape_of
from interdrive.scenario.inspection import inspect

# Roads


def test_lanelets_are_sorted_by_id_and_keep_their_relations(read):
    left_of = '<adjacentLeft ref="1" drivingDir="opposite"/><successor ref="3"/>'
    right_of = '<adjacentRight ref="2" drivingDir="same"/>'
    lanelets = read(document(lanelets=lanelet(3) + lanelet(1, more=right_of) + lanelet(2, more=left_of))).lanelets
    assert lanelets.ids.tolist() == [1, 2, 3]
    assert lanelets.adjacent_right.tolist() == [2, -1, -1]
    assert lanelets.adjacent_right_same_direction.tolist() == [True, False, False]
    assert lanelets.adjacent_left.tolist() == [-1, 1, -1]
    assert lanelets.adjacent_left_same_direction.tolist() == [False, False, False]
    assert lanelets.successors == ((), (3,), ())


def test_bounds_keep_their_coordinates_and_lose_their_height(read):
    bounds = {"left": ((0, 2, 5), (100, 2.25, 6)), "right": ((0, -2, 5), (100, -2, 6))}
    lanelets = read(document(lanelets=lanelet(1, **bounds))).lanelets
    np.testing.assert_array_equal(lanelets.left[0], [[0, 2], [100, 2.25]])


def test_speed_limit_of_2018b_is_the_lanelets_own(read):
    lanelets = lanelet(1, more="<speedLimit>13.5</speedLimit>") + lanelet(2)
    np.testing.assert_array_equal(
        read(document(version="2018b", lanelets=lanelets)).lanelets.speed_limit, [13.5, math.nan]
    )


def test_speed_limit_of_2020a_is_that_of_the_lowest_sign(read):
    lanelets = lanelet(1, more='<trafficSignRef ref="7"/><trafficSignRef ref="8"/>')
    text = document(cr.speed_sign(7, 20.0) + cr.speed_sign(8, 13.9), lanelets=lanelets)
    assert read(text).lanelets.speed_limit.tolist() == [13.9]


# Recorded traffic


def test_signs_that_planners_do_not_obey_are_counted_in_a_note(read):
    stop = "<stopLine><lineMarking>solid</lineMarking></stopLine>"
    signs = "".join(
        f'<trafficSign id="{number}"><trafficSignElement><trafficSignID>{code}</trafficSignID>{value}'
        "</trafficSignElement></trafficSign>"
        for number, code, value in (
            (7, 274, "<additionalValue>10</additionalValue>"),
            (8, 206, ""),
            (9, 205, ""),
            (10, 276, ""),
        )
    )
    lanelets = lanelet(1, more=stop + "".join(f'<trafficSignRef ref="{number}"/>' for number in (7, 8, 9, 10)))
    scenario = read(document(signs, lanelets=lanelets))
    one = "1 traffic sign is not obeyed: planners know speed limits, signs of priority and traffic lights only"
    assert [note for note in scenario.notes if "obeyed" in note] == [one]
    assert (inspect(scenario).n_stop_signs, inspect(scenario).n_priority_signs) == (1, 1)
    assert not any("obeyed" in note for note in read(document("")).notes)


def test_crosswalks_are_lanelets_of_that_type_and_those_that_an_intersection_names(read):
    crossing = '<crossing><crossingLanelet ref="3"/></crossing>'
    incoming = '<incoming id="12"><incomingLanelet ref="1"/></incoming>'
    typed = lanelet(2, more="<laneletType>crosswalk</laneletType>")
    found = f'<intersection id="11">{incoming}{crossing}</intersection>'
    scenario = read(document(found, lanelets=lanelet(1) + typed + lanelet(3)))
    assert scenario.crosswalks == (2, 3)
    assert inspect(scenario).n_crosswalks == 2


def test_a_trajectory_is_in_the_tables_at_its_time_steps(read):
    states = [state(t, float(t), orientation=0.5, velocity=10.0, acceleration=0.25, yawRate=0.125) for t in (1, 2, 3)]
    one = driven(read(document(car(30, initial(0.0, orientation=0.5, acceleration=0.25, yawRate=0.125), states))))
    np.testing.assert_array_equal(one["x"], [0, 1, 2, 3])
    np.testing.assert_array_equal(one["orientation"], 0.5)
    np.testing.assert_array_equal(one["acceleration"], 0.25)
    np.testing.assert_array_equal(one["yaw_rate"], 0.125)
    assert one["valid"].all()


def test_absent_obstacles_are_not_valid_and_nan(read):
    late = car(30, initial(1.0, time=1), [state(2, 2.0, orientation=0.0, velocity=10.0)])
    long = car(31, initial(0.0, y=1.0), [state(t, 1.0 * t, 1.0, orientation=0.0, velocity=10.0) for t in range(1, 5)])
    scenario = read(document(late + long))
    one = driven(scenario)
    assert scenario.obstacles.n_steps == 5
    assert one["valid"].tolist() == [False, True, True, False, False]
    assert np.isnan(one["x"][[0, 3, 4]]).all()
    assert np.isnan(one["velocity"][[0, 3, 4]]).all()


def test_a_gap_in_a_trajectory_stays_a_gap_and_is_noted(read):
    states = [state(t, 1.0 * t, orientation=0.0, velocity=10.0) for t in (1, 4)]
    scenario = read(document(car(30, initial(0.0), states)))
    assert driven(scenario)["valid"].tolist() == [True, True, False, False, True]
    assert "absent between recorded time steps, obstacles: 30" in scenario.notes


def test_an_initial_state_repeated_in_the_trajectory_counts_once(read):
    states = [state(t, 1.0 * t, orientation=0.0, velocity=10.0) for t in (0, 1, 2)]
    assert driven(read(document(car(30, initial(0.0), states))))["x"].tolist() == [0.0, 1.0, 2.0]


def test_of_two_different_states_at_a_time_step_the_first_counts_and_that_is_noted(read):
    states = [state(t, x, orientation=0.0, velocity=10.0) for t, x in ((1, 1.0), (2, 2.0), (2, 50.0), (3, 3.0))]
    scenario = read(document(car(30, initial(0.0), states)))
    assert driven(scenario)["x"].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert "a time step stated twice at different places, the first counts, obstacles: 30" in scenario.notes


def test_velocity_is_derived_along_the_heading(read):
    """Backwards along -x with the nose to +x: speed -20 m/s."""
    states = [state(t, -2.0 * t, orientation=0.0) for t in (1, 2, 3)]
    scenario = read(document(car(30, initial(0.0, velocity=None), states)))
    np.testing.assert_allclose(driven(scenario)["velocity"], -20.0)
    assert "velocity derived from the motion, obstacles: 30" in scenario.notes


def test_accelerations_that_only_some_state_are_noted_and_those_that_nobody_states_are_not(read):
    without = [state(t, 1.0 * t, orientation=0.0, velocity=10.0) for t in (1, 2)]
    stating = [state(t, 1.0 * t, orientation=0.0, velocity=10.0, acceleration=0.0) for t in (1, 2)]
    derived = [car(30, initial(0.0), without), car(31, initial(9.0), without)]
    assert not [note for note in read(document("".join(derived))).notes if "derived" in note]
    stated = car(31, initial(0.0, acceleration=0.0), stating)
    notes = read(document(car(30, initial(0.0), without) + stated)).notes
    assert "acceleration derived from the motion, obstacles: 30" in notes
    assert not [note for note in notes if "yaw rate derived" in note]


def test_acceleration_and_yaw_rate_are_derived_from_speed_and_heading(read):
    """Speed grows by 0.2 m/s and heading by 0.01 rad per step of 0.1 s, through the jump from pi to -pi."""
    headings = [math.remainder(3.13 + 0.01 * t, math.tau) for t in range(5)]
    states = [state(t, -1.0 * t, orientation=headings[t], velocity=10.0 + 0.2 * t) for t in range(1, 5)]
    one = driven(read(document(car(30, initial(0.0, orientation=headings[0]), states))))
    np.testing.assert_allclose(one["acceleration"], 2.0)
    np.testing.assert_allclose(one["yaw_rate"], 0.1)


def test_a_missing_orientation_follows_the_motion_and_stands_still_with_the_vehicle(read):
    """North, then standing: the heading stays north; commonroad-io fills the missing initial one with 0."""
    places = [0.0, 1.0, 2.0, 2.0, 2.0, 2.0]
    states = [state(t, 0.0, places[t], velocity=10.0) for t in range(1, 6)]
    scenario = read(document(car(30, initial(0.0, orientation=None), states)))
    np.testing.assert_allclose(driven(scenario)["orientation"], math.pi / 2)


def test_orientations_are_wrapped_to_half_turns(read):
    states = [state(1, 1.0, orientation=4.0, velocity=10.0)]
    np.testing.assert_allclose(
        driven(read(document(car(30, initial(0.0, orientation=-6.0), states))))["orientation"],
        [
            -6.0 + math.tau,
            4.0 - math.tau,
        ],
    )


def test_a_point_mass_has_two_velocities_along_the_axes_of_the_world(read):
    states = [state(t, 0.3 * t, 0.4 * t, velocity=3.0, velocityY=4.0) for t in (1, 2)]
    one = driven(read(document(car(30, initial(0.0, orientation=math.atan2(4, 3), velocity=5.0), states))))
    np.testing.assert_allclose(one["velocity"], 5.0)
    np.testing.assert_allclose(one["orientation"], math.atan2(4, 3))


@pytest.mark.parametrize(
    "more",
    [
        {"steeringAngle": 0.0},
        {"steeringAngle": 0.0, "yawRate": 0.0, "slipAngle": 0.0},
        {"acceleration": 0.0, "jerk": 0.0},
        {"curvature": 0.0, "rollAngle": 0.0, "pitchAngle": 0.0},
    ],
    ids=["KS", "ST", "custom", "more custom"],
)
def test_every_class_of_states_is_read(read, more):
    states = [state(t, 1.0 * t, orientation=0.0, velocity=10.0, **more) for t in (1, 2)]
    np.testing.assert_array_equal(driven(read(document(car(30, initial(0.0), states))))["velocity"], 10.0)


def test_uncertain_states_become_their_middle_and_are_noted(read):
    area = cr.rectangle_at(1, 3, length=2, width=2)
    states = [state(1, None, position=area, orientation=(0.1, 0.3), velocity=(9.0, 13.0))]
    scenario = read(document(car(30, initial(0.0), states)))
    one = driven(scenario)
    assert (one["x"][1], one["y"][1]) == (1.0, 3.0)
    assert one["velocity"][1] == 11.0
    assert one["orientation"][1] == pytest.approx(0.2)
    assert "uncertain states replaced by their middle, obstacles: 30" in scenario.notes


def test_a_set_based_prediction_leaves_the_obstacle_at_its_initial_time_step_only(read):
    area = "<polygon>" + point(0, 0) + point(4, 0) + point(4, 2) + "</polygon>"
    sets = f"<occupancySet><occupancy><shape>{area}</shape>{exact('time', 1)}</occupancy></occupancySet>"
    scenario = read(
        document(car(30, initial(0.0), prediction=sets) + car(31, initial(50.0), [state(1, 51.0, orientation=0.0)]))
    )
    assert driven(scenario)["valid"].tolist() == [True, False]
    assert any(note.startswith("set-based predictions left out") and "30" in note for note in scenario.notes)


def test_static_obstacles_are_there_at_every_step_and_never_move(read):
    still = (
        f'<staticObstacle id="9"><type>parkedVehicle</type><shape>{cr.RECTANGLE}</shape>{initial(7.0)}</staticObstacle>'
    )
    scenario = read(document(still + car(30, initial(0.0), [state(t, 1.0 * t, orientation=0.0) for t in (1, 2)])))
    one = driven(scenario, 9)
    assert scenario.obstacles.is_static.tolist() == [True, False]
    assert scenario.obstacles.kinds == ("parked_vehicle", "car")
    assert one["valid"].all()
    np.testing.assert_array_equal(one["x"], 7.0)
    np.testing.assert_array_equal(one["velocity"], 0.0)


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (cr.RECTANGLE, {"kind": "rectangle", "length": 4.5, "width": 1.8}),
        (
            cr.rectangle_at(1.5, -1, length=4, width=2, orientation=0.5),
            {"kind": "rectangle", "length": 4.0, "center": (0.0, 0.0), "orientation": 0.5},
        ),
        ("<circle><radius>0.4</radius></circle>", {"kind": "circle", "radius": 0.4, "center": (0.0, 0.0)}),
        (
            "<circle><radius>1</radius><center><x>2</x><y>3</y></center></circle>",
            {"kind": "circle", "center": (0.0, 0.0)},
        ),
    ],
    ids=["rectangle", "rectangle off its origin", "circle", "circle off its origin"],
)
def test_footprints_are_read_about_their_centre(read, shape, expected):
    footprint = read(document(car(30, initial(0.0), [state(1, 1.0, orientation=0.0)], shape=shape))).obstacles.shapes[0]
    assert {name: getattr(footprint, name) for name in expected} == expected


def test_polygon_footprints_keep_their_vertices_without_a_repeated_last_one(read):
    corners = [(0, 0), (4, 0), (4, 2), (1, 3), (0, 0)]
    shape = f"<polygon>{''.join(point(*corner) for corner in corners)}</polygon>"
    footprint = read(document(car(30, initial(0.0), [state(1, 1.0, orientation=0.0)], shape=shape))).obstacles.shapes[0]
    np.testing.assert_array_equal(footprint.vertices, np.array(corners[:-1]) - (2.0, 1.5))


def test_footprints_of_several_parts_are_groups(read):
    shape = cr.RECTANGLE + "<circle><radius>1</radius><center><x>2</x><y>0</y></center></circle>"
    footprint = read(document(car(30, initial(0.0), [state(1, 1.0, orientation=0.0)], shape=shape))).obstacles.shapes[0]
    assert footprint.kind == "group"
    assert [member.kind for member in footprint.members] == ["rectangle", "circle"]


# Planning problems


def test_a_goal_area_keeps_its_shape_time_speed_and_heading(read):
    area = cr.rectangle_at(90, 1, length=6, width=3, orientation=0.25)
    text = document(planning_problem(60, goal(position=area, time=(10, 20), velocity=(5, 8), orientation=(-0.5, 0.5))))
    problem = read(text).planning_problems[0]
    one = problem.goal[0]
    assert (problem.id, one.time_step, one.velocity, one.orientation) == (60, (10, 20), (5.0, 8.0), (-0.5, 0.5))
    assert (one.areas[0].kind, one.areas[0].center, one.areas[0].orientation) == ("rectangle", (90.0, 1.0), 0.25)


def test_goal_lanelets_become_one_polygon_each(read):
    lanelets = lanelet(1) + lanelet(2, left=((100, 2), (200, 2)), right=((100, -2), (200, -2)))
    text = document(planning_problem(60, goal(position='<lanelet ref="2"/><lanelet ref="1"/>')), lanelets=lanelets)
    one = read(text).planning_problems[0].goal[0]
    assert one.lanelet_ids == (2, 1)
    np.testing.assert_array_equal(one.areas[0].vertices, [[100, 2], [200, 2], [200, -2], [100, -2]])


def test_a_goal_without_position_has_no_areas_and_several_goals_are_alternatives(read):
    problem = read(document(planning_problem(60, goal(time=(1, 5)) + goal(time=(6, 9))))).planning_problems[0]
    assert [(one.areas, one.time_step) for one in problem.goal] == [((), (1, 5)), ((), (6, 9))]


def test_a_missing_goal_is_an_empty_tuple_and_noted(read):
    scenario = read(document(planning_problem(60, "")))
    assert scenario.planning_problems[0].goal == ()
    assert "no goal, planning problems: 60" in scenario.notes


def test_initial_values_that_the_file_lacks_are_not_taken_for_zero(read):
    problem = read(document(planning_problem(0, goal(), start=initial(5.0, velocity=3.0)))).planning_problems[0]
    assert problem.initial_state.velocity == 3.0
    assert math.isnan(problem.initial_state.acceleration)
    assert math.isnan(problem.initial_state.yaw_rate)


@pytest.mark.parametrize("missing", ["orientation", "velocity", "acceleration", "yawRate"])
def test_stated_initial_values_stay_where_others_are_missing(read, missing):
    stated = {"orientation": 0.1, "velocity": 9.0, "acceleration": 0.5, "yawRate": 0.12, missing: None}
    found = read(document(car(30, initial(5.0, **stated), [state(1, 6.0, orientation=0.1, velocity=9.5)])))
    fields = zip(("orientation", "velocity", "acceleration", "yaw_rate"), stated.values(), strict=True)
    kept = {name: value for name, value in fields if value is not None}
    assert {name: driven(found)[name][0] for name in kept} == kept
    assert found.obstacles.derived[0] == tuple({"yawRate": "yaw_rate"}.get(name, name) for name in [missing])


# Where a scenario comes from


def test_a_file_is_known_by_name_id_and_digest(read, tmp_path):
    scenario = read(document(), "some name.xml")
    assert (scenario.name, scenario.benchmark_id, scenario.dt) == ("some name", "ZAM_Test-1_1_T-1", 0.1)
    assert scenario.path == tmp_path / "some name.xml"
    assert len(scenario.sha256) == 64


def test_objects_of_commonroad_io_become_the_same_scenario(tmp_path):
    from commonroad.common.reader.file_reader_xml import XMLFileReader

    text = document(
        car(
            30,
            initial(0.0, acceleration=0.0, yawRate=0.0),
            [state(t, 1.0 * t, orientation=0.0, velocity=10.0) for t in (1, 2)],
        )
        + planning_problem(60, goal(position='<lanelet ref="1"/>'))
    )
    path = cr.saved(tmp_path, text)
    from_file, from_objects = read_scenario(path), scenario_from_commonroad(*XMLFileReader(path).open())
    assert from_objects.path is None
    np.testing.assert_array_equal(from_objects.obstacles.x, from_file.obstacles.x)
    np.testing.assert_array_equal(from_objects.obstacles.velocity, from_file.obstacles.velocity)
    np.testing.assert_array_equal(from_objects.lanelets.left[0], from_file.lanelets.left[0])
    assert from_objects.obstacles.shapes[0].length == 4.5
    assert from_objects.planning_problems[0].goal[0].lanelet_ids == (1,)


def test_what_objects_lack_is_derived(tmp_path):
    from commonroad.common.reader.file_reader_xml import XMLFileReader

    states = [state(t, 1.0 * t, orientation=0.0, velocity=10.0) for t in (1, 2)]
    scenario, _problems = XMLFileReader(cr.saved(tmp_path, document(car(30, initial(0.0), states)))).open()
    obstacle = scenario.dynamic_obstacles[0]
    obstacle.initial_state.velocity = None
    obstacle.initial_state.acceleration = None
    assert driven(scenario_from_commonroad(scenario))["velocity"].tolist() == pytest.approx([10.0] * 3)


def test_shapes_of_every_version_of_commonroad_io_are_known():
    """Up to 2024.3: groups. From 2026.1 on: rectangles with a shifted origin, trucks with and without trailer."""
    shapes = foreign_shapes()
    assert shapes
    for foreign, expected in shapes:
        found = shape_of(foreign)
        members = found.members if found.kind == "group" else (found,)
        assert [(one.kind, one.center, one.length) for one in members] == expected


def foreign_shapes():
    try:
        from commonroad.geometry.shape import Circle, Rectangle, ShapeGroup
    except ImportError:
        from commonroad.geometry.obstacle_shapes.rect_obstacle_shape import RectObstacleShape
        from commonroad.geometry.obstacle_shapes.semi_trailer_truck_shape import SemiTrailerTruckShape
        from commonroad.geometry.obstacle_shapes.truck_shape import TruckShape

        truck = TruckShape.create_default()
        rear = pytest.approx(0.5 * 5.1 - 0.5)
        return [
            (RectObstacleShape(width=2.0, length=4.0, origin_x_shift=-1.25), [("rectangle", (1.25, 0.0), 4.0)]),
            (truck, [("rectangle", (rear, 0.0), 5.1)]),
            (
                SemiTrailerTruckShape.create_default(),
                [("rectangle", (rear, 0.0), 5.1), ("rectangle", (pytest.approx(0.45 - 13.6 / 2 + 0.9), 0.0), 13.6)],
            ),
        ]
    group = ShapeGroup([Rectangle(4.0, 2.0, np.array([1.0, 0.5]), 0.0), Circle(1.0, np.array([2.0, 0.0]))])
    return [(group, [("rectangle", (1.0, 0.5), 4.0), ("circle", (2.0, 0.0), 0.0)])]


def test_something_else_than_a_commonroad_scenario_is_refused():
    with pytest.raises(InputError, match="str is not a commonroad"):
        scenario_from_commonroad("test.xml")


def test_protobuf_files_of_the_installed_commonroad_io_are_read(tmp_path):
    from commonroad.common.file_reader import CommonRoadFileReader
    from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
    from commonroad.common.reader.file_reader_xml import XMLFileReader
    from commonroad.common.util import FileFormat

    states = [state(t, 1.0 * t, orientation=0.0, velocity=10.0) for t in (1, 2)]
    text = document(car(30, initial(0.0), states) + planning_problem(60, goal(position='<lanelet ref="1"/>')))
    from_xml = read_scenario(cr.saved(tmp_path, text))
    scenario, problems = XMLFileReader(tmp_path / "test.xml").open()
    writer = CommonRoadFileWriter(scenario, problems, "a", "b", "c", set(), file_format=FileFormat.PROTOBUF)
    name = "ZAM_Test-1_1_T-1"
    always = OverwriteExistingFile.ALWAYS
    if hasattr(CommonRoadFileReader, "open_all"):
        writer.write_map_to_file(str(tmp_path / "ZAM_Test-1.pb"), always)
        writer.write_dynamic_to_file(str(tmp_path / f"{name}.pb"), always)
        writer.write_scenario_to_file(str(tmp_path / f"{name}-SC.pb"), always)
    else:
        writer.write_to_file(str(tmp_path / f"{name}.pb"), always)
    from_protobuf = read_scenario(tmp_path / f"{name}.pb")
    np.testing.assert_array_equal(from_protobuf.obstacles.x, from_xml.obstacles.x)
    np.testing.assert_array_equal(from_protobuf.lanelets.right[0], from_xml.lanelets.right[0])
    assert from_protobuf.planning_problems[0].id == 60
    assert from_protobuf.planning_problems[0].goal[0].lanelet_ids == (1,)


def test_importing_the_reader_does_not_import_commonroad_io():
    code = "import sys, interdrive.files; sys.exit(any(name.startswith('commonroad') for name in sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# What is refused

NAN_LANELET = lanelet(1).replace("<x>100</x>", "<x>nan</x>", 1)
INFINITE_CAR = car(30, initial(0.0), [state(1, "1e999", orientation=0.0, velocity=1.0)])
BAD_DOCUMENTS = {
    "empty": (b"", "the file is empty"),
    "not XML": (b"PK\x03\x04 something", "not an XML file"),
    "truncated": (document(car(30, initial(0.0)))[:-300].encode(), "broken XML .* complete"),
    "XML bomb": (cr.BOMB, "document type declaration"),
    "external entity": (cr.EXTERNAL_ENTITY, "document type declaration"),
    "other root": (b"<svg/>", "<svg> is no map or scenario that is read here"),
    "old version": (document(version="2017a"), "version 2017a is not supported"),
    "no lanelets": (document(lanelets=""), "has no lanelets"),
    "dt 0": (document(dt="0"), "dt.* is 0"),
    "dt negative": (document(dt="-0.1"), "dt.* is -0.1"),
    "dt nan": (document(dt="nan"), "dt.* is nan"),
    "dt text": (document(dt="fast"), "dt.* is fast"),
    "lanelet with nan": (document(lanelets=NAN_LANELET), "lanelet 1 has the value nan in <x>"),
    "obstacle at infinity": (document(INFINITE_CAR), "dynamicObstacle 30 has the value 1e999"),
    "planning problem with nan": (document(planning_problem(60, goal(), start=initial("NaN"))), "planningProblem 60"),
    "far out": (document(car(30, initial(1e12))), "dynamicObstacle 30 has the value 1000000000000.0 in <x>"),
    "same obstacle id twice": (document(car(30, initial(0.0)) * 2), "two obstacles have the id 30"),
    "same lanelet id twice": (document(lanelets=lanelet(1) * 2), "two lanelets have the id 1"),
    "same planning problem id twice": (
        document(planning_problem(6, goal()) * 2),
        "two planning problems have the id 6",
    ),
    "id of an obstacle and a lanelet": (document(car(1, initial(0.0))), "ID 1 is already used"),
    "id not a number": (document(car("x", initial(0.0))), "the id 'x'"),
    "uneven bounds": (document(lanelets=lanelet(4, left=((0, 2), (5, 2), (9, 2)))), "lanelet 4 has 3 points"),
    "missing goal lanelet": (
        document(planning_problem(6, goal(position='<lanelet ref="5"/>'))),
        "lanelet 5, which does not",
    ),
    "no footprint": (document(car(30, initial(0.0), shape="")), "obstacle 30 has no shape"),
    "flat footprint": (
        document(car(30, initial(0.0), shape=cr.RECTANGLE.replace("1.8", "0"))),
        "obstacle 30 has no area",
    ),
    "half a footprint": (document(car(30, initial(0.0), shape="<rectangle/>")), "the shape of obstacle 30"),
    "no initial state": (document(car(30, "")), "obstacle 30 has no initial state"),
    "unknown kind": (
        document(car(30, initial(0.0), kind="spaceship")),
        "cannot be read at dynamicObstacle 30 .*spaceship",
    ),
    "endless turns": (
        document(car(30, initial(0.0), [state(1, 1.0, orientation=(0.0, 1e20))])),
        "dynamicObstacle 30 has the orientation 1e",
    ),
    "half a state": (
        document(car(30, initial(0.0), [state(1, 1.0, orientation=0.0).replace("<x>1.0</x>", "")])),
        "cannot be read at <point> of dynamicObstacle 30 .*; correct that element$",
    ),
    "time step far off": (
        document(car(30, initial(0.0), [state(99999999, 1.0, orientation=0.0)])),
        "time step 99999999",
    ),
    "unreadable protobuf": (b"\x00\xff garbage", "cannot be read|is not beside it"),
}


def test_a_reason_of_commonroad_io_comes_without_the_names_of_its_classes():
    with pytest.raises(InputError) as refused, quiet("test.xml"):
        raise AssertionError("<CommonRoadFileReader/create>: the element has no length")
    assert str(refused.value) == "test.xml: cannot be read (the element has no length); correct the file"


@pytest.mark.parametrize("name", BAD_DOCUMENTS)
def test_a_bad_file_is_refused_in_one_line_that_names_it(read, name):
    text, message = BAD_DOCUMENTS[name]
    ending = ".pb" if "protobuf" in name else ".xml"
    with pytest.raises(InputError, match=message) as caught:
        read(text, "bad" + ending)
    assert "bad" + ending in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_scenario(tmp_path / "nothing.xml")
    with pytest.raises(InputError, match="is a folder"):
        read_scenario(tmp_path)


def test_reading_says_nothing_aloud(read, capsys, caplog):
    scenario = read(document().replace("ZAM_Test-1_1_T-1", "nonsense id"))
    assert scenario.benchmark_id == "nonsense id"
    assert capsys.readouterr() == ("", "")
    assert caplog.records == []


# All recorded scenarios


def test_every_recorded_scenario_is_read_or_refused_in_one_line(recorded_scenarios):
    refused = {}
    for path, scenario in recorded_scenarios.items():
        if isinstance(scenario, InputError):
            refused[Path(path).stem] = str(scenario)
            continue
        obstacles = scenario.obstacles
        for name in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate"):
            np.testing.assert_array_equal(
                np.isfinite(getattr(obstacles, name)), obstacles.valid, err_msg=f"{path} {name}"
            )
        assert np.all(np.diff(obstacles.ids) > 0)
    assert set(refused) == {"test_reading_obstacles", "test_reading_planning_problem"}
    assert all("no lanelets" in message and "\n" not in message for message in refused.values())


def test_recorded_states_are_those_that_commonroad_io_reads(scenarios_folder):
    from commonroad.common.reader.file_reader_xml import XMLFileReader

    path = scenarios_folder / "highway" / "USA_US101-23_1_T-1.xml"
    theirs, _problems = XMLFileReader(path).open()
    ours = read_scenario(path)
    assert len(theirs.dynamic_obstacles) > 20
    for obstacle in theirs.dynamic_obstacles:
        one = driven(ours, obstacle.obstacle_id)
        assert one["valid"].sum() == len(obstacle.prediction.trajectory.state_list) + 1
        for theirs_now in [obstacle.initial_state, *obstacle.prediction.trajectory.state_list]:
            step = theirs_now.time_step
            assert (one["x"][step], one["y"][step]) == tuple(theirs_now.position)
            assert one["velocity"][step] == theirs_now.velocity
