"""A collision has one time wherever it is told: that of the first state in which the contact was found."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from drivers import Straight

from interdrive import score, simulate
from interdrive.cli import main
from interdrive.cli.report import print_run
from interdrive.criticality import collisions
from interdrive.plots import draw_critical_moment
from interdrive.report.contents import run_contents
from interdrive.results import save
from interdrive.results.story import ending, story
from interdrive.run.goals import said_seconds
from interdrive.studies.reading import _encounter
from interdrive.testing import Car, problem, straight_road, world

#: Time between steps, distance to drive until the contact at 10 m/s, and the time of the first state after it.
CASES = {
    "early in a step": (0.1, 77.1, "7.8"),
    "late in a step": (0.1, 77.9, "7.8"),
    "short steps": (0.04, 77.3, "7.76"),
    "long steps": (0.5, 76.2, "8.0"),
    "odd steps": (0.025, 30.1, "3.025"),
}


@pytest.fixture(scope="module", params=CASES.values(), ids=CASES.keys())
def hit(request, tmp_path_factory):
    """Agent 1 stands; the recorded car 7 comes from behind with 10 m/s and hits it between two time steps."""
    dt, way, told = request.param
    agent = problem(1, 30.0 + 4.5 + way, velocity=0.0, goal=(180.0, 0.0), time_step=(0, round(12.0 / dt)))
    car = Car(7, 30.0, velocity=10.0)
    scenario = world(straight_road(300.0), cars=[car], problems=[agent], steps=round(10.0 / dt), dt=dt)
    run = simulate(scenario, agents=[1], planner=Straight, threads=1)
    assert run.outcomes.outcome == ("collision",)
    return run, told, save(run, tmp_path_factory.mktemp("hit") / "run")


def test_outcome_and_table_of_the_command(hit, capsys):
    run, told, folder = hit
    assert run.outcomes.time_step[0] * run.scenario.dt == pytest.approx(float(told))
    print_run(run, folder)
    assert re.search(rf"\b1 +collision +{re.escape(told)} +7\b", capsys.readouterr().out)
    assert run.outcomes.to_arrow()["time_s"].to_pylist() == [float(told)]


def test_story(hit):
    run, told, folder = hit
    assert ending(run, 1).startswith(f"agent 1: collision at {told} s: ")
    (contact,) = [line for line in story(run, 1) if "distance of closest encounter" in line]
    assert contact.endswith(f"0.0 m with 7 at {told} s")
    explained = CliRunner().invoke(main, ["explain", str(folder), "1"]).output
    assert f"collision at {told} s" in explained


def test_score(hit):
    run, told, _ = hit
    assert f"hit by 7 at {told} s, not its fault" in score(run, panel="none").why(1)


def test_criticality_and_harm(hit):
    run, told, _ = hit
    found = run.criticality([1, 7])
    for name, ids in {"dce": (1, 7), "ttc": (7,)}.items():
        for number in ids:
            moment = found.extremes[name]
            assert moment.value[found.row(number)] == 0.0
            assert said_seconds(int(moment.time_step[found.row(number)]), run.scenario.dt) == told, (name, number)
    assert (collisions(run).time_step == run.outcomes.time_step).all()
    title = draw_critical_moment(run, found.most_critical("dce")).axes[0].get_title(loc="left")
    assert title.endswith(f" at {told} s")


def test_report_and_study(hit):
    run, told, folder = hit
    header = run_contents(folder).header
    (event,) = [event for event in header["events"] if event["kind"] == "collision"]
    assert said_seconds(event["step"] + run.states.first_time_step, run.scenario.dt) == told
    (agent,) = [one for one in header["participants"] if one["id"] == 1]
    assert agent["end"] == event["step"]
    assert _encounter(SimpleNamespace(agent=1, other=7), run).startswith(f"they collide at {told} s with ")


@pytest.mark.parametrize(
    ("step", "dt", "text"),
    [
        (78, 0.1, "7.8"),
        (194, 0.04, "7.76"),
        (16, 0.5, "8.0"),
        (121, 0.025, "3.025"),
        (1, 1.0, "1.0"),
        (2, 1 / 3, "0.667"),
    ],
)
def test_times_have_the_digits_that_tell_steps_apart(step, dt, text):
    assert said_seconds(step, dt) == text


def test_rules_broken_before_a_collision_are_told_up_to_its_time():
    from interdrive.run import Violations
    from interdrive.scoring.faults import Verdict, _at_crossing

    at = np.array([58])
    broken = Violations(
        ("agent",),
        np.array([1]),
        ("red_light",),
        at,
        at,
        np.array([1]),
        np.array([-1]),
        *(np.zeros(1) for _ in range(3)),
    )
    contact = Verdict("", -3.0, "front", False, 7.71, 78, "")
    # The contact is 1.91 s after the line, its time 2.0 s after the time of the violation.
    assert _at_crossing(contact, broken, 1, 2, 0.1, 10.0).words == "passed a red light 2.0 s before the contact with 2"
