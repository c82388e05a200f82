"""The command line: what it passes on, what it prints, how it exits. Mostly with a stand-in for the simulation."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.compute as pc
import pytest
from click.testing import CliRunner
from invented_run import invented_run, outcomes

from interdrive import files, simulation
from interdrive.cli import main
from interdrive.config.plugins import DEFAULT_PLANNER, Choice
from interdrive.errors import InputError
from interdrive.results import read_results, save
from interdrive.runs import RunInterrupted

RUN = invented_run()
GOOD = replace(
    RUN, outcomes=replace(RUN.outcomes, outcome=("goal_reached", "collision", "goal_reached_late", "goal_missed"))
)


class Simulated:
    """Stands in for `Simulation`: keeps its arguments, returns a run or raises."""

    def __init__(self):
        self.arguments, self.result, self.agents = None, GOOD, GOOD.agents

    def __call__(self, scenario, **arguments):
        self.arguments = {"scenario": scenario, **arguments}
        return self

    def run(self, on_step):
        scenario = self.arguments["scenario"]
        for step in range(3):
            on_step(step, 3 - step, 3, 10)
        if isinstance(self.result, BaseException):
            raise self.result
        if isinstance(scenario, str | Path) and Path(scenario).exists():
            path = Path(scenario)
            source = replace(
                self.result.scenario, path=path, name=path.stem, sha256=hashlib.sha256(path.read_bytes()).hexdigest()
            )
            return replace(self.result, scenario=source)
        return self.result


@pytest.fixture
def simulated(monkeypatch):
    stand_in = Simulated()
    for module in ("interdrive.simulation", "interdrive.simulation.simulation"):
        monkeypatch.setattr(f"{module}.Simulation", stand_in)
    monkeypatch.setattr(files, "run_document", lambda run: b"<commonRoad/>")
    return stand_in


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty working folder with a scenario file in it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bend.xml").write_text("<commonRoad/>")
    return tmp_path


def invoke(*arguments):
    return CliRunner().invoke(main, list(arguments))


def refused(result):
    """The one line of a refusal."""
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert len(lines) == 1, lines
    assert lines[0].startswith("error: ")
    return lines[0].removeprefix("error: ")


def test_a_run_is_simulated_saved_and_reported(simulated, here):
    done = invoke("run", "bend.xml", "--out", "made")
    assert done.exit_code == 0, done.output
    assert read_results("made").info["digest"] == GOOD.digest
    for text in (
        "bend, 4 agents: 1 goal_reached, 1 goal_reached_late, 1 goal_missed, 1 collision",
        "ran into 22 from",
        "note: vehicle 21 stays recorded: it leaves the map",
        "60 steps, 16.8 ms per step (median), 5.95 times real time",
        "results in made",
    ):
        assert text in done.stdout
    row = next(line for line in done.stdout.splitlines() if line.split()[:2] == ["2", "collision"])
    assert row.split()[2:5] == ["4.7", "22", "17.0"]
    assert done.stderr == ""  # no terminal, no progress bar


@pytest.mark.parametrize(("text", "agents"), [("all", "all"), ("5", 5), ("5,7", (5, 7)), ("5,", (5,))])
def test_agents_are_all_a_number_or_ids(simulated, here, text, agents):
    assert invoke("run", "bend.xml", "--agents", text).exit_code == 0
    assert simulated.arguments["agents"] == agents


def test_the_command_line_wins_over_the_file_and_the_file_over_the_defaults(simulated, here):
    (here / "sub").mkdir()
    (here / "sub" / "there.xml").write_text("<commonRoad/>")
    (here / "sub" / "run.toml").write_text(
        'scenario = "there.xml"\nagents = [1, 2]\nseed = 3\npredictor = "constant_velocity"\n'
        "[run]\nplanner = 'frenet'\nthreads = 2\n"
        "[planner.frenet]\nhorizon = 2.0\nlevel = 1\n[view]\nsensor_radius = 50\n"
    )
    assert invoke("run", "--config", "sub/run.toml", "--seed", "9", "--set", "planner.frenet.level=3").exit_code == 0
    given = simulated.arguments
    assert (given["scenario"], given["agents"], given["seed"]) == ("sub/there.xml", (1, 2), 9)
    assert (given["predictor"], given["threads"]) == ("constant_velocity", 2)
    assert given["settings"].planner.frenet.horizon == 2.0
    assert given["settings"].planner.frenet.level == 3
    assert given["settings"].view.sensor_radius == 50.0


def test_a_style_is_a_preset_of_comfort_that_single_settings_change(simulated, here):
    (here / "run.toml").write_text('style = "brisk"\n[planner.rollout.comfort]\njerk = 3.0\n')
    assert invoke("run", "bend.xml", "--config", "run.toml").exit_code == 0
    comfort = simulated.arguments["settings"].planner.rollout.comfort
    assert (comfort.jerk, comfort.deceleration) == (3.0, 3.0)
    single = ["--set", "planner.rollout.comfort.time_gap=2"]
    assert invoke("run", "bend.xml", "--config", "run.toml", "--style", "calm", *single).exit_code == 0
    comfort = simulated.arguments["settings"].planner.rollout.comfort
    assert (comfort.jerk, comfort.deceleration, comfort.time_gap) == (3.0, 1.5, 2.0)


def test_a_planner_per_agent_comes_from_the_command_line_and_from_the_file(simulated, here):
    (here / "run.toml").write_text(
        'agents = [1, 2]\n[run]\nplanner = "frenet,lazy=false"\n[planner.frenet]\nhorizon = 2.0\n'
        '[agent.1]\nplanner = "a.b:C"\nweights.speed = 0.5\nview.sensor_radius = 40\n[agent.2]\nlevel = 1\n'
    )
    given = ["--agent", "2=frenet,level=3", "--agent", "5=view.occlusion=true"]
    assert invoke("run", "bend.xml", "--config", "run.toml", *given).exit_code == 0
    assert simulated.arguments["planner"] == {
        "default": "frenet,lazy=false",
        1: Choice("a.b:C", {"weights.speed": 0.5, "view.sensor_radius": 40}),
        2: Choice("frenet", {"level": "3"}),
        5: Choice(None, {"view.occlusion": "true"}),
    }
    assert simulated.arguments["settings"].planner.frenet.horizon == 2.0


def test_without_a_folder_every_run_gets_its_own(simulated, here):
    for _ in range(3):
        assert invoke("run", "bend.xml").exit_code == 0
    assert sorted(path.name for path in (here / "out").iterdir()) == ["bend", "bend-2", "bend-3"]


def test_a_planner_error_is_saved_and_exits_with_1(simulated, here):
    simulated.result = RUN
    done = invoke("run", "bend.xml", "--out", "made")
    assert done.exit_code == 1
    assert "ZeroDivisionError: division by zero" in done.stdout
    assert read_results("made").outcomes["outcome"].to_pylist()[3] == "planner_error"


def test_pictures_lie_beside_the_tables(simulated, here):
    simulated.result = GOOD
    assert invoke("run", "bend.xml", "--out", "made", "--png", "--gif").exit_code == 0
    assert {"run.png", "run.gif"} <= {path.name for path in (here / "made").iterdir()}
    again = invoke("run", "bend.xml", "--out", "made", "--overwrite")
    assert again.exit_code == 0
    assert not (here / "made" / "run.png").exists()


def test_quiet_prints_nothing(simulated, here):
    done = invoke("run", "bend.xml", "--quiet")
    assert (done.exit_code, done.output) == (0, "")


def test_of_many_agents_only_those_that_did_not_arrive_are_listed(simulated, here):
    n = 100
    outcome = ["goal_reached"] * n
    outcome[41] = "infeasible"
    many = outcomes(np.arange(1000, 1000 + n), outcome, planner=("frenet",) * n, time_step=np.full(n, 50))
    simulated.result = replace(GOOD, outcomes=many, notes=tuple(f"note {k}" for k in range(30)))
    text = invoke("run", "bend.xml").stdout
    assert re.findall(r"^ *(1\d\d\d) ", text, re.M) == ["1041"]
    assert "99 more in outcomes.parquet" in text
    assert "100 agents: 99 goal_reached, 1 infeasible" in text
    assert "18 more notes in run.json" in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run"], "run: no scenario"),
        (["run", "nowhere.xml"], "nowhere.xml: no such file, and no shipped scenario has that name"),
        (["run", "bend.xml", "--set", "planner.frenet.horizn=3"], "did you mean planner.frenet.horizon?"),
        (["run", "bend.xml", "--set", "planner.frenet.horizon=long"], "expected a number [s], not 'long'"),
        (
            ["run", "bend.xml", "--set", "step.replan_every=0"],
            "step.replan_every: must be 1 to 10000, not 0",
        ),
        (["run", "bend.xml", "--set", "seed"], "--set seed: write it as name=value"),
        (["run", "bend.xml", "--style", "brsk"], "style: there is no style 'brsk'; did you mean brisk?"),
        (["run", "bend.xml", "--seed", "x"], "--seed: expected a whole number, not 'x'"),
        (["run", "bend.xml", "--threads", "x"], "--threads: expected a whole number or none, not 'x'"),
        (["run", "bend.xml", "--config", "none.toml"], "none.toml: no such file"),
        (["run", "bend.xml", "--config", "bend.xml"], "bend.xml: not a configuration file: "),
        (["run", "bend.xml", "--config", "typo.toml"], "typo.toml: sed: no such entry; did you mean seed?"),
        (
            ["run", "bend.xml", "--config", "other.toml"],
            "xyzzy: no such entry; there are agents, ",
        ),
        (
            ["run", "bend.xml", "--config", "wrong.toml"],
            "wrong.toml: view.sensor_radius: expected a number [m], not 'far'",
        ),
        (["run", "bend.xml", "--agent", "5"], "--agent 5: write it as ID=PLANNER[,NAME=VALUE...]"),
        (["run", "bend.xml", "--agent", "x=frenet"], "--agent x=frenet: write it as ID=PLANNER[,NAME=VALUE...]"),
        (["run", "bend.xml", "--agent", "5="], "--agent 5: planner '': the name is missing"),
        (["run", "bend.xml", "--agent", "5=frenet,level"], "--agent 5: planner 'frenet,level': level after a comma"),
        (["run", "bend.xml", "--agent", "5=frenet", "--agent", "5=frenet"], "--agent 5=frenet: agent 5 is named twice"),
        (["run", "bend.xml", "--config", "by_agent.toml"], "by_agent.toml: agent.x: write a table per agent"),
        (["run", "bend.xml", "--out", "."], "this folder has other contents (bend.xml) and is not replaced"),
        (["run", "bend.xml", "--out", "bend.xml"], "a file with this name already exists"),
        (["run", "bend.xml", "--mp4"], "MP4 needs ffmpeg"),
        (["run", "bend.xml", "--sed", "3"], "No such option '--sed'"),
        (["walk"], "No such command 'walk'"),
        (["verify", "nowhere"], "nowhere: this is not a run folder, it has no run.json"),
        (["settings", "nonsense"], "nonsense: no setting has this word in its name or text"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line_before_the_simulation(
    simulated, here, arguments, message, monkeypatch
):
    monkeypatch.setenv("PATH", "")
    (here / "typo.toml").write_text("sed = 3\n")
    (here / "other.toml").write_text("xyzzy = 3\n")
    (here / "by_agent.toml").write_text('[agent.x]\nplanner = "frenet"\n')
    (here / "wrong.toml").write_text('[view]\nsensor_radius = "far"\n')
    assert message in refused(invoke(*arguments))
    assert simulated.arguments is None
    assert not (here / "out").exists()


def test_the_name_of_a_shipped_scenario_may_be_misspelt(simulated, here, monkeypatch):
    monkeypatch.setattr(files.shipped, "shipped_scenarios", lambda: ("highway", "t_junction"))
    assert invoke("run", "t_junction").exit_code == 0
    assert simulated.arguments["scenario"] == "t_junction"
    assert "did you mean the shipped scenario t_junction?" in refused(invoke("run", "t_juntcion"))


def test_errors_of_the_simulation_are_one_line(simulated, here):
    simulated.result = InputError("agent 9:\n  no such vehicle")
    assert refused(invoke("run", "bend.xml")) == "agent 9: no such vehicle"
    assert not (here / "out").exists()


def test_an_interrupted_run_is_kept_as_far_as_it_came_and_exits_with_130(simulated, here):
    simulated.result = RunInterrupted(replace(GOOD, finished=False))
    done = invoke("run", "bend.xml", "--out", "made")
    seconds = (GOOD.states.n_steps - 1) * GOOD.scenario.dt
    line = f"interrupted after {seconds:.1f} s; the run until then is in made\n"
    assert (done.exit_code, done.stdout, done.stderr) == (130, "", line)
    assert read_results("made").info["finished"] is False


def test_an_interrupt_before_the_simulation_writes_nothing_and_exits_with_130(simulated, here):
    simulated.result = KeyboardInterrupt()
    done = invoke("run", "bend.xml")
    assert (done.exit_code, done.stdout, done.stderr) == (130, "", "interrupted, nothing written\n")
    assert not (here / "out").exists()


def test_an_interrupt_while_drawing_keeps_the_run(simulated, here, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("interdrive.plots.draw_run", stop)
    done = invoke("run", "bend.xml", "--out", "made", "--png")
    assert (done.exit_code, done.stderr) == (130, "interrupted while drawing; the run is in made\n")
    assert read_results("made").info["digest"] == GOOD.digest


def test_a_full_disk_is_one_line_and_leaves_nothing(simulated, here, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("interdrive.results.folder.write_parquet", full)
    line = refused(invoke("run", "bend.xml", "--out", "made"))
    assert line == f"{here / 'made'}: cannot be written: No space left on device"
    assert [path.name for path in here.iterdir()] == ["bend.xml"]


def test_verify_repeats_the_run_as_it_was(simulated, here):
    assert invoke("run", "bend.xml", "--out", "made", "--agents", "1,2", "--seed", "4").exit_code == 0
    settings = {**GOOD.settings, "agents": [1, 2], "seed": 4, "planner": {"1": "frenet", "2": "a.b:C"}}
    info = json.loads((here / "made" / "run.json").read_text())
    info["settings"] = settings | {"settings": {"planner.frenet.horizon": 2.0}}
    (here / "made" / "run.json").write_text(json.dumps(info))
    done = invoke("verify", "made", "--threads", "1", "--trust")
    assert done.exit_code == 0, done.output
    assert done.stdout.startswith("equal: digest 000")
    given = simulated.arguments
    assert (given["agents"], given["seed"], given["threads"]) == ([1, 2], 4, 1)
    assert given["planner"] == {"1": "frenet", "2": "a.b:C"}
    assert given["settings"].planner.frenet.horizon == 2.0


def test_verify_exits_with_1_and_shows_both_digests_if_they_differ(simulated, here):
    invoke("run", "bend.xml", "--out", "made")
    simulated.result = replace(GOOD, digest="1" * 64)
    done = invoke("verify", "made")
    assert done.exit_code == 1
    assert "1" * 64 in done.stdout
    assert "0" * 64 in done.stdout


def test_verify_refuses_another_scenario_file_and_takes_a_moved_one(simulated, here):
    invoke("run", "bend.xml", "--out", "made")
    (here / "bend.xml").rename(here / "moved.xml")
    assert "cannot be read (No such file or directory); give its present path with --scenario" in refused(
        invoke("verify", "made")
    )
    assert invoke("verify", "made", "--scenario", "moved.xml").exit_code == 0
    (here / "moved.xml").write_text("<other/>")
    assert "has changed since the run" in refused(invoke("verify", "made", "--scenario", "moved.xml"))


def test_check_prints_what_a_scenario_holds_and_goes_on_after_a_bad_one(here, monkeypatch):
    (here / "bad.xml").touch()
    monkeypatch.setattr(
        files, "open_scenario", lambda path, *, raw, source: RUN.scenario if path.name == "bend.xml" else _refuse(path)
    )
    done = invoke("check", "bad.xml", "bend.xml")
    assert done.exit_code == 2
    assert done.stderr == "error: bad.xml: no lanelets\n"
    for text in (
        "ZAM_Bend-1_1_T-1",
        "4 lanelets",
        "60 steps of 0.1 s, 5.9 s in all",
        "pedestrian, not a vehicle",
        "static obstacle",
    ):
        assert text in done.stdout


def _refuse(path):
    raise InputError(f"{path}: no lanelets")


def test_settings_lists_names_defaults_and_meaning():
    done = invoke("settings", "view")
    assert done.exit_code == 0
    assert done.stdout.splitlines()[1].split()[:2] == ["view.sensor_radius", "80"]


def test_settings_are_found_by_words_of_their_meaning():
    done = invoke("settings", "leaders")
    names = [line.split()[0] for line in done.stdout.splitlines() if line.startswith(("planner.", "view.", "step."))]
    assert "planner.frenet.comfort.deceleration" in names, "Deceleration before leaders, curves and the goal."
    assert not any(name.startswith("view.") for name in names)


@pytest.fixture
def real(tmp_path, monkeypatch):
    """A working folder with a scenario that can really be run."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bend.xml").write_bytes(files.run_document(RUN))
    return tmp_path


