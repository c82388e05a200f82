"""Intervals over places: golden widths, coverage on invented sets, Holm by hand, letters."""

import math

import numpy as np
import pytest

from interdrive.comparison.intervals import holm, letters, mean_interval, mean_of_files, widening
from interdrive.comparison.paper import PaperTable, separable


@pytest.mark.parametrize(("n", "factor"), [(6, 1.4367), (10, 1.2166), (16, 1.1232)])
def test_intervals_of_few_places_are_widened(n, factor):
    assert widening(n) == pytest.approx(factor, abs=1e-4)


def drawn_sets(n_places, n_sets, seed):
    """Sets with 1 to 5 files per place; places differ by 8 points (standard deviation), files of one by 10 more."""
    random = np.random.default_rng(seed)
    for _ in range(n_sets):
        sizes = random.integers(1, 6, n_places)
        level = random.normal(0.0, 8.0, n_places)
        values = np.repeat(level, sizes) + random.normal(0.0, 10.0, sizes.sum())
        yield values, np.repeat(np.arange(n_places), sizes).astype(str).tolist()


@pytest.mark.long
@pytest.mark.parametrize("n_places", [6, 10, 16, 30])
def test_95_percent_intervals_over_places_hold_the_truth_and_those_over_files_do_not(n_places):
    n_sets, places, files = 300, 0, 0
    for k, (values, groups) in enumerate(drawn_sets(n_places, n_sets, seed=n_places)):
        low, high = mean_interval(values, groups)
        places += low <= 0.0 <= high
        if k % 4:
            continue
        low, high = mean_interval(values, [str(k) for k in range(len(values))])
        files += low <= 0.0 <= high
    assert 0.92 <= places / n_sets <= 0.98, "0.95 within three standard errors of 300 sets, and of the method"
    assert files / (n_sets / 4) <= 0.87


def test_the_order_of_files_has_no_effect():
    values, groups = next(iter(drawn_sets(12, 1, seed=5)))
    order = np.random.default_rng(1).permutation(len(values))
    assert mean_interval(values[order], [groups[k] for k in order]) == pytest.approx(mean_interval(values, groups))


def test_below_five_places_there_is_no_interval():
    assert all(map(math.isnan, mean_interval(np.arange(4.0), list("abcd"))))
    assert not any(map(math.isnan, mean_interval(np.arange(5.0), list("abcde"))))


def test_a_total_is_the_mean_of_files_and_leaves_out_agents_without_a_value():
    total, means, names = mean_of_files(np.array([1.0, 0.0, 0.5, np.nan]), ["x", "x", "y", "z"])
    assert (total, means.tolist(), names) == (0.5, [0.5, 0.5], ("x", "y"))
    assert math.isnan(mean_of_files(np.array([np.nan]), ["x"])[0])


def test_holm_by_hand():
    # Sorted 0.01, 0.02, 0.03, 0.04 times 4, 3, 2, 1: 0.04, 0.06, 0.06, 0.06.
    assert holm([0.04, 0.01, 0.03, 0.02]) == pytest.approx([0.06, 0.04, 0.06, 0.06])
    found = holm([0.5, math.nan, 0.9])
    assert found[0] == 1.0 and math.isnan(found[1]) and found[2] == 1.0


def test_planners_that_share_a_letter_are_not_separable():
    differ = {frozenset(pair): pair == ("first", "last") for pair in
              (("first", "middle"), ("middle", "last"), ("first", "last"))}  # fmt: skip
    assert letters(["first", "middle", "last"], differ) == {"first": "a", "middle": "ab", "last": "b"}


def test_nothing_is_separable_with_fewer_than_ten_places():
    scores = {"good": {f"f{k}": 0.9 + 0.001 * k for k in range(9)}, "bad": {f"f{k}": 0.1 for k in range(9)}}
    places = {f"f{k}": f"road {k}" for k in range(10)}
    assert separable(scores, places) == {}
    for one in scores.values():
        one["f9"] = 0.5 * one["f8"]
    assert separable(scores, places) == {"good": "a", "bad": "b"}
    assert separable(scores, dict.fromkeys(places, "one road")) == {}, "ten files of one road are one place"


def test_latex_has_no_characters_that_mean_something_else():
    table = PaperTable("R & D, 5 % of my_set, jerk [m/s³] < 2", ("planner", "in time %"), (("my_module:P{1}", "99.5"),))
    said = table.latex()
    assert r"R \& D, 5 \% of my\_set, jerk [m/s$^3$] $<$ 2" in said
    assert r"my\_module:P\{1\} & 99.5 \\" in said
    assert said.count(r"\begin") == said.count(r"\end") == 2
    assert "| my_module:P{1} | 99.5 |" in table.markdown()
