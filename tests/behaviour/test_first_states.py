"""With which yaw rate and acceleration agents start: what is stated, unless path and speed contradict it."""

from dataclasses import replace

import commonroad_documents as cr
import numpy as np
import pytest

from interdrive import Simulation, simulate
from interdrive.scenario import Shape
from interdrive.testing import Car, bend, problem, straight_road, world

PLANNERS = ["rollout", "frenet", "idm", "idm_mobil", "velocity_adjusting"]


def stating(scenario, row=0, **values):
    """The scenario with other first values of a recorded vehicle."""
    obstacles = scenario.obstacles
    first = int(obstacles.valid[row].argmax())
    tables = {name: getattr(obstacles, name).copy() for name in values}
    for name, value in values.items():
        tables[name][row, first] = value
    return replace(scenario, obstacles=replace(obstacles, **tables))


def motorway(yaw_rate, velocity=10.8, lorry=19.8):
    """A lorry on the second of four empty lanes, with a first yaw rate; cars around it."""
    cars = [
        Car(5, x=60.0, y=3.5, velocity=velocity),
        Car(7, x=62.0, velocity=13.4),
        Car(9, x=50.0, y=7.0, velocity=13.8),
        Car(10, x=38.0, y=3.5, velocity=11.5),
    ]
    scenario = world(straight_road(600.0, lanes=4), cars=cars, steps=60)
    shapes = (Shape("rectangle", lorry, 2.4), *scenario.obstacles.shapes[1:])
    scenario = replace(scenario, obstacles=replace(scenario.obstacles, shapes=shapes))
    return stating(scenario, yaw_rate=yaw_rate)


def start(scenario, **more):
    return Simulation(scenario, **more).agents[0].initial_state


@pytest.mark.parametrize("yaw_rate", [0.37, -0.37, 0.2, -0.2, 1.5])
def test_a_lorry_with_a_noisy_first_yaw_rate_drives_on(yaw_rate):
    run = simulate(motorway(yaw_rate), planner="rollout")
    assert run.outcomes.outcome == ("goal_reached",) * 4
    row = run.states.participant_id.tolist().index(5)
    assert np.nanmin(run.states.velocity[row]) > 9.0, "m/s"
    assert np.nanmax(np.abs(run.states.y[row] - 3.5)) < 0.6, "m: the side of the lorry at most 5 cm beyond its lane"


@pytest.mark.parametrize(("velocity", "noise"), [(30.0, 0.12), (20.0, -0.2), (10.8, 0.37), (4.0, 0.5), (1.5, -0.4)])
def test_noise_is_replaced_at_every_speed_and_in_both_signs(velocity, noise):
    for sign in (1, -1):
        found = start(motorway(sign * noise, velocity, lorry=4.5))
        assert found.yaw_rate == pytest.approx(0.0, abs=1e-3), "rad/s"


@pytest.mark.parametrize("yaw_rate", [0.15, -0.15, 0.02, 0.0])
def test_a_yaw_rate_that_a_driver_may_have_counts_to_the_last_bit(yaw_rate):
    assert start(motorway(yaw_rate)).yaw_rate == yaw_rate


@pytest.mark.parametrize("planner", PLANNERS)
def test_all_planners_start_in_the_same_state(planner):
    expected = start(motorway(0.37), planner="rollout")
    assert start(motorway(0.37), planner=planner) == expected


def in_the_bend(yaw_rate, velocity=7.0, radius=15.0):
    """A car in the middle of a left turn that goes on along it."""
    dt, angle = 0.1, np.arange(0, 12) * velocity * 0.1 / radius + 0.5
    scenario = world(bend(radius=radius), cars=[Car(1, x=0.0, velocity=velocity)], steps=len(angle) - 1, dt=dt)
    obstacles = scenario.obstacles
    turned = replace(
        obstacles,
        x=(radius * np.sin(angle))[None],
        y=(radius - radius * np.cos(angle))[None],
        orientation=angle[None],
        yaw_rate=np.full_like(obstacles.yaw_rate, velocity / radius),
    )
    return stating(replace(scenario, obstacles=turned), yaw_rate=yaw_rate)


FEW = {"agents.min_displacement": 3.0}


@pytest.mark.parametrize("yaw_rate", [0.40, 7.0 / 15.0, 0.52])
def test_a_vehicle_that_starts_inside_a_turn_keeps_its_real_yaw_rate(yaw_rate):
    assert start(in_the_bend(yaw_rate), settings=FEW).yaw_rate == yaw_rate


@pytest.mark.parametrize("yaw_rate", [0.0, -0.4])
def test_inside_a_turn_a_yaw_rate_of_another_turn_is_replaced_by_that_of_the_path(yaw_rate):
    assert start(in_the_bend(yaw_rate), settings=FEW).yaw_rate == pytest.approx(7.0 / 15.0, abs=0.05)


