"""Windows of one recording are joined to a scenario."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from windows import window, windows

from interdrive import InputError, join, read_scenario, simulate
from interdrive.files import scenario_document
from interdrive.recordings import joined
from interdrive.scenario import STATE_FIELDS, Shape, TrafficLight
from interdrive.testing import Car, bend, problem, straight_road, world

CARS = [
    Car(11, x=5.0, velocity=12.0),
    Car(12, x=60.0, y=3.5, velocity=15.0, last=70),
    Car(13, x=5.0, y=3.5, velocity=11.0, first=45),
    Car(14, x=300.0, y=3.5),
]


def whole(**more):
    """99 steps of four cars."""
    return world(straight_road(600.0, lanes=2), **{"cars": CARS, "steps": 99, **more})


def states(scenario):
    return {name: getattr(scenario.obstacles, name) for name in STATE_FIELDS}


def are_equal(a, b):
    return all(np.array_equal(value, states(b)[name], equal_nan=True) for name, value in states(a).items())


@pytest.mark.parametrize("length", [10, 33, 50, 99])
def test_joined_windows_equal_the_recording_bit_for_bit(length):
    parts = windows(whole(), length)
    found = joined(parts[::-1])
    assert found.obstacles.ids.tolist() == [11, 12, 13, 14]
    assert are_equal(found, whole())
    assert found.obstacles.kinds == whole().obstacles.kinds


def test_a_note_says_how_many_participants_continue_and_how_well():
    found = joined(windows(whole(), 50))
    assert found.notes == (
        (
            "2 recordings joined: 4 participants, 4 continue in the next, 0.000 m from where their speeds lead "
            "(median; 99 %: 0.000 m, largest: 0.000 m)"
        ),
    )
    assert found.name == "REC_Road-1_0_T-99"
    assert found.path is None


def test_headings_of_all_windows_are_turned_by_one_angle():
    found = joined(windows(whole(), 50, offset=0.03))
    assert found.obstacles.orientation[found.obstacles.valid] == pytest.approx(0.0, abs=1e-9)
    assert "headings turned by 1.72 degrees" in found.notes[-1]
    raw = joined(windows(whole(), 50, offset=0.03), raw=True)
    assert raw.obstacles.orientation[raw.obstacles.valid] == pytest.approx(-0.03)


def test_time_steps_are_those_of_the_names_also_where_other_digits_stand_before_them():
    names = ["REC_Road-1_1480_T-129", "REC_Road-1_14130_T-179"]
    found = joined([window(whole(), first, first + 49, name) for first, name in zip((0, 50), names, strict=True)])
    assert found.obstacles.n_steps == 180
    assert not found.obstacles.valid[:, :80].any()
    assert found.obstacles.x[0, 80:] == pytest.approx(whole().obstacles.x[0])


def test_the_first_window_may_count_from_1():
    found = joined([window(whole(), 0, 49, "REC_Road-1_1_T-49"), window(whole(), 50, 99)])
    assert are_equal(found, whole())


@pytest.mark.parametrize("names", [("a_1", "a_2", "a_3", "a_4"), ("one", "two", "three", "four")])
def test_without_time_steps_in_names_a_running_number_or_the_participants_give_the_order(names):
    parts = [window(whole(), 25 * i, 25 * i + 24, name) for i, name in enumerate(names)]
    found = joined([parts[2], parts[0], parts[3], parts[1]])
    assert are_equal(found, whole())


def test_windows_of_which_none_continues_another_are_refused():
    parts = [window(whole(cars=[Car(i, x=50.0 * i, velocity=9.0)]), 0, 20, f"part {'xyz'[i]}") for i in range(3)]
    with pytest.raises(InputError, match="neither their names nor their participants say which one follows which"):
        joined(parts)


def test_a_missing_window_leaves_a_gap_and_is_named():
    parts = windows(whole(), 20)
    found = joined([*parts[:2], *parts[3:]])
    assert found.obstacles.ids.tolist() == [11, 12, 13, 14]
    assert not found.obstacles.valid[:, 40:60].any()
    assert "no recording of time steps 40 to 59: all tracks are cut there" in found.notes
    assert "absent between two recordings, obstacles: 11, 12, 14" in found.notes
    assert found.notes[0].startswith("4 recordings joined: 4 participants, 6 continue")


def test_an_id_that_is_another_vehicle_in_the_next_window_becomes_a_new_participant():
    before = window(whole(), 0, 49)
    elsewhere = [replace(CARS[0], x=5.61), *CARS[1:]]
    found = joined([before, window(whole(cars=elsewhere), 50, 99)])
    assert found.obstacles.ids.tolist() == [11, 12, 13, 14, 15]
    assert found.obstacles.valid[0].tolist() == [True] * 50 + [False] * 50
    assert found.obstacles.valid[4].tolist() == [False] * 50 + [True] * 50
    assert "another vehicle with the same id in the next recording, which got a new id: 11" in found.notes
    near = [replace(CARS[0], x=5.59), *CARS[1:]]
    assert joined([before, window(whole(cars=near), 50, 99)]).obstacles.ids.tolist() == [11, 12, 13, 14]


def test_planning_problems_are_left_out_with_a_note():
    one = problem(9, 5.0, goal=(90.0, 0.0), time_step=(0, 60))
    found = joined(windows(whole(problems=[one]), 50))
    assert found.planning_problems == ()
    assert "2 planning problems left out: each belongs to one of the recordings" in found.notes


def test_static_obstacles_stand_as_long_as_they_are_recorded():
    scenario = whole()
    scenario = replace(scenario, obstacles=replace(scenario.obstacles, is_static=np.array([False, False, False, True])))
    found = joined(windows(scenario, 50))
    assert found.obstacles.is_static.tolist() == [False, False, False, True]
    assert found.obstacles.valid[3].all()
    gone = window(scenario, 50, 99)
    without = replace(gone.obstacles, valid=gone.obstacles.valid & (gone.obstacles.ids != 14)[:, None])
    gone = window(replace(scenario, obstacles=without), 0, 49, "REC_Road-1_50_T-99")
    found = joined([window(scenario, 0, 49), gone])
    assert found.obstacles.is_static.tolist() == [False] * 4
    assert found.obstacles.valid[3].tolist() == [True] * 50 + [False] * 50


def test_traffic_lights_keep_their_time():
    light = TrafficLight(50, (("red", 30), ("green", 20)), offset=5)
    parts = [replace(window(whole(), first, first + 49), traffic_lights=(light,)) for first in (0, 50)]
    shifted = [replace(part, name=name) for part, name in zip(parts, ("R_80_T-129", "R_130_T-179"), strict=True)]
    assert joined(shifted).traffic_lights[0].signals(180)[80:].tolist() == light.signals(100).tolist()


REFUSED = {
    "at least two": lambda a, b: [a],
    "a.xml cannot be joined with itself": lambda a, b: [
        b,
        replace(a, path=Path("a.xml")),
        replace(a, path=Path("a.xml")),
    ],
    "their lanelets differ": lambda a, b: [a, replace(b, lanelets=bend())],
    "0.1 s between time steps, and 0.2 s": lambda a, b: [a, replace(b, dt=0.2)],
    "begins at time step 40, before": lambda a, b: [a, replace(b, name="REC_Road-1_40_T-89")],
    "obstacle 11 is a car in one and a truck in the other": lambda a, b: [
        a,
        replace(b, obstacles=replace(b.obstacles, kinds=("truck", *b.obstacles.kinds[1:]))),
    ],
    "obstacle 11 has another size": lambda a, b: [
        a,
        replace(b, obstacles=replace(b.obstacles, shapes=(Shape("rectangle", 9.0, 2.0), *b.obstacles.shapes[1:]))),
    ],
}


@pytest.mark.parametrize("words", REFUSED)
def test_windows_that_do_not_belong_together_are_refused_in_one_line(words):
    with pytest.raises(InputError, match=words) as refused:
        joined(REFUSED[words](window(whole(), 0, 49), window(whole(), 50, 99)))
    assert "\n" not in str(refused.value)


def test_files_are_joined_written_and_read_back_with_the_same_states(tmp_path):
    paths = []
    for part in windows(whole(), 50):
        paths.append(tmp_path / f"{part.name}.xml")
        paths[-1].write_bytes(scenario_document(part))
    found = join(paths)
    assert are_equal(found, whole())
    written = tmp_path / "whole.xml"
    written.write_bytes(scenario_document(found, paths[0]))
    assert are_equal(read_scenario(written), found)
    assert simulate(found, agents=[11]).digest == simulate(written, agents=[11]).digest


def test_a_text_is_no_list_of_files():
    with pytest.raises(InputError, match="give a list of files"):
        join("a.xml")
