"""`interdrive search`: a planted fault is found, kept, shrunk, repeated, collected; bad input."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import drivers
import numpy as np
import pyarrow.parquet as pq
import pytest
from braking_leader import AGENT, BRAKING, LEADER, scenario
from click.testing import CliRunner

import interdrive as idr
from interdrive import InputError, ResultsError
from interdrive.cli import main
from interdrive.failure_search import HEAD, Space, Summary, check_failure, compared, failures, keeping, replay
from interdrive.failure_search.evaluation import Drivers, judged
from interdrive.failure_search.page import search_figure
from interdrive.failure_search.pairs import pairs
from interdrive.failure_search.search_folder import SearchFolder
from interdrive.failure_search.spaces import disturbance, undisturbed
from interdrive.failure_search.trials import Setup, Trial
from interdrive.plots.view import view_of_end
from interdrive.testing import Car, straight_road, world

RUNS = 12
#: A planner that does not see what is ahead.
BLIND = "drivers:Straight"


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "leader.xml"
    idr.write_scenario(scenario(), path)
    return path


def searched(file, out, runs=RUNS, **more):
    options = {"agent_id": AGENT, "predictor": "constant_velocity", "space": BRAKING, **more}
    return idr.search(file, options.pop("planner", BLIND), runs=runs, out=out, **options)


@pytest.fixture(scope="module")
def done(file, tmp_path_factory):
    folder = tmp_path_factory.mktemp("search") / "blind"
    return searched(file, folder), folder


def invoked(*arguments):
    result = CliRunner().invoke(main, ["search", *map(str, arguments)])
    return result.exit_code, " ".join(result.output.split())


@pytest.mark.long
def test_a_planner_that_does_not_see_its_leader_brake_is_found_at_fault_and_others_avoid_it(done):
    found, folder = done
    assert found.runs == RUNS
    assert 0 < found.uniform_failures <= found.uniform_runs
    assert found.rate[1] < found.rate[0] < found.rate[2]
    assert found.undisturbed == found.left_out == ()
    one = found.failures[0]
    assert (one.failure, one.witness, one.drive.agent_id) == ("ran_into", "cc", AGENT)
    assert one.disturbance.startswith("102 brakes with ")
    assert {path.name for path in one.folder.iterdir()} == {
        *("README.md", "failure.gif", "failure.json", "failure.png", "run", "run.toml", "start.xml", "witness"),
    }
    assert len(found.failures) <= 3, "failures of one signature"
    rows = pq.read_table(folder / "evaluations.parquet").to_pydict()
    assert rows["index"] == list(range(RUNS))
    assert rows["source"][:9] == ["uniform"] * 9
    assert rows["uniform"] == [source == "uniform" for source in rows["source"]]
    assert "levels" in rows["source"]
    assert [failure != "" for failure in rows["failure"]] == [value < 0.0 for value in rows["criticality"]]


def test_a_failure_is_repeated_to_the_bit_and_its_file_is_an_ordinary_scenario(done, tmp_path):
    one = done[0].failures[0]
    with pytest.raises(InputError, match=r"names code outside interdrive \(drivers:Straight\)"):
        replay(one)
    run, is_equal = replay(one, trust=True)
    assert is_equal
    assert one.replay(trust=True).digest == one.digest
    assert run.digest == one.digest
    assert invoked("replay", one.folder, "--trust")[0] == 0
    moved = tmp_path / "moved"
    shutil.copytree(one.folder, moved)
    stored = json.loads((moved / "failure.json").read_text())
    (moved / "failure.json").write_text(json.dumps({**stored, "digest": "0" * 64}))
    code, text = invoked("replay", moved, "--trust")
    assert code == 1
    assert "digest different" in text
    out = tmp_path / "again"
    ran = CliRunner().invoke(main, ["run", "--config", str(one.folder / "run.toml"), "--out", str(out), "--quiet"])
    assert ran.exit_code == 0, ran.output
    assert idr.load(out).digest == one.digest


def test_the_runs_of_a_failure_are_valid_and_its_witness_drives_on(done):
    one = done[0].failures[0]
    run, other = (idr.load(one.folder / name) for name in ("run", "witness"))
    (ended,), (avoided,) = run.outcomes.outcome, other.outcomes.outcome
    assert (ended, run.digest) == ("collision", one.digest)
    assert avoided not in ("collision", "infeasible", "planner_error")
    assert {name for (name,) in zip(other.outcomes.planner, strict=True)} == {one.witness}
    for name in ("run", "witness"):
        verified = CliRunner().invoke(main, ["verify", "--trust", str(one.folder / name)])
        assert (verified.exit_code, verified.output[:6]) == (0, "equal:")


def test_the_picture_of_a_failure_shows_where_it_happened(done):
    run = done[0].failures[0].replay(trust=True)
    view = view_of_end(run, AGENT, seconds=1.0)
    row = run.states.participant_id.tolist().index(AGENT)
    last = int(np.flatnonzero(run.states.valid[row])[-1])
    (x, y) = view.picture_from_world(np.array([run.states.x[row, last], run.states.y[row, last]]))
    assert view.x_limits[0] + 15.0 < x < view.x_limits[1] - 15.0
    assert view.y_limits[0] + 15.0 < y < view.y_limits[1] - 15.0
    assert view.width < 12.0 + 2.0 * 15.0 + 2.0 * 15.0, "m: a second, what is around it, and a margin"


@pytest.mark.long
def test_an_agent_that_fails_undisturbed_is_named_first_and_still_searched(tmp_path):
    path = tmp_path / "slow.xml"
    made = world(straight_road(400.0), cars=[Car(AGENT, 20.0), Car(LEADER, 50.0, velocity=4.0)], steps=80)
    x, velocity = made.obstacles.x.copy(), made.obstacles.velocity.copy()
    # The recorded driver of the agent slows down from 12 to 4 m/s.
    velocity[0] = np.maximum(12.0 - 0.3 * np.arange(velocity.shape[1]), 4.0)
    x[0] = 20.0 + 0.1 * (np.cumsum(velocity[0]) - velocity[0])
    idr.write_scenario(replace(made, obstacles=replace(made.obstacles, x=x, velocity=velocity)), path)
    found = searched(path, tmp_path / "out", 3, traffic="recorded")
    assert (found.undisturbed, found.runs, found.uniform_failures) == ((f"slow {AGENT}",), 3, 3)
    what = ("--planner", BLIND, "--agent", AGENT, "--predictor", "constant_velocity", "--no-shrink", "--keep", 1)
    code, text = invoked(path, *what, "--traffic", "recorded", "--runs", 1, "--workers", 1, "--out", tmp_path / "again")
    assert code == 0
    assert text.index(f"slow {AGENT}") < text.index("001: slow")


@pytest.mark.long
def test_an_interrupted_search_keeps_what_it_found_and_goes_on_to_the_same_bytes(done, file, tmp_path):
    def stop(runs, n_failures):
        if runs == 5:
            raise KeyboardInterrupt

    out = tmp_path / "stopped"
    with pytest.raises(KeyboardInterrupt):
        searched(file, out, on_run=stop)
    assert pq.read_table(out / "evaluations.parquet").num_rows == 5
    with (out / "evaluations.jsonl").open("a") as log:
        log.write('{"index": 5, "pa')  # what a killed process leaves
    found = searched(file, out)
    assert (out / "evaluations.jsonl").read_bytes() == (done[1] / "evaluations.jsonl").read_bytes()
    assert [one.digest for one in found.failures] == [one.digest for one in done[0].failures]


@pytest.mark.long
def test_a_killed_search_goes_on_to_the_same_bytes_and_another_process_repeats_its_failures(done, file, tmp_path):
    support = str(Path(drivers.__file__).parent)
    out, space = tmp_path / "killed", tmp_path / "space.toml"
    space.write_text(
        "start_time = [0.0, 0.0]\nstart_speed = [1.0, 1.0]\ndriver = []\nerrors = ['brakes']\nerror_share = 0.5\n"
        "error_time = [0.0, 4.0]\nsight = [80.0, 80.0]\nocclusion = 0.0\nperception = 0.0\nothers = 1\n"
    )
    program = [sys.executable, "-m", "interdrive", "search"]
    what = [file, "--planner", BLIND, "--agent", AGENT, "--predictor", "constant_velocity", "--space", space]
    limits = ["--runs", 100 * RUNS, "--workers", 1, "--out", out]
    words = [*program, *map(str, [*what, *limits])]
    environment = {**os.environ, "PYTHONPATH": support}
    log = out / "evaluations.jsonl"
    with subprocess.Popen(words, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        while process.poll() is None and not (log.exists() and log.read_bytes().count(b"\n") >= 3):
            time.sleep(0.02)
        process.kill()
    assert process.returncode == -signal.SIGKILL
    begun = log.read_bytes().count(b"\n")
    found = searched(file, out, runs=max(begun, RUNS))
    whole = (done[1] / "evaluations.jsonl").read_text().splitlines()
    assert log.read_text().splitlines()[:RUNS] == whole
    assert found.failures[0].digest == done[0].failures[0].digest
    again = subprocess.run(
        [*program, "replay", "--trust", str(found.failures[0].folder)],
        env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (again.returncode, again.stdout.splitlines()[-1]) == (0, "digest equal"), again.stderr


def test_the_page_of_a_search_has_every_failure_with_its_film_its_runs_and_the_yield(done, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(done[1], folder)
    ran = CliRunner().invoke(main, ["report", str(folder)])
    assert ran.exit_code == 0, ran.output
    page = (folder / "report.html").read_text()
    for one in done[0].failures:
        name = one.folder.name
        assert f"{name}: leader, agent {AGENT}, ran_into" in page
        for part in ("run/report.html", "witness/report.html", "failure.gif"):
            assert f'"failures/{name}/{part}"' in page
            assert (folder / "failures" / name / part).stat().st_size > 0
    assert f'<td class="number">{done[0].uniform_failures}</td>' in page
    assert (folder / "found.pdf").read_bytes().startswith(b"%PDF")
    figure = search_figure(Summary.of(folder))
    assert [len(line.get_xdata()) for line in figure.axes[0].get_lines()] == [
        1 + done[0].uniform_runs,
        1 + RUNS - done[0].uniform_runs,
    ]


def test_searches_are_compared_row_by_row(done, tmp_path):
    shutil.copytree(done[1], tmp_path / "again")
    code, text = invoked("compare", done[1], tmp_path / "again")
    assert code == 0
    first, second = (one.cells() for one in compared([done[1], tmp_path / "again"]))
    assert first[1:] == second[1:]
    assert (first[0], second[0]) == ("blind", "again")
    assert all(cell in text for cell in first)
    assert dict(zip(HEAD, first, strict=True))["failures"] == str(len(done[0].failures))
    assert invoked("compare", tmp_path)[0] == 2


def test_a_suite_says_which_failures_a_planner_has_fixed(done, tmp_path):
    suite = tmp_path / "suite"
    code, text = invoked("suite", done[1], "--out", suite)
    assert (code, f"{len(done[0].failures)} failure" in text) == (0, True)
    assert invoked("suite", done[1], "--out", suite)[0] == 2, "collected twice"
    code, text = invoked("check", suite, "--planner", BLIND)
    assert code == 1
    assert f"0 of {len(done[0].failures)} fixed" in text
    assert invoked("check", suite, "--planner", "cc")[0] == 0
    one = failures(suite)[0]
    assert check_failure(one, "cc").failure == ""
    one.check("cc")
    with pytest.raises(AssertionError, match="ran_into"):
        one.check(BLIND)


HANGING = """
import drivers, time