def test_without_choices_the_command_line_does_what_python_does_without(real):
    assert invoke("run", "bend.xml", "--out", "made", "--quiet").exit_code == 0
    save(simulation.simulate(real / "bend.xml"), "by_python")
    made, by_python = read_results("made"), read_results("by_python")
    assert made.info["digest"] == by_python.info["digest"]
    assert made.info["settings"] == by_python.info["settings"]
    assert made.views is made.predictions is made.candidates is None
    assert {path.suffix for path in (real / "made").iterdir()} == {".parquet", ".json", ".xml"}


def test_a_real_run_is_the_same_again_to_the_last_bit(real):
    done = invoke(
        "run", "bend.xml", "--agents", "3,4", "--out", "made", "--threads", "1", "--set", "view.sensor_radius=60"
    )
    assert done.exit_code == 0, done.output
    made = read_results("made")
    assert made.outcomes["agent_id"].to_pylist() == [3, 4]
    assert made.info["settings"]["settings"]["view.sensor_radius"] == 60.0
    agents = made.states.filter(pc.field("is_agent"))
    assert set(agents["participant_id"].to_pylist()) == {3, 4}
    assert set(made.plans["agent_id"].to_pylist()) == {3, 4}
    assert invoke("verify", "made", "--threads", "2").exit_code == 0
    info = json.loads((real / "made" / "run.json").read_text())
    (real / "made" / "run.json").write_text(json.dumps(info | {"digest": "0" * 64}))
    assert invoke("verify", "made").exit_code == 1


