"""The tutorial on calibration, run as the site runs it."""

import importlib
import json
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.long
def test_the_tutorial_does_what_it_says(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(DOCS / "extensions")
    pages = importlib.import_module("executed_pages")
    pages.run(DOCS / "tutorials" / "calibrate_drivers.md", tmp_path / "pictures")
    blocks = json.loads((tmp_path / "pictures" / "calibrate_drivers.json").read_text())
    assert len(blocks) == 5
    assert "time_gap.median" in blocks[1]
