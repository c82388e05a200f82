"""Kinds of figures of a run: whoever names them names all."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from interdrive.cli.plot import plot
from interdrive.plots.figures import KINDS
from interdrive.runs import Run

GUIDE = Path(__file__).parents[2] / "docs" / "how_to" / "figures.md"


@pytest.mark.parametrize("kind", KINDS)
def test_the_command_the_method_and_the_guide_name_a_kind(kind):
    (said,) = (option.help for option in plot.params if option.name == "kind")
    assert kind in re.split(r", | or ", said)
    assert f'"{kind}"' in Run.plot.__doc__
    assert f"\n| `{kind}` |" in GUIDE.read_text(encoding="utf-8")


def test_the_guide_names_no_other_kind():
    rows = re.findall(r"^\| `(.+?)` \|", GUIDE.read_text(encoding="utf-8"), re.MULTILINE)
    assert tuple(rows) == KINDS
