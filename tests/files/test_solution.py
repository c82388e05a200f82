"""CommonRoad solutions of planning problems."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from xml.etree import ElementTree

import numpy as np
import pytest
from click.testing import CliRunner
from commonroad.common.solution import CommonRoadSolutionReader, VehicleModel, VehicleType

import interdrive as idr
from interdrive.cli import main
from interdrive.errors import MissingExtraError
from interdrive.files.solution import steering_angles
from interdrive.files.solution_check import check_solution
from interdrive.results import save
from interdrive.testing import Car, problem, straight_road, world


@pytest.fixture(scope="module")
def run():
    return idr.simulate("t_junction", agents="problems")


def states_of(document, trajectory="ksTrajectory"):
    root = ElementTree.fromstring(document)
    return root, [{field.tag: float(field.text) for field in state} for state in root.find(trajectory)]


def test_only_planning_problems_drive(run):
    assert [agent.origin for agent in run.agents] == ["planning problem"]


def test_a_solution_starts_where_its_problem_does_and_ends_in_its_goal(run):
    root, states = states_of(idr.write_solution(run))
    problem = run.scenario.planning_problems[0]
    start = problem.initial_state
    assert root.get("benchmark_id") == "KS2:SM1:ZAM_InterdriveTJunction-2_1_T-1:2020a"
    first, last = states[0], states[-1]
    assert (first["x"], first["y"], first["orientation"]) == (start.x, start.y, start.orientation)
    assert [state["time"] for state in states] == list(range(start.time_step, run.outcomes.time_step[0] + 1))
    assert last["time"] <= problem.goal[0].time_step[1]


def test_drives_that_start_with_turned_headings_are_refused(run):
    turned = replace(run, scenario=replace(run.scenario, turned=0.03))
    with pytest.raises(idr.InputError, match=r"its headings were turned when it was read.*run it with --raw"):
        idr.write_solution(turned)


def test_commonroad_io_reads_it_and_equal_runs_give_equal_bytes(run):
    document = idr.write_solution(run)
    assert document == idr.write_solution(run)
    found = CommonRoadSolutionReader.fromstring(document.decode()).planning_problem_solutions[0]
    assert (found.vehicle_model, found.vehicle_type) == (VehicleModel.KS, VehicleType.BMW_320i)
    assert found.planning_problem_id == 2001


def test_other_models_have_their_fields(run):
    _, single_track = states_of(idr.write_solution(run, model="ST"), "stTrajectory")
    assert set(single_track[0]) == {
        "x",
        "y",
        "steeringAngle",
        "velocity",
        "orientation",
        "yawRate",
        "slipAngle",
        "time",
    }
    _, point = states_of(idr.write_solution(run, model="PM", cost="WX1"), "pmTrajectory")
    speed = np.hypot(point[0]["xVelocity"], point[0]["yVelocity"])
    assert speed == pytest.approx(single_track[0]["velocity"])


def test_a_point_mass_moves_as_the_centre_does(run):
    """In a turn the centre moves aside, and its speed is not that of the rear axle."""
    _, states = states_of(idr.write_solution(run, model="PM", cost="WX1"), "pmTrajectory")
    x, y, along_x, along_y = (np.array([s[name] for s in states]) for name in ("x", "y", "xVelocity", "yVelocity"))
    dt = run.scenario.dt
    # Most, 0.033 m/s, where the acceleration jumps within a step.
    for place, velocity in ((x, along_x), (y, along_y)):
        assert np.diff(place) / dt == pytest.approx(0.5 * (velocity[1:] + velocity[:-1]), abs=0.04)


@pytest.mark.parametrize(("number", "name"), [(1, "FORD_ESCORT"), (3, "VW_VANAGON"), (4, "TRUCK")])
def test_a_problem_drives_the_vehicle_type_of_the_setting(number, name):
    run = idr.simulate("t_junction", agents="problems", settings={"agents.vehicle_type": number})
    assert run.outcomes.outcome == ("goal_reached",)
    found = CommonRoadSolutionReader.fromstring(idr.write_solution(run).decode()).planning_problem_solutions[0]
    assert found.vehicle_type == VehicleType[name]


@pytest.mark.parametrize(("number", "length", "kind"), [(0, 4.5, "car"), (4, 5.1, "truck")])
def test_a_problem_drives_the_recorded_vehicle_at_its_start_unless_a_type_is_set(number, length, kind):
    start = problem(1, x=20.0, goal=(60.0, 0.0), time_step=(20, 60))
    scene = world(straight_road(), cars=[Car(7, x=20.0, velocity=10.0)], problems=[start])
    run = idr.simulate(scene, agents="problems", settings={"agents.vehicle_type": number})
    assert (run.outcomes.agent_id.tolist(), run.states.kinds) == ([7], (kind,))
    assert run.states.length.tolist() == [length]


def test_date_and_processor_are_written_if_they_are_given(run):
    document = idr.write_solution(run, date=datetime(2026, 1, 31, 12), processor='a "fast" one')
    found = CommonRoadSolutionReader.fromstring(document.decode())
    assert (found.date, found.processor_name) == (datetime(2026, 1, 31, 12), 'a "fast" one')


def test_a_heading_with_a_whole_turn_more_begins_as_the_file_states_it(tmp_path):
    """The official check compares numbers."""
    text = idr.shipped_scenario("t_junction").read_text()
    start = text.index("<exact>", text.index("<orientation>", text.index("<planningProblem"))) + len("<exact>")
    end = text.index("</exact>", start)
    stated = float(text[start:end]) - 2.0 * np.pi
    path = tmp_path / "turned.xml"
    path.write_text(f"{text[:start]}{stated!r}{text[end:]}")
    _, states = states_of(idr.write_solution(idr.simulate(path, agents="problems")))
    assert states[0]["orientation"] == pytest.approx(stated, abs=1e-12)


def test_steering_is_interpolated_where_a_vehicle_hardly_moves():
    angles = steering_angles(np.array([2.0, 0.05, 0.0, 2.0]), np.array([0.2, 9.0, np.nan, 0.8]), 2.5)
    first, last = np.arctan(0.25), np.arctan(1.0)
    assert angles == pytest.approx([first, first + (last - first) / 3, first + 2 * (last - first) / 3, last])
    assert steering_angles(np.zeros(2), np.zeros(2), 2.5).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"cost": "XY1"}, "cost 'XY1': expected one of JB1"),
        ({"cost": "SM1", "model": "PM"}, "a point mass can have JB1, WX1, MW1"),
        ({"model": "MB"}, "model 'MB': expected one of KS, ST, PM"),
        ({"vehicle": 5}, "vehicle 5: expected a number from 1 to 4"),
        ({"vehicle": 3}, "4.508 m by 1.61 m, type 2 [(]BMW 320i[)], not type 3"),
    ],
)
def test_what_cannot_be_written_is_refused(run, options, said):
    with pytest.raises(idr.InputError, match=said):
        idr.write_solution(run, **options)


def test_other_agents_unsolved_problems_and_nameless_scenarios_are_refused(run):
    other = replace(run, agents=(replace(run.agents[0], origin="recorded"),))
    late = replace(run, outcomes=replace(run.outcomes, outcome=("time_limit",), reason=("too slow",)))
    nameless = replace(run, scenario=replace(run.scenario, benchmark_id="mine"))
    for wrong, said in (
        (other, "agent 2001 is no planning problem"),
        (late, "planning problem 2001 is not solved: time_limit, too slow"),
        (replace(run, agents=()), "planning problem 2001 was not driven"),
        (nameless, "benchmark id 'mine' is none that a solution can name"),
    ):
        with pytest.raises(idr.InputError, match=said):
            idr.write_solution(wrong)


def test_the_command_writes_the_document_into_the_run_folder(run, tmp_path):
    folder = save(run, tmp_path / "run")
    result = CliRunner().invoke(main, ["solution", str(folder)])
    assert result.exit_code == 0, result.output
    assert (folder / "solution.xml").read_bytes() == idr.write_solution(idr.load(folder))
    for wrong in (["--model", "MB"], ["--date", "yesterday"]):
        refused = CliRunner().invoke(main, ["solution", str(folder), *wrong])
        assert (refused.exit_code, refused.stderr.count("\n")) == (2, 1)


def test_without_the_checker_the_extra_that_brings_it_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r'pip install "interdrive\[checker\]"'):
        check_solution(b"", tmp_path / "x.xml")
