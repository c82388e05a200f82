"""Traffic by SUMO, in an environment that has it: `make sumo`."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def crossing(tmp_path):
    """A copy of the crossing with traffic lights."""
    folder = tmp_path / "crossing"
    shutil.copytree(Path(__file__).parent / "crossing", folder)
    return folder


@pytest.fixture
def equal_crossing(tmp_path):
    """A copy of the crossing at which vehicles from the right go first."""
    folder = tmp_path / "equal_crossing"
    shutil.copytree(Path(__file__).parent / "equal_crossing", folder)
    return folder


@pytest.fixture(scope="session")
def published():
    """Folder of published interactive scenarios."""
    inputs = Path(os.environ.get("INTERDRIVE_INPUTS", ROOT.parent / "shared" / "inputs"))
    folder = inputs / "sumo_scenarios"
    if not folder.is_dir():
        pytest.skip(f"no SUMO scenarios in {inputs}: set INTERDRIVE_INPUTS to the folder of maps and recordings")
    return folder
