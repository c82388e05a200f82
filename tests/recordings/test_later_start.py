"""A run that begins at a later time step of a recording is that of a file that was cut there."""

from dataclasses import replace

import numpy as np
import pytest

from interdrive import InputError, load, score, simulate
from interdrive.files import open_scenario, scenario_document
from interdrive.recordings import part_of
from interdrive.scenario import TrafficLight
from interdrive.testing import Car, problem, straight_road, world

START = 40

#: 11 is there all the time, 12 leaves before the start, 13 has entered by then, 14 enters later, 15 stands.
CARS = [
    Car(11, x=5.0, velocity=12.0),
    Car(12, x=60.0, y=3.5, velocity=15.0, last=35),
    Car(13, x=5.0, y=3.5, velocity=11.0, first=25),
    Car(14, x=5.0, velocity=10.0, first=60),
    Car(15, x=500.0, y=3.5),
]


def whole(**more):
    return world(straight_road(600.0, lanes=2), **{"cars": CARS, "steps": 120, **more})


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "whole.xml"
    path.write_bytes(scenario_document(whole()))
    return path


@pytest.fixture
def cut(tmp_path, file):
    """A file of the same recording that was cut at the start."""
    path = tmp_path / "cut.xml"
    scenario = open_scenario(file)
    path.write_bytes(scenario_document(part_of(scenario, START, scenario.obstacles.n_steps), file))
    return path


@pytest.mark.parametrize("planner", ["rollout", "idm"])
def test_a_run_that_begins_later_has_the_bits_of_that_of_a_file_that_was_cut_there(file, cut, planner):
    later, of_cut = simulate(file, start=START, planner=planner), simulate(cut, planner=planner)
    assert later.digest == of_cut.digest != simulate(file, planner=planner).digest
    assert later.outcomes.agent_id.tolist() == of_cut.outcomes.agent_id.tolist() == [11, 13, 14]
    assert later.outcomes.outcome == of_cut.outcomes.outcome
    for one, other in zip(later.agents, of_cut.agents, strict=True):
        assert one.start_time_step == other.start_time_step
        assert [goal.time_step for goal in one.goal] == [goal.time_step for goal in other.goal]
        for goal, same in zip(one.goal, other.goal, strict=True):
            assert [area.vertices.tolist() for area in goal.areas] == [area.vertices.tolist() for area in same.areas]


def test_time_steps_count_from_the_start_and_a_note_says_so(file):
    run = simulate(file, agents=[13], start=START)
    assert run.states.participant_id.tolist() == [11, 13, 14, 15]
    assert run.scenario.obstacles.x[0, 0] == pytest.approx(5.0 + START * 1.2)
    assert f"begins at time step {START} of the recording, which is 0 here; its last one is 80" in run.notes


def test_a_scenario_from_memory_begins_later_too(file):
    assert simulate(whole(), start=START).digest == simulate(file, start=START).digest


def test_the_setting_is_the_argument(file):
    by_setting = simulate(file, settings={"recording.start": START})
    assert by_setting.digest == simulate(file, start=START).digest
    assert by_setting.settings["settings"]["recording.start"] == START


def test_planning_problems_keep_their_times_and_those_that_began_are_left_out():
    early = problem(2, x=60.0, goal=(200.0, 0.0), time_step=(60, 70))
    late = problem(3, x=30.0, goal=(200.0, 0.0), time_step=(START + 60, START + 70), start=START + 5)
    found = open_scenario(whole(problems=[early, late]), start=START)
    assert [(one.id, one.initial_state.time_step, one.goal[0].time_step) for one in found.planning_problems] == [
        (3, 5, (60, 70))
    ]
    assert found.notes[-1] == "planning problems that begin earlier are left out: 2"


def test_lights_show_what_they_showed():
    light = TrafficLight(5, (("red", 300), ("green", 200)), offset=7)
    found = open_scenario(replace(whole(), traffic_lights=(light,)), start=START)
    (shifted,) = found.traffic_lights
    assert shifted.offset == 7 - START
    assert shifted.phases == light.phases


def test_only_who_overlaps_after_the_start_is_told():
    both = [Car(21, x=50.0, last=20), Car(22, x=51.0, last=20), Car(23, x=5.0, velocity=8.0)]
    found = open_scenario(open_scenario(whole(cars=both)), start=START)
    assert found.overlaps == ()


def test_a_run_folder_begins_where_its_run_began(tmp_path, file):
    run = simulate(file, agents=[13], start=START)
    folder = run.save(tmp_path / "run")
    again = load(folder)
    assert (again.scenario.start, again.digest) == (START, run.digest)
    assert np.array_equal(again.scenario.obstacles.x, run.scenario.obstacles.x, equal_nan=True)
    assert score(again).score == score(run).score
    file.unlink()
    assert load(folder).scenario.start == START


@pytest.mark.parametrize(
    ("start", "words"),
    [
        (120, "recording.start: whole has time steps 0 to 120: none follows 120"),
        (-1, "recording.start: must be at least 0 and"),
        (1.5, "recording.start"),
    ],
)
def test_a_time_step_that_is_not_there_is_refused_in_one_line(file, start, words):
    with pytest.raises(InputError, match=words) as refused:
        simulate(file, start=start)
    assert "\n" not in str(refused.value)


def test_what_begins_later_already_does_not_begin_elsewhere(file):
    found = open_scenario(file, start=START)
    assert open_scenario(found, start=START) is found
    with pytest.raises(InputError, match="whole begins at time step 40, not at 50"):
        simulate(found, start=50)
