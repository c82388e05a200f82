"""Every field that planners in Python get is documented, in docstrings and in docs/reference/planner_interface.md."""

import re
from pathlib import Path

import pytest

from interdrive import _core

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "planner_interface.md"
#: Not for planners: how routes are made, and what travels between processes.
INTERNAL = {
    "Route": {"through", "along", "find", "first_state"},
    "Vehicle": {"of_type"},
    "Predictions": {"seen_by", "known", "plan_ages", "received"},
}


def fields(name):
    return [field for field in dir(getattr(_core, name)) if not field.startswith("_")]


@pytest.mark.parametrize("name", ["Scene", "View", "Ego", "Route", "Goal", "Vehicle", "Predictions", "RoadNetwork"])
def test_every_field_says_what_it_is(name):
    bare = [field for field in fields(name) if not getattr(getattr(_core, name), field).__doc__]
    assert bare == []


@pytest.mark.parametrize("name", ["View", "Ego", "Route", "Goal", "Vehicle", "Predictions"])
def test_the_page_for_planners_names_every_field(name):
    named = set(re.findall(r"\w+", " ".join(re.findall(r"`([^`]+)`", PAGE.read_text(encoding="utf-8")))))
    assert set(fields(name)) - INTERNAL.get(name, set()) - named == set()
