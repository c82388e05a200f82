"""Planners and predictors that do what they must not: they cost their own agent, never the run or another agent."""

from __future__ import annotations

import gc
import os
import re
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
from drivers import Straight
from parallel_drivers import EndingItself, Interrupting, Unprintable

from interdrive import InputError, PredictorError, SimulationSettings, simulate
from interdrive.config.schema import StepSettings
from interdrive.foreign import undisturbed
from interdrive.testing import problem, straight_road, world


def two_agents():
    problems = [
        problem(100, 20.0, goal=(60.0, 0.0), time_step=(0, 50)),
        problem(200, 20.0, 3.5, goal=(60.0, 3.5), time_step=(0, 50)),
    ]
    return world(straight_road(lanes=2), problems=problems)


def drive(hostile, other=Straight, threads=1, **choices):
    return simulate(two_agents(), agents=[100, 200], planner={100: hostile, 200: other}, threads=threads, **choices)


def raising(error):
    """A planner that raises what the function makes."""

    class Raising:
        def plan(self, view, predictions):
            raise error()

    return Raising


class MuteError(Exception):
    def __str__(self):
        raise RuntimeError("no comment")


class NumericError(Exception):
    def __str__(self):
        return 7  # noqa: PLE0307


class EndlessError(Exception):
    def __str__(self):
        return str(self)


class Own(BaseException):
    pass


class Slippery(str):
    __slots__ = ()

    def split(self, *_):
        raise RuntimeError("not like this")


class SlyError(Exception):
    def __str__(self):
        return Slippery("no idea")


def its_own_cause():
    error = ValueError("round and round")
    error.__cause__ = error
    return error


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (MuteError, "MuteError"),
        (NumericError, "NumericError"),
        (EndlessError, "EndlessError"),
        (Own, "Own"),
        (SlyError, "SlyError: no idea"),
        (GeneratorExit, "GeneratorExit"),
        (lambda: SystemExit("enough"), "SystemExit: enough"),
        (its_own_cause, "ValueError: round and round"),
        (lambda: ValueError(10**7 * "long "), "ValueError: long long"),
    ],
)
def test_whatever_a_planner_raises_costs_its_own_agent_only(error, words):
    run = drive(raising(error))
    assert run.outcomes.outcome == ("planner_error", "goal_reached")
    said = run.outcomes.message[0]
    assert re.search(rf"time step 0: test_hostile_planners\.py:\d+ in plan: {words}", said)
    assert len(said) < 1200


@pytest.mark.parametrize("error", [MuteError, Own, GeneratorExit, SlyError])
def test_whatever_a_predictor_raises_ends_the_run_with_one_line(error):
    class Raising:
        def predict(self, scene):
            raise error

    with pytest.raises(
        PredictorError, match=rf"time step 0: test_hostile_planners\.py:\d+ in predict: {error.__name__}"
    ):
        simulate(two_agents(), planner=Straight, predictor=Raising, threads=1)


@pytest.mark.parametrize("error", [MuteError, Own, GeneratorExit])
def test_whatever_the_making_of_a_planner_raises_is_a_refusal(error):
    def factory():
        raise error

    with pytest.raises(InputError, match=f"cannot be made \\({error.__name__}\\)"):
        drive(factory)


@pytest.mark.parametrize("hostile", [Unprintable, EndingItself, Interrupting])
def test_in_a_process_of_its_own_it_costs_its_own_agent_only(hostile, capfd):
    run = drive(hostile, threads=2)
    assert run.outcomes.outcome == ("planner_error", "goal_reached")
    assert run.outcomes.message[0].rpartition(": ")[2] in ("MuteError", "Own", "KeyboardInterrupt")
    assert capfd.readouterr() == ("", "")


def lowest_recursion_limit():
    limit = 1
    while True:
        try:
            return sys.setrecursionlimit(limit)
        except RecursionError:
            limit += 1


def disturbances(folder):
    def forked():
        os.fork()

    def moved():
        os.chdir(folder)

    def silent():
        sys.stdout = None

    return {
        "recursion limit": lowest_recursion_limit,
        "floating-point errors": lambda: np.seterr(all="raise"),
        "warnings": lambda: warnings.simplefilter("error"),
        "working folder": moved,
        "standard output": silent,
        "fork": forked,
    }


def surroundings():
    return sys.getrecursionlimit(), np.geterr(), list(warnings.filters), sys.stdout


@pytest.mark.parametrize("what", disturbances(None))
def test_what_a_planner_changes_in_the_process_is_put_back_after_every_call(tmp_path, what):
    disturb, before, seen = disturbances(tmp_path)[what], surroundings(), []

    class Disturbing(Straight):
        def plan(self, view, predictions):
            plan = super().plan(view, predictions)
            if view.time_step == 1:
                disturb()
            return plan

    class Watching(Straight):
        def plan(self, view, predictions):
            seen.append(surroundings())
            return super().plan(view, predictions)

    process, folder = os.getpid(), Path.cwd()
    run = drive(Disturbing, Watching)
    assert os.getpid() == process  # a forked child never comes here
    assert all(one == before for one in seen)
    assert (surroundings(), Path.cwd()) == (before, folder)
    assert run.outcomes.outcome[1] == "goal_reached"


def test_a_planner_that_switches_the_alarm_off_is_stopped_all_the_same():
    class Deaf(Straight):
        def plan(self, view, predictions):
            signal.signal(signal.SIGALRM, signal.SIG_IGN)
            while True:
                gc.isenabled()

    start = time.perf_counter()
    run = drive(Deaf, settings=SimulationSettings(step=StepSettings(planner_timeout_s=0.2)))
    assert time.perf_counter() - start < 20.0
    assert run.outcomes.outcome == ("planner_error", "goal_reached")
    assert "at most 0.2 s are allowed" in run.outcomes.message[0]


def test_a_profiler_works_after_a_planner_that_was_stopped_by_force():
    profiled = (
        "import cProfile, sys\n"
        "sys.path[:0] = ['tests/planners', 'tests/support']\n"
        "import test_hostile_planners as hostile\n"
        "hostile.test_a_planner_that_switches_the_alarm_off_is_stopped_all_the_same()\n"
        "print(cProfile.Profile().runcall(lambda: (lambda: 41)() + 1))\n"
    )
    done = subprocess.run([sys.executable, "-c", profiled], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (0, "42\n"), done.stderr


def test_a_child_that_comes_back_ends_even_if_it_raises():
    def fork():
        if os.fork() == 0:
            raise ValueError("in the child")
        return os.wait()[1]

    assert undisturbed(fork) == 0
