"""Recordings that several files show count once."""

from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np

import interdrive as idr
from interdrive.prediction_evaluation.repeats import KnownTracks
from interdrive.testing import Car, straight_road, world

DT = 0.1


def obstacles(*cars, steps=60, begin=0):
    """Those of a recording of some cars, cut at a time step and with other ids."""
    found = world(straight_road(300.0, lanes=2), cars=cars, steps=steps).obstacles
    cut = {name: getattr(found, name)[:, begin:] for name in _IN_TIME}
    return replace(found, ids=found.ids + 10 * begin, **cut)


_IN_TIME = ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate", "valid")
DRIVING = Car(1, 20.0, velocity=12.0)


def test_a_later_file_of_the_same_recording_repeats_what_the_first_could_judge():
    known = KnownTracks()
    assert not known.repeated(obstacles(DRIVING), DT).any()
    (repeated,) = known.repeated(obstacles(DRIVING, begin=20, steps=90), DT)
    # The first file ends at step 60, which is 40 here: until 30 it had a second to go.
    assert np.flatnonzero(repeated).tolist() == list(range(31))


def test_another_vehicle_at_another_place_or_speed_repeats_nothing():
    known = KnownTracks()
    known.repeated(obstacles(DRIVING), DT)
    others = Car(1, 20.0, 3.5, velocity=12.0), Car(2, 20.0, velocity=12.5), Car(3, 20.01, velocity=12.0)
    assert not known.repeated(obstacles(*others), DT).any()


def test_a_vehicle_that_passes_the_same_way_and_then_does_something_else_is_another_one():
    known = KnownTracks()
    first = obstacles(DRIVING)
    known.repeated(first, DT)
    braked = np.where(np.arange(first.x.shape[1]) < 45, first.x, first.x - 0.5)
    assert not known.repeated(replace(first, x=braked), DT).any()


def test_time_steps_of_another_length_repeat_nothing():
    known = KnownTracks()
    known.repeated(obstacles(Car(1, 20.0, velocity=10.0)), DT)
    assert not known.repeated(obstacles(Car(1, 20.0, velocity=10.0)), 0.2).any()


def test_a_vehicle_that_only_stands_is_repeated_by_one_that_stands_there_as_long():
    known = KnownTracks()
    known.repeated(obstacles(Car(1, 50.0), steps=40), DT)
    assert known.repeated(obstacles(Car(1, 50.0), steps=30), DT).any()
    assert not known.repeated(obstacles(Car(1, 50.0), steps=50), DT).any(), "it stands there for longer"
    assert not known.repeated(obstacles(Car(1, 50.5), steps=30), DT).any()


def test_a_drive_in_two_files_is_counted_once_and_the_note_says_so(tmp_path):
    """The first file lacks a car that the second one has."""
    whole = idr.shipped_scenario("lane_merge").read_bytes()
    root = ET.fromstring(whole)
    missing = root.find("dynamicObstacle")
    root.remove(missing)
    (tmp_path / "a.xml").write_bytes(ET.tostring(root))
    (tmp_path / "b.xml").write_bytes(whole)

    def evaluated(*names):
        files = [tmp_path / f"{name}.xml" for name in names]
        return idr.evaluate_predictors(files, "constant_velocity", every=10)

    alone, both = evaluated("b"), evaluated("a", "b")
    assert len(both.samples) == len(alone.samples)
    of_second = both.samples.file == 1
    assert set(both.samples.participant_id[of_second]) == {int(missing.get("id"))}
    n, vehicles = (~of_second).sum(), len(set(both.samples.participant_id[~of_second]))
    assert f"{n} samples of {vehicles} vehicles in 1 files are left out: earlier files contain them" in both.notes


def test_a_file_that_shows_nothing_new_is_not_among_the_files(tmp_path):
    for name in ("a", "b"):
        (tmp_path / f"{name}.xml").write_bytes(idr.shipped_scenario("lane_merge").read_bytes())
    found = idr.evaluate_predictors(tmp_path, "constant_velocity", every=10)
    assert [path.name for path in found.files] == ["a.xml"]
