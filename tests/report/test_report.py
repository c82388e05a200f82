"""The page of a run: what is in it, that it needs nothing else, and what it says about what is missing."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from click.testing import CliRunner
from drivers import Straight
from invented_run import invented_run
from packed import unpacked

from interdrive.cli import main
from interdrive.config.schema import RecordSettings, SimulationSettings, StepSettings
from interdrive.criticality import MEASURES, CriticalitySettings, evaluate
from interdrive.criticality.tables import save_criticality
from interdrive.errors import InputError, ResultsError
from interdrive.report import write_pair_report, write_run_report
from interdrive.report.contents import run_contents
from interdrive.report.differences import differing_settings
from interdrive.report.events import Event, events_of
from interdrive.report.measured import Measured
from interdrive.report.packing import Packer
from interdrive.results import candidates_table, holds_run, predictions_table, read_results, save
from interdrive.results.information import read_information
from interdrive.runs import recorded_run
from interdrive.simulation import simulate
from interdrive.testing import Car, problem, straight_road, world

ROOT = Path(__file__).resolve().parents[2]
EVERYTHING = RecordSettings(views=True, predictions=True, candidates=12, candidate_spacing=0.0)


@pytest.fixture(scope="module")
def run():
    """Two agents and a slow recorded car on two lanes, everything recorded."""
    problems = [
        problem(100, 20.0, goal=(90.0, 0.0), time_step=(0, 90)),
        problem(200, 12.0, 3.5, velocity=12.0, goal=(110.0, 3.5), time_step=(0, 90)),
    ]
    made = world(straight_road(300.0, lanes=2), cars=[Car(7, 60.0, velocity=6.0)], problems=problems)
    return simulate(made, agents=[100, 200], settings=SimulationSettings(record=EVERYTHING), threads=1)


@pytest.fixture(scope="module")
def folder(run, tmp_path_factory):
    return save(run, tmp_path_factory.mktemp("report") / "run")


@pytest.fixture
def copied(folder, tmp_path):
    """A copy of the run folder, to break."""
    return Path(shutil.copytree(folder, tmp_path / "copy"))


def missing(path):
    return {entry["what"]: entry["text"] for entry in run_contents(path).header["missing"]}


# Packing


@pytest.mark.parametrize(
    ("values", "unit", "steps"),
    [
        (np.array([[1.234, 2.346, np.nan], [np.nan, -40.0, 7.0]]), 0.01, True),
        (np.array([[1.234, 2.346, np.nan], [np.nan, -40.0, 7.0]]), 0.01, False),
        (np.array([[3, 70_000], [-5, 9]]), None, True),
        (np.array([[3, 70_000], [-5, 9]]), None, False),
        (np.array([True, False, True]), None, False),
        (np.empty((0, 4)), 0.01, True),
        (np.empty((4, 0)), 0.01, True),
        (np.full((2, 3), np.nan), 0.01, True),
    ],
)
def test_what_is_packed_comes_out_again_to_its_resolution(values, unit, steps):
    packer = Packer()
    packer.add("other", np.arange(3))
    packer.add("it", values, unit=unit, steps=steps)
    found = unpacked(packer.header, packer.text())["it"]
    assert found.shape == values.shape
    np.testing.assert_allclose(found, values.astype(float), atol=0.5 * (unit or 0.0) + 1e-12, rtol=0.0)


def test_numbers_without_a_resolution_keep_four_digits_and_what_is_not_finite():
    values = np.array([1234.5678, -0.00012345678, np.inf, -np.inf, np.nan, 0.0])
    packer = Packer()
    packer.add("it", values)
    np.testing.assert_allclose(unpacked(packer.header, packer.text())["it"], values, rtol=1e-4)


# Contents


def test_a_page_holds_the_states_of_everybody_to_a_centimetre(run, folder):
    contents = run_contents(folder)
    found = unpacked(contents.header["arrays"], contents.arrays)
    valid = run.states.valid
    assert np.array_equal(found["valid"].astype(bool), valid)
    shift = (run.states.x - found["x"])[valid]
    assert np.ptp(shift) <= 0.011
    assert shift.mean() == pytest.approx(round(shift.mean()), abs=0.006), "positions start at a whole metre"
    np.testing.assert_allclose(found["velocity"][valid], run.states.velocity[valid], atol=0.006)
    assert [p["id"] for p in contents.header["participants"]] == [7, 100, 200]
    assert [p["agent"] for p in contents.header["participants"]] == [-1, 0, 1]


def test_a_page_holds_every_plan_with_its_velocities(run, folder):
    contents = run_contents(folder)
    found = unpacked(contents.header["arrays"], contents.arrays)
    assert len(found["plan_step"]) == len(run.plans.time_step)
    spacing = contents.header["arrays"]["plan_step"]["spacing"]
    own = run.plans.velocity[run.plans.agent_id == 100][:, ::spacing]
    mine = found["plan_velocity"][found["plan_participant"] == 1]
    np.testing.assert_allclose(mine[:, : own.shape[1]], own, atol=0.006)


def test_a_page_tells_when_the_plans_were_made_that_agents_follow(run, tmp_path):
    settings = SimulationSettings(step=StepSettings(replan_every=3))
    made = run_contents(save(simulate(run.scenario, agents=[200], settings=settings, threads=1), tmp_path / "run"))
    found = unpacked(made.header["arrays"], made.arrays)
    step = found["plan_step"].astype(int)
    assert np.array_equal(found["plan_made"], step - step % 3)
    costs = np.isfinite(found["plan_cost"])
    assert np.array_equal(costs, found["plan_made"] == step), "plans that go on have no cost of their own"


def test_goals_and_sight_of_agents_are_in_the_header(folder):
    agent = run_contents(folder).header["participants"][1]
    assert agent["sensor_radius"] == 80.0
    assert agent["occlusion"] is False
    assert len(agent["goal"]) == 1
    assert len(agent["goal"][0]) >= 4


def test_candidates_include_the_chosen_one_and_the_plan_is_it():
    agent = problem(100, 20.0, goal=(90.0, 0.0), time_step=(0, 90))
    held_up = world(straight_road(300.0, lanes=2), cars=[Car(7, 60.0)], problems=[agent])
    run = simulate(held_up, agents=[100], settings=SimulationSettings(record=EVERYTHING), threads=1)
    considered, plans = run.candidates, run.plans
    assert considered.chosen.sum() == (plans.status == 1).sum()
    rows = np.flatnonzero(considered.agent_id == 100)
    steps, counts = np.unique(considered.time_step[rows], return_counts=True)
    assert 3 <= counts.max() <= 12, "behind the standing car it looks at several ways"
    step = steps[counts.argmax()]
    found = rows[considered.time_step[rows] == step]
    chosen = found[considered.chosen[found]][0]
    own = np.flatnonzero((plans.agent_id == 100) & (plans.time_step == step))[0]
    np.testing.assert_allclose(considered.x[chosen], plans.x[own][considered.point], atol=0.001)
    usable = found[[considered.rejection[row] == "" for row in found]]
    assert np.nanargmin(considered.cost[usable]) == np.flatnonzero(usable == chosen)[0]


def test_candidates_are_kept_every_half_second_from_the_start_of_an_agent_on(run):
    settings = SimulationSettings(record=RecordSettings(candidates=3))
    kept = simulate(run.scenario, agents=[100, 200], settings=settings, threads=1).candidates
    every = run.candidates
    for agent in (100, 200):
        steps = np.unique(every.time_step[every.agent_id == agent])
        assert np.unique(kept.time_step[kept.agent_id == agent]).tolist() == steps[::5].tolist()


def test_candidates_are_those_of_new_plans_only(run):
    settings = SimulationSettings(record=RecordSettings(candidates=3), step=StepSettings(replan_every=2))
    drive = simulate(run.scenario, agents=[100, 200], settings=settings, threads=1)
    carried = drive.plans.time_step[np.isnan(drive.plans.cost) & (drive.plans.status == 1)]
    assert len(carried) > 10
    assert sorted(set(drive.candidates.agent_id.tolist())) == [100, 200]
    for agent in (100, 200):
        steps = np.unique(drive.candidates.time_step[drive.candidates.agent_id == agent])
        own = drive.plans.agent_id == agent
        costs = dict(zip(drive.plans.time_step[own].tolist(), drive.plans.cost[own].tolist(), strict=True))
        assert np.isfinite([costs[step] for step in steps.tolist()]).all()
        assert set(np.diff(steps).tolist()) == {6}


def test_predictions_are_kept_every_half_second_with_probabilities_that_add_up(run):
    predicted = run.predictions
    assert predicted.point.tolist() == [5, 10, 15, 20, 25, 30]
    for step in (0, 10):
        for participant in (7, 100, 200):
            rows = (predicted.time_step == step) & (predicted.participant_id == participant)
            assert predicted.probability[rows].sum() == pytest.approx(1.0)
    row = np.flatnonzero((predicted.time_step == 0) & (predicted.participant_id == 7))[0]
    assert predicted.x[row, 0] == pytest.approx(63.0, abs=0.1), "0.5 s at 6 m/s from 60 m"


def test_recording_changes_nothing_that_happens(run):
    plain = simulate(run.scenario, agents=[100, 200], threads=1)
    assert plain.digest == run.digest
    assert plain.predictions is None
    assert plain.candidates is None


def test_what_was_recorded_survives_the_folder(run, folder):
    loaded = read_results(folder)
    assert loaded.predictions.equals(predictions_table(run))
    assert loaded.candidates.equals(candidates_table(run))
    assert loaded.predictions.num_rows == run.predictions.x.size
    numbers = loaded.candidates["candidate"].to_pylist()[:: len(run.candidates.point)]
    plans = [*(row for row, number in enumerate(numbers) if number == 0), len(numbers)]
    assert all(numbers[row:after] == list(range(after - row)) for row, after in pairwise(plans))


def test_a_negative_number_of_candidates_is_refused():
    with pytest.raises(InputError, match=r"candidates: must be at least 0"):
        RecordSettings(candidates=-1)
    with pytest.raises(InputError, match=r"candidate_spacing: must not be negative"):
        RecordSettings(candidate_spacing=-0.1)


# Events


def test_collisions_goals_and_what_planners_gave_up_are_events(tmp_path):
    header = run_contents(save(invented_run(), tmp_path / "run")).header
    said = {(event["kind"], event["text"]): event for event in header["events"]}
    crash = said["collision", "2 collides with 22 at 17.0 m/s"]
    assert crash["step"] == 47
    assert [header["participants"][row]["id"] for row in crash["rows"]] == [2, 22]
    assert ("goal_reached", "1 reaches its goal") in said
    assert ("planner_error", "4 ends: its planner failed") in said
    assert (
        said["emergency_braking", "2 falls back on an emergency plan; most samples were rejected: collision with 24"][
            "step"
        ]
        == 47
    )
    assert [event["step"] for event in header["events"]] == sorted(event["step"] for event in header["events"])


def approach(gap):
    """Agent 100 closes in by 1 m per time step on car 7, which is gone after time step 30; 200 keeps its distance."""
    problems = [
        problem(100, 20.0, velocity=20.0, goal=(90.0, 0.0), time_step=(0, 90)),
        problem(200, 20.0, 3.5, velocity=12.0, goal=(90.0, 3.5), time_step=(0, 90)),
    ]
    length = 4.508  # of the agents; that of cars is 4.5 m
    cars = [Car(7, 20.0 + 0.5 * (length + 4.5) + gap, velocity=10.0, last=30), Car(8, 80.0, 3.5, velocity=12.0)]
    made = world(straight_road(300.0, lanes=2), cars=cars, problems=problems)
    return simulate(made, agents=[100, 200], planner=Straight, predictor="constant_velocity", threads=1)


def critical(events):
    return [event for event in events if event["kind"] == "critical"]


def test_the_most_critical_moment_is_an_event_if_it_is_below_the_threshold(tmp_path):
    header = run_contents(save(approach(gap=45.0), tmp_path / "run")).header
    [event] = [event for event in critical(header["events"]) if "time to collision" in event["text"]]
    assert event["value"] == pytest.approx(1.5, abs=0.001), "15 m are left at 10 m/s"
    assert event["step"] == 30
    assert event["text"] == "100: time to collision along lanes 1.50\N{NO-BREAK SPACE}s with 7"
    assert [header["participants"][row]["id"] for row in event["rows"]] == [100, 7]


def test_above_the_threshold_no_moment_is_an_event(tmp_path):
    header = run_contents(save(approach(gap=50.5), tmp_path / "run")).header
    found = evaluate(approach(gap=50.5))
    assert np.nanmin(found["ttc"]) == pytest.approx(2.05, abs=0.001)
    assert critical(header["events"]) == []


@pytest.mark.parametrize(
    ("measure", "value", "text"),
    [
        ("ttc", 2.0, "1: time to collision along lanes 2.00\N{NO-BREAK SPACE}s with 22"),
        ("ttc", 2.001, None),
        ("pet", 0.25, "1: post-encroachment time 0.25\N{NO-BREAK SPACE}s with 22"),
        ("pet", 1.001, None),
        ("btn", 1.0, "1: brake threat number 1.00 with 22"),
        ("btn", 0.999, None),
        ("btn", np.inf, None),
        ("ttc", np.nan, None),
        ("hw", 0.0, None),
    ],
)
def test_measures_with_a_threshold_are_events_from_it_on(measure, value, text):
    run = invented_run()
    names = [one.name for one in MEASURES]
    shape = len(MEASURES), len(run.outcomes.agent_id)
    extreme, step, partner = np.full(shape, np.nan), np.zeros(shape, dtype=int), np.full(shape, -1)
    at = names.index(measure), 0
    extreme[at], step[at], partner[at] = value, 17, np.searchsorted(run.states.participant_id, 22)
    measured = Measured(np.empty((*shape, 0)), np.empty((*shape, 0), dtype=int), extreme, step, partner)
    no_plans = pa.table({"point": []})
    found = [event for event in events_of(run, no_plans, measured, 1) if event.kind == "critical"]
    assert [(event.text, event.step, event.value) for event in found] == ([(text, 17, value)] if text else [])


def test_an_emergency_lasts_as_long_as_no_new_plan_is_of_another_kind():
    """Agent 1 plans anew every third time step and at 47, when its plan of 46 ends."""
    made = {40: "planned", 43: "emergency_braking", 46: "emergency_braking", 47: "emergency_braking", 50: "planned"}
    rows = [
        {"time_step": step, "agent_id": 1, "point": point, "status": made.get(step, "planned"), "rejection": ""}
        for step in range(40, 54)
        for point in range(2 if step == 46 else 20)
    ]
    run = invented_run()
    kinds = [(e.kind, e.step) for e in events_of(run, pa.Table.from_pylist(rows), None, 3) if e.rows == (0,)]
    assert [event for event in kinds if event[0] == "emergency_braking"] == [("emergency_braking", 43)]


# The page


def test_a_page_is_one_file_that_names_no_other_and_is_the_same_each_time(folder, tmp_path):
    path = write_run_report(folder, tmp_path / "page.html")
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"""(?:src|href)=["'](?!data:)""", text)
    assert "default-src 'none'" in text
    assert text == write_run_report(folder, tmp_path / "again.html").read_text(encoding="utf-8")


