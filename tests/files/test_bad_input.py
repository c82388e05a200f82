"""What cannot be used ends the command with exit code 2 and one line on stderr; nothing half-written stays behind."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import commonroad_documents as cr
import pytest
from click.testing import CliRunner
from commonroad_documents import car, document, goal, initial, lanelet, planning_problem, state

import interdrive as idr
from interdrive.cli import main
from interdrive.results import read_results

#: A second lanelet that no way leads to.
APART = lanelet(1) + lanelet(2, left=((0, 52), (100, 52)), right=((0, 48), (100, 48)))
TO_APART = planning_problem(60, goal(position='<lanelet ref="2"/>'))
DRIVING = car(30, initial(10.0), [state(t, 10.0 + t, orientation=0.0, velocity=10.0) for t in range(1, 31)])
OFF_ROAD = planning_problem(60, goal(position='<lanelet ref="1"/>'), start=initial(5.0, 30.0, yawRate=0, slipAngle=0))


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refusal(capfd, *arguments):
    """The one line with which a command refuses to work."""
    before = {path: path.lstat().st_mtime_ns for path in Path().rglob("*")}
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1, done.stderr
    assert done.stderr.startswith("error: ")
    assert capfd.readouterr() == ("", "")  # what does not go through Python's streams
    assert {path: path.lstat().st_mtime_ns for path in Path().rglob("*")} == before
    return done.stderr


@pytest.mark.parametrize("command", [["run", "--out", "made"], ["check"]])
@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "no such file"),
        ("{}", "not an XML file"),
        (document(DRIVING)[:-200], "is the file complete?"),
        (document(DRIVING) + "<more/>", "junk after document element: line"),
        (document(DRIVING).replace("</commonRoad>", "</commonroad>"), "correct the file there"),
        (cr.BOMB, "document type declaration"),
        (cr.EXTERNAL_ENTITY, "document type declaration"),
        (document(lanelets=""), "has no lanelets"),
        (document(DRIVING, dt="0"), "is 0"),
        (document(car(30, initial("NaN"))), "obstacle 30 has the value nan"),
        (document(lanelets=lanelet(1, left=((0, 2), ("nan", 2)))), "lanelet 1 has the value nan"),
    ],
)
def test_a_file_that_cannot_be_used(here, capfd, command, text, words):
    if text is not None:
        cr.saved(here, text, "bad.xml")
    line = refusal(capfd, *command, "bad.xml")
    assert line.startswith("error: bad.xml: ")
    assert words.lower() in line.lower()


@pytest.mark.parametrize(
    ("content", "agents", "words"),
    [
        (DRIVING, "30,99", "agent 99: no such vehicle; possible agents: 30"),
        (TO_APART + DRIVING, "60,", "agent 60: no way leads from lanelet 1 to lanelet 2"),
        (TO_APART, "all", "no vehicle can become an agent (agent 60: no way leads from lanelet 1 to lanelet 2)"),
        (OFF_ROAD + DRIVING, "60,", "agent 60: no lanelet within 1.5 m of the start (5.00, 30.00)"),
        (OFF_ROAD, "all", "no vehicle can become an agent (agent 60: no lanelet within 1.5 m of the start"),
        (car(31, initial(60.0)) + DRIVING, "31,", "agent 31: recorded at one time step only; possible agents: 30"),
        (car(31, initial(60.0)), "all", "no vehicle can become an agent"),
        (DRIVING, "2", "2 agents requested, but only 1"),
        (DRIVING, "-1", "the number of agents must be at least"),
    ],
)
def test_an_agent_that_cannot_be(here, capfd, content, agents, words):
    cr.saved(here, document(content, lanelets=APART), "some.xml")
    assert words in refusal(capfd, "run", "some.xml", "--agents", agents, "--out", "made")


@pytest.mark.parametrize(("content", "id_"), [(TO_APART, 60), (OFF_ROAD, 60)])
def test_among_all_an_agent_without_a_route_is_left_out_and_named(here, content, id_):
    cr.saved(here, document(content + DRIVING, lanelets=APART), "some.xml")
    done = CliRunner().invoke(main, ["run", "some.xml", "--out", "made"])
    assert (done.exit_code, done.stderr) == (0, "")
    assert f"note: agent {id_}: no " in done.stdout
    assert read_results("made").outcomes["agent_id"].to_pylist() == [30]


def test_an_obstacle_with_one_state_stands_by_and_is_no_agent(here):
    cr.saved(here, document(car(31, initial(60.0)) + DRIVING), "some.xml")
    shown = CliRunner().invoke(main, ["check", "some.xml"])
    assert (shown.exit_code, shown.stderr) == (0, "")
    assert "1 vehicle: 30" in shown.stdout
    assert "recorded at one time step only" in shown.stdout
    assert CliRunner().invoke(main, ["run", "some.xml", "--out", "made"]).exit_code == 0
    states = read_results("made").states.to_pandas()
    assert states[states.participant_id == 31].time_step.tolist() == [0]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--planner", "frenet,level"], "planner 'frenet,level': level after a comma"),
        (["--planner", "frent"], "unknown planner 'frent': did you mean frenet?"),
        (["--planner", "nowhere:Planner"], "module nowhere cannot be imported"),
        (["--predictor", "constant_velocty"], "did you mean constant_velocity?"),
        (["--set", "planner.frenet.horizn=3"], "did you mean planner.frenet.horizon?"),
        (["--set", "view.sensor_radius=-1"], "view.sensor_radius: must be positive"),
        (["--set", "view.sensor_radius=nan"], "view.sensor_radius: expected a number [m], not 'nan'"),
        (["--set", "planner.frenet.weights.prediction=-1"], "planner.frenet.weights.prediction: must not be negative"),
        (
            ["--set", "step.replan_every=99999999999999999999"],
            "step.replan_every: must be 1 to 10000, not 99999999999999999999",
        ),
        (["--set", "goal.time_late=1e300"], "goal.time_late: must be at most"),
        (["--threads", "-1"], "threads must be at least 1"),
        (["--threads", "0"], "threads must be at least 1"),
        (["--seed", "-1"], "the seed must be from 0 to 2^64 - 1, is -1"),
        (["--agents", ","], "agents: the list of ids is empty"),
        (["--out", "some.xml/below"], "some.xml is not a folder"),
        (["--out", "some.xml"], "a file with this name already exists"),
        (["--out", "/proc/made"], "/proc/made: cannot be written"),
    ],
)
def test_a_choice_that_cannot_be(here, capfd, arguments, words):
    cr.saved(here, document(DRIVING), "some.xml")
    assert words in refusal(capfd, "run", "some.xml", *arguments)


def command(*arguments, **options):
    words = [sys.executable, "-m", "interdrive", *arguments]
    return subprocess.run(words, capture_output=True, text=True, check=False, **options)


def limits_files_to_20_kilobytes():
    import resource

    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))


@pytest.mark.parametrize("target", ["real", "missing"])
@pytest.mark.parametrize(
    "command", [("run", "t_junction", "--overwrite"), ("criticality", "t_junction"), ("batch", "t_junction")]
)
def test_a_link_as_the_folder_to_write_to(here, capfd, command, target):
    Path("real").mkdir()
    Path("link").symlink_to(target)
    assert refusal(capfd, *command, "--out", "link").startswith("error: link: this is a symbolic link; name the folder")


def pipes_and_devices():
    os.mkfifo("pipe.xml")
    os.mkfifo("pipe.toml")
    Path("folder").mkdir()
    os.mkfifo("folder/pipe.xml")
    Path("zero.xml").symlink_to("/dev/zero")


@pytest.mark.parametrize(
    "arguments",
    [
        ("check", "pipe.xml"),
        ("check", "zero.xml"),
        ("run", "pipe.xml", "--out", "made"),
        ("run", "t_junction", "--config", "pipe.toml", "--out", "made"),
        ("batch", "folder", "--out", "made"),
        ("batch", "pipe.xml", "--out", "made"),
        ("predict-eval", "t_junction", "--split", "pipe.toml", "--out", "made"),
    ],
)
def test_a_pipe_or_device_is_not_waited_for(here, capfd, arguments):
    pipes_and_devices()
    assert "it is a pipe or a device, not a file" in refusal(capfd, *arguments)


def test_a_writer_that_fails_half_way(here):
    # Python would store half of its compiled modules, too, and read them ever after.
    environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}
    done = command("run", "t_junction", "--out", "made", preexec_fn=limits_files_to_20_kilobytes, env=environment)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"error: {here / 'made'}: cannot be written: File too large\n"
    assert list(here.iterdir()) == []


def test_ctrl_c_in_the_middle_of_a_run(here):
    """The signal comes from outside while the native planners of 30 vehicles are at work."""
    (here / "watched.py").write_text(
        "import numpy as np\n"
        "from pathlib import Path\n"
        "from interdrive import Predictions\n"
        "class Watched:\n"
        "    def predict(self, scene):\n"
        "        if scene.time_step == 3:\n"
        "            Path('started').touch()\n"
        "        none = np.zeros((0, 1, 30))\n"
        "        ids, valid = np.zeros(0, dtype=np.int64), np.zeros((0, 1, 30), dtype=bool)\n"
        "        covariance = np.zeros((0, 1, 30, 2, 2))\n"
        "        return Predictions(scene.time_step, ids, none[..., 0], *[none] * 4, covariance, valid)\n"
    )
    words = ["run", "highway", "--predictor", "watched:Watched", "--set", "planner.frenet.level=4", "--out", "made"]
    with subprocess.Popen(
        [sys.executable, "-m", "interdrive", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as running:
        deadline = time.monotonic() + 60
        while not (here / "started").exists():
            assert running.poll() is None, running.communicate()
            assert time.monotonic() < deadline
            time.sleep(0.005)
        running.send_signal(signal.SIGINT)
        try:
            stdout, stderr = running.communicate(timeout=60)
        finally:
            running.kill()
    assert (running.returncode, stdout) == (130, "")
    assert re.fullmatch(r"interrupted after \d\.\d s; the run until then is in made\n", stderr)
    assert {path.name for path in here.iterdir()} - {"__pycache__"} == {"watched.py", "started", "made"}
    kept = idr.load(here / "made")
    assert not kept.finished
    assert kept.states.n_steps > 3
    assert set(kept.outcomes.outcome) == {"running"}
