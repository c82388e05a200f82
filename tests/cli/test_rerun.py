"""`interdrive rerun`: the run of a folder once more, also where the folder is of an older version."""

import json
import shutil

import pytest
from click.testing import CliRunner

from interdrive import load
from interdrive.cli import main


def call(*arguments):
    return CliRunner().invoke(main, list(map(str, arguments)))


@pytest.fixture(scope="module")
def old(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rerun") / "old"
    choices = ["--agents", "2", "--planner", "idm", "--predictor", "constant_velocity", "--threads", "1", "--quiet"]
    assert call("run", "t_junction", *choices, "--out", folder).exit_code == 0
    return folder


def changed(old, folder, change):
    """A copy of the folder with another run.json."""
    shutil.copytree(old, folder)
    info = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    change(info)
    (folder / "run.json").write_text(json.dumps(info), encoding="utf-8")
    return folder


def test_a_run_of_this_version_is_repeated_to_the_last_bit(old, tmp_path):
    done = call("rerun", old, "--out", tmp_path / "new")
    assert done.exit_code == 0
    assert done.stdout.splitlines()[-1] == "all states are equal to the last bit"
    assert load(tmp_path / "new").digest == load(old).digest


def test_a_folder_of_an_older_version_is_read_and_lost_settings_are_named(old, tmp_path):
    def older(info):
        info["format"] = 1
        info["settings"]["settings"]["planner.frenet.forgotten"] = 3

    folder = changed(old, tmp_path / "older", older)
    assert "is that of an older interdrive" in call("verify", folder).stderr
    done = call("rerun", folder, "--out", tmp_path / "new")
    assert done.exit_code == 0
    assert "planner.frenet.forgotten = 3: this setting no longer exists and is left out" in done.stdout
    assert "all states are equal to the last bit" in done.stdout


def test_what_is_to_differ_differs_and_agents_that_end_differently_are_named(old, tmp_path):
    done = call("rerun", old, "--planner", "frenet", "--set", "step.max_steps=20", "--out", tmp_path / "new")
    assert done.exit_code == 0
    lines = done.stdout.splitlines()
    assert "the states differ from those of the old run" in lines
    assert any(line.startswith("agent 2001: ") and line.endswith(" before, time_limit now") for line in lines)
    assert set(load(tmp_path / "new").outcomes.planner) == {"frenet"}


def test_code_outside_interdrive_is_imported_only_if_it_is_trusted(old, tmp_path):
    folder = changed(old, tmp_path / "foreign", lambda info: info["settings"].update(planner="nowhere:Planner"))
    assert "add --trust" in call("rerun", folder, "--out", tmp_path / "new").stderr


@pytest.mark.parametrize(
    ("change", "more", "words"),
    [
        (lambda info: info["scenario"].update(path="gone.xml"), [], "gone.xml: the scenario of the run is gone"),
        (lambda info: info["scenario"].update(path=None), [], "came from memory"),
        (lambda info: info.pop("settings"), [], "does not say how to repeat the run"),
        (lambda info: info["settings"].update(repeatable=False), [], "repeat it in Python"),
        (lambda info: info["settings"].update(planner=3), ["--trust"], "planner"),
        (lambda info: None, ["--set", "nothing=1"], "nothing: no such setting"),
        (lambda info: None, ["--set", "step.max_steps"], "write it as name=value"),
    ],
)
def test_what_cannot_be_repeated_is_one_line(old, tmp_path, change, more, words):
    done = call("rerun", changed(old, tmp_path / "changed", change), *more, "--out", tmp_path / "new")
    assert done.exit_code == 2, done.output
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert words in done.stderr
    assert not (tmp_path / "new").exists()


def test_a_folder_that_is_no_run_is_one_line(tmp_path):
    assert "it has no run.json" in call("rerun", tmp_path).stderr
    (tmp_path / "batch.json").write_text("{}", encoding="utf-8")
    assert "it is a batch" in call("rerun", tmp_path).stderr


def test_a_shipped_scenario_that_has_moved_with_interdrive_is_found(old, tmp_path):
    def moved(info):
        info["scenario"]["path"] = "/gone/site-packages/interdrive/scenarios/t_junction.xml"

    folder = changed(old, tmp_path / "moved", moved)
    done = call("rerun", folder, "--out", tmp_path / "new")
    assert done.stdout.splitlines()[-1] == "all states are equal to the last bit"
    given = call("rerun", folder, "--scenario", "t_junction", "--out", tmp_path / "given")
    assert given.stdout.splitlines()[-1] == "all states are equal to the last bit"
    lost = call("rerun", folder, "--scenario", "nowhere", "--out", tmp_path / "lost")
    assert lost.exit_code == 2
    assert "nowhere: there is no such file, and no scenario of this name is shipped" in lost.stderr
