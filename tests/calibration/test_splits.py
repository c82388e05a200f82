"""Which recordings are fitted, choose, and check: splits and folds."""

import json

import numpy as np
import pytest

import interdrive as idr
from interdrive.calibration.split import read_parts
from interdrive.config.drivers import read_drivers
from interdrive.errors import InputError
from interdrive.testing import Car, straight_road, world

QUICK = {"stage": "A", "evaluations": 29, "long": 0.0, "rollouts": 1}


def _motorway(folder, name, gap, steps=60):
    cars = [Car(101 + i, gap * i, 0.0, 15.0 + i % 3) for i in range(12)]
    idr.write_scenario(world(straight_road(1500.0), cars=cars, steps=steps, dt=0.2, name=name), folder / f"{name}.xml")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    found = tmp_path_factory.mktemp("recordings")
    for number in (1, 2, 3):
        _motorway(found, f"DEU_Motorway-{number}_1_T-1", 24.0 + number)
    _motorway(found, "DEU_Bypass-1_1_T-1", 40.0)
    (found / "far").mkdir()
    _motorway(found / "far", "DEU_Avenue-1_1_T-1", 30.0)
    return found


def _split(tmp_path, folder, text):
    path = folder / f"{tmp_path.name}.toml"
    path.write_text(text)
    return path


def _names(recordings):
    return sorted(file.stem for one in recordings for file in one.files)


def test_a_split_divides_windows_places_and_folders(folder, tmp_path):
    split = _split(tmp_path, folder, 'fit = ["DEU_Motorway:1-2"]\nchoose = ["DEU_Motorway:3-3"]\ntest = ["far"]\n')
    parts = read_parts([folder], (), split, raw=False, any_traffic=False)
    assert _names(parts.fit) == ["DEU_Motorway-1_1_T-1", "DEU_Motorway-2_1_T-1"]
    assert _names(parts.choose) == ["DEU_Motorway-3_1_T-1"]
    assert _names(parts.test) == ["DEU_Avenue-1_1_T-1"]
    assert "1 of 5 files are in no part of the split" in parts.notes


def test_windows_of_a_place_are_counted_by_recording_and_then_by_time(tmp_path):
    later, earlier = ("DEU_Lane-2_1_T-79", "DEU_Lane-2_80_T-159"), ("DEU_Lane-1_80_T-159", "DEU_Lane-1_400_T-479")
    tenth = "DEU_Lane-10_1_T-79"
    for name in (*later, *earlier, tenth):
        _motorway(tmp_path, name, 30.0)
    split = _split(tmp_path, tmp_path, 'fit = ["DEU_Lane:1-2"]\nchoose = ["DEU_Lane:3-4"]\ntest = ["DEU_Lane:5-5"]\n')
    parts = read_parts([tmp_path], (), split, raw=False, any_traffic=False)
    assert _names(parts.fit) == sorted(earlier)
    assert _names(parts.choose) == sorted(later)
    assert _names(parts.test) == [tenth]


def test_the_part_that_chooses_picks_one_of_the_best_and_counts_as_seen(folder, tmp_path):
    split = _split(tmp_path, folder, 'fit = ["DEU_Motorway"]\nchoose = ["DEU_Bypass"]\ntest = ["DEU_Avenue"]\n')
    found = idr.calibrate(folder, split=split, out=tmp_path / "fit", **QUICK)
    rows = [json.loads(line) for line in (tmp_path / "fit" / "evaluations.jsonl").read_text().splitlines()]
    short, choice = ([row for row in rows if row["stage"] == stage] for stage in ("A", "choice"))
    best = sorted(short, key=lambda row: row["objective"])[:8]
    assert [row["z"] for row in choice[1:]] == [row["z"] for row in best]
    assert found.objectives["choice"] == (choice[0]["objective"], min(row["objective"] for row in choice[1:]))
    assert found.evaluations == {"A": len(short), "choice": 9}
    assert read_drivers(str(found.file)).fitted_on == ("DEU_Motorway", "DEU_Bypass")
    assert found.verdicts["DEU_Bypass"].is_realistic is None
    assert found.provenance["held_out"] == ["DEU_Avenue"]
    assert np.isfinite(found.provenance["held_out_energy_5"]["DEU_Avenue"])


