"""CommonRoad files out: a run as a document that other tools read."""

import dataclasses
import os
import subprocess
import sys

import commonroad_documents as cr
import numpy as np
import pytest
from commonroad_documents import car, document, driven, goal, initial, lanelet, planning_problem, point, state
from recorded_runs import run_of, written

from interdrive.files import read_scenario, run_document


def test_a_written_run_is_read_back_as_it_was(read, tmp_path):
    states = [state(t, 1.23456789 * t, -0.2 * t, orientation=0.1, velocity=12.5, yawRate=0.01) for t in range(1, 9)]
    still = (
        f'<staticObstacle id="9"><type>parkedVehicle</type><shape>{cr.RECTANGLE}</shape>{initial(7.0)}</staticObstacle>'
    )
    late = car(31, initial(20.0, time=3), [state(4, 21.0, orientation=0.0, velocity=10.0)], kind="truck")
    text = document(still + car(30, initial(0.0), states) + late + planning_problem(60, goal(time=(3, 8))))
    before = read(text)
    after = written(run_of(before), tmp_path)
    assert_same_traffic(before.obstacles, after.obstacles)
    assert after.obstacles.kinds == before.obstacles.kinds
    assert [(shape.kind, shape.length, shape.width) for shape in after.obstacles.shapes] == [
        ("rectangle", 4.5, 1.8)
    ] * 3
    assert [problem.id for problem in after.planning_problems] == [60]
    assert after.planning_problems[0].goal == before.planning_problems[0].goal
    assert (after.dt, after.benchmark_id) == (before.dt, before.benchmark_id)


def assert_same_traffic(before, after):
    np.testing.assert_array_equal(after.ids, before.ids)
    np.testing.assert_array_equal(after.is_static, before.is_static)
    np.testing.assert_array_equal(after.valid, before.valid)
    for name in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate"):
        np.testing.assert_allclose(getattr(after, name), getattr(before, name), atol=1e-6, rtol=0, err_msg=name)


def test_time_steps_of_a_run_that_starts_late_are_kept(read, tmp_path):
    states = [state(t, 1.0 * t, orientation=0.0, velocity=10.0) for t in range(1, 6)]
    after = written(run_of(read(document(car(30, initial(0.0), states))), first_time_step=2), tmp_path)
    assert driven(after)["valid"].tolist() == [False, False, True, True, True, True]
    np.testing.assert_allclose(driven(after)["x"][2:], [2, 3, 4, 5])


@pytest.mark.parametrize(
    "shape",
    [
        cr.rectangle_at(1.5, -1, length=4, width=2, orientation=0.5),
        cr.RECTANGLE + cr.rectangle_at(3, 0, length=2, width=1),
        "<polygon>" + point(0, 0) + point(4, 0) + point(1, 1) + point(0, 3) + "</polygon>",
    ],
    ids=["rectangle off its origin", "group", "polygon"],
)
def test_every_footprint_is_written_such_that_commonroad_io_reads_it_in_its_place(read, tmp_path, shape):
    from commonroad.common.reader.file_reader_xml import XMLFileReader

    before = read(document(car(30, initial(0.0), [state(1, 1.0, orientation=0.0)], shape=shape)))
    after = written(run_of(before), tmp_path)
    footprint = after.obstacles.shapes[0]
    assert footprint.kind == "polygon"
    assert area_of(footprint.vertices) > 0.0
    theirs, _problems = XMLFileReader(tmp_path / "written.xml").open()
    vertices = np.array(theirs.dynamic_obstacles[0].obstacle_shape.vertices)
    np.testing.assert_allclose(vertices.min(axis=0), footprint.vertices.min(axis=0), atol=1e-6)
    np.testing.assert_allclose(vertices.max(axis=0), footprint.vertices.max(axis=0), atol=1e-6)


def area_of(vertices):
    (x, y), (x1, y1) = vertices.T, np.roll(vertices, -1, axis=0).T
    return 0.5 * abs(np.sum(x * y1 - x1 * y))


