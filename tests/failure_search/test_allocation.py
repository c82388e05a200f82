"""How a search spends its runs: a fair rate, more failures, the same choices after an interruption."""

import numpy as np
import pytest

from interdrive.failure_search.allocation import ROUND, Allocation
from interdrive.failure_search.rates import interval, rate_ratio, yields

#: Two coordinates; the second one chooses among kinds.
CHOICES = (False, False, True)
PAIRS = 12


def fails(pair, point):
    """A planner that fails in 2 % of the points, all of them in two of the pairs."""
    return pair in (3, 7) and point[0] < 0.3 and point[1] < 0.4


def driven(seed, runs, method="levels", stop_at=()):
    """The rows of a search whose worlds are points; it is interrupted at some numbers of runs."""
    allocation, rows = Allocation(PAIRS, CHOICES, seed, method), []
    while len(rows) < runs:
        first = len(rows)
        stop = min([runs, *(one for one in stop_at if one > first)])
        for proposal in allocation.proposals(first, rows)[: stop - first]:
            point = next(proposal.points(seed))
            failed = fails(proposal.pair, point)
            near = float(np.hypot(max(point[0] - 0.3, 0.0), max(point[1] - 0.4, 0.0))) + (proposal.pair not in (3, 7))
            rows.append(
                {
                    "index": proposal.index,
                    "source": proposal.source,
                    "pair": proposal.pair,
                    "point": point.tolist(),
                    "outcome": "collision" if failed else "goal_reached",
                    "failure": "ran_into" if failed else "",
                    "signature": f"{proposal.pair} ran_into" if failed else "",
                    "criticality": -1.0 if failed else near,
                }
            )
    return rows


def test_the_interval_of_the_uniform_rate_holds_the_true_one_in_95_of_100_searches():
    true = 2.0 / PAIRS * 0.3 * 0.4
    rates = [yields(driven(seed, 250))[0].rate for seed in range(100)]
    assert sum(low <= true <= high for _, low, high in rates) >= 95
    assert np.mean([at for at, _, _ in rates]) == pytest.approx(true, rel=0.1), "no bias"


def test_levels_find_several_times_as_many_failures_as_uniform_runs():
    shares = []
    for seed in range(5):
        directed = yields(driven(seed, 600))[-1]
        assert directed.source == "directed"
        uniform = yields(driven(seed, 600, "uniform"))[0]
        shares.append(directed.rate[0] / max(uniform.rate[0], 1.0 / 600))
    assert np.median(shares) >= 3.0


def test_a_uniform_search_draws_nothing_else():
    assert {row["source"] for row in driven(0, 200, "uniform")} == {"uniform"}


@pytest.mark.parametrize("runs", [1, PAIRS, 3 * PAIRS])
def test_the_first_runs_visit_all_pairs_alike(runs):
    visits = np.bincount([row["pair"] for row in driven(0, runs)], minlength=PAIRS)
    assert visits.max() - visits.min() <= 1


def test_the_first_points_of_a_pair_are_spread_over_every_coordinate():
    allocation = Allocation(PAIRS, CHOICES, 0)
    rows = driven(0, allocation.sweeps * PAIRS)
    points = np.array([row["point"] for row in rows if row["pair"] == 5])
    strata = np.sort((points * allocation.sweeps).astype(int), axis=0)
    assert (strata == np.arange(allocation.sweeps)[:, None]).all()


def test_an_interrupted_search_makes_the_same_choices():
    whole = driven(3, 300)
    assert driven(3, 300, stop_at=(1, 40, 77, 100, 100 + ROUND)) == whole
    assert driven(3, 170) == whole[:170]


def test_points_of_which_enough_failures_are_known_have_no_more_neighbours():
    rows = driven(1, 600)
    closed = [row for row in rows if row["failure"]]
    kinds = {row["signature"]: 0 for row in closed}
    parents = []
    allocation = Allocation(PAIRS, CHOICES, 1)
    for proposal in allocation.proposals(len(rows), rows):
        if proposal.parent is not None:
            parents.append(fails(proposal.pair, proposal.parent))
    assert kinds
    assert parents
    assert not any(parents)


def test_intervals_are_those_of_clopper_and_pearson():
    # Fleiss, Levin, Paik, "Statistical Methods for Rates and Proportions": 0 of 10, 5 of 10, 10 of 10.
    assert interval(0, 10) == pytest.approx((0.0, 0.0, 0.3085), abs=1e-4)
    assert interval(5, 10) == pytest.approx((0.5, 0.1871, 0.8129), abs=1e-4)
    assert interval(10, 10) == pytest.approx((1.0, 0.6915, 1.0), abs=1e-4)


def test_the_interval_of_a_ratio_follows_from_the_number_of_failures_of_both():
    # 5 of 10 failures, which Clopper and Pearson put between 0.1871 and 0.8129; the second kind had twice as many runs.
    at, low, high = rate_ratio(5, 100, 5, 200)
    assert (at, low, high) == pytest.approx((2.0, 2 * 0.1871 / 0.8129, 2 * 0.8129 / 0.1871), rel=1e-3)
    assert rate_ratio(0, 100, 0, 100)[1:] == (0.0, np.inf)
    assert rate_ratio(3, 100, 0, 100)[0] == np.inf
