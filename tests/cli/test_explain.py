"""`interdrive explain`: what it tells of a run that was saved."""

import re

import numpy as np
import pytest
from click.testing import CliRunner
from drivers import Straight

from interdrive import save, simulate
from interdrive.cli import main
from interdrive.testing import Car, problem, straight_road, world


class Braking(Straight):
    """Brakes at 4 m/s² to a stop."""

    def plan(self, view, predictions):
        plan, ego, time = super().plan(view, predictions), view.ego, np.arange(31) * view.dt
        braked = np.minimum(time, ego.velocity / 4.0)
        plan.velocity[:] = ego.velocity - 4.0 * braked
        plan.x[:] = ego.x + ego.velocity * braked - 2.0 * braked**2
        return plan


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Agent 100 brakes from 8 m/s behind car 7, which stands 20 m ahead; agent 200 is alone on its lane."""
    problems = [
        problem(100, 20.0, velocity=8.0, goal=(60.0, 0.0), time_step=(0, 30)),
        problem(200, 20.0, 3.5, goal=(60.0, 3.5), time_step=(0, 60)),
    ]
    scenario = world(straight_road(lanes=2), cars=[Car(7, 40.0)], problems=problems)
    run = simulate(scenario, agents=[100, 200], planner={100: Braking, "default": Straight}, threads=1)
    path = tmp_path_factory.mktemp("explain") / "run"
    save(run, path)
    return str(path)


def explain(*arguments):
    return CliRunner().invoke(main, ["explain", *arguments])


def test_without_an_agent_there_is_one_line_per_agent(folder):
    reason = "behind 7 for 5.1 s, standing for 3.1 s; 27.0 m before the goal area when the time was over"
    assert explain(folder).stdout.splitlines() == [
        f"agent 100: time_limit at 5.1 s: {reason}",
        "agent 200: goal_reached at 3.5 s",
    ]


def test_the_story_of_an_agent_has_phases_and_critical_moments(folder):
    lines = explain(folder, "100").stdout.splitlines()
    assert lines[1:6] == [
        "  a planning problem, planner test_explain:Braking",
        "  goal from 0.0 to 3.0 s",
        "    0.0 to   2.0 s  slowing behind 7, from 8.0 to 0.0 m/s",
        "    2.0 to   5.1 s  standing behind 7",
        "  least time to collision along lanes 1.9 s with 7 at 0.0 s",
    ]


def test_a_figure_of_the_story_is_written(folder, tmp_path):
    done = explain(folder, "100", "--png", str(tmp_path / "a.png"), "--pdf", str(tmp_path / "a.pdf"))
    assert done.exit_code == 0
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["300"], "agent 300: not an agent of this run; its agents are 100, 200"),
        (["all"], "explain all: write the id of an agent, such as 605"),
        (["--png", "a.png"], "explain: a figure shows one agent; name it after the run folder"),
        (["100", "--png", "a.jpg"], "--png a.jpg: the file must end in .png"),
    ],
)
def test_what_cannot_be_explained_is_refused_in_one_line(folder, arguments, words):
    done = explain(folder, *arguments)
    assert (done.exit_code, done.stderr) == (2, f"error: {words}\n")


def test_foreign_text_in_a_figure_is_no_formula(tmp_path):
    class Failing:
        def plan(self, view, predictions):
            raise ValueError("cost $x_{ is $ wrong")

    scenario = world(straight_road(), problems=[problem(100, 20.0, goal=(60.0, 0.0), time_step=(0, 30))])
    save(simulate(scenario, planner=Failing, threads=1), tmp_path / "run")
    done = explain(str(tmp_path / "run"), "100", "--png", str(tmp_path / "story.png"))
    assert (done.exit_code, done.stderr) == (0, "")
    assert (tmp_path / "story.png").read_bytes().startswith(b"\x89PNG")


@pytest.fixture(scope="module")
def batched(tmp_path_factory):
    """Two planners on the T-junction; only the run folders of the second one are kept."""
    path = tmp_path_factory.mktemp("explain_batch")
    common = ["batch", "t_junction", "--agents", "2", "--workers", "1", "--quiet", "--out", str(path / "batch")]
    for more in (["--planner", "recorded"], ["--planner", "idm", "--keep", "all"]):
        assert CliRunner().invoke(main, [*common, *more]).exit_code == 0
    return str(path / "batch")


def key_of(batched, planner):
    lines = explain(batched).stdout.splitlines()
    return next(line.split()[0] for line in lines if f"planner {planner}" in line)


def test_of_a_batch_there_is_one_line_per_run(batched):
    lines = [line for line in explain(batched).stdout.splitlines() if "t_junction, planner" in line]
    assert len(lines) == 2
    assert all("goal_reached" in line for line in lines)


def test_from_a_batch_one_comes_to_a_run_and_to_an_agent(batched):
    run = explain(batched, key_of(batched, "idm")).stdout
    agent = run.split()[1].rstrip(":")
    told = explain(batched, key_of(batched, "idm"), agent).stdout.splitlines()
    assert told[0] == run.splitlines()[0]
    assert "planner idm" in told[1]


def test_a_run_without_folder_is_told_from_the_table_of_the_batch(batched):
    assert re.search(r"\n  agent \d+ goal_reached at", explain(batched, key_of(batched, "recorded")).stdout)


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["t_junction"], "2 runs have that; name one by its key"),
        (["xyz"], "run xyz: there is none in the batch"),
        (["a", "1", "2"], "nothing more"),
        (["--png", "a.png"], "a figure shows one agent"),
        (["KEY", "2001"], "its run folder was not kept; repeat the batch with --keep all"),
        (["KEY", "first"], "write the id of an agent"),
    ],
)
def test_what_a_batch_does_not_have_is_one_line(batched, names, words):
    done = explain(batched, *(key_of(batched, "recorded") if name == "KEY" else name for name in names))
    assert done.exit_code == 2
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert words in done.stderr