def test_by_default_the_page_goes_into_the_folder_which_stays_a_run_folder(copied):
    assert write_run_report(copied) == copied / "report.html"
    assert holds_run(copied)


def test_texts_from_outside_cannot_end_the_data(copied):
    info = json.loads((copied / "run.json").read_text())
    info["notes"] = ["</script><script>alert(1)</script>"]
    (copied / "run.json").write_text(json.dumps(info))
    text = write_run_report(copied).read_text(encoding="utf-8")
    assert "alert(1)" in text
    assert "<script>alert" not in text


def test_the_bundle_was_made_from_the_sources_that_lie_here():
    frontend = ROOT / "frontend"
    names = [f"src/{path.name}" for path in (frontend / "src").iterdir()]
    total = hashlib.sha256()
    for name in sorted([*names, "build.mjs", "package.json"]):
        total.update(f"{name}\n".encode() + (frontend / name).read_bytes())
    for name in ("report.js", "report.css"):
        first = (ROOT / "python" / "interdrive" / "report" / "bundle" / name).read_text(encoding="utf-8").split("\n")[0]
        assert total.hexdigest() in first, f"{name} is older than frontend/: run make report_bundle"


# What is missing


def test_a_run_as_it_is_by_default_says_what_it_lacks_and_how_to_get_it(run, tmp_path):
    found = missing(save(replace(run, views=None, predictions=None, candidates=None), tmp_path / "run"))
    assert sorted(found) == ["candidates", "predictions", "views"]
    assert all("--report" in text for text in found.values())


