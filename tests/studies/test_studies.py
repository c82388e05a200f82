"""Case studies: what is simulated, what the table (compared with shapely) and the figures say, what is refused."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
import shapely
from click.testing import CliRunner
from invented_run import invented_run

from interdrive import read_scenario, shipped_scenario, simulate
from interdrive.cli import main
from interdrive.criticality import CriticalitySettings
from interdrive.errors import InputError, ResultsError
from interdrive.results import read_results
from interdrive.studies import (
    DEGREES,
    case_study,
    footprint_distances,
    known_cases,
    profile_figure,
    reading,
    save_study,
    scene_figure,
)
from interdrive.studies.lateral import lateral_offsets
from interdrive.studies.measures import collided, distance_of_closest_encounter
from interdrive.testing import Car, problem, straight_road, world

pytestmark = pytest.mark.long

PAIRS = {"lane_merge": (2001, 1004), "t_junction": (2001, 1001)}


@pytest.fixture(scope="module")
def studies():
    return {name: case_study(name, agent=agent, other=other, threads=1) for name, (agent, other) in PAIRS.items()}


@pytest.fixture(params=list(PAIRS))
def study(request, studies):
    return studies[request.param]


def row_of(run, number):
    return int(np.flatnonzero(run.states.participant_id == number)[0])


def polygon(run, row, column):
    """The footprint as a polygon of shapely."""
    states = run.states
    half = 0.5 * np.array([states.length[row], states.width[row]])
    corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * half
    angle = states.orientation[row, column]
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return shapely.Polygon(corners @ turn + (states.x[row, column], states.y[row, column]))


def smallest_distance(run, first, second):
    i, j = row_of(run, first), row_of(run, second)
    both = np.flatnonzero(run.states.valid[i] & run.states.valid[j])
    return min(polygon(run, i, k).distance(polygon(run, j, k)) for k in both)


# What is simulated


def test_there_is_a_run_for_every_degree_in_which_nobody_but_the_two_plans(study):
    assert tuple(study.runs) == DEGREES
    for degree, run in study.runs.items():
        driven = {study.agent} if degree == "deterministic" else {study.agent, study.other}
        assert set(run.states.participant_id[run.states.is_agent].tolist()) == driven
        assert run.finished


def test_each_degree_has_its_planner_for_the_other_vehicle(study):
    planners = [(row["degree"], row["planner"], row["other_planner"]) for row in study.table.to_pylist()]
    assert planners == [
        ("deterministic", "rollout", "recorded"),
        ("semi_deterministic", "rollout", "velocity_adjusting"),
        ("interactive", "rollout", "rollout"),
    ]


def test_in_the_deterministic_degree_the_other_vehicle_is_where_it_was_recorded(study):
    run, obstacles = study.runs["deterministic"], study.scenario.obstacles
    row, recorded = row_of(run, study.other), int(np.flatnonzero(obstacles.ids == study.other)[0])
    there = np.flatnonzero(run.states.valid[row])
    for name in ("x", "y", "orientation", "velocity"):
        assert np.array_equal(getattr(run.states, name)[row, there], getattr(obstacles, name)[recorded, there])


def test_in_the_semi_deterministic_degree_the_other_vehicle_stays_on_its_recorded_path(study):
    run, obstacles = study.runs["semi_deterministic"], study.scenario.obstacles
    row, recorded = row_of(run, study.other), int(np.flatnonzero(obstacles.ids == study.other)[0])
    path = shapely.LineString(np.stack([obstacles.x[recorded], obstacles.y[recorded]], axis=1))
    there = run.states.valid[row]
    driven = shapely.points(run.states.x[row, there], run.states.y[row, there])
    on_recording = shapely.line_locate_point(path, driven) < path.length - 1e-6
    assert shapely.distance(path, driven)[on_recording].max() < 0.05


def test_a_study_comes_out_the_same_for_any_number_of_threads(study):
    again = case_study(study.scenario, agent=study.agent, other=study.other, threads=3)
    assert [run.digest for run in again.runs.values()] == [run.digest for run in study.runs.values()]


def test_each_run_is_the_one_that_simulate_makes(study):
    run = simulate(study.scenario, agents=[study.agent, study.other], threads=1)
    assert run.digest == study.runs["interactive"].digest


# The table


def test_the_smallest_distance_is_the_one_that_shapely_finds(study):
    for row, run in zip(study.table.to_pylist(), study.runs.values(), strict=True):
        assert not row["collided"]
        assert row["min_dce"] == pytest.approx(smallest_distance(run, study.agent, study.other), abs=1e-9)


def test_the_table_has_the_criticality_of_the_agent_with_the_other_vehicle_alone(study):
    for row, run in zip(study.table.to_pylist(), study.runs.values(), strict=True):
        settings = CriticalitySettings(conflict_areas="stated" if run.scenario.incomings else "crossing")
        found = run.criticality([study.agent], other_ids=[study.other], settings=settings)
        assert set(np.unique(found.series["ttc"].partner_id)) <= {-1, study.other}
        for column, measure in (("min_ttc", "ttc"), ("max_btn", "btn"), ("et", "et"), ("pet", "pet")):
            value = found.extremes[measure].value[0]
            assert row[column] == (None if np.isnan(value) else value), column


def test_the_table_has_the_outcomes_of_both_and_none_for_a_recording(study):
    for row, run in zip(study.table.to_pylist(), study.runs.values(), strict=True):
        outcomes = dict(zip(run.outcomes.agent_id.tolist(), run.outcomes.outcome, strict=True))
        assert row["agent_outcome"] == outcomes[study.agent]
        assert row["other_outcome"] == outcomes.get(study.other)
        assert (row["scenario"], row["agent_id"], row["other_id"]) == (study.scenario.name, study.agent, study.other)


class Blind:
    """Drives straight on at constant speed, whatever is there."""

    def plan(self, view, predictions):
        from interdrive import Trajectory

        ahead = view.ego.velocity * view.dt * np.arange(31)
        level = np.zeros(31)
        return Trajectory(view.ego.x + ahead, view.ego.y + level, level, view.ego.velocity + level)


def test_two_that_collide_have_distance_zero_and_are_said_to_collide():
    scenario = world(
        straight_road(400.0),
        cars=[Car(7, 40.0, velocity=5.0)],
        problems=[problem(100, 10.0, velocity=15.0, goal=(300.0, 0.0), time_step=(0, 200))],
    )
    study = case_study(scenario, agent=100, other=7, planner=Blind, threads=1)
    rows = study.table.to_pylist()
    assert [row["collided"] for row in rows] == [True, True, True]
    assert [row["min_dce"] for row in rows] == [0.0, 0.0, 0.0]
    assert [row["agent_outcome"] for row in rows] == ["collision"] * 3
    assert rows[0]["other_outcome"] is None
    # 25.5 m between the bumpers, 10 m/s faster
    assert "Deterministic: they collide at 2.6 s with 10.0 m/s" in reading(study)
    assert "X" in {line.get_marker() for axes in profile_figure(study).axes for line in axes.lines}
    assert scene_figure(study).axes[0].get_title(loc="left") == "deterministic: collision"


def test_a_collision_counts_whoever_reports_it():
    run = invented_run()
    assert collided(run, 2, 22)
    assert collided(run, 22, 2)
    assert not collided(run, 1, 22)
    assert distance_of_closest_encounter(run, 22, 2) == 0.0


def test_the_distance_is_undefined_while_one_of_them_is_absent():
    run = invented_run()
    distances = footprint_distances(run, 1, 4)
    assert np.flatnonzero(np.isfinite(distances)).tolist() == list(range(5, 40))
    assert distances[5] == pytest.approx(smallest_distance_at(run, 1, 4, 5))
    valid = run.states.valid.copy()
    valid[row_of(run, 1), 5:] = False
    never = replace(run, states=replace(run.states, valid=valid))
    assert np.isnan(footprint_distances(never, 1, 4)).all()
    assert np.isnan(distance_of_closest_encounter(never, 1, 4))
    assert np.isnan(footprint_distances(run, 1, 99)).all()


def smallest_distance_at(run, first, second, column):
    return polygon(run, row_of(run, first), column).distance(polygon(run, row_of(run, second), column))


def test_circles_and_polygons_have_their_own_distance():
    run = invented_run()
    bush, walker = row_of(run, 23), row_of(run, 24)
    states = run.states
    center = np.array([states.x[bush, 0], states.y[bush, 0]])
    outline = np.array([(-2.0, -1.5), (2.0, -1.5), (1.0, 1.5), (-2.0, 1.0)]) + center
    away = shapely.Polygon(outline).distance(shapely.Point(states.x[walker, 0], states.y[walker, 0])) - 0.3
    assert footprint_distances(run, 23, 24)[0] == pytest.approx(away)


# Lateral positions


def test_lateral_positions_are_distances_to_the_path_positive_to_the_left():
    angle = np.linspace(0.0, 1.5, 60)
    path = 40.0 * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1)
    points = np.random.default_rng(3).uniform((2.0, -5.0), (35.0, 35.0), (200, 2))
    line = shapely.LineString(path)
    found = lateral_offsets(path, points)
    inside = np.isfinite(found)
    assert inside.sum() > 150
    assert np.abs(found[inside]) == pytest.approx(shapely.distance(line, shapely.points(points))[inside], abs=1e-9)
    # The path bends around (0, 40): to its left is nearer to that point than 40 m.
    clear = inside & (np.abs(found) > 0.1)
    assert np.array_equal(found[clear] > 0.0, np.hypot(*(points[clear] - (0.0, 40.0)).T) < 40.0)


def test_beyond_the_ends_of_a_path_and_while_absent_there_is_no_lateral_position():
    path = np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 0.0), (20.0, 0.0)])
    points = np.array([(-1.0, 0.5), (0.0, 0.5), (10.0, -2.0), (20.0, 0.5), (21.0, 0.5), (np.nan, np.nan)])
    assert np.array_equal(lateral_offsets(path, points), [np.nan, 0.5, -2.0, 0.5, np.nan, np.nan], equal_nan=True)


# Figures


def test_the_profiles_show_position_and_velocity_of_both_with_three_lines_each(study):
    figure = profile_figure(study)
    upper_left, upper_right, lower_left, lower_right = figure.axes
    assert [upper_left.get_title(), upper_right.get_title()] == [
        f"agent {study.agent}",
        f"other vehicle {study.other}",
    ]
    assert "lateral position" in upper_left.get_ylabel()
    assert upper_left.get_ylabel().endswith("[m]")
    assert lower_left.get_ylabel() == "velocity [m/s]"
    assert {lower_left.get_xlabel(), lower_right.get_xlabel()} == {"time [s]"}
    names = [degree.replace("_", "-") for degree in DEGREES]
    for axes in figure.axes:
        lines = [line for line in axes.lines if line.get_label() in names]
        assert [line.get_label() for line in lines] == names
        assert len({(line.get_color(), str(line.get_linestyle())) for line in lines}) == 3
        assert axes.get_xlim() == upper_left.get_xlim()
    assert lower_left.get_ylim() == lower_right.get_ylim()
    lines = [line for line in lower_right.lines if line.get_label() in names]
    for run, line in zip(study.runs.values(), lines, strict=True):
        row = row_of(run, study.other)
        there = run.states.valid[row]
        assert np.array_equal(line.get_ydata()[there], run.states.velocity[row, there])
        assert np.isnan(line.get_ydata()[~there]).all()
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend[:4] == [*names, "nearest"]


def test_the_scenes_show_the_same_part_of_the_world_in_a_panel_per_degree(study):
    figure = scene_figure(study)
    assert len(figure.axes) == 3
    assert len({(axes.get_xlim(), axes.get_ylim()) for axes in figure.axes}) == 1
    for axes, row in zip(figure.axes, study.table.to_pylist(), strict=True):
        assert axes.get_title(loc="left") == f"{row['degree'].replace('_', '-')}: min. DCE {row['min_dce']:.2f} m"
        stamps = [text for text in axes.texts if text.get_text().endswith(" s")]
        assert sum(text.get_fontweight() == "bold" for text in stamps) == 2
        assert len(stamps) >= 4
    assert figure.get_figwidth() * 25.4 == pytest.approx(180.0)


def test_no_time_stamp_in_a_scene_covers_another_one(study):
    figure = scene_figure(study)
    figure.canvas.draw()
    for axes in figure.axes:
        boxes = [text.get_window_extent() for text in axes.texts if text.get_text().endswith(" s")]
        for index, box in enumerate(boxes):
            for other in boxes[index + 1 :]:
                width = min(box.x1, other.x1) - max(box.x0, other.x0)
                height = min(box.y1, other.y1) - max(box.y0, other.y0)
                assert min(width, height) < 0.2 * box.height


def test_time_stamps_stand_beside_where_the_vehicle_is_then(studies):
    study = studies["lane_merge"]
    run, axes = study.runs["deterministic"], scene_figure(study).axes[0]
    column = 0
    start = run.states.x[row_of(run, study.agent), column], run.states.y[row_of(run, study.agent), column]
    nearest = min(
        (text for text in axes.texts if text.get_text() == "0 s"),
        key=lambda text: np.hypot(*(np.array(text.get_position()) - start)),
    )
    assert np.hypot(*(np.array(nearest.get_position()) - start)) < 6.0


# The folder


def test_the_folder_holds_tables_runs_and_figures(studies, tmp_path):
    folder = save_study(list(studies.values()), tmp_path / "study")
    rows = pq.read_table(folder / "table.parquet").to_pylist()
    assert rows == [row for study in studies.values() for row in study.table.to_pylist()]
    with (folder / "table.csv").open() as file:
        texts = list(csv.DictReader(line for line in file if not line.startswith("# ")))
    assert [float(text["min_dce"]) for text in texts] == [row["min_dce"] for row in rows]
    assert [text["degree"] for text in texts] == [row["degree"] for row in rows]
    for study in studies.values():
        inside = folder / study.name
        assert sorted(path.name for path in inside.iterdir()) == sorted(
            [*DEGREES, "profiles.pdf", "profiles.png", "scenes.pdf", "scenes.png"]
        )
        for degree, run in study.runs.items():
            assert read_results(inside / degree).info["digest"] == run.digest
        assert (inside / "scenes.pdf").read_bytes().startswith(b"%PDF")
    cases = json.loads((folder / "study.json").read_text())["cases"]
    assert [case["folder"] for case in cases] == [study.name for study in studies.values()]
    assert {(case["planner"], case["predictor"]) for case in cases} == {("rollout", "neural")}


def test_a_saved_run_of_a_study_can_be_verified(studies, tmp_path):
    study = studies["t_junction"]
    folder = save_study([study], tmp_path / "study")
    for degree in DEGREES:
        done = CliRunner().invoke(main, ["verify", str(folder / study.name / degree)])
        assert done.exit_code == 0, done.output


def test_another_study_is_replaced_only_if_asked_and_foreign_folders_never(studies, tmp_path):
    study = studies["lane_merge"]
    folder = save_study([study], tmp_path / "study")
    with pytest.raises(ResultsError, match="a study already exists there"):
        save_study([study], folder)
    save_study([study], folder, overwrite=True)
    (folder / study.name / "notes.txt").write_text("mine")
    with pytest.raises(ResultsError, match=f"has other contents \\({study.name}\\)"):
        save_study([study], folder, overwrite=True)
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "cat.jpg").write_text("cat")
    with pytest.raises(ResultsError, match="cat"):
        save_study([study], tmp_path / "photos", overwrite=True)
    assert (tmp_path / "photos" / "cat.jpg").read_text() == "cat"


def test_nothing_is_left_behind_when_writing_fails(studies, tmp_path, monkeypatch):
    def fails(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("interdrive.studies.folder.write_table", fails)
    with pytest.raises(ResultsError, match="No space left"):
        save_study([studies["lane_merge"]], tmp_path / "deep" / "study")
    assert list(tmp_path.iterdir()) == []


# The command


def invoke(*arguments):
    return CliRunner().invoke(main, ["study", *arguments])


def refused(*arguments):
    """The one line of a refusal."""
    done = invoke(*arguments)
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1, done.stderr
    return done.stderr.strip().removeprefix("error: ")


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty working folder, and no recorded scenarios."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("INTERDRIVE_SCENARIOS", raising=False)
    return tmp_path


def test_without_recorded_scenarios_a_known_study_is_the_shipped_one_and_says_so(here):
    done = invoke("merge")
    assert done.exit_code == 0, done.output
    assert "lane_merge: agent 2001 (rollout), other vehicle 1004" in done.stdout
    assert "note: merge/ZAM_Zip-1_56_T-1.xml is left out: INTERDRIVE_SCENARIOS does not name its folder" in done.stdout
    assert "results in out/study_merge" in done.stdout
    assert "…" not in done.stdout  # nothing is cut off
    for degree in ("deterministic", "semi-deterministic", "interactive"):
        assert any(line.split()[:1] == [degree] for line in done.stdout.splitlines())
    assert (here / "out" / "study_merge" / "lane_merge_2001_1004" / "interactive" / "run.json").exists()
    assert "Deterministic: they come to " in done.stdout
    assert invoke("merge", "--quiet").stdout == ""
    assert (here / "out" / "study_merge-2").exists()


def test_any_scenario_and_pair_can_be_studied_with_planner_and_settings(here):
    done = invoke(
        "t_junction", "--agent", "2001", "--other", "1003", "--planner", "frenet", "--predictor", "constant_velocity",
        "--set", "planner.frenet.level=1", "--threads", "1", "--out", "made",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    for degree in DEGREES:
        settings = read_results(here / "made" / "t_junction_2001_1003" / degree).info["settings"]
        assert settings["predictor"] == "constant_velocity"
        assert settings["settings"]["planner.frenet.level"] == 1
    assert "a study already exists there" in refused("merge", "--out", "made")


def test_the_printed_table_has_room_for_long_outcomes(here):
    done = invoke("t_junction", "--planner", "idm")
    assert "no goal_reached_late goal_reached " in " ".join(done.stdout.split())
    assert "…" not in done.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ("t_junction", "--agent", "7", "--other", "1001"),
            "agent 7: no such vehicle; possible agents: 2001,",
        ),
        (("t_junction", "--agent", "2001", "--other", "2001"), "agent 2001 and the other vehicle must be two vehicles"),
        (("t_junction", "--agent", "1001", "--other", "2001"), "other vehicle 2001: it has no recording"),
        (("t_junction", "--agent", "2001", "--other", "5"), "other vehicle 5: it has no recording"),
        (("t_junction", "--agent", "2001"), "study t_junction: no encounter; give --agent and --other"),
        (("highway",), "study highway: no encounter; give --agent and --other; studies by name: merge, t_junction"),
        (("nowhere.xml", "--agent", "1", "--other", "2"), "nowhere.xml: no such file"),
        (("merge", "--planner", "frenett"), "frenett"),
        (("merge", "--set", "view.range=3"), "view.range: no such setting"),
        (("merge", "--set", "view"), "--set view: write it as name=value"),
        (("merge", "--agent", "one", "--other", "2"), "'one' is not a valid integer"),
    ],
)
def test_what_cannot_be_studied_is_refused_in_one_line(here, arguments, words):
    assert words in refused(*arguments)
    assert list(here.iterdir()) == []


def test_a_folder_of_recorded_scenarios_that_does_not_hold_them_is_refused(here, monkeypatch):
    monkeypatch.setenv("INTERDRIVE_SCENARIOS", str(here))
    line = refused("merge")
    assert line.startswith(f"{here}/merge/ZAM_Zip-1_56_T-1.xml: no such file; INTERDRIVE_SCENARIOS must name")


def test_an_unknown_study_is_refused_with_the_list():
    with pytest.raises(InputError, match="no study 'roundabout'; there are merge, t_junction"):
        known_cases("roundabout")


def test_a_planning_problem_that_is_the_other_vehicle_is_refused():
    scenario = read_scenario(shipped_scenario("lane_merge"))
    obstacles = scenario.obstacles
    row = int(np.flatnonzero(obstacles.ids == 1004)[0])
    task = scenario.planning_problems[0]
    start = replace(task.initial_state, x=float(obstacles.x[row, 0]), y=float(obstacles.y[row, 0]))
    scenario = replace(scenario, planning_problems=(replace(task, initial_state=start),))
    with pytest.raises(InputError, match="agent 1004 and the other vehicle are one vehicle"):
        case_study(scenario, agent=task.id, other=1004)


# Recorded scenarios


@pytest.mark.parametrize("name", ["merge", "t_junction"])
def test_the_studies_of_the_paper_run_on_their_recorded_scenarios(name, scenarios_folder, monkeypatch):
    monkeypatch.setenv("INTERDRIVE_SCENARIOS", str(scenarios_folder))
    cases, notes = known_cases(name)
    assert notes == ()
    recorded = [case for case in cases if str(scenarios_folder) in case.scenario]
    assert len(recorded) == len(cases) - 1
    for case in recorded:
        study = case_study(case.scenario, agent=case.agent, other=case.other)
        for row, run in zip(study.table.to_pylist(), study.runs.values(), strict=True):
            expected = 0.0 if row["collided"] else smallest_distance(run, case.agent, case.other)
            assert row["min_dce"] == pytest.approx(expected, abs=1e-9)
