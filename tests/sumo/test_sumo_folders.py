"""Folders for SUMO: what is read, and what is refused in one line."""

from __future__ import annotations

import os
import pickle
import re

import pytest

import interdrive as idr
from interdrive import InputError
from interdrive.errors import InterdriveError
from interdrive.files.sumo_config import NotUnderstoodError, values_of
from interdrive.simulation import Simulation

#: Steps before the run, steps, seed and width of sublanes [m] of published scenarios.
STATED = {
    "DEU_Aachen-2_1_I-1": (198, 150, 369, 1.2),
    "DEU_Aachen-3_1_I-1": (171, 150, 287, 1.2),
    "DEU_Cologne-63_5_I-1": (100, 150, 848, 1.2),
    "DEU_Frankfurt-34_11_I-1": (222, 200, 873, 0.8),
}


@pytest.mark.parametrize("name", STATED)
def test_the_configuration_is_read_without_unpickling(published, name):
    said = values_of((published / name / "simulation_config.p").read_bytes())
    names = ("presimulation_steps", "simulation_steps", "random_seed", "lateral_resolution")
    assert tuple(said[one] for one in names) == STATED[name]


def test_a_pickle_that_would_run_code_is_refused_by_name(tmp_path):
    with pytest.raises(NotUnderstoodError, match=r"posix\.system, byte"):
        values_of(pickle.dumps(os.system))


@pytest.mark.parametrize("cut", [0, 1, 40, 1000])
def test_a_truncated_pickle_is_not_understood(published, cut):
    data = (published / "DEU_Cologne-63_5_I-1" / "simulation_config.p").read_bytes()[:cut]
    with pytest.raises(NotUnderstoodError, match="damaged"):
        values_of(data)


def test_one_that_is_not_understood_leaves_the_defaults_and_a_note(crossing):
    (crossing / "simulation_config.p").write_bytes(pickle.dumps(os.system))
    scenario = idr.read_source(crossing)
    assert scenario.sumo.presimulation_steps == 0
    assert any("simulation_config.p is not understood (posix.system" in note for note in scenario.notes)


def test_the_traffic_of_the_file_is_left_out_and_its_problems_stay(published):
    scenario = idr.read_source(published / "DEU_Cologne-63_5_I-1")
    assert (len(scenario.obstacles.ids), len(scenario.planning_problems)) == (0, 1)
    assert "SUMO drives the traffic, by DEU_Cologne-63_5_I-1.sumo.cfg" in scenario.notes
    assert "15 recorded vehicles are left out" in scenario.notes


def edited(folder, name, old, new):
    file = folder / name
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def without(name):
    return lambda folder: (folder / name).unlink()


def moved_net(folder):
    for end in ("net.xml", "rou.xml"):
        (folder.parent / f"crossing.{end}").write_bytes((folder / f"crossing.{end}").read_bytes())
    edited(folder, "crossing.sumocfg", "crossing.net.xml", "../crossing.net.xml")


