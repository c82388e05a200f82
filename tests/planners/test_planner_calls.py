"""Planners in Python: what they may not do, how long they may take, and processes of their own."""

from __future__ import annotations

import os
import time

import numpy as np
import pytest
from drivers import Straight
from parallel_drivers import Alone, Dying, Elsewhere, Leaving, Raising, Remembering, Sleeping, Stuck

from interdrive import InputError, RunInterrupted, SimulationSettings, Trajectory, simulate
from interdrive.config.schema import StepSettings
from interdrive.testing import Car, check_planner, problem, straight_road, world


def two_agents(steps: tuple[int, int] = (0, 50)):
    problems = [
        problem(100, 20.0, goal=(60.0, 0.0), time_step=steps),
        problem(200, 20.0, 3.5, goal=(60.0, 3.5), time_step=steps),
    ]
    return world(straight_road(lanes=2), cars=[Car(7, 40.0, 3.5, 9.0)], problems=problems)


def drive(planner, threads=1, steps=(0, 50), **choices):
    return simulate(two_agents(steps), agents=[100, 200], planner=planner, threads=threads, **choices)


def with_timeout(seconds: float) -> SimulationSettings:
    return SimulationSettings(step=StepSettings(planner_timeout_s=seconds))


class WritesIntoItsView(Straight):
    def plan(self, view, predictions):
        view.x[:] = 0.0
        return super().plan(view, predictions)


class WritesIntoPredictions(Straight):
    def plan(self, view, predictions):
        predictions.x[:] = 0.0
        return super().plan(view, predictions)


class WritesIntoItsPath(Straight):
    def plan(self, view, predictions):
        view.ego.route.reference_path[0] = 0.0
        return super().plan(view, predictions)


def bent(change):
    class Bent(Straight):
        def plan(self, view, predictions):
            plan = super().plan(view, predictions)
            fields = {name: np.array(getattr(plan, name)) for name in ("x", "y", "orientation", "velocity")}
            return Trajectory(**{**fields, **change(fields)})

    return Bent


@pytest.mark.parametrize(
    ("planner", "words"),
    [
        (WritesIntoItsView, "writes into its view, which is read-only"),
        (WritesIntoPredictions, "writes into its view, which is read-only"),
        (WritesIntoItsPath, "writes into its view, which is read-only"),
        (
            bent(lambda f: {"x": np.where(np.arange(31) > 9, f["x"] + 90.0, f["x"])}),
            "jumps by 91.00 m between points 9 and 10",
        ),
        (bent(lambda f: {"x": f["x"] + 0.2}), "starts 0.20 m away"),
        (bent(lambda f: {"velocity": f["velocity"] + 500.0}), "500.00 m/s off the agent's speed"),
        (bent(lambda f: {"orientation": f["orientation"] + 1.0}), "1.00 rad off"),
        (bent(lambda f: {"y": np.full(31, np.inf)}), "y is not a number at point 0 (inf)"),
        (bent(lambda f: {"y": f["y"][:-1]}), "y has 30 values, x has 31"),
        (bent(lambda f: {"y": np.zeros((31, 2))}), "y has shape [31, 2], one dimension is expected"),
        (bent(lambda f: {"velocity": ["fast"] * 31}), "velocity is not an array of real numbers: it holds texts"),
        (
            bent(lambda f: {"velocity": f["velocity"].astype(str)}),
            "velocity is not an array of real numbers: it holds texts",
        ),
        (bent(lambda f: {"x": f["x"] + 0j}), "x is not an array of real numbers: it holds complex numbers"),
        (bent(lambda f: {"y": [0j, *f["y"][1:]]}), "y is not an array of real numbers: it holds complex numbers"),
        (bent(lambda f: {"y": np.ma.masked_less(f["y"], 1.0)}), "y is a masked array, plain numbers are expected"),
        (bent(lambda f: {"y": [np.ma.masked, *f["y"][1:]]}), "y holds masked values, plain numbers are expected"),
        (
            bent(lambda f: {"y": np.broadcast_to(np.int32(1), (10_000, 10**9))}),
            "y has 10000000000000 values, at most 10000 are allowed",
        ),
        (bent(lambda f: {"y": f["y"] > 1.0}), "y is not an array of real numbers: it holds truth values"),
        (bent(lambda f: {"y": f["y"].astype("m8[s]")}), "y is not an array of real numbers: it holds times"),
        (bent(lambda f: {"y": [None, *f["y"][1:]]}), "y is not an array of real numbers: it holds objects"),
        (
            bent(lambda f: {"x": np.broadcast_to(20.0, 10**12)}),
            "the plan has 1000000000000 points, at most 10000 are allowed",
        ),
        (bent(lambda f: {"yaw_rate": np.zeros(20_000_000)}), "the plan has 20000000 points, at most 10000 are allowed"),
        (bent(lambda f: {"orientation": range(10**9)}), "the plan has 1000000000 points, at most 10000 are allowed"),
        (
            bent(lambda f: {"x": np.repeat(f["x"][:1], 31)}),
            "states 10.0 m/s (points 0 to 1); positions are footprint centres, the rear axle is 1.4 m behind",
        ),
        (bent(lambda f: {"x": 2 * f["x"][0] - f["x"]}), "the plan moves -1.0 m in 0.1 s but states 10.0 m/s"),
        (
            bent(lambda f: {"x": f["x"] - np.where(np.arange(31) > 0, 1.4, 0.0)}),
            "the plan moves -0.4 m in 0.1 s but states 10.0 m/s (points 0 to 1); positions are footprint centres",
        ),
        (
            bent(lambda f: {"x": np.repeat(f["x"][:1], 31), "y": f["y"] + np.arange(31.0)}),
            "the plan moves 0.0 m in 0.1 s but states 10.0 m/s",
        ),
        (bent(lambda f: {"velocity": None}), "velocity is missing"),
        (bent(lambda f: {name: values[:1] for name, values in f.items()}), "1 points, at least two"),
    ],
)
def test_garbage_costs_its_own_agent_only_and_names_agent_planner_and_step(planner, words):
    run = drive({100: planner, "default": Straight})
    assert run.outcomes.outcome == ("planner_error", "goal_reached")
    message = run.outcomes.message[0]
    assert message.startswith(f"agent 100, planner {planner.__module__}:{planner.__qualname__}, time step 0: ")
    assert words in message