class Hanging(drivers.Straight):
    def plan(self, view, predictions):
        time.sleep(60.0)
"""


@pytest.mark.long
def test_a_planner_that_hangs_ends_a_check_and_a_repetition_after_the_time_that_it_is_given(
    done, tmp_path, monkeypatch
):
    (tmp_path / "hanging.py").write_text(HANGING)
    monkeypatch.syspath_prepend(str(tmp_path))
    suite = tmp_path / "suite"
    assert invoked("suite", done[1], "--out", suite)[0] == 0
    for more in failures(suite)[1:]:
        shutil.rmtree(more.folder)
    code, text = invoked("check", suite, "--planner", "hanging:Hanging", "--run-timeout", 0.5)
    assert code == 1
    assert "no answer: it took longer than 0.5 s (--run-timeout) 0 of 1 fixed" in text
    assert invoked("check", suite, "--planner", "cc", "--run-timeout", 60)[0] == 0
    (one,) = failures(suite)
    assert invoked("replay", one.folder, "--trust", "--run-timeout", 60)[0] == 0
    about = one.folder / "failure.json"
    about.write_text(about.read_text().replace(BLIND, "hanging:Hanging"))
    code, text = invoked("replay", one.folder, "--trust", "--run-timeout", 0.5)
    assert (code, "it took longer than 0.5 s" in text) == (2, True)
    assert invoked("check", suite, "--planner", "cc", "--run-timeout", 0)[0] == 2


def test_the_command_says_what_it_found_and_its_interval(file, tmp_path):
    code, text = invoked(file, "--planner", "idm", "--agent", AGENT, "--runs", 4, "--out", tmp_path / "idm")
    assert code == 0
    assert "0 failures kept, 0 of them avoidable; 0 of 4 uniform runs fail: 0.00 % (0.00 to 60.24)" in text


def test_what_is_stated_of_the_traffic_is_not_drawn(file, tmp_path):
    # Drawn, too, it would be given twice, and no world could be driven.
    more = {"space": replace(BRAKING, driver=("time_gap",)), "traffic": "idm,time_gap=1.5"}
    assert searched(file, tmp_path / "stated", 3, planner="idm", **more).uniform_runs == 3


def test_a_search_that_drives_nothing_says_so(file, tmp_path):
    # Nobody can have come from 1000 s away.
    space = tmp_path / "far.toml"
    space.write_text("start_time = [900.0, 1000.0]\nothers = 1\n")
    arguments = (file, "--planner", "idm", "--agent", AGENT, "--runs", 1, "--space", space, "--out", tmp_path / "far")
    code, text = invoked(*arguments)
    assert code == 0
    assert "0 of 0 uniform runs fail nothing was driven: no disturbed world was plausible" in text


def test_the_command_in_a_failure_trusts_the_planner_that_is_code(done):
    text = (done[0].failures[0].folder / "README.md").read_text()
    assert "interdrive search replay . --trust" in text
    assert "Python has to find drivers:Straight" in text


@pytest.mark.parametrize("spoilt", [{"undisturbed": [1]}, {"planner": None}])
def test_a_damaged_search_is_refused_in_one_line(done, tmp_path, spoilt):
    shutil.copytree(done[1], tmp_path / "spoilt")
    about = json.loads((tmp_path / "spoilt" / "search.json").read_text())
    kept = {name: value for name, value in {**about, **spoilt}.items() if value is not None}
    (tmp_path / "spoilt" / "search.json").write_text(json.dumps(kept))
    code, text = invoked("compare", tmp_path / "spoilt")
    assert (code, "is damaged" in text) == (2, True)


@pytest.mark.long
@pytest.mark.parametrize("workers", [2, 4])
def test_results_do_not_depend_on_the_number_of_processes(done, file, tmp_path, workers):
    searched(file, tmp_path / "more", workers=workers)
    for name in ("evaluations.jsonl", "evaluations.parquet", "search.json"):
        assert (tmp_path / "more" / name).read_bytes() == (done[1] / name).read_bytes(), name
    assert [one.digest for one in failures(tmp_path / "more")] == [one.digest for one in done[0].failures]


DEADLY = """
import os
from drivers import Straight