def test_the_hull_of_a_turned_rectangle_is_that_rectangle(read, tmp_path):
    shape = cr.rectangle_at(1.5, -1, length=4, width=2, orientation=0.5)
    before = read(document(car(30, initial(0.0), [state(1, 1.0, orientation=0.0)], shape=shape)))
    after = written(run_of(before), tmp_path).obstacles
    vertices = after.shapes[0].vertices
    assert area_of(vertices) == pytest.approx(8.0)
    # The footprint is centred, its place is that of the state.
    np.testing.assert_allclose(vertices.mean(axis=0), [0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose((after.x[0, 0], after.y[0, 0]), (1.5, -1.0), atol=1e-6)


def test_a_circle_off_its_origin_becomes_one_at_the_place_of_its_state(read, tmp_path):
    circle = "<circle><radius>1</radius><center><x>2</x><y>3</y></center></circle>"
    before = read(document(car(30, initial(0.0), [state(1, 1.0, orientation=0.0)], shape=circle)))
    after = written(run_of(before), tmp_path).obstacles
    assert (after.shapes[0].kind, after.shapes[0].radius, after.shapes[0].center) == ("circle", 1.0, (0.0, 0.0))
    np.testing.assert_allclose((after.x[0, 0], after.y[0, 0]), (2.0, 3.0), atol=1e-6)


def test_roads_signs_lights_and_intersections_come_from_the_scenarios_file(scenarios_folder, tmp_path):
    from commonroad.common.reader.file_reader_xml import XMLFileReader

    path = scenarios_folder / "intersection" / "USA_Lanker-1_3_T-1.xml"
    before = read_scenario(path)
    after = written(run_of(before), tmp_path)
    networks = [XMLFileReader(file).open()[0].lanelet_network for file in (path, tmp_path / "written.xml")]
    for name in ("lanelets", "traffic_signs", "traffic_lights", "intersections"):
        assert len(getattr(networks[0], name)) == len(getattr(networks[1], name)) > 0
    for before_bound, after_bound in zip(before.lanelets.left, after.lanelets.left, strict=True):
        np.testing.assert_array_equal(after_bound, before_bound)


@pytest.mark.parametrize("source", ["2018b", "changed file", "memory"])
def test_roads_of_any_origin_keep_bounds_relations_and_speed_limits(read, tmp_path, source):
    more = '<successor ref="2"/><adjacentRight ref="3" drivingDir="opposite"/><speedLimit>13.888888888</speedLimit>'
    before = read(document(version="2018b", lanelets=lanelet(1, more=more) + lanelet(2) + lanelet(3)))
    if source == "changed file":
        before.path.write_text("something else")
    if source == "memory":
        before = dataclasses.replace(before, path=None)
    after = written(run_of(before), tmp_path)
    for name in ("ids", "adjacent_left", "adjacent_right", "adjacent_right_same_direction", "speed_limit"):
        np.testing.assert_array_equal(getattr(after.lanelets, name), getattr(before.lanelets, name))
    assert after.lanelets.successors == before.lanelets.successors
    np.testing.assert_allclose(after.lanelets.left[0], before.lanelets.left[0], atol=1e-6)


def test_the_sign_of_a_limit_of_2018b_takes_no_id_from_traffic(read, tmp_path):
    states = [state(1, 1.0, orientation=0.0, velocity=10.0)]
    old_car = car(30, initial(0.0), states).replace("dynamicObstacle", "obstacle")
    old_car = old_car.replace("<type>", "<role>dynamic</role><type>")
    limit = lanelet(29, more="<speedLimit>13.5</speedLimit>")
    before = read(document(old_car, version="2018b", lanelets=limit))
    after = written(run_of(before), tmp_path)
    assert after.obstacles.ids.tolist() == [30]
    np.testing.assert_array_equal(after.lanelets.speed_limit, [13.5])


def test_ids_that_collide_are_replaced_by_free_ones(read, tmp_path):
    """Obstacle 1 has the id of a lanelet, planning problem 30 that of an obstacle, and 0 is none in this format."""
    states = [state(1, 1.0, orientation=0.0)]
    cars = car(30, initial(0.0), states) + car(31, initial(9.0), states)
    before = read(document(cars + planning_problem(30, goal()) + planning_problem(0, goal())))
    after = written(run_of(before, participants=[1, 30]), tmp_path)
    assert after.obstacles.ids.tolist() == [2, 30]
    assert sorted(problem.id for problem in after.planning_problems) == [31, 32]


def test_a_written_run_is_valid_by_the_schema_of_commonroad_io(scenarios_folder, tmp_path):
    from commonroad.common.file_writer import CommonRoadFileWriter

    for name in ("t_junction/ZAM_Tjunction-1_42_T-1", "highway/USA_US101-23_1_T-1", "merge/ZAM_Zip-1_56_T-1"):
        before = read_scenario(scenarios_folder / f"{name}.xml")
        data = run_document(run_of(before))
        assert CommonRoadFileWriter.check_validity_of_commonroad_file(data) in (True, None)
        assert_same_traffic(before.obstacles, written(run_of(before), tmp_path).obstacles)


def test_equal_runs_are_written_as_equal_bytes_whatever_the_order_of_hashes():
    script = (
        "import hashlib\n"
        "from interdrive.runs import recorded_run\n"
        "from interdrive.files import read_scenario, shipped_scenario, run_document\n"
        "data = run_document(recorded_run(read_scenario(shipped_scenario('intersection'))))\n"
        "print(len(data), hashlib.sha256(data).hexdigest())\n"
    )
    one, other = (
        subprocess.run(
            [sys.executable, "-c", script],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    )
    assert int(one.split()[0]) > 10_000
    assert one == other