@pytest.mark.long
def test_a_real_run_with_a_planner_per_agent_is_the_same_again(real):
    (real / "mine.py").write_text(
        "from dataclasses import dataclass\n"
        "import numpy as np\n"
        "from interdrive import Trajectory\n"
        "@dataclass\n"
        "class Straight:\n"
        "    share: float = 1.0\n"
        "    def plan(self, view, predictions):\n"
        "        ego, time = view.ego, np.arange(31) * view.dt\n"
        "        x = ego.x + self.share * ego.velocity * np.cos(ego.orientation) * time\n"
        "        y = ego.y + self.share * ego.velocity * np.sin(ego.orientation) * time\n"
        "        return Trajectory(x, y, np.full(31, ego.orientation), np.full(31, self.share * ego.velocity))\n"
    )
    chosen = ["--agent", "3=mine:Straight,share=0.97,view.sensor_radius=30", "--agent", "4=frenet,level=1"]
    # Another process: this one must not keep the module.
    options = ["-m", "interdrive", "run", "bend.xml", "--agents", "1,3,4", *chosen, "--out", "made"]
    done = python(*options)
    assert done.returncode == 0, done.stderr
    made = read_results("made")
    assert made.outcomes["planner"].to_pylist() == [DEFAULT_PLANNER, "mine:Straight", "frenet"]
    assert made.info["settings"]["planner"] == {
        "1": DEFAULT_PLANNER,
        "3": {"planner": "mine:Straight", "share": 0.97},
        "4": {"planner": "frenet", "level": 1},
    }
    assert made.info["settings"]["views"]["3"]["sensor_radius"] == 30.0
    untrusted = python("-m", "interdrive", "verify", "made", stdin=subprocess.DEVNULL)
    assert (untrusted.returncode, untrusted.stdout) == (2, "")
    assert untrusted.stderr == (
        "error: made: run.json names code outside interdrive (mine:Straight), which would be imported and run; "
        "add --trust if you trust this folder\n"
    )
    ours, theirs = os.openpty()
    for answer, code in (("n", 2), ("y", 0)):
        os.write(ours, f"{answer}\n".encode())
        asked = python("-m", "interdrive", "verify", "made", stdin=theirs)
        assert (asked.returncode, "names code outside interdrive: mine:Straight" in asked.stderr) == (code, True)
    os.close(ours)
    os.close(theirs)
    again = python("-m", "interdrive", "verify", "made", "--trust")
    assert (again.returncode, again.stdout[:6]) == (0, "equal:"), again.stderr


