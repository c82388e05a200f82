"""The measures of predictions, on small worlds and hand-made numbers."""

import numpy as np
import pytest
from recorded_moments import Modes, measured, modes, recording

import interdrive as idr
from interdrive.prediction_evaluation.measures import Predicted, joined
from interdrive.prediction_evaluation.mixtures import log_densities, log_sum, region_levels
from interdrive.testing import Car


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
