"""`record.profile` and `interdrive run --profile`: what planners, phases and agents cost."""

import time

import numpy as np
import pytest
from click.testing import CliRunner
from drivers import Straight
from parallel_drivers import Remembering

from interdrive import load, save, simulate
from interdrive.cli import main
from interdrive.results.costs import agent_costs, phase_costs, planner_costs
from interdrive.testing import problem, straight_road, world


class Slow(Straight):
    """Sleeps 4 ms in every call."""

    def plan(self, view, predictions):
        time.sleep(0.004)
        return super().plan(view, predictions)


def two_agents():
    problems = [
        problem(100, 20.0, goal=(60.0, 0.0), time_step=(0, 50)),
        problem(200, 20.0, 3.5, goal=(60.0, 3.5), time_step=(0, 50)),
    ]
    return world(straight_road(lanes=2), problems=problems)


def profiled(planners):
    return simulate(two_agents(), agents=[100, 200], planner=planners, threads=1, settings={"record.profile": True})


@pytest.fixture(scope="module")
def run():
    return profiled({100: Slow, "default": "rollout"})


def seconds(run, agent, part):
    profile = run.profile
    mine = (profile.agent_id == agent) & (np.array(profile.part) == part)
    return profile.seconds[mine]


def test_every_plan_of_every_agent_is_measured(run):
    steps = [int(np.sum(run.plans.agent_id == agent)) for agent in (100, 200)]
    assert len(seconds(run, 200, "plan")) == steps[1]
    assert [len(seconds(run, 100, part)) for part in ("plan", "view", "call", "check")] == [0, *[steps[0]] * 3]


def test_the_times_are_those_that_passed(run):
    phases = {cost.name: cost.total for cost in phase_costs(run)}
    assert np.all(seconds(run, 100, "call") >= 0.004)
    own = sum(seconds(run, 100, part).sum() for part in ("view", "call", "check"))
    assert 0.8 * phases["plan_python"] < own <= phases["plan_python"]
    assert 0.0 < seconds(run, 200, "plan").sum() <= phases["plan"], "one thread: plans are part of their phase"


def test_a_planner_in_a_process_of_its_own_is_measured_there():
    run = profiled({100: Remembering, "default": "rollout"})
    assert len(seconds(run, 100, "call")) == np.sum(run.plans.agent_id == 100)
    assert np.all(seconds(run, 100, "call") > 0.0)


def test_a_profile_changes_no_bit_of_the_run_and_is_not_made_unasked(run):
    without = simulate(two_agents(), agents=[100, 200], planner={100: Slow, "default": "rollout"}, threads=1)
    assert without.profile is None
    assert without.digest == run.digest


def test_costs_are_sorted_by_their_sums_and_add_up(run):
    assert [(cost.name, cost.part) for cost in planner_costs(run)] == [
        ("test_profile:Slow", "view"),
        ("test_profile:Slow", "call"),
        ("test_profile:Slow", "check"),
        ("rollout", "plan"),
    ]
    by_agent, by_planner = agent_costs(run), planner_costs(run)
    assert sum(cost.total for cost in by_agent) == pytest.approx(run.profile.seconds.sum())
    assert sum(cost.total for cost in by_planner) == pytest.approx(run.profile.seconds.sum())
    call = next(cost for cost in by_planner if cost.part == "call")
    assert call.median <= call.high <= call.most == seconds(run, 100, "call").max()


def test_a_saved_profile_is_read_again_and_checked(run, tmp_path):
    save(run, tmp_path / "run")
    again = load(tmp_path / "run")
    assert again.profile.part == run.profile.part
    assert np.array_equal(again.profile.seconds, run.profile.seconds)


def test_the_command_prints_phases_planners_and_agents(tmp_path):
    done = CliRunner().invoke(
        main, ["run", "t_junction", "--agents", "3", "--profile", "--threads", "1", "--out", str(tmp_path / "run")]
    )
    assert done.exit_code == 0
    lines = done.stdout.splitlines()
    assert any(line.startswith("predict (neural)") for line in lines)
    assert any(line.split()[:3] == ["rollout", "plan", "3"] for line in lines)
    assert (tmp_path / "run" / "profile.parquet").exists()
