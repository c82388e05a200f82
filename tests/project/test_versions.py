"""What uses other libraries most, once each; `make versions` runs this with the oldest that pyproject.toml allows."""

from __future__ import annotations

import subprocess
import sys

import pytest

from interdrive import SimulationSettings, read_batch, save, simulate
from interdrive.config.schema import RecordSettings
from interdrive.plots import animate_run
from interdrive.report import write_run_report
from interdrive.results import read_results

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of a run of a shipped scenario that recorded everything, with a film of few pictures."""
    record = RecordSettings(views=True, predictions=True, candidates=5)
    run = simulate("t_junction", settings=SimulationSettings(record=record))
    path = save(run, tmp_path_factory.mktemp("versions") / "run")
    animate_run(run, path / "run.gif", fps=0.5)
    return path


def command(*arguments):
    done = subprocess.run(
        [sys.executable, "-m", "interdrive", *map(str, arguments)], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr.strip()) == (0, ""), done.stderr
    return done.stdout


def test_tables_come_back_as_they_were_written(folder):
    found = read_results(folder)
    assert found.outcomes["outcome"].to_pylist().count("goal_reached") >= 6
    assert found.states.num_rows > 100
    assert found.predictions.num_rows > 0


def test_a_run_is_repeated_bit_for_bit(folder):
    assert "equal: digest" in command("verify", folder)


def test_criticality_is_judged_stored_and_drawn(folder):
    assert "thw" in command("criticality", folder, "--png")
    assert (folder / "criticality_moment.png").stat().st_size > 1000


def test_a_film_is_written(folder):
    assert (folder / "run.gif").read_bytes().startswith(b"GIF89a")


def test_figures_have_vector_fonts(folder):
    command("plot", folder, "--kind", "trajectories", "--out", folder.parent / "figure.pdf")
    assert (folder.parent / "figure.pdf").read_bytes().startswith(b"%PDF")


def test_the_report_is_one_page(folder):
    assert "</html>" in write_run_report(folder).read_text(encoding="utf-8")[-200:]


def test_a_batch_is_compared(folder):
    out = folder.parent / "batch"
    command("batch", "lane_merge", "--agents", "1", "--planner", "idm,frenet", "--workers", "1", "--out", out)
    assert "frenet" in command("compare", out)
    command("batch", "lane_merge", "--agents", "1", "--planner", "idm", "--out", out)
    runs = read_batch(out, ["key", "planner"]).to_pylist()
    assert sorted(run["planner"] for run in {run["key"]: run for run in runs}.values()) == ["frenet", "idm"]
