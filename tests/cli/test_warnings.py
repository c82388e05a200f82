"""No command shows a warning of Python; the processes fail on them, see conftest.py."""

import subprocess
import sys

import numpy as np
import pytest

from interdrive.report.packing import Packer


def command(folder, *arguments):
    return subprocess.run(
        [sys.executable, "-m", "interdrive", *arguments], cwd=folder, capture_output=True, text=True, check=False
    )


@pytest.mark.long
@pytest.mark.parametrize("scenario", ["signals", "lane_merge"])
def test_a_run_with_everything_that_it_can_draw_and_record_shows_none(tmp_path, scenario):
    drawn = ("--report", "--png", "--set", "step.max_steps=12", "--agents", "6", "--out", "run", "--quiet")
    done = command(tmp_path, "run", scenario, *drawn)
    assert (done.returncode, done.stderr) == (0, "")
    for arguments in (
        ("criticality", "run", "--png", "--quiet"),
        ("plot", "run", "--kind", "criticality", "--out", "c.pdf", "--quiet"),
        ("report", "run", "--quiet"),
    ):
        done = command(tmp_path, *arguments)
        assert (done.returncode, done.stderr) == (0, ""), arguments


def test_numbers_that_are_too_large_for_a_page_are_packed_without_one():
    packer = Packer()
    with np.errstate(all="raise"):
        packer.add("cost", np.array([1e300, -1e300, np.inf, np.nan, 1.0]))
    assert packer.header["cost"]["type"] == "f32"
