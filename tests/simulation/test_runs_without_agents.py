"""Runs in which nobody plans: what is recorded, or nothing at all, for a time."""

import numpy as np
import pytest
from click.testing import CliRunner

import interdrive as idr
from interdrive.cli import main
from interdrive.plots import draw_run
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


def test_with_generated_traffic_its_own_duration_counts():
    empty = world(straight_road(200.0, 1), steps=0)
    settings = {"step.duration": 2.0}
    run = idr.simulate(empty, agents=0, traffic="rate=0.001,duration=5", settings=settings, threads=1)
    assert run.states.n_steps == 51


def test_more_than_a_million_steps_are_refused_unless_the_most_steps_are_stated():
    often = world(straight_road(200.0, 1), cars=[Car(7, x=50.0, velocity=10.0)], steps=200, dt=0.01)
    with pytest.raises(idr.InputError, match=r"^step.duration: 20000 s are more than 1000000 time steps.*10000 s$"):
        Simulation(often, agents=0, settings={"step.duration": 2e4})
    few = {"step.duration": 2e4, "step.max_steps": 20}
    assert Simulation(often, agents=0, settings=few, threads=1).world.last_time_step == 20
    Simulation(often, agents=[7], settings={"step.duration": 2e4}, threads=1)


def test_a_picture_of_such_a_run_has_no_starts_and_no_times():
    alone, driven = (draw_run(idr.simulate(cars(), agents=agents, threads=1)) for agents in (0, [7]))
    labels = [[text.get_text() for text in figure.legends[0].get_texts()] for figure in (alone, driven)]
    assert ["start" in one for one in labels] == [False, True]
    assert [len(figure.axes) for figure in (alone, driven)] == [1, 2]


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