class Deadly(Straight):
    def plan(self, view, predictions):
        if len(view.ids) and view.velocity[0, -1] < 11.0:
            os._exit(3)
        return super().plan(view, predictions)
"""


def test_a_run_that_ends_its_process_is_a_row_and_the_search_goes_on(done, file, tmp_path, monkeypatch):
    (tmp_path / "deadly.py").write_text(DEADLY)
    monkeypatch.syspath_prepend(str(tmp_path))
    told = pq.read_table(done[1] / "evaluations.parquet").to_pydict()
    first = next(index for index, text in enumerate(told["disturbance"]) if "brakes" in text)
    found = searched(file, tmp_path / "out", planner="deadly:Deadly", workers=2, runs=first + 1)
    assert found.runs == first + 1
    rows = pq.read_table(tmp_path / "out" / "evaluations.parquet").to_pydict()
    assert rows["outcome"][first] is None
    assert rows["disturbance"][first] == "leader, agent 101: a run is lost: its process ended (exit code 3)"
    assert rows["digest"][:first] == told["digest"][:first]


@pytest.mark.long
def test_a_search_ends_after_its_time_and_after_so_many_failures(done, file, tmp_path):
    assert searched(file, tmp_path / "short", runs=None, minutes=1e-9).runs == 0
    found = searched(file, tmp_path / "one", stop_after=1)
    assert [one.digest for one in found.failures] == [done[0].failures[0].digest]
    assert found.runs < RUNS
    assert searched(file, tmp_path / "one").runs == RUNS, "it goes on"


def test_messages_are_lost_only_where_agents_have_v2x(file, tmp_path):
    (pair, _) = pairs(scenario(), "leader.xml", 4)
    space = Space().with_v2x(is_on=True)
    point = dict(zip(space.coordinates, undisturbed(space), strict=True))
    lossy = disturbance(space, "idm", pair, list({**point, "v2x_loss": 0.25}.values()))
    assert (lossy.loss, lossy.words()) == (0.25, "25 % of messages are lost")
    assert disturbance(space, "idm", pair, list(point.values())).loss is None
    assert "v2x_loss" not in Space().with_v2x(is_on=False).coordinates
    with pytest.raises(InputError, match="no vehicle has V2X; set v2x"):
        searched(file, tmp_path / "none", space=replace(BRAKING, v2x_loss=(0.5, 1.0)))


def test_a_failure_repeats_with_the_settings_and_the_losses_of_its_search(file, tmp_path):
    found = searched(
        file,
        tmp_path / "out",
        RUNS,
        keep=1,
        stop_after=1,
        shrink=False,
        settings={"v2x.penetration": "1", "v2x.cpm": "true"},
    )
    (one,) = found.failures
    assert one.drive.settings["v2x.cpm"] == "true"
    assert 0.0 < float(one.drive.settings["v2x.loss"]) < 1.0
    assert " % of messages are lost" in one.disturbance
    run, is_equal = replay(one, trust=True)
    assert is_equal
    assert run.settings["settings"]["v2x.loss"] == float(one.drive.settings["v2x.loss"])
    out = tmp_path / "again"
    ran = CliRunner().invoke(main, ["run", "--config", str(one.folder / "run.toml"), "--out", str(out), "--quiet"])
    assert ran.exit_code == 0, ran.output
    assert idr.load(out).digest == one.digest


def test_a_failure_by_what_the_agent_perceives_is_repeated_to_the_bit(file, tmp_path):
    space = replace(BRAKING, perception=1.0, missed=(1.0, 1.0), error_share=1.0)
    found = searched(file, tmp_path / "out", RUNS, planner="idm", space=space, keep=1, stop_after=1)
    (one,) = found.failures
    assert (one.failure, one.drive.perception["missed"]) == ("ran_into", 1.0)
    assert "misses others in 100 % of the time steps" in one.disturbance
    assert replay(one)[1]
    out = tmp_path / "again"
    ran = CliRunner().invoke(main, ["run", "--config", str(one.folder / "run.toml"), "--out", str(out), "--quiet"])
    assert ran.exit_code == 0, ran.output
    assert idr.load(out).digest == one.digest


def test_failures_on_other_lanelets_are_of_another_kind(done):
    run = done[0].failures[0].replay(trust=True)
    (lanelet,) = run.scenario.lanelets.ids.tolist()
    assert judged(run, AGENT).lanelets == (lanelet, lanelet)
    assert done[0].failures[0].signature == f"leader {AGENT} ran_into {LEADER} {lanelet}-{lanelet}"


def test_disturbances_that_mean_the_same_are_driven_once(file, monkeypatch):
    (pair,) = [one for one in pairs(scenario(), str(file), 1) if one.agent_id == AGENT]
    space = replace(BRAKING, errors=("replays",), error_share=1.0, v2x_loss=(0.0, 0.0))
    setup = Setup(Drivers(BLIND, "idm", "constant_velocity"), space, 0)
    driven = []
    monkeypatch.setattr(keeping, "avoided_by", lambda *_: "")
    monkeypatch.setattr(keeping, "judged_in", lambda *world: driven.append(world))
    at = {**dict.fromkeys(space.coordinates, 0.7), "sight": 1.0}
    point, is_small = keeping._smallest(Trial(setup, pair, None, tuple(at.values()), "alike"))
    # Only that it replays its recording means something; when, how much, and who of one vehicle do not.
    assert len(driven) == 1
    assert is_small
    assert dict(zip(space.coordinates, point, strict=True))["error"] == 0.7


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"agent_id": 7}, "leader: agent 7: no vehicle that can be an agent has this id"),
        ({"planner": object()}, "a search keeps failures: name the planner, as module:object"),
        ({"runs": 0}, "runs: must be positive, is 0"),
        ({"minutes": -1.0}, "minutes: must be positive, is -1.0"),
        ({"workers": 0}, "workers: must be positive, is 0"),
        ({"run_timeout": 0.0}, "run_timeout: must be positive, is 0.0"),
        ({"method": "cma"}, "method: must be one of levels, uniform, not 'cma'"),
        ({"planner": "idmm"}, "idmm"),
        ({"settings": {"v2x.penetratio": "1"}}, "did you mean v2x.penetration?"),
        ({"settings": {"recording.raw": "true"}}, "recording.raw: settings of recording cannot be chosen for a search"),
        ({"traffic": "recorded", "space": Space(driver=("time_gap",))}, "traffic recorded has no time_gap to draw"),
        (
            {"traffic": "recorded", "space": Space(errors=("disobeys",))},
            "errors: disobeys means nothing to traffic that",
        ),
    ],
)
def test_what_cannot_be_searched_is_refused(file, tmp_path, change, words):
    with pytest.raises(InputError) as refused:
        searched(file, tmp_path / "out", **change)
    assert words in str(refused.value)
    assert not (tmp_path / "out").exists()


def test_a_folder_with_something_else_is_not_touched(done, file, tmp_path):
    with pytest.raises(InputError, match=r"holds another search \(seed differ\)"):
        searched(file, done[1], seed=1)
    with (
        closing(SearchFolder(tmp_path / "busy", {"planner": BLIND})),
        pytest.raises(ResultsError, match="another process is searching there"),
    ):
        SearchFolder(tmp_path / "busy", {"planner": BLIND})
    assert not (tmp_path / "busy").exists(), "nothing was searched"
    tmp_path = tmp_path / "other"
    tmp_path.mkdir()
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="is no search, and not empty"):
        searched(file, tmp_path)
    with pytest.raises(ResultsError, match="there are no failures"):
        failures(tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("start_time = [2.0, -2.0]", "start_time: needs two finite bounds, the lower one first, not 2 and -2"),
        ("start_time = [-inf, inf]", "start_time: needs two finite bounds, the lower one first, not -inf and inf"),
        ("sight = [30.0, inf]", "sight: needs two finite bounds"),
        ("start_speed = [0.0, 1.0]", "start_speed: must be positive, is 0"),
        ('errors = ["sleeps"]', "errors: there is no error sleeps; there are brakes, drifts, inattentive, disobeys"),
        ("error_share = 2.0", "error_share: must be from 0 to 1, is 2"),
        ("other = 3", "did you mean others?"),
        ('driver = ["mood"]', "driver: drivers do not differ in mood"),
        ("quantiles = [0.1, 1.0]", "quantiles: must be below 1, is 1"),
        ('drivers = "homes"', "did you mean house?"),
        ("error_time = [-1.0, 1.0]", "error_time: must not be negative, is -1"),
        ("v2x_loss = [0.0, 2.0]", "v2x_loss: must be from 0 to 1, is 2"),
        ("missed = [0.0, 1.5]", "missed: must be from 0 to 1, is 1.5"),
        ("delay = [-0.1, 0.3]", "delay: must not be negative, is -0.1"),
        ("delay = [0.0, 11.0]", "delay: must be at most 10, is 11"),
        ("position_error = [0.0, 101.0]", "position_error: must be at most 100, is 101"),
        ("speed_error = [0.0, 11.0]", "speed_error: must be at most 10, is 11"),
        ("occlusion = -0.5", "occlusion: must be from 0 to 1, is -0.5"),
        ("=", "not a TOML file"),
    ],
)
def test_a_file_that_says_no_space_is_refused_in_one_line(tmp_path, text, words):
    path = tmp_path / "space.toml"
    path.write_text(text)
    code, said = invoked("t_junction", "--planner", "idm", "--space", path, "--out", tmp_path / "out")
    assert code == 2
    assert words in said


def test_traffic_that_replays_makes_no_errors_of_drivers():
    space = Space().with_traffic("recorded")
    assert (space.errors, space.driver) == (("brakes", "drifts"), ())
    assert Space().with_traffic("idm") == Space()


def test_a_file_that_cannot_be_read_or_has_no_pair_is_left_out_and_named(file, tmp_path):
    folder = tmp_path / "files"
    folder.mkdir()
    shutil.copy(file, folder / "leader.xml")
    (folder / "broken.xml").write_text("<commonRoad")
    idr.write_scenario(world(straight_road(400.0), cars=[Car(7, 20.0, velocity=12.0)], steps=80), folder / "alone.xml")
    found = searched(folder, tmp_path / "out", runs=1, agent_id=None, planner="idm")
    alone, broken = found.left_out
    assert alone == "alone: 1 vehicle that can be an agent, and a search needs another one near"
    assert "broken.xml" in broken
    with pytest.raises(InputError, match=r"nothing to search: alone: .*; .*broken\.xml"):
        searched([folder / "alone.xml", folder / "broken.xml"], tmp_path / "none", agent_id=None)


def test_one_line_makes_a_test_case_of_a_failure(done):
    names = [str(failure) for failure in idr.failures(done[1])]
    assert names == [f"{number:03d}" for number in range(1, len(names) + 1)]
