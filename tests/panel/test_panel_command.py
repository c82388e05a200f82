"""`interdrive score RUN` with and without a panel."""

from __future__ import annotations

import csv
import io

import pytest
from click.testing import CliRunner

import interdrive as idr
from interdrive.cli import main
from interdrive.report.contents import run_contents
from interdrive.results import save
from interdrive.scoring import stored_score
from interdrive.scoring.tables import COLUMNS


def invoked(*arguments):
    result = CliRunner().invoke(main, ["score", *map(str, arguments)])
    return result.exit_code, result.stdout, result.stderr


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    run = idr.simulate("t_junction", agents=[1003, 1005], planner="idm", threads=1)
    return save(run, tmp_path_factory.mktemp("panel") / "run")


def test_one_agent_is_scored_against_a_panel(folder):
    before = sorted(path.name for path in folder.iterdir())
    code, text, _ = invoked(folder, "--agents", "1003")
    assert code == 0
    assert "panel: lawful, idm, idm_mobil, rollout" in text
    assert "hindrance" in text
    assert sorted(path.name for path in folder.iterdir()) == before, "it writes nothing"


def test_without_a_panel_the_command_says_that_scores_do_not_compare(folder):
    for options in ((), ("--panel", "none")):
        code, text, _ = invoked(folder, *options)
        assert code == 0
        assert "absolute, without a panel" in text


def test_pages_show_the_stored_score(folder, monkeypatch):
    monkeypatch.setattr("interdrive.panel.scores.PANEL", ("lawful", "idm"))
    code, text, _ = invoked(folder, "--panel", "default")
    assert code == 0
    assert "several agents are scored" in text
    stored = stored_score(folder).to_pylist()
    assert [row["panel"] for row in stored] == ["lawful, idm"] * 2
    agents = {p["id"]: p for p in run_contents(folder).header["participants"] if p["agent"] >= 0}
    assert [agents[row["agent_id"]]["score"] for row in stored] == [row["score"] for row in stored]


def test_csv_has_all_columns(folder):
    code, text, _ = invoked(folder, "--panel", "none", "--csv")
    assert code == 0
    rows = list(csv.DictReader(io.StringIO(text)))
    assert list(rows[0]) == [column.name for column in COLUMNS]
    assert [row["agent_id"] for row in rows] == ["1003", "1005"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--panel", "none", "--agents", "5"), "5 is not an agent of this run"),
        (("--panel", "none", "--set", "scoring.panel.ttc=-1"), "must not be negative"),
    ],
)
def test_bad_input_is_one_line(folder, arguments, message):
    code, _, errors = invoked(folder, *arguments)
    assert code == 2
    assert message in errors
    assert len(errors.strip().splitlines()) == 1


def test_batches_are_scored_as_they_run(tmp_path):
    (tmp_path / "batch.json").write_text("{}")
    code, _, errors = invoked(tmp_path, "--panel", "default")
    assert code == 2
    assert "batches are scored as they run; options apply to run folders" in errors
