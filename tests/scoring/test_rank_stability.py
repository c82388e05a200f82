"""How stable a ranking is: draws of places within classes, ranks, letters, and agreement between kinds of traffic."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from interdrive.benchmarks.ranking import Standings, kendall, places_needed, ranked


def standings(values, places=None, classes=None, weights=None, traffic=("replay", "a", "b"), counted=("a", "b")):
    """Scores of shape (planners, traffic, units)."""
    table = np.array(values, dtype=np.float64)
    n = table.shape[2]
    return Standings(
        planners=tuple("pqrst"[: len(table)]),
        traffic=traffic,
        values=table,
        places=tuple(places or [f"place {u}" for u in range(n)]),
        classes=tuple(classes or [""] * n),
        weights=weights or {"": 1.0},
        counted=counted,
    )


def drawn(means, n=16, spread=5.0, traffic=3, seed=0):
    """Scores of planners with these means at `n` places, whose difficulty they share."""
    rng = np.random.default_rng(seed)
    common = rng.normal(0.0, 10.0, n)
    return standings([[mean + common + rng.normal(0.0, spread, n) for _ in range(traffic)] for mean in means])


def test_the_number_is_the_mean_of_the_traffic_that_counts_with_the_weights_of_classes():
    found = standings(
        [[[0.0, 0.0, 0.0], [90.0, 80.0, 40.0], [70.0, 60.0, 20.0]]],
        classes=["town", "town", "motorway"],
        weights={"town": 0.3, "motorway": 0.1},
    )
    # (0.3 · 85 + 0.1 · 40) / 0.4 = 73.75 and (0.3 · 65 + 0.1 · 20) / 0.4 = 53.75
    assert found.numbers() == pytest.approx([63.75])
    assert found.totals()[0].tolist() == pytest.approx([0.0, 73.75, 53.75])


def test_units_of_one_place_are_drawn_together():
    found = standings([[[10.0, 20.0, 90.0]] * 3], places=["x", "x", "y"])
    assert found.totals({"x": 2, "y": 0})[0] == pytest.approx([15.0] * 3)
    assert set(np.round(found.samples()[:, 0, 0], 6).tolist()) == {15.0, 40.0, 90.0}


def test_places_are_drawn_within_their_classes():
    found = standings([[[10.0, 90.0]] * 3], classes=["a", "b"], weights={"a": 1.0, "b": 1.0})
    assert np.ptp(found.samples()) == 0.0, "one place per class is always drawn"


def test_a_planner_without_scores_in_traffic_that_counts_has_a_column_and_no_rank():
    values = np.full((2, 3, 12), 80.0)
    values[1, 1:] = math.nan
    found = ranked(standings(values))
    assert [(one.planner, one.rank) for one in found.ranks] == [("p", 1), ("q", 0)]
    assert found.ranks[1].columns["replay"] == 80.0 and math.isnan(found.ranks[1].number)


def test_clear_differences_are_separable_and_chance_is_not():
    found = ranked(drawn([90.0, 75.0, 74.9], spread=3.0))
    assert [one.letters for one in found.ranks] == ["a", "b", "b"]
    best, *others = found.ranks
    assert (best.rank_low, best.rank_high, best.above_next) == (1, 1, 1.0)
    assert {one.rank_low for one in others} == {2} and {one.rank_high for one in others} == {3}
    assert 0.05 < others[0].above_next < 0.999
    assert best.low < best.number < best.high


@pytest.mark.parametrize(("n", "classes"), [(9, None), (12, ["a"] * 10 + ["b"] * 2)])
def test_few_places_have_no_intervals_of_ranks_and_no_letters(n, classes):
    values = np.random.default_rng(0).uniform(50.0, 90.0, (2, 3, n))
    found = ranked(standings(values, classes=classes, weights={"": 1.0, "a": 1.0, "b": 1.0}))
    assert not found.is_sure
    assert {(one.rank_low, one.rank_high, one.letters) for one in found.ranks} == {(0, 0, "")}
    assert all(math.isnan(one.low) for one in found.agreements)


def test_kendalls_tau_is_that_of_its_definition():
    assert kendall(np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.0, 2.0, 3.0, 4.0])) == 1.0
    # One of six pairs in the other order: (5 - 1) / 6.
    assert kendall(np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.0, 2.0, 4.0, 3.0])) == pytest.approx(4 / 6)
    # A tie in one of both: 5 / sqrt(5 · 6).
    assert kendall(np.array([1.0, 1.0, 3.0, 4.0]), np.array([1.0, 2.0, 3.0, 4.0])) == pytest.approx(5 / math.sqrt(30))


def test_the_sentence_says_whether_the_ranking_depends_on_the_traffic():
    same = drawn([90.0, 70.0, 50.0], spread=1.0)
    assert ranked(same).sentence == "the ranking is the same in all traffic"
    values = same.values.copy()
    values[[0, 2], 0] = values[[2, 0], 0]
    said = ranked(standings(values, traffic=("recorded", "a", "b"))).sentence
    assert said.startswith("the ranking depends on the traffic: tau(replay, a) -1.0 (-1.0 to -1.0); ")
    assert said.endswith("moves from 3 to 1") or said.endswith("moves from 1 to 3")


def test_more_places_are_needed_where_differences_spread_more():
    few, many = (places_needed(drawn([80.0, 77.0], n=200, spread=spread), 3.0)["p", "q"] for spread in (5.0, 10.0))
    # Two kinds of traffic count: sd of the difference is spread; (2.80 · 5 / 3)² = 21.8.
    assert 17 <= few <= 27 and 3.0 < many / few < 5.0


def test_the_order_of_planners_and_units_does_not_matter():
    found = drawn([80.0, 78.0, 76.0])
    whole = {one.planner: one for one in ranked(found).ranks}
    for order in itertools.islice(itertools.permutations(range(3)), 3):
        turned = Standings(
            tuple(found.planners[p] for p in order), found.traffic, found.values[list(order)], found.places,
            found.classes, found.weights, found.counted,
        )  # fmt: skip
        assert {one.planner: one for one in ranked(turned).ranks} == whole
