"""Headings that are off by one angle are turned when a file is read."""

import math
import re
from dataclasses import replace

import commonroad_documents as cr
import numpy as np
import pytest

from interdrive import read_scenario, simulate
from interdrive.recordings import heading_offset, repaired
from interdrive.scenario import GoalState
from interdrive.testing import Car, problem, straight_road, world

#: 3 cars that drive 100 steps of 2 m: 300 samples.
CARS = [Car(number, x=20.0 * number, y=3.5 * (number - 1), velocity=20.0) for number in (1, 2, 3)]


def recorded(offset=0.0, noise=0.0, cars=CARS, **more):
    """Cars on a straight road whose headings are off by an angle and noise [degrees]."""
    scenario = world(straight_road(600.0, lanes=3), cars=cars, **more)
    drawn = np.random.default_rng(0).normal(0.0, 1.0, scenario.obstacles.x.shape)
    orientation = scenario.obstacles.orientation - np.radians(offset + noise * drawn)
    return replace(scenario, obstacles=replace(scenario.obstacles, orientation=orientation))


def headings(scenario):
    """Headings of all cars [degrees]."""
    return np.degrees(scenario.obstacles.orientation[scenario.obstacles.valid])


@pytest.mark.parametrize("offset", [1.95, -1.95, 0.75, 90.05, 178.95])
def test_headings_that_are_off_by_one_angle_are_turned_and_a_note_says_so(offset):
    found = repaired(recorded(offset, noise=0.1))
    assert np.median(headings(found)) == pytest.approx(0.0, abs=0.05)
    assert np.degrees(found.turned) == pytest.approx(offset, abs=0.05)
    assert re.fullmatch(
        rf"headings turned by {str(offset)[:-1]}\d degrees, in which vehicles move "
        r"\(300 steps, interquartile range 0\.\d\d degrees\)",
        found.notes[0],
    )


@pytest.mark.parametrize("offset", [180.0, 179.95, -179.95, 180.1])
def test_headings_that_point_backwards_are_turned_round(offset):
    """Angles beside half a turn lie at both ends of the range."""
    found = repaired(recorded(offset, noise=0.1))
    assert np.median(headings(found)) == pytest.approx(0.0, abs=0.05)
    assert abs(math.remainder(np.degrees(found.turned) - offset, 360.0)) < 0.1


@pytest.mark.parametrize(
    ("offset", "noise", "cars"),
    [
        (0.45, 0.0, CARS),  # less than half a degree
        (1.93, 2.0, CARS),  # noise rather than one angle
        (1.93, 0.0, CARS[:1]),  # 100 steps are too few
        (1.93, 0.0, [replace(car, velocity=9.0) for car in CARS]),  # steps of 0.9 m have no direction
    ],
)
def test_other_headings_are_left_as_they_are_bit_for_bit(offset, noise, cars):
    scenario = recorded(offset, noise, cars)
    found = repaired(scenario)
    assert found.notes == ()
    assert np.array_equal(found.obstacles.orientation, scenario.obstacles.orientation, equal_nan=True)


def test_bicycles_people_and_what_stands_do_not_tell_the_offset():
    scenario = recorded(1.93)
    riders = replace(scenario.obstacles, kinds=("bicycle", "pedestrian", "motorcycle"))
    assert heading_offset([riders]).n_samples == 0
    assert not heading_offset([riders]).is_constant
    standing = replace(scenario.obstacles, is_static=np.array([True, False, False]))
    assert heading_offset([standing]).n_samples == 200


def test_starts_and_goals_of_planning_problems_turn_with_the_recordings():
    one = problem(9, 5.0, goal=(90.0, 0.0), time_step=(0, 60), orientation=np.radians(-2.0))
    goal = GoalState(one.goal[0].areas, (), (0, 60), orientation=(-0.1, 0.1))
    found = repaired(recorded(2.0, problems=[replace(one, goal=(goal,))]))
    turned = found.planning_problems[0]
    assert turned.initial_state.orientation == pytest.approx(0.0, abs=1e-9)
    assert turned.goal[0].orientation == pytest.approx((-0.1 + np.radians(2.0), 0.1 + np.radians(2.0)))


def test_headings_stay_within_half_a_turn():
    west = [replace(car, x=500.0, orientation=np.pi) for car in CARS]
    found = repaired(recorded(-1.0, noise=0.2, cars=west))
    assert np.all(np.abs(found.obstacles.orientation) <= np.pi)
    assert np.median(np.abs(headings(found))) == pytest.approx(180.0, abs=0.3)


def file_with_an_offset(folder, offset=2.0):
    """A file with two cars that drive along x and state a heading that is off [degrees]."""
    heading = -np.radians(offset)
    cars = "".join(
        cr.car(
            number,
            cr.initial(5.0, y, orientation=heading, velocity=10.5, acceleration=0.0, yawRate=0.0),
            [cr.state(i, 5.0 + 1.05 * i, y, orientation=heading, velocity=10.5) for i in range(1, 111)],
        )
        for number, y in ((30, 0.0), (31, 1.9))
    )
    lanes = cr.lanelet(1, left=((0, 4), (200, 4)), right=((0, -2), (200, -2)))
    return cr.saved(folder, cr.document(cars, lanelets=lanes), "turned.xml")


def test_reading_repairs_and_raw_leaves_the_file_as_it_is(tmp_path):
    path = file_with_an_offset(tmp_path)
    assert headings(read_scenario(path)) == pytest.approx(0.0, abs=1e-6)
    assert any("headings turned by 2.00 degrees" in note for note in read_scenario(path).notes)
    raw = read_scenario(path, raw=True)
    assert headings(raw) == pytest.approx(-2.0)
    assert not any("turned" in note for note in raw.notes)


def test_a_run_says_how_its_recordings_were_read_and_is_loaded_that_way(tmp_path):
    path = file_with_an_offset(tmp_path)
    for raw, heading in ((False, 0.0), (True, -2.0)):
        run = simulate(path, agents=[30], settings={"recording.raw": raw})
        assert run.settings["settings"]["recording.raw"] is raw
        run.save(tmp_path / f"run-{raw}")
        loaded = type(run).load(tmp_path / f"run-{raw}")
        assert headings(loaded.scenario) == pytest.approx(heading, abs=1e-6)
    again = simulate(read_scenario(path, raw=True), agents=[30])
    assert again.settings["settings"]["recording.raw"] is True
    assert again.digest == run.digest


def test_recordings_that_drive_backwards_keep_their_headings():
    back = [replace(car, x=500.0 + car.x, velocity=-20.0) for car in CARS]
    found = repaired(recorded(cars=back))
    assert found.turned == 0.0
    assert np.median(headings(found)) == 0.0
    # Turned files of such recordings are turned back.
    assert np.degrees(repaired(recorded(1.95, noise=0.1, cars=back)).turned) == pytest.approx(1.95, abs=0.05)
