"""Runs in which nobody plans: what is recorded, or nothing at all, for a time."""

import numpy as np
import pytest
from click.testing import CliRunner

import interdrive as idr
from interdrive.cli import main
from interdrive.simulation import Simulation
from interdrive.testing import Car, problem, straight_road, world

SETTINGS = {"record.violations": False}


def cars():
    """Two recorded cars on a road of 200 m for 3 s, and a problem behind them."""
    return world(
        straight_road(200.0, 1),
        cars=[Car(7, x=50.0, velocity=10.0), Car(8, x=80.0, velocity=10.0)],
        problems=[problem(900, 20.0, goal=(150.0, 0.0), time_step=(0, 100))],
        steps=30,
    )


def test_recorded_vehicles_drive_to_the_end_of_the_recording():
    run = idr.simulate(cars(), agents=0, threads=1)
    assert run.finished
    assert (len(run.agents), len(run.outcomes.agent_id)) == (0, 0)
    assert run.states.participant_id.tolist() == [7, 8]
    assert run.states.n_steps == run.scenario.obstacles.n_steps
    assert np.array_equal(run.states.x, run.scenario.obstacles.x)


@pytest.mark.parametrize(("duration", "last"), [(1.5, 15), (4.0, 40)])
def test_it_lasts_as_long_as_the_settings_say(duration, last):
    run = idr.simulate(cars(), agents=0, threads=1, settings={"step.duration": duration})
    assert run.states.n_steps == last + 1
    is_there = run.states.valid.any(axis=0)
    assert is_there.sum() == min(last + 1, run.scenario.obstacles.n_steps)


def test_steps_end_with_the_time_and_no_sooner():
    simulation = Simulation(cars(), agents=0, threads=1, settings={"step.duration": 0.3})
    assert (simulation.is_done, simulation.world.last_time_step) == (False, 3)
    for _ in range(5):
        simulation.step()
    assert (simulation.is_done, simulation.time_step) == (True, 3)


def test_agents_end_a_run_however_long_one_without_agents_would_be():
    few, many = (
        idr.simulate(cars(), agents=[7], threads=1, settings={"step.duration": seconds}) for seconds in (0.0, 60.0)
    )
    assert few.digest == many.digest


def test_a_map_on_which_traffic_draws_nobody_is_empty_for_its_duration():
    empty = world(straight_road(200.0, 1), steps=0)
    run = idr.simulate(empty, agents=0, traffic="rate=0.001,duration=5", threads=1)
    assert (run.states.n_steps, len(run.agents)) == (51, 0)
    assert run.demand.agent_id.tolist() == []


def test_nothing_at_all_is_refused():
    with pytest.raises(idr.InputError, match="has no traffic; without agents nothing happens"):
        idr.simulate(world(straight_road(200.0, 1), steps=0), agents=0)


def test_the_command_writes_such_a_run_which_repeats(tmp_path):
    def call(*words):
        return CliRunner().invoke(main, list(map(str, words)))

    done = call("run", "t_junction", "--agents", 0, "--set", "step.duration=1", "--out", tmp_path / "r")
    assert done.exit_code == 0, done.output
    assert "t_junction, no agents\n" in done.output
    assert call("verify", tmp_path / "r").exit_code == 0
    assert call("report", tmp_path / "r").exit_code == 0
    assert idr.load(tmp_path / "r").states.n_steps == 11
