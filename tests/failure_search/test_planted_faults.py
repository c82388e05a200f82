"""Planted faults are found on `t_junction` with the right signature, and a planner that only stands is not blamed."""

import sys
from pathlib import Path

import pytest

import interdrive as idr

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "failures"
if not FOLDER.is_dir():
    pytest.skip("benchmarks/ is part of the repository, not of the package", allow_module_level=True)

pytestmark = pytest.mark.long


@pytest.fixture
def searched(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))

    def searched(name, **more):
        return idr.search("t_junction", f"planted:{name}", out=tmp_path / "out", **more)

    yield searched
    sys.modules.pop("planted", None)


def test_a_planner_that_brakes_late_is_found_out(searched):
    found = searched("Late", runs=100, stop_after=1)
    (one,) = found.failures
    assert (one.failure, one.witness) == ("ran_into", "cc")
    assert found.undisturbed == ()


def test_a_planner_that_is_blind_to_its_right_is_found_out(searched):
    (one,) = searched("BlindRight", runs=100, seed=2, stop_after=1).failures
    assert (one.drive.agent_id, one.failure) == (1004, "ran_into")
    assert one.witness


def test_directed_runs_fail_three_times_as_often_as_uniform_ones(searched, tmp_path):
    # Measured with five seeds: docs/research/failures.md, where 1 to 2 % of the uniform runs fail.
    found = searched("BlindRight", runs=200, seed=1, keep=1, shrink=False)
    uniform, directed = found.yields[0], found.yields[-1]
    assert uniform.rate[0] < 0.05
    assert directed.rate[0] >= 3.0 * max(uniform.rate[0], 0.015)


def test_a_planner_that_stands_still_is_not_blamed(searched):
    found = searched("Standing", runs=40)
    assert (found.failures, found.undisturbed) == ((), ())