@pytest.mark.parametrize(
    ("spoil", "line"),
    [
        (without("crossing.rou.xml"), "crossing.sumocfg: names crossing.rou.xml (route-files), which is not there"),
        (without("crossing.cr.xml"), "needs a CommonRoad file (*.cr.xml), there is none"),
        (moved_net, "names ../crossing.net.xml (net-file), which lies outside its folder"),
        (
            lambda folder: edited(folder, "crossing.sumocfg", 'step-length value="0.1"', 'step-length value="0.03"'),
            "step-length 0.03 s does not divide the time step of 0.1 s",
        ),
        (
            lambda folder: edited(folder, "crossing.sumocfg", 'step-length value="0.1"', 'step-length value="0.0125"'),
            "crossing.sumocfg: SUMO rounds its steps of 12.5 ms to whole ones; change their length",
        ),
        (
            lambda folder: edited(folder, "crossing.net.xml", 'convBoundary="-120', 'convBoundary="-920'),
            "the net lies up to 800 m from the lanelets",
        ),
        (
            lambda folder: edited(folder, "crossing.sumocfg", "crossing.net.xml", "crossing.net.xml,crossing.net.xml"),
            "crossing.sumocfg: names 2 nets; give one as net-file",
        ),
        (
            lambda folder: (folder / "crossing.net.xml").write_text("<routes/>"),
            "crossing.net.xml: is no net of SUMO but <routes>; give what netconvert wrote",
        ),
        (
            lambda folder: edited(folder, "crossing.net.xml", 'netOffset="0.00,0.00"', 'netOffset="nan,0.00"'),
            "crossing.net.xml: netOffset is not 2 numbers",
        ),
        (
            lambda folder: edited(folder, "crossing.net.xml", 'convBoundary="-120.00,', 'convBoundary="'),
            "crossing.net.xml: convBoundary is not 4 numbers",
        ),
        (
            lambda folder: (folder / "second.sumo.cfg").write_text("<configuration/>"),
            "needs a configuration of SUMO (*.sumo.cfg), there are crossing.sumocfg, second.sumo.cfg",
        ),
        (
            lambda folder: edited(folder, "crossing.sumocfg", "<configuration>", "<!DOCTYPE a><configuration>"),
            "has a document type",
        ),
        (lambda folder: edited(folder, "crossing.sumocfg", "</input>", ""), "crossing.sumocfg: line 10"),
        (lambda folder: edited(folder, "crossing.rou.xml", "</routes>", ""), "crossing.rou.xml: line"),
        (
            lambda folder: edited(folder, "crossing.rou.xml", "</routes>", '<edgeData id="a" file="/tmp/a"/></routes>'),
            "crossing.rou.xml: names /tmp/a (edgeData), which lies outside its folder",
        ),
        (
            lambda folder: edited(folder, "crossing.sumocfg", 'step-length value="0.1"', 'step-length value="nan"'),
            "step-length is no number",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_refused_in_one_line(crossing, spoil, line):
    spoil(crossing)
    with pytest.raises(InputError) as refused:
        idr.read_source(crossing)
    assert line in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("end", "steps"), [("", 300), ('<end value="42"/>', 420), ('<end value="0"/>', 300)])
def test_the_end_of_the_configuration_ends_it(crossing, end, steps):
    edited(crossing, "crossing.sumocfg", '<begin value="0"/>', f'<begin value="0"/>{end}')
    assert idr.read_source(crossing).sumo.n_steps == steps


def with_end(folder, end):
    edited(folder, "crossing.sumocfg", '<begin value="0"/>', f'<begin value="0"/><end value="{end}"/>')
    return folder


@pytest.mark.parametrize("end", ["1e9", "1e308", "99999999999999999999"])
def test_an_end_after_more_than_a_million_steps_needs_a_duration(crossing, end):
    with pytest.raises(InputError, match=r"^step.duration: crossing takes more than 1000000 time steps"):
        Simulation(with_end(crossing, end), agents=0)


def test_with_a_duration_or_agents_a_late_end_does_no_harm(crossing):
    scenario = idr.read_source(with_end(crossing, "1e9"))
    assert idr.simulate(scenario, agents=0, settings={"step.duration": 0.2}, threads=1).states.n_steps == 3
    assert not Simulation(scenario, threads=1).is_done


def test_an_end_that_sumo_cannot_read_is_refused_by_sumo(crossing):
    with pytest.raises(InterdriveError, match="'1e308' exceeds the time value range"):
        Simulation(with_end(crossing, "1e308"), threads=1)


@pytest.mark.parametrize("name", STATED)
def test_the_steps_of_published_scenarios_end_them(published, name):
    assert idr.read_source(published / name).sumo.n_steps == STATED[name][1]


def test_a_folder_without_planning_problems_says_how_to_drive_it(crossing):
    text = (crossing / "crossing.cr.xml").read_text()
    (crossing / "crossing.cr.xml").write_text(
        re.sub("<planningProblem .*</planningProblem>", "", text, flags=re.DOTALL)
    )
    with pytest.raises(InputError, match="crossing: has no planning problems; with --agents 0 SUMO's vehicles drive"):
        Simulation(crossing)


def test_generated_traffic_is_refused_beside_it(crossing):
    with pytest.raises(InputError, match="SUMO makes its traffic; leave out --traffic"):
        idr.simulate(crossing, traffic="rate=600")


def test_inputs_may_have_all_their_names_and_stand_in_any_section(crossing):
    (crossing / "crossing.sumocfg").write_text(
        '<configuration><net value="crossing.net.xml"/><r v="crossing.rou.xml"/></configuration>'
    )
    assert [name for name, _ in idr.read_source(crossing).sumo.files][1:] == ["crossing.net.xml", "crossing.rou.xml"]


def test_a_begin_at_a_time_of_day_moves_the_lights(crossing):
    text = (crossing / "crossing.cr.xml").read_text()
    text = re.sub(r"<trafficLightRef[^>]*/>|<trafficLight id.*?</trafficLight>", "", text, flags=re.DOTALL)
    (crossing / "crossing.cr.xml").write_text(text)
    offsets = []
    for begin in ("45", "00:00:45"):
        edited(crossing, "crossing.sumocfg", 'begin value="', f'begin value="{begin}" was="')
        offsets.append({light.offset for light in idr.read_source(crossing).traffic_lights})
        edited(crossing, "crossing.sumocfg", f'begin value="{begin}" was="', 'begin value="')
    assert offsets == [{450}, {450}]


def test_a_width_of_sublanes_that_cannot_be_leaves_the_default(crossing):
    # PROTO 4, DefaultConfig without arguments, its state {"lateral_resolution": 2 to the power of 2000}.
    names = b"\x8c\x1asumocr.sumo_config.default\x8c\x0dDefaultConfig\x93)\x81}"
    number = b"\x8a\xfb" + (2**2000).to_bytes(251, "little")
    (crossing / "simulation_config.p").write_bytes(
        b"\x80\x04" + names + b"\x8c\x12lateral_resolution" + number + b"sb."
    )
    assert values_of((crossing / "simulation_config.p").read_bytes()) == {"lateral_resolution": 2**2000}
    assert idr.read_source(crossing).sumo.lateral_resolution == 0.0


def test_a_batch_takes_a_folder_of_such_folders(crossing, tmp_path):
    done = idr.batch(crossing.parent, tmp_path / "batch", planner="idm", workers=1)
    assert sum(done.status.values()) == done.status["finished"] == 1
