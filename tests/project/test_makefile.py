"""What targets of the Makefile pass on."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_batches_read_all_folders_of_scenarios_and_stored_figures_those_of_the_first():
    said = subprocess.run(
        ["make", "--dry-run", "planners", "driving_guard"],
        cwd=ROOT, env={**os.environ, "INTERDRIVE_SCENARIOS": "/a:/b"}, capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    assert said.count("interdrive batch /a /b --planner") == 2
    assert "benchmarks/driving/guard.py /a\n" in said
