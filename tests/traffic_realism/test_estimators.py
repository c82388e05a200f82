"""Proper scores, distances, classifier and filters on numbers that can be worked out by hand."""

import numpy as np
import pytest

from interdrive.traffic_realism.estimators import auc, crps, energy_score, intervals, smooth, wasserstein
from interdrive.traffic_realism.trees import two_sample_auc

NAN = float("nan")


@pytest.mark.parametrize(
    ("samples", "truth", "score"),
    [
        ([(0, 0), (4, 0)], (1, 0), 0.0),
        ([(0, 0), (3, 4), (6, 0)], (3, 0), 0.666667),
        ([(2, 0)], (5, 4), 5.0),
    ],
)
def test_the_energy_score_is_the_distance_less_half_of_that_between_samples(samples, truth, score):
    found = energy_score(np.array(samples, dtype=float)[:, None], np.array([truth], dtype=float))
    assert found == pytest.approx([score], abs=1e-6)


@pytest.mark.parametrize(("samples", "truth", "score"), [((1, 2, 4), 2.5, 0.166667), ((0, 4), 1.0, 0.0)])
def test_the_ranked_probability_score_is_the_same_in_one_dimension(samples, truth, score):
    found = crps(np.array(samples, dtype=float)[:, None], np.array([truth]))
    assert found == pytest.approx([score], abs=1e-6)


@pytest.mark.parametrize(
    ("one", "other", "distance"),
    [
        ((0, 1, 3), (5, 6, 8), 5.0),
        ((0, 1), (0, 0, 1, 1), 0.0),
        ((0, 1, 2), (0, 2), 0.333333),
        ((0, 1, NAN), (0, 1), 0.0),
        ((), (1,), NAN),
    ],
)
def test_the_wasserstein_distance_is_the_area_between_distribution_functions(one, other, distance):
    found = wasserstein(np.array(one, dtype=float), np.array(other, dtype=float))
    assert found == pytest.approx(distance, abs=1e-6, nan_ok=True)


def test_filters_differentiate_polynomials_exactly_and_know_nothing_at_the_edges():
    time = 0.2 * np.arange(25)
    assert smooth(time**3, 0.2, 13, 3, 2)[12] == pytest.approx(14.4)
    assert smooth(time**3, 0.2, 13, 3, 3)[12] == pytest.approx(6.0)
    speed = smooth(0.75 * time**2, 0.2, 7, 2, 1)
    assert speed[10] == pytest.approx(3.0)
    assert np.isnan(speed[[0, 2, -3, -1]]).all()
    assert np.isfinite(speed[[3, -4]]).all()
    assert np.isnan(smooth(time[:5], 0.2, 7, 2)).all()


def test_the_area_under_the_curve_counts_pairs_in_the_right_order():
    positive = np.array([True, True, False, False])
    assert auc(np.array([4.0, 3.0, 2.0, 1.0]), positive) == 1.0
    assert auc(np.array([1.0, 4.0, 2.0, 3.0]), positive) == 0.5
    assert auc(np.ones(4), positive) == 0.5
    assert np.isnan(auc(np.ones(2), np.array([True, True])))


def test_an_interval_draws_groups_as_a_whole():
    groups = np.repeat(np.arange(4.0), 50)
    values = groups.copy()
    low, high = intervals(values, groups)
    assert low < 0.8
    assert high > 2.2
    assert np.isnan(intervals(values[:50], groups[:50])[0])


def _snippets(shift):
    random = np.random.default_rng(3)
    groups = np.repeat(np.arange(20), 40)
    recorded = random.normal(size=(800, 3))
    simulated = random.normal(size=(800, 3)) + np.array([shift, 0.0, 0.0])
    features = np.concatenate((recorded, simulated))
    features[::7, 2] = np.nan
    return features, np.arange(1600) >= 800, np.tile(groups, 2)


def test_a_classifier_finds_a_shift_and_nothing_where_there_is_none():
    assert two_sample_auc(*_snippets(2.0)) > 0.85
    assert two_sample_auc(*_snippets(0.0)) == pytest.approx(0.5, abs=0.05)


def test_equal_samples_cannot_be_told_apart():
    features, labels, groups = _snippets(0.0)
    features[800:] = features[:800]
    assert two_sample_auc(features, labels, groups) == 0.5
    assert np.isnan(two_sample_auc(features[:40], labels[:40], np.zeros(40)))
