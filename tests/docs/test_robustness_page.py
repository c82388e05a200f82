"""The bounds in docs/reference/scenario_limits.md are those of the program."""

import re
from pathlib import Path

import pytest

from interdrive.scenario import limits

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "scenario_limits.md"
NUMBERS = {name: value for name, value in vars(limits).items() if name.isupper() and type(value) in (int, float)}
BOUNDS = {name: value for name, value in NUMBERS.items() if not name.startswith("_")}


def stated():
    """Bounds of the page's table by name."""
    rows = re.findall(r"^\|.*\| (\S+) \| `(\w+)` \|$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {name: float(value) for value, name in rows}


def test_the_page_states_every_bound_of_the_program_and_no_other():
    assert len(BOUNDS) > 20
    assert set(stated()) == set(BOUNDS)


@pytest.mark.parametrize("name", BOUNDS)
def test_a_stated_bound_is_the_one_that_is_checked(name):
    assert stated()[name] == BOUNDS[name]
