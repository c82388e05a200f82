"""Real recordings: what is repaired, and what joining their windows gives."""

import re

import numpy as np
import pytest

from interdrive import join, read_scenario, simulate
from interdrive.files import scenario_document
from interdrive.recordings import heading_offset, joined
from interdrive.scenario import STATE_FIELDS

#: By place: participants, joins, residuals of joins (median, 99 %, largest) [m], heading offset, its interquartile
#: range [degrees], whether headings are turned, and the first and last time step.
PLACES = {
    "MONAEast": (934, 1080, (0.003, 0.085, 0.447), -1.931, 0.042, True, (0, 2399)),
    "MONAMerge": (190, 68, (0.003, 0.012, 0.012), -1.930, 0.038, True, (0, 1199)),
    "AachenBendplatz": (72, 78, (0.001, 0.183, 0.209), -0.474, 0.712, False, (80, 1279)),
}


@pytest.fixture(scope="module")
def read(real_recordings):
    """The windows of each place as their files have them."""
    return {place: [read_scenario(path, raw=True) for path in real_recordings[place]] for place in PLACES}


@pytest.fixture(scope="module")
def whole(read):
    return {place: joined(windows) for place, windows in read.items()}


@pytest.mark.parametrize("place", PLACES)
def test_windows_of_a_place_join(whole, place):
    n_participants, n_joins, residuals, *_, steps = PLACES[place]
    found = whole[place]
    present = np.flatnonzero(found.obstacles.valid.any(axis=0))
    assert len(found.obstacles.ids) == n_participants
    assert (present[0], present[-1]) == steps
    words = re.search(r"(\d+) continue .* (\S+) m from .*: (\S+) m, largest: (\S+) m\)", " ".join(found.notes))
    assert int(words[1]) == n_joins
    assert tuple(float(number) for number in words.groups()[1:]) == residuals


@pytest.mark.parametrize("place", PLACES)
def test_heading_offsets_are_found(read, whole, place):
    *_, median, spread, is_turned, _ = PLACES[place]
    offset = heading_offset(one.obstacles for one in read[place])
    assert np.degrees(offset.median) == pytest.approx(median, abs=1e-3)
    assert np.degrees(offset.spread) == pytest.approx(spread, abs=1e-3)
    assert offset.is_constant == is_turned
    assert any("headings turned by -1.93 degrees" in note for note in whole[place].notes) == is_turned


def test_motor_vehicles_of_a_motorway_take_77487_steps_of_more_than_a_metre(read):
    assert heading_offset(one.obstacles for one in read["MONAEast"]).n_samples == 77_487


def test_a_joined_recording_has_the_states_of_its_windows_but_for_the_heading(read, whole):
    obstacles = whole["MONAEast"].obstacles
    for one in read["MONAEast"]:
        first = int(re.search(r"_(\d+)_T", one.name)[1]) // 80 * 80
        rows = np.searchsorted(obstacles.ids, one.obstacles.ids)
        for name in STATE_FIELDS:
            if name != "orientation":
                part = getattr(obstacles, name)[rows, first : first + 80]
                assert np.array_equal(part, getattr(one.obstacles, name), equal_nan=True), (one.name, name)


def test_every_window_is_turned_and_headings_then_follow_the_motion(real_recordings):
    for path in real_recordings["MONAMerge"]:
        offset = heading_offset([read_scenario(path).obstacles])
        assert abs(np.degrees(offset.median)) < 0.01, path.name


def test_a_missing_window_is_named(whole):
    notes = whole["AachenBendplatz"].notes
    assert "no recording of time steps 480 to 559: all tracks are cut there" in notes


def test_overlapping_vehicles_are_listed_and_people_in_a_bus_are_not(whole):
    assert len(whole["MONAEast"].overlaps) == 47
    assert whole["AachenBendplatz"].overlaps == ()


def test_a_problem_whose_vehicle_enters_later_drives_that_vehicle(real_recordings):
    """The files of one place give the absolute time as 0; vehicles of two problems enter near each other."""
    path = next(path for path in real_recordings["AachenBendplatz"] if "_14160_" in path.name)
    run = simulate(path, agents="problems", planner="idm", settings={"step.max_steps": 60})
    ids = {agent.id for agent in run.agents}
    assert {10018, 10021} <= ids
    assert not ids & {100018, 100021}
    assert sum("enters at time step" in note for note in run.notes) == 2


@pytest.mark.parametrize(("place", "agent"), [("MONAEast", 10001), ("MONAMerge", 10030), ("AachenBendplatz", 10015)])
def test_a_run_that_begins_later_has_the_bits_of_that_of_the_part(real_recordings, tmp_path, place, agent):
    windows = sorted(real_recordings[place], key=lambda path: int(re.search(r"T-(\d+)", path.name)[1]))[:3]
    whole = join(windows)
    start = int(np.flatnonzero(whole.obstacles.valid.any(axis=0))[0]) + 100
    part = tmp_path / "part.xml"
    part.write_bytes(scenario_document(join(windows, first=start), windows[0]))
    later = simulate(whole, agents=[agent], planner="idm", start=start)
    assert later.digest == simulate(part, agents=[agent], planner="idm").digest


def test_files_in_any_order_are_joined_and_can_be_driven(real_recordings):
    found = join(real_recordings["MONAMerge"][::-1])
    assert len(found.obstacles.ids) == 190
    run = simulate(found, agents=[10000], planner="idm", settings={"step.max_steps": 40})
    assert run.outcomes.outcome[0] in ("goal_reached", "time_limit")
