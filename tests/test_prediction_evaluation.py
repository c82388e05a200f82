"""The measures of predictions, on small worlds and hand-made numbers."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import interdrive as idr
from interdrive.prediction_evaluation.evaluation import Predicted, _departure, answered, joined
from interdrive.prediction_evaluation.folder import save_evaluation
from interdrive.prediction_evaluation.measures import judged
from interdrive.prediction_evaluation.mixtures import log_densities, log_sum, region_levels
from interdrive.prediction_evaluation.recordings import Recording, category_of
from interdrive.prediction_evaluation.scenes import example_scenes
from interdrive.prediction_evaluation.tables import ALL, MEAN, calibration_table, measures_table, samples_table
from interdrive.prediction_evaluation.timing import VEHICLES, crowd
from interdrive.predictors.calls import called
from interdrive.run_settings import SimulationSettings
from interdrive.testing import Car, straight_road, world

SETTINGS = SimulationSettings()


def recording(cars, steps=60, dt=0.1, lanes=1):
    return Recording(world(straight_road(300.0, lanes=lanes), cars=cars, steps=steps, dt=dt), SETTINGS)


def measured(predictor, found, every=1):
    """All measures of a predictor in a recording, and the moments."""
    asked = called(predictor, SETTINGS.predictor, found.core_scenario)
    moments, answers = [], []
    for moment in found.moments(every):
        moments.append(moment)
        answers.append(answered(asked, found, moment))
    truth = np.concatenate([m.truth for m in moments])
    now = np.concatenate([np.stack([m.scene.x[m.row, -1], m.scene.y[m.row, -1]], axis=1) for m in moments])
    return judged(joined(answers), truth, now, found.scenario.dt, found.road), moments


class Modes:
    """Everybody is expected at (offset, 0) from a straight drive, one mode per offset."""

    offsets = (0.0,)
    probability = (1.0,)
    variance = 1.0
    steps = 30

    def predict(self, scene):
        n, m = len(scene.ids), len(self.offsets)
        time = np.arange(1, self.steps + 1) * scene.dt
        shape = (n, m, self.steps)
        x = scene.x[:, -1, None] + scene.velocity[:, -1, None] * time
        offset = np.array(self.offsets)[None, :, None]
        return idr.Predictions(
            scene.time_step,
            scene.ids,
            np.tile(np.array(self.probability, dtype=float), (n, 1)),
            x[:, None] + offset,
            np.broadcast_to(scene.y[:, -1, None, None], shape),
            np.broadcast_to(scene.orientation[:, -1, None, None], shape),
            np.broadcast_to(scene.velocity[:, -1, None, None], shape),
            np.broadcast_to(self.variance * np.eye(2), (*shape, 2, 2)),
            np.ones(shape, dtype=bool),
        )


def modes(offsets, probability, **more):
    return type("Modes", (Modes,), {"offsets": offsets, "probability": probability, **more})


def test_a_perfect_prediction_has_no_error_and_is_in_every_region():
    found, _ = measured(Modes, recording([Car(1, 20.0, velocity=10.0)]))
    ends = found["fde_3"][np.isfinite(found["fde_3"])]
    assert len(ends) == 31
    assert ends == pytest.approx(0.0, abs=1e-9)
    assert np.nanmax(found["region_3"]) == pytest.approx(0.0, abs=1e-9)
    # Density of a unit normal at its mean: 1 / (2 pi).
    assert np.nanmean(found["nll_3"]) == pytest.approx(np.log(2 * np.pi))
    assert np.nanmean(found["off_road"]) == 0.0


def test_the_most_probable_mode_and_the_best_mode_are_told_apart():
    found, _ = measured(modes((4.0, 1.0), (0.7, 0.3)), recording([Car(1, 20.0, velocity=10.0)]))
    assert np.nanmean(found["fde_3"]) == pytest.approx(4.0)
    assert np.nanmean(found["ade_2"]) == pytest.approx(4.0)
    assert np.nanmean(found["fde_best_3"]) == pytest.approx(1.0)
    # 0.7 and 0.3 of unit normals 4 and 1 m away.
    density = (0.7 * np.exp(-8.0) + 0.3 * np.exp(-0.5)) / (2 * np.pi)
    assert np.nanmean(found["nll_3"]) == pytest.approx(-np.log(density))
    assert np.nanmean(found["ellipse_3"]) == pytest.approx(1 - np.exp(-8.0))


def test_a_mode_without_probability_is_no_mode():
    found, _ = measured(modes((4.0, 0.0), (1.0, 0.0)), recording([Car(1, 20.0, velocity=10.0)]))
    assert np.nanmean(found["fde_best_3"]) == pytest.approx(4.0)


def test_a_measure_is_undefined_where_the_recording_ends_before():
    found, moments = measured(Modes, recording([Car(1, 20.0, velocity=10.0)], steps=25))
    assert [moment.scene.time_step for moment in moments] == list(range(16))
    assert np.isfinite(found["fde_1"]).all()
    assert np.isfinite(found["fde_2"]).sum() == 6
    assert np.isnan(found["fde_3"]).all()
    assert np.isnan(found["answered_3"]).all()


def test_a_prediction_that_ends_too_early_is_counted_as_no_answer():
    found, _ = measured(modes((0.0,), (1.0,), steps=20), recording([Car(1, 20.0, velocity=10.0)]))
    assert np.nanmean(found["answered_2"]) == 1.0
    assert np.nanmean(found["answered_3"]) == 0.0
    assert np.isnan(found["fde_3"]).all()


@pytest.mark.parametrize("dt", [0.1, 0.2, 0.25])
def test_a_second_is_a_second_whatever_the_time_step(dt):
    standing_still = modes((0.0,), (1.0,), steps=round(3 / dt), predict=_stays)
    found, _ = measured(standing_still, recording([Car(1, 20.0, velocity=5.0)], steps=round(6 / dt), dt=dt))
    assert [np.nanmean(found[f"fde_{h}"]) for h in (1, 2, 3)] == pytest.approx([5.0, 10.0, 15.0])


def _stays(self, scene):
    return Modes.predict(self, _Frozen(scene))


class _Frozen:
    def __init__(self, scene):
        self.time_step, self.ids, self.dt, self.x, self.y = scene.time_step, scene.ids, scene.dt, scene.x, scene.y
        self.orientation, self.velocity = scene.orientation, 0.0 * scene.velocity


def test_who_stands_is_known_for_half_a_second_and_who_stays_does_not_drive_off():
    cars = [Car(1, 50.0, first=10), Car(2, 80.0, velocity=0.3), Car(3, 20.0)]
    found, moments = measured("constant_velocity", recording(cars))
    stands = {
        m.scene.time_step: dict(zip(m.scene.ids[m.row].tolist(), m.stands.tolist(), strict=True)) for m in moments
    }
    assert stands[4] == {2: False, 3: False}
    assert stands[5] == {2: False, 3: True}
    assert stands[14] == {1: False, 2: False, 3: True}
    assert stands[15] == {1: True, 2: False, 3: True}
    assert found["displacement"][np.concatenate([m.stays for m in moments])].max() == 0.0


def test_predicted_points_off_the_road_are_counted_with_their_probability():
    # The road is 3.5 m wide; the second mode is beside it.
    sideways = modes((0.0, 0.0), (0.8, 0.2), predict=_aside)
    found, _ = measured(sideways, recording([Car(1, 20.0, velocity=10.0)]))
    assert np.nanmean(found["off_road"]) == pytest.approx(0.2)


def _aside(self, scene):
    one = Modes.predict(self, scene)
    y = np.array(one.y)
    y[:, 1] += 5.0
    return idr.Predictions(
        one.time_step, one.ids, one.probability, one.x, y, one.orientation, one.velocity, one.covariance, one.valid
    )


def test_the_level_of_one_mode_is_that_of_its_ellipse():
    points = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 3.0)])
    covariance = np.tile(np.diag([1.0, 9.0]), (3, 1, 1, 1))
    levels = region_levels(points, np.ones((3, 1)), np.zeros((3, 1, 2)), covariance)
    assert levels == pytest.approx([0.0, 1 - np.exp(-0.5), 1 - np.exp(-0.5)])


def test_two_modes_on_the_same_place_have_the_level_of_one():
    radius = np.linspace(0.1, 3.0, 20)
    points = np.stack([radius, 0 * radius], axis=1)
    weights, means = np.tile([0.4, 0.6], (20, 1)), np.zeros((20, 2, 2))
    levels = region_levels(points, weights, means, np.tile(np.eye(2), (20, 2, 1, 1)))
    assert levels == pytest.approx(1 - np.exp(-0.5 * radius**2), abs=0.004)


def test_levels_of_samples_drawn_from_a_mixture_are_uniform():
    """Calibration of a predictor that is right: as many positions inside a region as its mass says."""
    random = np.random.default_rng(5)
    n = 4000
    weights = np.tile([0.5, 0.3, 0.2], (n, 1))
    means = np.tile([(0.0, 0.0), (2.0, 1.0), (9.0, -3.0)], (n, 1, 1))
    covariance = np.tile([[[1.0, 0.5], [0.5, 2.0]], [[0.3, 0.0], [0.0, 0.3]], [[4.0, -1.0], [-1.0, 1.0]]], (n, 1, 1, 1))
    which = random.choice(3, size=n, p=weights[0])
    points = np.array([random.multivariate_normal(means[0, k], covariance[0, k]) for k in which])
    levels = region_levels(points, weights, means, covariance)
    for mass in (0.1, 0.5, 0.9, 0.99):
        assert (levels <= mass).mean() == pytest.approx(mass, abs=0.025)


def test_the_likelihood_of_a_point_far_from_every_mode_stays_a_number():
    far = log_densities(np.array([1e4, 0.0]), np.zeros((2, 2)), np.tile(0.02 * np.eye(2), (2, 1, 1)))
    assert log_sum(far, np.array([0.5, 0.5]), axis=0) == pytest.approx(-0.5 * 1e8 / 0.02 - np.log(2 * np.pi * 0.02))


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
    for _, curve in table.groupby(["predictor", "category", "horizon"], observed=True):
        assert (np.diff(curve["region"]) >= 0).all()
        assert (np.diff(curve["nominal"]) > 0).all()


def test_every_sample_is_one_vehicle_at_one_judged_step(shipped):
    table = samples_table(shipped).to_pandas()
    one = table[table["predictor"] == "lane_following"]
    assert len(one) == len(shipped.samples)
    assert not one.duplicated(["file", "time_step", "participant_id"]).any()
    assert (one["time_step"] % 10 == 0).all()
    assert set(one["kind"]) <= {"car", "truck", "bus", "motorcycle", "bicycle"}


def test_time_per_call_is_measured_for_every_number_of_vehicles(shipped):
    assert [(t.predictor, t.vehicles) for t in shipped.timings] == [
        (name, n) for name in ("constant_velocity", "lane_following") for n in VEHICLES
    ]
    assert all(t.milliseconds > 0 for t in shipped.timings)


def test_a_crowd_has_as_many_vehicles_as_asked_for_on_roads_of_their_own():
    many = crowd(60)
    assert len(np.unique(many.obstacles.ids)) == 60
    scene = Recording(many, SETTINGS).at(5).scene
    on_road = scene.road.on_road(np.stack([scene.x[:, -1], scene.y[:, -1]], axis=1))
    assert on_road.mean() > 0.9


def test_the_same_evaluation_gives_the_same_numbers():
    one, again = (
        idr.evaluate_predictors("lane_merge", "lane_following", every=20, with_timing=False) for _ in range(2)
    )
    assert measures_table(one).equals(measures_table(again))


def test_an_evaluation_can_be_saved_and_is_not_replaced_without_asking(shipped, tmp_path):
    folder = save_evaluation(shipped, tmp_path / "found", with_samples=True, with_figures=False)
    assert pq.read_table(folder / "measures.parquet").num_rows == 10
    about = json.loads((folder / "evaluation.json").read_text())
    assert about["every"] == 10
    assert len(about["files"]) == 3
    with pytest.raises(idr.ResultsError, match="is there already"):
        save_evaluation(shipped, folder)
    (folder / "mine.txt").write_text("")
    with pytest.raises(idr.ResultsError, match=r"mine\.txt"):
        save_evaluation(shipped, folder, overwrite=True)


def test_somebody_to_judge_is_needed(tmp_path):
    with pytest.raises(idr.InputError, match="no such file or folder"):
        idr.evaluate_predictors("nowhere.xml")
    with pytest.raises(idr.InputError, match="has no CommonRoad file"):
        idr.evaluate_predictors(tmp_path)
    with pytest.raises(idr.InputError, match="there twice"):
        idr.evaluate_predictors("t_junction", ["all", "lane_following"])


def test_a_file_in_a_folder_that_cannot_be_used_is_a_note_and_one_that_was_named_an_error(tmp_path):
    (tmp_path / "broken.xml").write_text("<a>")
    (tmp_path / "urban").mkdir()
    (tmp_path / "urban" / "a.xml").write_bytes(Path(idr.shipped_scenario("lane_merge")).read_bytes())
    found = idr.evaluate_predictors(tmp_path, "constant_velocity", every=50, with_timing=False)
    assert [path.name for path in found.files] == ["a.xml"]
    assert "broken.xml" in found.notes[0]
    assert set(found.samples.category) == {"urban"}
    with pytest.raises(idr.InputError, match=r"broken\.xml"):
        idr.evaluate_predictors([tmp_path / "broken.xml", tmp_path], "constant_velocity")


def test_all_are_the_native_predictors_without_the_one_for_studies():
    found = idr.evaluate_predictors("lane_merge", every=100, with_timing=False)
    left_out = {note.split(maxsplit=1)[0] for note in found.notes if "is left out" in note}
    assert {*found.predictors, *left_out} == {name for name in idr.predictors.NATIVE if name != "ground_truth"}
    assert found.predictors[:2] == ("constant_velocity", "lane_following")


def test_ground_truth_is_right_about_those_it_is_asked_for():
    found, _ = measured("ground_truth", recording([Car(1, 20.0, velocity=10.0)]))
    assert np.nanmax(found["fde_3"]) == pytest.approx(0.0, abs=1e-9)


def test_predicted_tables_of_different_sizes_are_put_together():
    small = Predicted(np.ones((1, 1)), np.ones((1, 1, 2, 2)), np.ones((1, 1, 2, 2, 2)), np.ones((1, 1, 2), dtype=bool))
    large = Predicted(
        np.full((2, 3), 1 / 3), np.ones((2, 3, 4, 2)), np.ones((2, 3, 4, 2, 2)), np.ones((2, 3, 4), dtype=bool)
    )
    both = joined([small, large])
    assert both.mean.shape == (3, 3, 4, 2)
    assert both.valid[0].sum() == 2
    assert both.probability[0].tolist() == [1.0, 0.0, 0.0]


def test_figures_and_a_scene_per_category_are_drawn_as_pdf_and_png(tmp_path):
    found = idr.evaluate_predictors(["lane_merge", "t_junction"], "all", every=40, with_timing=False)
    folder = save_evaluation(found, tmp_path / "found")
    names = ("error_over_time", "calibration", "scene_junction", "scene_merge")
    wanted = {f"{name}.{ending}" for name in names for ending in ("pdf", "png")}
    assert {entry.name for entry in folder.iterdir() if entry.suffix != ".parquet"} == wanted | {"evaluation.json"}


def test_a_scene_shows_the_moment_at_which_most_vehicles_leave_a_straight_drive():
    found = idr.evaluate_predictors("t_junction", "lane_following", every=10, with_timing=False)
    (scene,) = example_scenes(found)
    telling = (found.samples.departure > 2.0) & (found.samples.departure < 20.0)
    counts = np.bincount(found.samples.time_step[telling])
    assert scene.moment.scene.time_step == counts.argmax()
    assert len(scene.row) == counts.max()


def test_the_departure_of_who_keeps_its_velocity_is_zero():
    scenario = world(straight_road(), cars=[Car(1, 20.0, velocity=10.0)])
    (moment,) = list(Recording(scenario, SETTINGS).moments(100))
    assert _departure(moment) == pytest.approx([0.0], abs=1e-9)


SPLIT = """
[[place]]
files = ["lane_*"]
part = "validation"
category = "highway"