@pytest.mark.parametrize(
    ("file", "what"), [("plans", "plans"), ("predictions", "predictions"), ("candidates", "candidates")]
)
def test_a_run_without_a_table_is_shown_without_it(copied, file, what):
    (copied / f"{file}.parquet").unlink()
    assert list(missing(copied)) == [what]
    write_run_report(copied)


def test_a_run_without_timing_is_shown_whole(copied):
    (copied / "timing.parquet").unlink()
    assert missing(copied) == {}


def test_measures_that_cannot_be_evaluated_are_named(copied, monkeypatch):
    def refuse(_run):
        raise InputError("no vehicle to judge")

    monkeypatch.setattr("interdrive.report.measured.evaluate", refuse)
    assert missing(copied) == {"criticality": "Criticality cannot be evaluated: no vehicle to judge"}
    assert run_contents(copied).header["measures"] == []


def test_measures_of_the_folder_are_preferred_to_evaluating_again(run, copied):
    def measured():
        contents = run_contents(copied)
        return unpacked(contents.header["arrays"], contents.arrays)

    before = measured()
    save_criticality(run.criticality(), copied)
    after = measured()
    assert np.array_equal(before["measure"], after["measure"], equal_nan=True)
    assert np.array_equal(before["measure_partner"], after["measure_partner"])
    save_criticality(run.criticality(settings=CriticalitySettings(radius=5.0)), copied)
    assert not np.array_equal(measured()["measure"], before["measure"], equal_nan=True)


