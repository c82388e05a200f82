"""The closed-loop comparison of predictors: what it says about failures and about what `neural` was trained on."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from interdrive import shipped_scenario
from interdrive.prediction_evaluation.split import read_split

SCRIPT = Path(__file__).resolve().parents[2] / "benchmarks" / "predictors.py"
if not SCRIPT.is_file():
    pytest.skip("benchmarks/ is part of the repository, not of the package", allow_module_level=True)


@pytest.fixture(scope="module")
def benchmark():
    spec = importlib.util.spec_from_file_location("predictors_benchmark", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_a_predictor_that_fails_is_told_from_a_file_that_cannot_be_driven(tmp_path):
    (tmp_path / "mine.py").write_text(
        "class Broken:\n    def predict(self, scene):\n        raise ValueError('no idea')\n"
    )
    (tmp_path / "torn.xml").write_text("<a>")
    files = [str(shipped_scenario("lane_merge")), "torn.xml"]
    done = subprocess.run(
        [sys.executable, str(SCRIPT), *files, "--predictors", "mine:Broken", "--workers", "1"],
        cwd=tmp_path,
        env={"PYTHONPATH": str(tmp_path), "PATH": ""},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 1, done.stderr
    failed, _, refused = done.stdout.partition("1 files cannot be driven")
    assert "A predictor failed in 1 runs" in failed
    why = "mine.py:3 in predict: ValueError: no idea"
    assert f"- lane_merge.xml: predictor mine:Broken, time step 0: {why}" in failed
    assert "- torn.xml: " in refused
    assert "lane_merge" not in refused


def test_files_of_places_that_neural_was_trained_at_are_known(benchmark):
    split = read_split(benchmark.SPLIT)
    names = {"USA_US101-1_1_T-1": True, "USA_Lanker-2_8_T-1": True, "USA_Peach-4_8_T-1": False, "my_own": False}
    assert {name: benchmark.is_trained_on(Path(f"{name}.xml"), split) for name in names} == names


def test_agents_are_counted_by_whether_neural_was_trained_at_their_place(benchmark):
    def ended(file, trained_on, outcome):
        return benchmark.Ended("neural", "urban", file, trained_on, 1, outcome, 9, -1, False, False)

    rows = [ended("a", True, "goal_reached"), ended("b", False, "goal_reached_late"), ended("c", False, "time_limit")]
    table = "\n".join(benchmark.summary(rows, ["neural"]))
    assert "| all | neural | 3 | 3 | 66.7 % | 33.3 % | 0.00 |" in table
    assert "| all, neural was trained there | neural | 1 | 1 | 100.0 % | 100.0 % | 0.00 |" in table
    assert "| all, neural was not trained there | neural | 2 | 2 | 50.0 % | 0.0 % | 0.00 |" in table


def test_predictors_are_compared_with_lane_following_wherever_it_stands(benchmark):
    def ended(predictor, agent, outcome):
        return benchmark.Ended(predictor, "urban", "a", True, agent, outcome, 9, -1, False, False)

    names = ["constant_velocity", "lane_following"]
    rows = [
        *(ended("constant_velocity", 1, "collision"), ended("constant_velocity", 2, "goal_reached")),
        *(ended("lane_following", 1, "goal_reached"), ended("lane_following", 2, "goal_reached")),
    ]
    table = list(benchmark.pairs(rows, names))
    assert "not with lane_following" in table[0]
    assert table[2:] == ["| constant_velocity | 0 | 1 | 1 | 0 |"]


def test_the_notes_name_places_and_count_files(benchmark):
    split = read_split(benchmark.SPLIT)
    paths = [Path(f"{name}.xml") for name in ("USA_US101-1_1_T-1", "USA_US101-3_1_T-1", "USA_Peach-4_8_T-1")]
    notes = "\n".join(benchmark.notes_of(paths, split, {}))
    assert "neural was trained at the places of 2 of the 3 files: US 101, Los Angeles." in notes
