"""Pictures of predictions and times per call: benchmarks/predictions."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.path import Path as MplPath
from recorded_moments import SETTINGS

import interdrive as idr
from interdrive.prediction_evaluation.recordings import Recording

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "predictions"
if not FOLDER.is_dir():
    pytest.skip("benchmarks/ is part of the repository, not of the package", allow_module_level=True)


@pytest.fixture
def pictures(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))

    def imported(name):
        return __import__(name)

    yield imported
    for name in ("figures", "scenes", "timing"):
        sys.modules.pop(name, None)


def test_time_per_call_is_measured_for_every_predictor_and_number_of_vehicles(pictures):
    found = idr.evaluate_predictors("lane_merge", ["constant_velocity", "lane_following"], every=100)
    timings = pictures("timing").measured_timings(found.choices, found.simulation, (1, 25))
    assert [(one.predictor, one.vehicles) for one in timings] == [
        (name, n) for n in (1, 25) for name in ("constant_velocity", "lane_following")
    ]
    assert all(one.milliseconds > 0 for one in timings)
    lines = pictures("timing").timing_table(timings).splitlines()
    assert lines[0] == "| ms per call, vehicles | 1 | 25 |"
    assert [line.split(" | ")[0] for line in lines[2:]] == ["| constant_velocity", "| lane_following"]


def test_a_crowd_has_as_many_vehicles_as_asked_for_on_roads_of_their_own(pictures):
    many = pictures("timing").crowd(60)
    assert len(np.unique(many.obstacles.ids)) == 60
    scene = Recording(many, SETTINGS).at(5).scene
    on_road = scene.road.on_road(np.stack([scene.x[:, -1], scene.y[:, -1]], axis=1))
    assert on_road.mean() > 0.9


@pytest.mark.long
def test_figures_and_a_scene_per_category_are_drawn_as_pdf_and_png(tmp_path):
    done = subprocess.run(
        [sys.executable, str(FOLDER), "lane_merge", "t_junction", "--every", "40", "--workers", "1", "--out", tmp_path,
         "--predictors", "lane_following"],
        env=os.environ, capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    names = ("error_over_time", "calibration", "scene_junction", "scene_merge")
    assert {entry.name for entry in tmp_path.iterdir()} == {
        f"{name}.{ending}" for name in names for ending in ("pdf", "png")
    }
    assert "| lane_following | " in done.stdout


def test_a_scene_shows_the_moment_at_which_most_vehicles_leave_a_straight_drive(pictures):
    found = idr.evaluate_predictors("t_junction", "lane_following", every=10)
    (scene,) = pictures("scenes").example_scenes(found)
    telling = (found.samples.departure > 2.0) & (found.samples.departure < 20.0)
    counts = np.bincount(found.samples.time_step[telling])
    assert scene.moment.scene.time_step == counts.argmax()
    assert len(scene.row) == counts.max()


def test_an_ellipse_holds_95_percent_of_what_its_covariance_says(pictures):
    mean, covariance = np.array([3.0, -1.0]), np.array([[2.0, 0.7], [0.7, 0.5]])
    (ring,) = pictures("scenes").ellipse_rings(mean[None], covariance[None], 0.95)
    samples = np.random.default_rng(0).multivariate_normal(mean, covariance, 4000)
    assert MplPath(ring).contains_points(samples).mean() == pytest.approx(0.95, abs=0.02)