def test_a_real_run_with_a_broken_planner_is_saved_and_exits_with_1(real):
    (real / "mine.py").write_text("class Broken:\n    def plan(self, view, predictions):\n        return 1 / 0\n")
    chosen = ["--agents", "3,", "--planner", "mine:Broken", "--out", "made"]
    # -P: python itself does not look for modules in the working folder.
    done = python("-P", "-m", "interdrive", "run", "bend.xml", *chosen)
    assert (done.returncode, done.stderr) == (1, "")
    assert "division by zero" in read_results("made").outcomes["message"].to_pylist()[0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--agents", "3,99"], "agent 99: no such vehicle"),
        (["--agents", "23,"], "agent 23: static obstacle"),
        (["--agents", "1000"], "1000 agents requested, but only 5"),
        (["--agents", "some"], "agents must be 'all', 'reachable', 'problems', a number or ids, not 'some'"),
        (["--agents", "3,", "--agent", "4=frenet"], "agent 4: a planner is given for it, but it is not an agent"),
        (
            ["--agent", "3=frenet,levl=1"],
            "agent 3: planner frenet: levl: no such setting; did you mean level?",
        ),
        (["--planner", "frent"], "unknown planner 'frent': did you mean frenet?"),
        (["--predictor", "lane_folowing"], "did you mean lane_following?"),
    ],
)
def test_what_the_simulation_refuses_is_one_line_and_nothing_is_written(real, arguments, message):
    assert message in refused(invoke("run", "bend.xml", *arguments, "--out", "made"))
    assert [path.name for path in real.iterdir()] == ["bend.xml"]


