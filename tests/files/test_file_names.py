"""Paths that are none: names of files that are not UTF-8, symbolic links in a circle. One line, or it works."""

from __future__ import annotations

import os
from pathlib import Path

import commonroad_documents as cr
import pytest
from click.testing import CliRunner
from commonroad_documents import car, document, initial, state

from interdrive import read_batch
from interdrive.batches.plan import scenario_files
from interdrive.cli import main
from interdrive.errors import ResultsError
from interdrive.results import read_results
from interdrive.storage import resolved

#: How the system gives a name with the byte E9 (é in Latin-1) to Python.
LATIN = os.fsdecode(b"caf\xe9")


def drive(start: float) -> str:
    """A scenario with one car that drives 3 s at 10 m/s."""
    states = [state(t, start + t, orientation=0.0, velocity=10.0) for t in range(1, 31)]
    return document(car(30, initial(start), states))


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A working folder with a scenario whose name is not UTF-8, and a link to itself."""
    monkeypatch.chdir(tmp_path)
    cr.saved(tmp_path, drive(10.0), f"{LATIN}.xml")
    Path("circle").symlink_to("circle")
    return tmp_path


def refusal(*arguments):
    """The one line with which a command refuses to work, having written nothing."""
    before = sorted(Path().rglob("*"))
    done = CliRunner().invoke(main, arguments)
    assert (done.exit_code, done.stdout) == (2, ""), done.output
    assert done.stderr.count("\n") == 1, done.stderr
    assert sorted(Path().rglob("*")) == before
    return done.stderr.removeprefix("error: ")


def test_a_scenario_whose_name_is_not_utf_8_is_run_and_its_path_comes_back(here):
    assert CliRunner().invoke(main, ["run", f"{LATIN}.xml", "--out", "made"]).exit_code == 0
    info = read_results("made").info
    assert info["scenario"]["name"] == r"caf\xe9"
    assert Path(info["scenario"]["path"]) == here / f"{LATIN}.xml"
    assert CliRunner().invoke(main, ["verify", "made"]).exit_code == 0


def test_a_batch_keeps_the_runs_of_scenarios_whose_names_are_not_utf_8(here):
    cr.saved(here, drive(20.0), "plain.xml")
    assert CliRunner().invoke(main, ["batch", ".", "--out", "all", "--workers", "1", "--quiet"]).exit_code == 0
    table = read_batch("all")
    assert sorted(table["scenario"].to_pylist()) == [r"caf\xe9", "plain"]
    assert set(table["status"].to_pylist()) == {"finished"}


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "t_junction", "--out"],
        ["criticality", "t_junction", "--out"],
        ["batch", "t_junction", "--out"],
        ["study", "merge", "--out"],
        ["predict-eval", "t_junction", "--out"],
        ["compare"],
        ["verify"],
        ["report"],
    ],
)
def test_folders_of_results_that_cannot_be_are_refused_at_once(here, arguments):
    assert "its symbolic links are circular" in refusal(*arguments, "circle")
    assert refusal(*arguments, LATIN).startswith(r"caf\xe9: results need a path that is UTF-8")


@pytest.mark.parametrize(
    "arguments",
    [
        *(
            ["check", "circle"],
            ["batch", "--out", "made", "circle"],
            ["run", "circle"],
            ["criticality", "circle"],
            ["predict-eval", "circle"],
        ),
        ["run", "t_junction", "--config", "circle"],
        ["run", "t_junction", "--predictor", "neural,weights=circle"],
        ["run", "t_junction", "--predictor", "neural,weights=~no-such-user/file"],
        ["models", "install", "walenet", "--from", "circle"],
    ],
)
def test_files_that_cannot_be_are_refused_at_once(here, arguments):
    assert arguments[-1].rpartition("=")[2] in refusal(*arguments)


def test_a_path_with_a_zero_byte_is_refused():
    with pytest.raises(ResultsError, match="not a valid path"):
        resolved("made\0")


def test_folders_that_link_to_each_other_are_searched_once(here):
    Path("deep").mkdir()
    for name, target in (("up", ".."), ("same", "."), ("again", "../deep")):
        (here / "deep" / name).symlink_to(target)
    files, _ = scenario_files([here])
    assert [file.name for file in files] == [r"caf\xe9"]


def test_a_configuration_file_of_5000_brackets_is_refused(here):
    Path("deep.toml").write_text("a = " + 5000 * "[")
    assert refusal("run", "--config", "deep.toml") == (
        "deep.toml: not a configuration file: its brackets are nested too deeply\n"
    )
