"""Speeds that no vehicle can change to are taken from those around; what vehicles do stays as it is stated."""

import foreign_files as ff
import numpy as np
import pytest

import interdrive as idr
from interdrive.files.sources.stated_speeds import put_right


def right(speeds, dt=0.1):
    found = np.array(speeds, dtype=float)
    return found, put_right(found, dt)


def test_the_first_speeds_of_a_track_that_is_only_just_seen_are_those_that_follow():
    found, count = right([15.0, 15.0, 44.0, 32.3, 32.7, 32.0, 31.8, 32.4, 32.5])
    assert count == 3
    np.testing.assert_allclose(found[:3], 32.3, atol=0.5)
    np.testing.assert_array_equal(found[3:], [32.3, 32.7, 32.0, 31.8, 32.4, 32.5])


def test_one_wrong_speed_within_or_at_the_end_of_a_track_is_replaced():
    for place in (7, 20):
        speeds = np.full(21, 12.0)
        speeds[place] = -8.0
        np.testing.assert_array_equal(right(speeds)[0], np.full(21, 12.0))


@pytest.mark.parametrize(
    ("what", "speeds"),
    [
        ("a crash", [14.0] * 10 + [0.0] * 10),
        ("braking as hard as tyres allow", np.maximum(0.0, 20.0 - 1.1 * np.arange(25))),
        ("noise", 8.0 + 1.5 * (-1.0) ** np.arange(20)),
        ("standing", [0.0] * 12),
        ("no speeds", [np.nan] * 12),
        ("a single one", [4.0]),
    ],
)
def test_what_vehicles_do_stays(what, speeds):
    found, count = right(speeds)
    assert count == 0, what
    np.testing.assert_array_equal(found, np.array(speeds, dtype=float))


def test_speeds_that_are_not_stated_stay_missing_and_do_not_count():
    found, count = right([np.nan, 3.0, np.nan, 20.0, 20.5, 20.0, 20.2])
    assert count == 1
    np.testing.assert_allclose(found, [np.nan, 20.0, np.nan, 20.0, 20.5, 20.0, 20.2], atol=0.25)


def test_time_steps_too_long_to_tell_change_nothing():
    assert right([0.0, 30.0, 0.0, 30.0], dt=2.0)[1] == 0


def test_an_agent_starts_as_fast_as_its_track_goes_on_and_a_note_says_so(tmp_path):
    ff.neutral_map(tmp_path)
    first, *rest = ff.car("car_a", n=31, speed=12.0)
    doubtful = (*first[:5], 1.0, *first[6:])
    (tmp_path / "tracks.csv").write_text(ff.tracks([doubtful, *rest]))
    scenario = idr.read_source(tmp_path / "tracks.csv", map=str(tmp_path / "lanes.csv"))
    assert scenario.obstacles.velocity[0, 0] == 12.0
    assert "speeds to which no vehicle can change taken from those around, tracks: car_a" in scenario.notes