def test_a_vehicle_on_a_straight_road_before_a_turn_may_begin_it():
    scenario = world(bend(radius=15.0), cars=[Car(1, x=-4.0, velocity=7.0)], steps=20)
    assert start(stating(scenario, yaw_rate=0.4)).yaw_rate == 0.4


def file_of_a_car(tmp_path, first, later=None, name="car.xml"):
    """A file with a car that goes straight on at 10 m/s; first values and positions along y later on as given."""
    later = (lambda i: {}) if later is None else later
    states = [
        cr.state(i, 5.0 + i, **{"y": 0.0, "orientation": 0.0, "velocity": 10.0, **later(i)}) for i in range(1, 61)
    ]
    return cr.saved(tmp_path, cr.document(cr.car(30, cr.initial(5.0, **first), states)), name)


@pytest.mark.parametrize(
    ("first", "acceleration", "yaw_rate"),
    [
        ({}, 0.0, 0.0),
        ({"acceleration": -1.5}, -1.5, 0.0),
        ({"yawRate": 0.12}, 0.0, 0.12),
        ({"acceleration": 0.5, "yawRate": 0.6}, 0.5, 0.0),
        ({"acceleration": 50.0}, 3.0, 0.0),
    ],
)
def test_values_that_a_file_lacks_are_estimated(tmp_path, first, acceleration, yaw_rate):
    found = start(file_of_a_car(tmp_path, first))
    assert found.acceleration == acceleration
    assert found.yaw_rate == pytest.approx(yaw_rate, abs=1e-3)


def swerving(i):
    """Another recorded future with the same end: it brakes and swerves to both sides."""
    wave = float(np.sin(np.pi * i / 10.0))
    return {} if i == 60 else {"y": 0.5 * wave, "orientation": 0.3 * wave, "velocity": 10.0 - 5.0 * abs(wave)}


@pytest.mark.parametrize("first", [{}, {"acceleration": 0.5}, {"yawRate": 0.1}, {"acceleration": 0.5, "yawRate": 0.37}])
def test_the_recorded_future_is_never_looked_at(tmp_path, first):
    paths = [file_of_a_car(tmp_path, first, later, f"{i}.xml") for i, later in enumerate((None, swerving))]
    one, other = (Simulation(path) for path in paths)
    assert one.agents[0].initial_state == other.agents[0].initial_state
    for simulation in (one, other):
        simulation.step()
    plans = [simulation.record().plans for simulation in (one, other)]
    np.testing.assert_array_equal(plans[0].x, plans[1].x)
    np.testing.assert_array_equal(plans[0].velocity, plans[1].velocity)


def with_a_past(acceleration, turn, stated=None):
    """A planning problem that starts after 2 s where a recorded car is that has changed its speed and heading."""
    scenario = world(straight_road(300.0, lanes=2), cars=[Car(3, x=10.0, velocity=10.0)], steps=60)
    o, time = scenario.obstacles, (np.arange(61) - 20) * 0.1
    now = float(o.x[0, 20])
    tables = {"velocity": (10.0 + acceleration * time)[None], "orientation": (turn * time)[None]}
    one = problem(100, now, velocity=10.0, goal=(200.0, 0.0), time_step=(0, 300), start=20)
    nothing = {"acceleration": np.nan, "yaw_rate": np.nan}
    initial = replace(one.initial_state, **{**nothing, **(stated or {})})
    return replace(scenario, obstacles=replace(o, **tables), planning_problems=(replace(one, initial_state=initial),))


def test_recorded_steps_before_the_start_give_what_the_problem_does_not_state():
    found = start(with_a_past(-1.2, 0.1), agents="problems")
    assert found.acceleration == pytest.approx(-1.2)
    assert found.yaw_rate == pytest.approx(0.1)
    found = start(with_a_past(-1.2, 0.1, {"acceleration": 0.4, "yaw_rate": 0.05}), agents="problems")
    assert (found.acceleration, found.yaw_rate) == (0.4, 0.05)


def test_the_past_replaces_a_yaw_rate_that_path_and_speed_contradict():
    found = start(with_a_past(0.0, 0.1, {"yaw_rate": 0.6}), agents="problems")
    assert found.yaw_rate == pytest.approx(0.1)


def test_the_past_confirms_a_turn_off_the_path():
    found = start(with_a_past(0.0, 0.38, {"yaw_rate": 0.39}), agents="problems")
    assert found.yaw_rate == 0.39


@pytest.mark.parametrize("velocity", [-2.0, 0.0])
def test_vehicles_that_reverse_or_stand_start_within_their_steering(velocity):
    scenario = world(straight_road(), cars=[Car(1, x=50.0, velocity=velocity), Car(2, x=20.0, velocity=9.0)])
    found = Simulation(stating(scenario, yaw_rate=0.8), settings={"agents.min_displacement": 0.0}).agents
    assert abs(found[0].initial_state.yaw_rate) < 1e-3
