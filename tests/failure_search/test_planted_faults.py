"""Planted faults are found on `t_junction` with the right signature, and a planner that only stands is not blamed."""

import sys
from pathlib import Path
from statistics import median

import pytest

import interdrive as idr
from interdrive.testing import Car, straight_road, world

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


def test_directed_runs_fail_three_times_as_often_as_uniform_ones(tmp_path):
    # Planted: it reacts 0.5 s late to the vehicle ahead, which a driver of `idm` rarely suffers for.
    file, late = tmp_path / "leader.xml", "idm,view.delay=0.5"
    cars = [Car(101, 20.0, velocity=12.0), Car(102, 50.0, velocity=12.0)]
    idr.write_scenario(world(straight_road(300.0), cars=cars, steps=60), file)
    what = {"agent_id": 101, "predictor": "constant_velocity", "runs": 150, "keep": 1, "shrink": False, "workers": 1}
    found = [idr.search(file, late, seed=seed, out=tmp_path / str(seed), **what).yields for seed in range(1, 6)]
    uniform = sum(of[0].failures for of in found) / sum(of[0].runs for of in found)
    assert 0.003 < uniform < 0.03, "about 1 % of the uniform runs of all seeds"
    assert median(of[-1].rate[0] for of in found) >= 3.0 * uniform


def test_a_planner_that_stands_still_is_not_blamed(searched):
    found = searched("Standing", runs=40)
    assert (found.failures, found.undisturbed) == ((), ())
