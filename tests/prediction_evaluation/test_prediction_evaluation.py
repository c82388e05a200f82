"""Evaluations of predictors: which recordings are taken, what is summed up, what is written."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from recorded_moments import SETTINGS

import interdrive as idr
from interdrive.prediction_evaluation.curves import calibration_table
from interdrive.prediction_evaluation.folder import save_evaluation
from interdrive.prediction_evaluation.recordings import Recording, category_of
from interdrive.prediction_evaluation.samples import _departure
from interdrive.prediction_evaluation.tables import ALL, MEAN, measures_table, samples_table
from interdrive.testing import Car, straight_road, world


@pytest.mark.parametrize(
    ("path", "category"),
    [
        ("data/highway/USA_US101-1_1_T-1.xml", "highway"),
        ("urban/more/a.xml", "urban"),
        ("t_junction/a.xml", "junction"),
        ("shipped/t_junction.xml", "junction"),
        ("merge/a.xml", "merge"),
        ("elsewhere/a.xml", "other"),
    ],
)
def test_a_file_has_the_category_of_its_folder(path, category):
    assert category_of(Path(path)) == category


@pytest.fixture(scope="module")
def shipped():
    return idr.evaluate_predictors(
        ["t_junction", "highway", "lane_merge"], ["constant_velocity", "lane_following"], every=10
    )


def test_all_samples_and_the_mean_of_categories_are_both_stated(shipped):
    rows = {(row["predictor"], row["category"]): row for row in measures_table(shipped).to_pylist()}
    lane = {category: row for (predictor, category), row in rows.items() if predictor == "lane_following"}
    assert list(lane) == ["highway", "junction", "merge", ALL, MEAN]
    parts = [lane[name] for name in ("highway", "junction", "merge")]
    weighted = sum(row["samples_3"] * row["fde_3"] for row in parts) / sum(row["samples_3"] for row in parts)
    assert lane[ALL]["fde_3"] == pytest.approx(weighted)
    # merge is none of the four categories that the mean is about.
    assert lane[MEAN]["fde_3"] == pytest.approx(0.5 * (lane["highway"]["fde_3"] + lane["junction"]["fde_3"]))
    assert lane[MEAN]["samples"] == lane["highway"]["samples"] + lane["junction"]["samples"]


def test_observed_shares_grow_with_the_nominal_ones(shipped):
    table = calibration_table(shipped).to_pandas()
    for _, curve in table.groupby(["predictor", "category", "vehicles", "horizon"], observed=True):
        assert (np.diff(curve["region"].dropna()) >= 0).all()
        assert (np.diff(curve["nominal"]) > 0).all()


def test_every_sample_is_one_vehicle_at_one_judged_step(shipped):
    table = samples_table(shipped).to_pandas()
    one = table[table["predictor"] == "lane_following"]
    assert len(one) == len(shipped.samples)
    assert not one.duplicated(["file", "time_step", "participant_id"]).any()
    assert (one["time_step"] % 10 == 0).all()
    assert set(one["kind"]) <= {"car", "truck", "bus", "motorcycle", "bicycle"}


def test_the_same_evaluation_gives_the_same_numbers():
    one, again = (idr.evaluate_predictors("lane_merge", "lane_following", every=20) for _ in range(2))
    assert measures_table(one).equals(measures_table(again))


def test_an_evaluation_can_be_saved_and_is_not_replaced_without_asking(shipped, tmp_path):
    folder = save_evaluation(shipped, tmp_path / "found", with_samples=True)
    assert pq.read_table(folder / "measures.parquet").num_rows == 10
    about = json.loads((folder / "evaluation.json").read_text())
    assert about["every"] == 10
    assert len(about["files"]) == 3
    with pytest.raises(idr.ResultsError, match="already exists there"):
        save_evaluation(shipped, folder)
    (folder / "mine.txt").write_text("")
    with pytest.raises(idr.ResultsError, match=r"mine\.txt"):
        save_evaluation(shipped, folder, overwrite=True)


def test_evaluation_to_judge_is_needed(tmp_path):
    with pytest.raises(idr.InputError, match="no such file"):
        idr.evaluate_predictors("nowhere.xml")
    with pytest.raises(idr.InputError, match="has no CommonRoad file"):
        idr.evaluate_predictors(tmp_path)
    with pytest.raises(idr.InputError, match="given twice"):
        idr.evaluate_predictors("t_junction", ["all", "lane_following"])


def test_a_file_in_a_folder_that_cannot_be_used_is_a_note_and_one_that_was_named_an_error(tmp_path):
    (tmp_path / "broken.xml").write_text("<a>")
    (tmp_path / "urban").mkdir()
    (tmp_path / "urban" / "a.xml").write_bytes(Path(idr.shipped_scenario("lane_merge")).read_bytes())
    found = idr.evaluate_predictors(tmp_path, "constant_velocity", every=50)
    assert [path.name for path in found.files] == ["a.xml"]
    assert "broken.xml" in found.notes[0]
    assert set(found.samples.category) == {"urban"}
    with pytest.raises(idr.InputError, match=r"broken\.xml"):
        idr.evaluate_predictors([tmp_path / "broken.xml", tmp_path], "constant_velocity")


def test_a_predictor_need_not_be_in_a_list():
    found = idr.evaluate_predictors("lane_merge", idr.LaneFollowing(modes_max=1), every=100)
    assert found.predictors == ("lane_following",)
    with pytest.raises(idr.InputError, match="None is not a predictor"):
        idr.evaluate_predictors("lane_merge", None)


def test_all_are_the_native_predictors_and_walenet_without_the_one_for_studies():
    found = idr.evaluate_predictors("lane_merge", every=100)
    left_out = {note.split(maxsplit=1)[0] for note in found.notes if "is left out" in note}
    assert {*found.predictors, *left_out} == {*idr.predictors.NATIVE, "walenet"} - {"ground_truth"}
    assert found.predictors[:2] == ("constant_velocity", "lane_following")


def test_the_departure_of_a_vehicle_that_keeps_its_velocity_is_zero():
    scenario = world(straight_road(), cars=[Car(1, 20.0, velocity=10.0)])
    (moment,) = list(Recording(scenario, SETTINGS).moments(100))
    assert _departure(moment) == pytest.approx([0.0], abs=1e-9)


def test_calibration_of_those_that_move_leaves_out_those_that_stay(shipped):
    inside = shipped.samples.values["lane_following"]["region_3"] <= 0.5
    evaluation = replace(shipped, samples=replace(shipped.samples, stays=inside))
    (row,) = [
        row
        for row in measures_table(evaluation).to_pylist()
        if (row["predictor"], row["category"]) == ("lane_following", ALL)
    ]
    assert 0.0 < row["region_50_3"] < 1.0
    assert row["moving_50_3"] == 0.0
    assert 0.0 < row["moving_99_3"] <= 1.0


def test_calibration_tells_those_that_move_from_those_that_stay(shipped):
    stays = np.arange(len(shipped.samples)) % 3 == 0
    evaluation = replace(shipped, samples=replace(shipped.samples, stays=stays))
    table = calibration_table(evaluation).to_pandas()
    rows = table[
        (table["predictor"] == "lane_following")
        & (table["category"] == ALL)
        & (table["horizon"] == 3.0)
        & (table["nominal"] == 0.9)
    ].set_index("vehicles")
    level = shipped.samples.values["lane_following"]["region_3"]
    for vehicles, mask in {"all": stays | True, "moving": ~stays, "staying": stays}.items():
        known = level[mask & np.isfinite(level)]
        assert rows.loc[vehicles, "samples"] == len(known) > 0
        assert rows.loc[vehicles, "region"] == pytest.approx((known <= 0.9).mean())
