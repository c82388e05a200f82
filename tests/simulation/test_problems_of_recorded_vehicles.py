"""Planning problems whose vehicle is recorded, too: both are one agent."""

from dataclasses import replace

import numpy as np
import pytest

from interdrive import Simulation, simulate
from interdrive.testing import Car, problem, straight_road, world

ROAD = straight_road(300.0, lanes=2)


def aim(number, x, velocity=12.0, *, start=0, y=0.0, **more):
    return problem(number, x, y, velocity, goal=(200.0, y), time_step=(0, 400), start=start, **more)


def agents_of(*problems, cars, steps=100, **more):
    """Ids of the agents of planning problems, and all notes."""
    scenario = world(ROAD, cars=cars, problems=problems, steps=steps)
    simulation = Simulation(replace(scenario, **more), agents="problems")
    return [agent.id for agent in simulation.agents], simulation.record().notes


def test_a_problem_whose_vehicle_enters_later_in_the_same_state_is_that_vehicle():
    late = Car(7, x=20.0, velocity=12.0, first=29)
    ids, notes = agents_of(aim(100, 20.4, 11.8), cars=[late])
    assert ids == [7]
    assert "planning problem 100 starts where recorded vehicle 7 enters at time step 29: they are one agent" in notes


@pytest.mark.parametrize("planner", ["rollout", "idm"])
def test_it_is_not_rammed_by_its_own_recording(planner):
    """The agent starts behind a slow car, so that its own recording would come from behind."""
    late, slow = Car(7, x=20.0, velocity=15.0, first=20), Car(8, x=60.0, velocity=4.0)
    scenario = world(ROAD, cars=[late, slow], problems=[aim(100, 20.0, 15.0)], steps=100)
    run = simulate(scenario, agents="problems", planner=planner)
    assert run.outcomes.agent_id.tolist() == [7]
    assert "collision" not in run.outcomes.outcome
    assert run.states.participant_id.tolist() == [7, 8]
    assert run.states.valid[0, 0], "it starts when its problem says"


def test_the_ids_may_be_equal():
    assert agents_of(aim(7, 20.0), cars=[Car(7, x=20.0, velocity=12.0, first=29)])[0] == [7]
    elsewhere = Car(7, x=90.0, velocity=12.0, first=29)
    ids, notes = agents_of(aim(7, 20.0), cars=[elsewhere])
    assert ids == [8]
    assert "planning problem 7 has the id of an obstacle elsewhere: its agent is 8" in notes


@pytest.mark.parametrize(
    "other",
    [
        {"x": 21.1},  # more than 1 m away
        {"y": 1.1},
        {"velocity": 12.6},  # more than 0.5 m/s faster
        {"orientation": 0.25},
        {"first": 0, "last": 20, "x": 30.0},  # it was there before
    ],
)
def test_vehicles_in_another_state_are_others(other):
    late = Car(7, **{"x": 20.0, "velocity": 12.0, "first": 29, **other})
    assert agents_of(aim(100, 20.0), cars=[late])[0] == [100]


@pytest.mark.parametrize("kind", ["pedestrian", "structure"])
def test_what_no_planner_drives_is_another_one(kind):
    scenario = world(ROAD, cars=[Car(7, x=20.0, velocity=12.0, first=29)], problems=[aim(100, 20.0)])
    scenario = replace(scenario, obstacles=replace(scenario.obstacles, kinds=(kind,)))
    assert [agent.id for agent in Simulation(scenario, agents="problems").agents] == [100]


def test_each_of_several_problems_gets_the_vehicle_that_fits_best():
    cars = [
        Car(7, x=20.0, velocity=12.0, first=14),
        Car(8, x=20.3, velocity=12.2, first=60),
        Car(9, x=20.6, velocity=12.4, first=40),
    ]
    problems = [aim(100, 20.6, 12.4), aim(101, 20.0, 12.0), aim(102, 20.3, 12.2)]
    _, notes = agents_of(*problems, cars=cars, steps=120)
    said = sorted(note.split(":")[0] for note in notes if "starts where" in note)
    assert said == [
        "planning problem 100 starts where recorded vehicle 9 enters at time step 40",
        "planning problem 101 starts where recorded vehicle 7 enters at time step 14",
        "planning problem 102 starts where recorded vehicle 8 enters at time step 60",
    ]


def test_two_problems_never_drive_one_vehicle():
    ids, _ = agents_of(aim(100, 20.0), aim(101, 20.2, y=0.3), cars=[Car(7, x=20.0, velocity=12.0, first=29)])
    assert ids == [7, 101]


def test_a_vehicle_that_is_there_at_the_time_comes_before_those_that_enter_later():
    """On motorways several vehicles enter at one place with one speed."""
    cars = [Car(7, x=20.0, velocity=12.0, first=29), Car(8, x=20.5, velocity=12.0)]
    assert agents_of(aim(100, 20.0), cars=cars)[0] == [8]


def test_a_problem_that_starts_between_recorded_steps_is_the_vehicle_in_between():
    scenario = world(ROAD, cars=[Car(7, x=20.0, velocity=12.0)], problems=[aim(100, 26.0, start=5)])
    every_second = np.arange(scenario.obstacles.n_steps) % 2 == 0
    tables = {
        name: np.where(every_second, getattr(scenario.obstacles, name), np.nan)
        for name in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate")
    }
    sparse = replace(scenario.obstacles, valid=scenario.obstacles.valid & every_second, **tables)
    simulation = Simulation(replace(scenario, obstacles=sparse), agents="problems")
    assert [agent.id for agent in simulation.agents] == [7]


@pytest.mark.parametrize("first", [10, 70])
def test_a_window_that_was_cut_out_of_a_recording_changes_nothing(first):
    """The problem starts at the first step of the file, its vehicle enters when it did."""
    cars = [Car(7, x=20.0, velocity=12.0, first=75), Car(8, x=90.0, y=3.5, velocity=5.0)]
    scenario = world(ROAD, cars=cars, problems=[aim(100, 20.0)], steps=120)
    part = slice(first, None)
    o = scenario.obstacles
    cut = replace(
        o,
        valid=o.valid[:, part],
        **{
            name: getattr(o, name)[:, part]
            for name in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate")
        },
    )
    for variant in (scenario, replace(scenario, obstacles=cut)):
        assert [agent.id for agent in Simulation(variant, agents="problems").agents] == [7]


@pytest.mark.parametrize(("first", "agent"), [(45, 7), (50, 7), (51, 100), (90, 100)])
def test_who_enters_much_later_than_a_stated_time_is_another_one(first, agent):
    """Many vehicles of generated traffic enter by one lane in nearly one state; a second of difference is rounding."""
    late = Car(7, x=20.0, velocity=12.0, first=first)
    assert agents_of(aim(100, 20.0, start=40), cars=[late], steps=120)[0] == [agent]


def test_raw_recordings_keep_them_apart():
    ids, _ = agents_of(aim(100, 20.0), cars=[Car(7, x=20.0, velocity=12.0, first=29)], raw=True)
    assert ids == [100]