[[place]]
files = ["t_junction", "highway"]
part = "a"
category = "urban"
"""


def test_a_split_says_which_files_are_judged_and_their_category(tmp_path):
    (tmp_path / "split.toml").write_text(SPLIT)
    files = ["lane_merge", "t_junction", "highway", "intersection"]
    found = idr.evaluate_predictors(
        files, "constant_velocity", every=50, split=tmp_path / "split.toml", with_timing=False
    )
    assert [path.stem for path in found.files] == ["lane_merge"]
    assert set(found.samples.category) == {"highway"}
    assert "1 files; 2 of other parts, 1 of no place" in found.notes[0]


@pytest.mark.parametrize(
    ("text", "part", "words"),
    [
        (SPLIT, "b", "there is no part 'b'; there are validation, a"),
        (SPLIT.replace("lane_", "other_"), "validation", "none of the 1 files is of the part validation"),
        ("x = [", "validation", "cannot be read as TOML"),
        ("x = 1", "validation", "there is no table"),
        ('[[place]]\nname = "A"\nfiles = "a*"', "validation", "place A: files must be a list of patterns"),
        ('[[place]]\nfiles = ["a*"]\npart = 1', "validation", "place number 1: part and category must be texts"),
    ],
)
def test_a_split_that_cannot_be_used_is_refused_in_one_line(tmp_path, text, part, words):
    (tmp_path / "split.toml").write_text(text)
    with pytest.raises(idr.InputError, match=words):
        idr.evaluate_predictors("lane_merge", "constant_velocity", split=tmp_path / "split.toml", part=part)


def test_calibration_of_those_that_move_leaves_out_those_that_stay(shipped):
    inside = shipped.samples.values["lane_following"]["region_3"] <= 0.5
    somebody = replace(shipped, samples=replace(shipped.samples, stays=inside))
    (row,) = [
        row
        for row in measures_table(somebody).to_pylist()
        if (row["predictor"], row["category"]) == ("lane_following", ALL)
    ]
    assert 0.0 < row["region_50_3"] < 1.0
    assert row["moving_50_3"] == 0.0
    assert 0.0 < row["moving_99_3"] <= 1.0