class Garbling:
    def plan(self, view, predictions):
        raise ValueError(f"no map in {os.fsdecode(b'roads')}{os.fsdecode(bytes([233]))}")


def test_what_a_planner_says_need_not_be_text():
    assert "no map in roads" in drive({100: Garbling, "default": Straight}).outcomes.message[0]


def test_a_planner_beyond_its_time_is_stopped_and_the_others_go_on():
    start = time.perf_counter()
    run = drive({100: Sleeping, "default": Straight}, settings=with_timeout(0.2))
    assert time.perf_counter() - start < 20.0
    assert run.outcomes.outcome == ("planner_error", "goal_reached")
    assert run.outcomes.time_step[0] == 3
    assert "at most 0.2 s are allowed" in run.outcomes.message[0]


def test_an_impossible_time_limit_is_refused_by_name():
    with pytest.raises(InputError, match=r"planner_timeout_s: must be positive"):
        StepSettings(planner_timeout_s=0.0)


def test_parallel_planners_run_in_processes_of_their_own(monkeypatch):
    monkeypatch.setenv("INTERDRIVE_TEST_PID", str(os.getpid()))
    for threads in (1, 2):
        assert drive(Elsewhere, threads).outcomes.outcome == ("goal_reached",) * 2


def test_parallel_planners_drive_to_the_same_bits_as_planners_in_the_process_of_the_run():
    alone = drive(Alone, steps=(0, 80))
    for threads in (1, 2, 3):
        assert drive(Remembering, threads, steps=(0, 80)).digest == alone.digest


@pytest.mark.long
@pytest.mark.parametrize(
    ("planner", "words"),
    [
        (Raising, "ValueError: no idea"),
        (Leaving, "its process ended in the planner of agent 100 (exit code 7)"),
        (Dying, "its process ended in the planner of agent 100 (exit code -9)"),
        (Stuck, "its process was killed: the planner of agent 100 took too long"),
    ],
)
@pytest.mark.parametrize("threads", [1, 2])
def test_a_process_that_fails_costs_its_own_agent_only(planner, words, threads):
    settings = with_timeout(1.0) if planner is Stuck else SimulationSettings()
    run = drive({100: planner, "default": Remembering}, threads, settings=settings)
    assert run.outcomes.outcome[0] == "planner_error"
    assert run.outcomes.time_step[0] == 3
    assert words in run.outcomes.message[0]
    assert run.outcomes.outcome[1] != "planner_error"


def test_a_parallel_planner_that_cannot_be_sent_runs_in_this_process_and_says_so():
    class Local(Straight):
        parallel = True

    run = drive(Local, threads=2)
    assert run.outcomes.outcome == ("goal_reached", "goal_reached")
    assert any("cannot be pickled for another process" in note for note in run.notes)


def test_outlines_of_participants_in_view_are_where_they_are():
    seen = []

    class Looking(Straight):
        def plan(self, view, predictions):
            seen.append(view.outlines(7)[0])
            return super().plan(view, predictions)

    simulate(two_agents(), agents=[100], planner=Looking, threads=1)
    assert np.allclose(seen[0].min(axis=0), [40.0 - 2.25, 3.5 - 0.9])
    assert np.allclose(seen[0].max(axis=0), [40.0 + 2.25, 3.5 + 0.9])


def test_the_check_of_the_contract_reports_how_every_small_world_ended():
    assert check_planner(Straight)["an empty road"] == "goal_reached"


class Failing:
    """Divides by zero in a function that it calls, at time step 2."""

    def plan(self, view, predictions):
        if view.time_step == 2:
            self.helper(0.0)
        return Straight().plan(view, predictions)

    def helper(self, nothing):
        return 1.0 / nothing


def test_a_failure_says_file_line_and_function_of_the_planner():
    message = drive(Failing).outcomes.message[0]
    line = Failing.helper.__code__.co_firstlineno + 1
    assert message.endswith(
        f"time step 2: test_planner_calls.py:{line} in helper: ZeroDivisionError: float division by zero"
    )


def test_a_failure_passes_through_on_request():
    with pytest.raises(ZeroDivisionError):
        drive(Failing, on_planner_error="raise")


def test_a_run_that_is_interrupted_is_in_the_exception():
    class Interrupting(Failing):
        def helper(self, nothing):
            raise KeyboardInterrupt

    settings = {"record.predictions": True, "record.candidates": 3}
    with pytest.raises(RunInterrupted, match=r"interrupted after 0\.2 s") as stop:
        drive(Interrupting, settings=settings)
    run = stop.value.run
    assert (run.finished, run.states.n_steps) == (False, 3)
    assert run.predictions.time_step.max(initial=0) < 2
    assert set(run.outcomes.outcome) == {"running"}
