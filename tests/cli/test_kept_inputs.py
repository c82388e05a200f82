"""No command replaces what it reads, however the path is written."""

from __future__ import annotations

import hashlib
import shutil
from dataclasses import replace

import pytest
from click.testing import CliRunner
from invented_run import invented_run

import interdrive as idr
from interdrive.cli import main
from interdrive.files import shipped_scenario
from interdrive.results import save


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A working folder with a run folder `a`, whose scenario is a good input."""
    monkeypatch.chdir(tmp_path)
    save(invented_run(), "a")
    shutil.copyfile(shipped_scenario("t_junction"), "a/scenario.xml")
    return tmp_path


def contents(folder):
    return {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.rglob("*") if path.is_file()}


def refused(*arguments):
    done = CliRunner().invoke(main, list(arguments))
    assert done.exit_code == 2, done.output
    assert done.stderr.count("\n") == 1
    return done.stderr


REPLACED = "which is read; choose another path"


@pytest.mark.parametrize(
    "scenario", ["a/scenario.xml", "./a/../a/scenario.xml", "link.xml", "b/scenario.xml", "ABSOLUTE"]
)
@pytest.mark.parametrize("out", ["a", "./a/", "a/../a", "ABSOLUTE"])
def test_a_run_never_replaces_its_scenario(here, scenario, out):
    (here / "link.xml").symlink_to("a/scenario.xml")
    (here / "b").symlink_to("a")
    before = contents(here)
    read = str(here / "a" / "scenario.xml") if scenario == "ABSOLUTE" else scenario
    target = str(here / "a") if out == "ABSOLUTE" else out
    assert REPLACED in refused("run", read, "--out", target, "--overwrite", "--quiet")
    assert contents(here) == before


def test_a_link_in_the_folder_to_a_scenario_elsewhere_stays(here):
    (here / "a" / "scenario.xml").rename(here / "elsewhere.xml")
    (here / "a" / "scenario.xml").symlink_to("../elsewhere.xml")
    assert REPLACED in refused("run", "a/scenario.xml", "--out", "a", "--overwrite")
    assert (here / "a" / "scenario.xml").is_symlink()


def test_a_configuration_in_the_folder_names_both_and_is_kept(here):
    (here / "a" / "solution.xml").write_text('[run]\nscenario = "t_junction"\nout = "a"\noverwrite = true\n')
    before = contents(here)
    assert "a/solution.xml, which is read" in refused("run", "--config", "a/solution.xml", "--out", "a")
    (here / "c.toml").write_text('[run]\nscenario = "a/scenario.xml"\nout = "a"\noverwrite = true\n')
    before = contents(here)
    assert "a/scenario.xml, which is read" in refused("run", "--config", "c.toml")
    assert contents(here) == before


@pytest.mark.parametrize(
    "choice",
    [
        ("--planner", "policy,file=a/solution.xml"),
        ("--agent", "1=policy,file=./a/solution.xml"),
        ("--predictor", "neural,weights=a/solution.xml"),
        ("--set", "predictor.neural.weights=a/solution.xml"),
    ],
)
def test_weights_in_the_folder_are_kept(here, choice):
    (here / "a" / "solution.xml").write_bytes(b"weights")
    line = refused("run", "t_junction", *choice, "--out", "a", "--overwrite")
    assert "solution.xml, which is read" in line


@pytest.mark.parametrize("out", ["a/run.json", "./a/states.parquet", "a/scenario.xml", "link", "away.xml"])
def test_a_solution_never_replaces_a_part_of_its_run(here, out, monkeypatch):
    monkeypatch.setattr("interdrive.files.solution.write_solution", lambda *_, **__: b"<solution/>")
    (here / "link").symlink_to("a/outcomes.parquet")
    made = invented_run()
    shutil.copyfile(shipped_scenario("t_junction"), "away.xml")
    away = replace(
        made.scenario, path=here / "away.xml", sha256=hashlib.sha256((here / "away.xml").read_bytes()).hexdigest()
    )
    save(replace(made, scenario=away), "a", overwrite=True)
    before = contents(here)
    assert REPLACED in refused("solution", "a", "--out", out)
    assert contents(here) == before


def test_a_page_or_picture_never_replaces_a_part_of_its_run_through_a_link(here):
    save(invented_run(), "b")
    for name in ("page.html", "picture.png", "figure.pdf"):
        (here / name).symlink_to("b/run.json")
    before = contents(here)
    assert REPLACED in refused("report", "b", "--out", "page.html")
    assert REPLACED in refused("explain", "b", "1", "--png", "picture.png")
    assert REPLACED in refused("plot", "b", "--kind", "velocity", "--out", "figure.pdf")
    assert contents(here) == before


def test_a_study_never_replaces_its_scenario(here):
    (here / "made" / "case" / "interactive").mkdir(parents=True)
    (here / "made" / "study.json").write_text("{}")
    shutil.copytree("a", "made/case/interactive", dirs_exist_ok=True)
    line = refused(
        "study", "made/case/interactive/scenario.xml", "--agent", "1", "--other", "2", "--out", "made", "--overwrite"
    )
    assert REPLACED in line


def test_a_batch_never_drives_a_recording_of_its_own(here):
    done = idr.batch("t_junction", "made", planner="idm", agents=1, workers=1, keep="all")
    (recording,) = (done.folder / "recordings").iterdir()
    assert REPLACED in refused("batch", str(recording / "scenario.xml"), "--out", "made", "--retry")


def test_a_folder_beside_its_input_is_written(here):
    shutil.copyfile(shipped_scenario("t_junction"), "mine.xml")
    done = CliRunner().invoke(
        main, ["run", "mine.xml", "--agents", "1", "--planner", "idm", "--out", "mine", "--quiet"]
    )
    assert done.exit_code == 0, done.output