def test_a_run_without_agents_is_shown(tmp_path):
    recorded = recorded_run(invented_run().scenario)
    header = run_contents(save(recorded, tmp_path / "run")).header
    assert header["events"] == []
    assert header["measures"] == []


@pytest.mark.parametrize("file", ["outcomes.parquet", "states.parquet", "run.json"])
def test_without_outcomes_states_or_run_json_there_is_no_page(copied, file):
    (copied / file).unlink()
    with pytest.raises(ResultsError, match=file):
        write_run_report(copied)
    assert not (copied / "report.html").exists()


def test_a_folder_of_another_format_is_refused_in_one_line(copied):
    info = json.loads((copied / "run.json").read_text())
    (copied / "run.json").write_text(json.dumps(info | {"format": 0}))
    with pytest.raises(ResultsError, match=r"run\.json: format 0 is that of an older interdrive") as caught:
        write_run_report(copied)
    assert "\n" not in str(caught.value)


def test_a_page_that_cannot_be_written_leaves_nothing_behind(folder, tmp_path):
    with pytest.raises(ResultsError, match=r"page\.html: a folder with this name already exists"):
        (tmp_path / "page.html").mkdir()
        (tmp_path / "page.html" / "thing").touch()
        write_run_report(folder, tmp_path / "page.html")
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


