"""What a scenario holds, and which vehicles can become agents."""

import csv
import math

import commonroad_documents as cr
import numpy as np
import pytest
from click.testing import CliRunner
from commonroad_documents import car, document, goal, initial, lanelet, planning_problem, state

from interdrive.cli import main
from interdrive.scenario.inspection import candidates, inspect, lanelets_at


def drive(number, distance, *, y=0.0, kind="car", steps=2):
    """An obstacle that gets `distance` away from its start within `steps` steps."""
    states = [state(t, 10.0 + distance * t / steps, y, orientation=0.0, velocity=5.0) for t in range(1, steps + 1)]
    return car(number, initial(10.0, y, velocity=5.0), states, kind=kind)


def reasons(scenario, **settings):
    found = candidates(scenario, **settings)
    return dict(zip(found.ids.tolist(), found.reasons, strict=True))


def test_every_kind_of_vehicle_that_drives_away_is_a_candidate(read):
    kinds = ("car", "truck", "bus", "motorcycle", "bicycle", "taxi", "priorityVehicle")
    found = candidates(read(document("".join(drive(30 + i, 10.0, kind=kind) for i, kind in enumerate(kinds)))))
    assert found.accepted.all()
    assert set(found.reasons) == {""}


def test_whoever_is_no_candidate_is_told_why(read):
    still = f'<staticObstacle id="2"><type>unknown</type><shape>{cr.RECTANGLE}</shape>{initial(7.0)}</staticObstacle>'
    text = document(
        still
        + drive(30, 20.0, kind="pedestrian")
        + car(31, initial(10.0))
        + drive(32, 9.94)
        + drive(33, 20.0, y=5.0)
        + drive(34, 10.0)
    )
    assert reasons(read(text)) == {
        2: "static obstacle",
        30: "pedestrian, not a vehicle that a planner can drive",
        31: "recorded at one time step only",
        32: "gets 9.9 m away from its start, less than 10 m",
        33: "starts off every lanelet",
        34: "",
    }


def test_the_distance_counts_where_it_is_largest_not_where_the_recording_ends(read):
    there_and_back = [state(1, 25.0, orientation=0.0), state(2, 10.0, orientation=0.0)]
    assert reasons(read(document(car(30, initial(10.0), there_and_back)))) == {30: ""}


def test_the_least_distance_can_be_set(read):
    assert reasons(read(document(drive(30, 9.0))), min_displacement=5.0) == {30: ""}


def test_a_scenario_without_obstacles_has_no_candidates(read):
    found = candidates(read(document()))
    assert (found.ids.size, found.accepted.size, found.reasons) == (0, 0, ())


def test_points_are_on_all_lanelets_that_hold_them(read):
    lanelets = read(
        document(lanelets=lanelet(1) + lanelet(2, left=((50, 2), (150, 2)), right=((50, -2), (150, -2))))
    ).lanelets
    x, y = np.array([10.0, 75.0, 75.0, math.nan]), np.array([0.0, 0.0, 3.0, 0.0])
    assert lanelets_at(lanelets, x, y).tolist() == [[True, False], [True, True], [False, False], [False, False]]


def test_an_inspection_has_the_size_of_everything(read):
    text = document(
        drive(30, 20.0, steps=4) + drive(31, 20.0, kind="truck") + drive(32, 0.0),
        version="2018b",
        lanelets=lanelet(1, more="<speedLimit>13.5</speedLimit>") + lanelet(2),
    )
    text = text.replace("dynamicObstacle", "obstacle").replace("<type>", "<role>dynamic</role><type>")
    found = inspect(read(text))
    assert (found.n_lanelets, found.lane_length, found.extent) == (2, 200.0, (100.0, 4.0))
    assert (found.n_steps, found.duration) == (5, pytest.approx(0.4))
    assert (found.kinds, found.n_static) == ((("car", 2), ("truck", 1)), 0)
    assert found.speed_limits == (13.5, 13.5)
    assert found.candidates.accepted.tolist() == [True, True, False]


def test_goals_are_put_in_words(read):
    area = cr.rectangle_at(90, 1, length=6, width=3)
    text = document(
        planning_problem(60, goal(position='<lanelet ref="1"/>', time=(10, 20), velocity=(5, 8)))
        + planning_problem(61, goal(position=area, orientation=(0.0, math.pi / 2)) + goal(time=(0, 9)))
        + planning_problem(62, "")
    )
    words = {problem.id: problem.goal for problem in inspect(read(text)).planning_problems}
    assert words[60] == "lanelet 1, steps 10 to 20 (1.0 to 2.0 s), speed 5.0 to 8.0 m/s"
    assert words[61] == (
        "a rectangle at (90.0, 1.0), steps 0 to 50 (0.0 to 5.0 s), heading 0 to 90 degrees "
        "or anywhere, steps 0 to 9 (0.0 to 0.9 s)"
    )
    assert words[62] == "no goal"


def test_where_a_planning_problem_starts_is_told(read):
    off = planning_problem(61, goal(), start=initial(5.0, 9.0))
    found = inspect(read(document(planning_problem(60, goal()) + off))).planning_problems
    assert [problem.start_lanelet_ids for problem in found] == [(1,), ()]
    assert (found[0].x, found[0].y, found[0].velocity) == (5.0, 0.0, 10.0)


def test_the_edge_of_a_lanelet_belongs_to_it(read):
    lanelets = read(document()).lanelets
    assert lanelets_at(lanelets, np.array([10.0, 100.0]), np.array([2.0, -2.0])).all()


def test_recorded_scenarios_have_as_many_candidates_as_were_counted_with_commonroad_io(
    scenarios_folder, recorded_scenarios
):
    """But for one file: there all positions are areas, which were not counted and here become their middle."""
    with (scenarios_folder / "INVENTORY.csv").open() as file:
        expected = {row["path"]: int(row["n_agent_candidates"]) for row in csv.DictReader(file)}
    different = {}
    for path, number in expected.items():
        if "test_reading_obstacles" in path or "test_reading_planning_problem" in path:
            continue
        found = int(candidates(recorded_scenarios[path]).accepted.sum())
        if found != number:
            different[path] = (found, number)
    assert different == {"format_edge_cases/DEU_A9-3_1_T-1.xml": (8, 0)}


def test_the_junctions_of_a_map_are_printed_with_what_decides_who_goes_first():
    printed = " ".join(CliRunner().invoke(main, ["check", "t_junction"]).output.split())
    assert "junction 1 6 lanelets about (-0, -3); areas: 3 crossing, 3 merge, 5 by signs, 1 left turns wait" in printed
