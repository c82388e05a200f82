"""Traffic on the command line."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import interdrive as idr
from interdrive.cli import main
from interdrive.simulation import Simulation

QUICK = ["--predictor", "lane_following", "--threads", "1", "--set", "record.violations=false"]


def call(*words):
    return CliRunner().invoke(main, list(map(str, words)))


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_run_prints_flows_by_lane_and_verify_repeats_it(tmp_path):
    traffic = "idm,rate=300,duration=15,mix=[1,0,0]"
    done = call("run", "t_junction", "--agents", 0, "--traffic", traffic, "--out", "made", *QUICK)
    assert done.exit_code == 0, done.output
    assert "generated traffic by lane" in done.output
    assert "goal_reached" in done.output
    assert (tmp_path / "made/demand.parquet").is_file()
    assert call("verify", "made").exit_code == 0


def test_a_run_that_may_become_large_is_written_meanwhile_and_repeats(tmp_path, monkeypatch):
    monkeypatch.setattr("interdrive.cli.run._HELD_MAX", 0)
    traffic = "idm,rate=300,duration=10,mix=[1,0,0]"
    done = call("run", "t_junction", "--agents", 0, "--traffic", traffic, "--out", "made", *QUICK)
    assert done.exit_code == 0, done.output
    assert "generated traffic by lane" in done.output
    assert "which are in states.parquet" in (tmp_path / "made/run.json").read_text(encoding="utf-8")
    assert call("verify", "made").exit_code == 0
    again = call("run", "t_junction", "--agents", 0, "--traffic", traffic, "--out", "made", *QUICK)
    assert (again.exit_code, again.output.count("\n")) == (2, 1)


def test_scenarios_of_sumo_need_its_extra(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    folder = Path(__file__).parents[1] / "sumo/crossing"
    done = call("run", folder, "--agents", "problems", "--out", "made", *QUICK)
    assert (done.exit_code, done.output) == (
        2,
        "error: SUMO scenarios need the extra: pip install 'interdrive[sumo]'\n",
    )


def test_traffic_writes_a_scenario_that_can_be_run():
    words = ["traffic", "t_junction", "--rate", 400, "--duration", 45, "--planner", "idm", "--set", "traffic.mix=1,0,0"]
    done = call(*words, "--egos", 2, "--threads", 1, "--out", "made.xml")
    assert done.exit_code == 0, done.output
    assert "interdrive run made.xml --agents problems" in done.output
    scenario = idr.read_scenario("made.xml")
    assert len(scenario.planning_problems) == 2
    assert len(scenario.obstacles.ids) > 5
    assert scenario.obstacles.n_steps <= 451
    assert "exists already" in call(*words, "--out", "made.xml").output
    run = idr.simulate("made.xml", agents="problems", predictor="lane_following", threads=1)
    assert "planner_error" not in run.outcomes.outcome
    # Vehicles that enter by the same lane later are others, and the goals leave the time of a drive and a reserve.
    assert [agent.id for agent in run.agents] == [problem.id for problem in scenario.planning_problems]
    for problem in scenario.planning_problems:
        (goal,) = problem.goal
        x, y = np.mean(goal.areas[0].vertices, axis=0)
        way = np.hypot(x - problem.initial_state.x, y - problem.initial_state.y)
        time = (goal.time_step[1] - problem.initial_state.time_step) * scenario.dt
        assert 7.0 < way / time < 14.0, "the limit is 50 km/h"


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["traffic", "t_junction", "--out", "a.xml"], "traffic: there is none; give --rate or --density"),
        (["traffic", "t_junction", "--rate", "9999", "--out", "a.xml"], "traffic.rate: the rate must be"),
        (["traffic", "t_junction", "--rate", "60", "--out", "a.txt"], "name a file that ends in .xml"),
        (["traffic", "t_junction", "--rate", "60", "--duration", "0", "--out", "a.xml"], "traffic.duration: must be"),
        (
            ["traffic", "t_junction", "--rate", "60", "--set", "traffic.warm_up=60", "--out", "a.xml"],
            "traffic.warm_up: 60 s leave nothing of traffic.duration (60 s)",
        ),
        (["run", "t_junction", "--traffic", "planner=idm"], "traffic: there is none"),
        (
            ["run", "t_junction", "--traffic", "idm,rate=60", "--set", "traffic.planner=pdm"],
            "--traffic idm,rate=60: planner is given by --set traffic.planner, too; leave one out",
        ),
        (
            ["run", "t_junction", "--traffic", "rate=60", "--set", "traffic.rate=70"],
            "rate is given by --set traffic.rate, too",
        ),
        (["run", "t_junction", "--traffic", "policy,rate=60"], "traffic.planner: policy has no file"),
        (["run", "t_junction", "--traffic", "idm:x+idm_mobil,rate=60"], "traffic.planner: 'x' is no share of idm"),
        (["run", "t_junction", "--traffic", "idm:0+pdm:0,rate=60"], "traffic.planner: the shares of idm:0+pdm:0"),
        (["benchmark", "idm", "--columns", "foo", "--out", "b"], "--columns foo: expected one of replay"),
        (["benchmark", "idm", "--power", "-1", "--out", "b"], "--power -1.0: must be above 0"),
        (["batch", "t_junction", "--seeds", "2", "--out", "b"], "seeds 2: a seed chooses a number of agents"),
    ],
)
def test_bad_input_gives_one_line(words, text):
    done = call(*words)
    assert done.exit_code == 2
    assert text in done.output
    assert done.output.count("\n") == 1


@pytest.mark.long
def test_a_batch_makes_other_traffic_for_every_seed():
    traffic = "idm,rate=300,duration=5"
    words = ["batch", "t_junction", "--seeds", 2, "--traffic", traffic, "--planner", "idm", "--keep", "all"]
    done = call(*words, "--predictor", "lane_following", "--workers", 1, "--out", "b", "--quiet")
    assert done.exit_code == 0, done.output
    table = idr.read_batch("b").to_pylist()
    assert len({row["digest"] for row in table if "digest" in row}) != 1
    assert {row["seed"] for row in table} == {0, 1}


def test_what_takes_long_before_the_first_step_is_told():
    told = []
    simulation = Simulation(
        "t_junction", agents=0, traffic="idm,rate=600,duration=20", on_setup=lambda *words: told.append(words)
    )
    n = len(simulation.agents)
    assert told == [("making traffic", done, n) for done in range(1, n + 1)] + [(f"preparing {n} agents", 0, 0)]


@pytest.mark.long
def test_compare_shows_flow_speed_and_queue_of_generated_traffic():
    for name, traffic in (("with", ["--traffic", "recorded,idm,rate=300,duration=10"]), ("without", [])):
        words = ["--planner", "idm,idm_mobil", "--agents", "1", "--workers", "1", "--out", f"out/{name}", *traffic]
        made = call("batch", "t_junction", *words, *QUICK[:2], *QUICK[4:])
        assert made.exit_code == 0, made.output
        said = call("compare", f"out/{name}")
        assert said.exit_code == 0, said.output
        shown = [words in said.output for words in ("traffic flow [1/h]", "traffic speed [m/s]", "traffic waits [s]")]
        assert shown == [name == "with"] * 3, said.output