# The command line


def test_a_page_replaces_nothing_that_is_no_page(copied):
    before = (copied / "run.json").read_bytes()
    done = CliRunner().invoke(main, ["report", str(copied), "--out", str(copied / "run.json")])
    assert done.exit_code == 2
    assert "run.json: a page needs a name that ends in .html or .htm" in done.output
    assert (copied / "run.json").read_bytes() == before
    assert write_run_report(copied, copied / "PAGE.HTM").is_file()


def test_run_with_report_records_and_writes_the_page(tmp_path):
    out = tmp_path / "run"
    done = CliRunner().invoke(main, ["run", "lane_merge", "--agents", "2", "--report", "--out", str(out), "--quiet"])
    assert done.exit_code == 0, done.output
    assert (out / "report.html").stat().st_size > 100_000
    header = run_contents(out).header
    assert header["missing"] == []
    assert header["info"]["settings"]["settings"]["record.candidates"] == 30


def test_a_planner_that_weighs_no_candidates_has_a_page_without_them(tmp_path):
    out = tmp_path / "run"
    options = ["--agents", "1", "--planner", "idm", "--report", "--out", str(out), "--quiet"]
    done = CliRunner().invoke(main, ["run", "lane_merge", *options])
    assert (done.exit_code, done.output) == (0, "")
    assert read_results(out).candidates.num_rows == 0