def test_on_request_an_exception_of_a_planner_ends_the_run_with_its_traceback(real):
    (real / "faulty.py").write_text("class Faulty:\n    def plan(self, view, predictions):\n        return 1 / 0\n")
    words = ["run", "bend.xml", "--agents", "3,", "--planner", "faulty:Faulty", "--out", "made", "--raise"]
    done = python("-m", "interdrive", *words)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("Traceback (most recent call last):")
    assert done.stderr.rstrip().endswith("return 1 / 0\n           ~~^~~\nZeroDivisionError: division by zero")
    assert not (real / "made").exists()


def test_ctrl_c_in_a_real_run_leaves_nothing_and_exits_with_130(real):
    (real / "slow.py").write_text(
        "import os, signal, time\n"
        "class Slow:\n"
        "    def plan(self, view, predictions):\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "        time.sleep(10)\n"
    )
    done = python(*["-m", "interdrive", "run", "bend.xml", "--agents", "3,", "--planner", "slow:Slow", "--out", "made"])
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted, nothing written\n")
    assert not (real / "made").exists()


def python(*arguments, **options):
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=False, **options)


def test_help_is_quick_and_needs_no_heavy_module():
    shown = python("-X", "importtime", "-m", "interdrive", "--help")
    assert shown.returncode == 0
    for module in ("numpy", "matplotlib", "pyarrow", "commonroad", "rich"):
        assert f" {module}\n" not in shown.stderr
    assert len(shown.stderr.splitlines()) < 300  # one line per module


def test_python_m_interdrive_is_the_same_command():
    assert python("-m", "interdrive", "--help").stdout.startswith("Usage: interdrive [OPTIONS] COMMAND")


def test_a_reader_that_goes_away_is_no_error_message():
    script = "import sys; from interdrive.cli import main; main(['settings'])"
    reading, writing = os.pipe()
    os.close(reading)
    gone = subprocess.run([sys.executable, "-c", script], stdout=writing, stderr=subprocess.PIPE, check=False)
    os.close(writing)
    assert (gone.returncode, gone.stderr) == (141, b"")