@pytest.mark.long
def test_each_fold_is_fitted_without_the_place_where_it_is_measured(folder, tmp_path):
    found = idr.calibrate(folder, folds="place", out=tmp_path / "fit", **QUICK)
    assert set(found.folds) == {"DEU_Motorway", "DEU_Bypass", "DEU_Avenue"}
    for place, fold in found.folds.items():
        assert place not in fold.places
        assert {row.place for row in fold.realism.rows} == {place}
        assert "fitted on this place" not in str(fold.verdicts[place])
        assert fold.file == tmp_path / "fit" / "folds" / place / "drivers.toml"
    assert set(found.places) == set(found.folds)
    assert read_drivers(str(found.file)).provenance["folds"] == found.provenance["folds"]
    alone = idr.calibrate(folder, hold_out=["DEU_Bypass"], out=tmp_path / "alone", **QUICK)
    assert found.folds["DEU_Bypass"].values == alone.values
    again = idr.calibrate(folder, folds="place", out=tmp_path / "fit", **QUICK)
    assert again.values == found.values


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('fit = ["DEU_Rome"]', r"fit: 'DEU_Rome': no file is of this place or below this path; there are DEU_Bypass"),
        ('fit = ["DEU_Motorway:2-9"]', r"write windows as DEU_Motorway:1-3; there are 3"),
        ('fit = ["DEU_Motorway:two"]', r"write windows as DEU_Motorway:1-3"),
        ('fit = ["DEU_Motorway"]\ntest = ["DEU_Motorway:1-1"]', r"DEU_Motorway-1_1_T-1.xml is in fit, too"),
        ('test = ["DEU_Motorway"]', r"fit: names nothing"),
        ("fit = [3]", r"fit: must be a list of places"),
        ('fits = ["DEU_Motorway"]', r"fits: is not known; there are fit, choose, test"),
        ("fit = ", r"cannot be read"),
    ],
)
def test_splits_that_make_no_sense_are_refused_in_one_line(folder, tmp_path, text, words):
    split = _split(tmp_path, folder, text)
    with pytest.raises(InputError, match=words) as caught:
        idr.calibrate(folder, split=split, out=tmp_path / "fit", **QUICK)
    assert "\n" not in str(caught.value)
    assert str(split) in str(caught.value)
    assert not (tmp_path / "fit").exists()


def test_one_way_to_divide_is_enough(folder, tmp_path):
    with pytest.raises(InputError, match="the split says what is held out"):
        idr.calibrate(folder, split="any.toml", hold_out=["DEU_Bypass"], out=tmp_path / "fit", **QUICK)
    with pytest.raises(InputError, match="give neither hold_out nor split"):
        idr.calibrate(folder, folds="place", hold_out=["DEU_Bypass"], out=tmp_path / "fit", **QUICK)
    with pytest.raises(InputError, match="folds: expected place, not 'time'"):
        idr.calibrate(folder, folds="time", out=tmp_path / "fit", **QUICK)
    with pytest.raises(InputError, match="DEU_Avenue is the only place"):
        idr.calibrate(folder / "far", folds="place", out=tmp_path / "fit", **QUICK)


def test_folds_that_leave_nobody_to_fit_are_refused_before_anything_is_fitted(folder, tmp_path):
    idr.write_scenario(
        world(straight_road(1500.0), cars=[Car(101, 0.0, 0.0, 15.0)], steps=60, dt=0.2),
        tmp_path / "DEU_Few-1_1_T-1.xml",
    )
    with pytest.raises(InputError, match="DEU_Avenue is the only place with 10 vehicles; leaving it out leaves none"):
        idr.calibrate([folder / "far", tmp_path], folds="place", out=tmp_path / "fit", **QUICK)
    assert not (tmp_path / "fit").exists()