def test_what_the_user_sets_wins_over_what_a_report_wants(tmp_path):
    out = tmp_path / "run"
    options = ["--report", "--set", "record.candidates=0", "--out", str(out), "--quiet"]
    assert CliRunner().invoke(main, ["run", "lane_merge", "--agents", "1", *options]).exit_code == 0
    assert list(missing(out)) == ["candidates"]


def test_report_says_where_the_page_is_and_how_large(copied):
    done = CliRunner().invoke(main, ["report", str(copied)])
    assert done.exit_code == 0
    assert re.search(r"report\.html \(0\.\d MB\); open it in a browser", done.output)


@pytest.mark.parametrize("what", ["empty", "nowhere", "file.html"])
def test_report_on_what_is_no_run_is_one_line_and_exit_code_2(tmp_path, what):
    (tmp_path / "empty").mkdir()
    (tmp_path / "file.html").touch()
    done = CliRunner().invoke(main, ["report", str(tmp_path / what)])
    assert done.exit_code == 2
    assert done.output.startswith("error: ")
    assert len(done.output.strip().splitlines()) == 1


def test_two_runs_of_a_scenario_share_a_page_and_others_do_not(tmp_path):
    run = invented_run()
    for name in ("frenet", "idm"):
        save(run, tmp_path / name)
    save(replace(run, scenario=replace(run.scenario, name="elsewhere")), tmp_path / "other")
    path = write_pair_report(tmp_path / "frenet", tmp_path / "idm")
    assert path == tmp_path / "frenet_idm.html"
    text = path.read_text(encoding="utf-8")
    assert text.count("<iframe ") == 2
    assert f"<h1>{tmp_path / 'idm'}</h1>" in text
    assert "Both runs have the same settings." in text
    with pytest.raises(ResultsError, match="runs of different scenarios"):
        write_pair_report(tmp_path / "frenet", tmp_path / "other")


def test_a_page_of_two_runs_and_its_command_say_which_settings_differ(tmp_path):
    world = {"agents": 2, "threads": 1, "predictor": "constant_velocity"}
    limits = {"step.max_steps": 5, "record.views": True}
    save(simulate("t_junction", planner="idm", settings=limits, **world), tmp_path / "one")
    limits = {"step.max_steps": 5, "view.sensor_radius": 40.0}
    save(simulate("t_junction", planner={2001: "idm", "default": "frenet"}, settings=limits, **world), tmp_path / "two")
    ids = [agent["id"] for agent in json.loads((tmp_path / "one" / "run.json").read_text())["agents"]]
    found = differing_settings(*(read_information(tmp_path / name) for name in ("one", "two")))
    planners = [(f"planner.{agent}", "idm", "frenet") for agent in ids if agent != 2001]
    assert found == [*planners, ("view.sensor_radius", "80", "40")]
    done = CliRunner().invoke(main, ["report", str(tmp_path / "one"), str(tmp_path / "two")])
    assert done.exit_code == 0
    assert any(line.split() == ["view.sensor_radius", "80", "40"] for line in done.stdout.splitlines())
    text = (tmp_path / "one_two.html").read_text(encoding="utf-8")
    assert "<tr><td>view.sensor_radius</td><td>80</td><td>40</td></tr>" in text


def test_an_event_without_a_mark_is_refused_instead_of_drawn_as_another():
    with pytest.raises(ValueError, match="events of the kind 'sneeze' have no mark"):
        Event(3, "sneeze", (0,), "100 sneezes")
