"""Comparisons that several files look at."""

import math

import pytest
from compared_batches import crash, invented


@pytest.fixture
def two(tmp_path):
    """Planner a reaches 3 of 4 goals and crashes once; planner b reaches 1 of 4."""
    late, limit = {"outcome": "goal_reached_late"}, {"outcome": "time_limit", "ttc_min": math.inf}
    return invented(
        tmp_path / "batch",
        [
            ("urban/x", "a", {1: {"ttc_min": 2.0}, 2: crash()}),
            ("urban/x", "b", {1: late, 2: limit}),
            ("highway/y", "a", {1: {"ttc_min": 4.0}, 2: {"ttc_min": 6.0}}),
            ("highway/y", "b", {1: {}, 2: limit}),
        ],
    )
