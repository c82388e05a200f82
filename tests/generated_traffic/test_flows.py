"""Flows of lanes from what became of vehicles, by hand."""

import numpy as np
import pytest

from interdrive.run import Demand
from interdrive.run.flows import flows_of

NEVER = np.nan


def lane_of(due, entered, *, begin=0.0, end=60.0):
    """The entry of a lane with vehicles that are due and enter at these times [s]."""
    n = len(due)
    demand = Demand(
        agent_id=np.arange(n),
        lane_id=np.full(n, 7),
        kind=("car",) * n,
        due=np.array(due),
        entered=np.array(entered),
        left=np.full(n, np.nan),
        exit_id=np.full(n, 9),
        route_length=np.full(n, 100.0),
    )
    return flows_of(demand, np.full(n, 10.0), begin, end, 0.1)[0]


def test_vehicles_that_entered_waited_until_then():
    row = lane_of([0.0, 10.0], [4.0, 12.0])
    assert (row.wait, row.left_out, row.vehicles) == (pytest.approx(3.0), 0, 2)


def test_vehicles_that_never_entered_waited_until_the_end():
    row = lane_of([0.0, 40.0, 50.0], [4.0, NEVER, NEVER])
    assert row.wait == pytest.approx((4.0 + 20.0 + 10.0) / 3.0), "s"
    assert (row.due, row.vehicles, row.left_out) == (3, 1, 2)


def test_what_enters_after_the_end_had_not_entered_and_what_is_due_later_does_not_count():
    row = lane_of([0.0, 40.0, 50.0, 61.0], [4.0, 62.0, NEVER, NEVER])
    assert (row.wait, row.left_out) == (pytest.approx((4.0 + 20.0 + 10.0) / 3.0), 2)


def test_a_lane_that_nobody_could_enter_has_a_wait():
    row = lane_of([0.0, 20.0], [NEVER, NEVER])
    assert (row.wait, row.vehicles, row.queue) == (pytest.approx(50.0), 0, 2)
