"""Lights of a Lanelet2 map show what SinD's table of states says of the lights that the map names."""

import shutil

import pytest
from sind_files import STATES, written

import interdrive as idr
from interdrive.files import scenario_document
from interdrive.files.scenario_file import losses


def read(path, **options):
    return idr.read_source(path, map=str(path.parent / "map.osm"), **options)


def shown(scenario, steps):
    [light] = scenario.traffic_lights
    at = 0
    signals = []
    for signal, length in light.phases:
        signals += [signal for step in steps if at <= step < at + length]
        at += length
    assert light.offset == 0
    return signals


def test_a_light_shows_what_the_table_says_from_the_first_step_of_the_recording_on(tmp_path):
    scenario = read(written(tmp_path))
    assert shown(scenario, (0, 19, 20, 29, 30, 39, 49, 50, 90_000)) == (
        ["red"] * 2 + ["green"] * 2 + ["yellow"] * 3 + ["red"] * 2
    ), "the recording begins at 1 s; an unknown code is as what was before"
    assert any("1 pedestrian traffic lights" in note for note in scenario.notes)
    assert "states of traffic lights that the map does not name left out, lights: Traffic light 1" in scenario.notes
    assert "TrafficLight_8_2_1.csv" in [name for name, _ in scenario.source.files]
    assert not any("dark" in note for note in scenario.notes)


def test_drivers_may_turn_right_on_red_there_and_a_file_keeps_all_of_it(tmp_path):
    scenario = read(written(tmp_path))
    [line] = scenario.stop_lines
    assert line.lanelet_id == 1
    assert line.turns_on_red == (3,)
    assert losses(scenario, scenario_document(scenario)) == ()


@pytest.mark.parametrize(("dt", "start", "steps"), [(0.2, None, (0, 9, 10, 14, 15)), (0.1, 2.0, (0, 9, 10, 19, 20))])
def test_states_keep_their_times_with_another_step_or_start(tmp_path, dt, start, steps):
    scenario = read(written(tmp_path), dt=dt, start=start)
    assert shown(scenario, steps) == ["red", "red", "green", "green", "yellow"]


def test_names_of_lights_count_without_the_word_vehicle_and_without_case(tmp_path):
    assert shown(read(written(tmp_path, STATES.replace("Traffic light 2", "Vehicle Traffic Light 2"))), (20,)) == [
        "green"
    ]


@pytest.mark.parametrize("name", ["", "Traffic light 9"])
def test_a_light_that_the_table_does_not_name_stays_dark(tmp_path, name):
    scenario = read(written(tmp_path, name=name))
    assert scenario.traffic_lights[0].phases == ()
    assert not scenario.stop_lines[0].turns_on_red
    assert "the cycles of traffic lights are unknown, so that they are dark: 1" in scenario.notes


def test_without_a_table_or_with_several_lights_stay_dark(tmp_path):
    path = written(tmp_path, states="")
    assert read(path).traffic_lights[0].phases == ()
    for name in ("Traffic_Lights.csv", "TrafficLight_a.csv"):
        (tmp_path / name).write_text(STATES)
    scenario = read(path)
    assert scenario.traffic_lights[0].phases == ()
    assert any("several tables of traffic lights" in note for note in scenario.notes)


@pytest.mark.parametrize(
    ("states", "words"),
    [
        (STATES.replace("timestamp(ms)", "time"), r"TrafficLight_8_2_1.csv: has no column timestamp\(ms\)"),
        (STATES.replace("180,6000,1,0", "180,6000,1,red"), "the column Traffic light 2 has a value that is no number"),
    ],
)
def test_a_table_of_lights_that_cannot_be_read_is_refused_in_one_line(tmp_path, states, words):
    with pytest.raises(idr.InputError, match=words) as refused:
        read(written(tmp_path, states))
    assert "\n" not in str(refused.value)


def test_an_agent_waits_at_a_red_light_of_the_table_and_drives_on_when_it_is_green(tmp_path):
    late = STATES.replace("90,3000,0,1,0", "90,10000,0,1,0").replace("120,4000", "900,40000")
    run = idr.simulate(read(written(tmp_path, late)), agents="all")
    assert run.outcomes.outcome[0] == "goal_reached_late"
    stands = run.states.velocity[0] < 0.2
    assert 40.0 < run.states.x[0, stands].max() < 50.0
    assert 9.0 < 0.1 * run.outcomes.time_step[0] < 15.0


def test_the_lights_of_tianjin_show_green_to_two_roads_at_a_time(inputs_folder, tmp_path):
    path = written(tmp_path, states="")
    shutil.copy(inputs_folder / "sind" / "8_2_1" / "TrafficLight_8_2_1.csv", tmp_path)
    scenario = idr.read_source(
        path, map=str(inputs_folder / "osm" / "SinD_Tianjin.osm"), projection="utm", origin="0,0"
    )
    labels = dict(scenario.source.lights)
    at_green = {label: set() for label in labels.values()}
    for light in scenario.traffic_lights:
        ends = [0]
        for signal, length in light.phases:
            ends.append(ends[-1] + length)
            if signal == "green":
                at_green[labels[light.id]] |= {step for step in (50, 200, 500, 800) if ends[-2] <= step < ends[-1]}
    assert at_green == {
        "Traffic light 4": {50, 500}, "Traffic light 8": {50, 500},
        "Traffic light 2": {200, 800}, "Traffic light 6": {200, 800},
    }  # fmt: skip
