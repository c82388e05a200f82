"""The bounds in docs/robustness.md are those of the program."""

import re
from pathlib import Path

import pytest

from interdrive.files import limits

PAGE = Path(__file__).parents[1] / "docs" / "robustness.md"
BOUNDS = {
    "time step size [s]": (limits.SMALLEST_DT, limits.LARGEST_DT),
    "id": (0, limits.LARGEST_ID),
    "time step of a state": (0, limits.LARGEST_TIME_STEP),
    "time step of a goal": (0, limits.LARGEST_GOAL_TIME_STEP),
    "coordinate [m]": (-limits.LARGEST_COORDINATE, limits.LARGEST_COORDINATE),
    "length of a lanelet [m]": (None, limits.LONGEST_LANELET),
    "length of all lanelets [m]": (None, limits.LONGEST_ROADS),
    "extent of the map along x or y [m]": (None, limits.LARGEST_EXTENT),
    "lanelets": (1, limits.MOST_LANELETS),
    "points of a lanelet's bound": (2, limits.MOST_POINTS_OF_A_LANELET),
    "points of all bounds": (2, limits.MOST_POINTS),
    "obstacles": (0, limits.MOST_OBSTACLES),
    "states of all obstacles": (0, limits.MOST_STATES),
    "planning problems": (0, limits.MOST_PROBLEMS),
    "size of a footprint [m]": (limits.SMALLEST_SIZE, limits.LARGEST_FOOTPRINT),
}


def stated():
    """First and last of each row of the page's table."""
    rows = re.findall(r"^\| (.+?) \| (\S+|above 0) \| (\S+) \|$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {what: (None if low == "above 0" else float(low), float(high)) for what, low, high in rows if high != "to"}


def test_the_page_states_every_bound_of_the_program():
    assert set(stated()) == set(BOUNDS)


@pytest.mark.parametrize("what", BOUNDS)
def test_a_stated_bound_is_the_one_that_is_checked(what):
    low, high = BOUNDS[what]
    assert stated()[what] == (low, pytest.approx(high, rel=0))
