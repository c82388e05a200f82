"""`interdrive score RUN --panel`."""

from __future__ import annotations

import csv
import io

import pytest
from click.testing import CliRunner

import interdrive as idr
from interdrive.cli import main
from interdrive.panel import PANEL_COLUMNS
from interdrive.results import save


def invoked(*arguments):
    result = CliRunner().invoke(main, ["score", *map(str, arguments)])
    return result.exit_code, result.stdout, result.stderr


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    run = idr.simulate("t_junction", agents=[1003, 1005], planner="idm", threads=1)
    return save(run, tmp_path_factory.mktemp("panel") / "run")


def test_a_saved_run_is_scored_against_a_panel(folder):
    before = sorted(path.name for path in folder.iterdir())
    code, text, _ = invoked(folder, "--panel", "default", "--agents", "1003")
    assert code == 0
    assert "panel: lawful, idm, idm_mobil, rollout" in text
    assert "hindrance" in text
    assert sorted(path.name for path in folder.iterdir()) == before, "it writes nothing"


def test_without_a_panel_the_command_says_that_scores_do_not_compare(folder):
    code, text, _ = invoked(folder, "--panel", "none")
    assert code == 0
    assert "absolute, without a panel" in text
    assert "several agents are scored" in text


def test_csv_has_all_columns(folder):
    code, text, _ = invoked(folder, "--panel", "none", "--csv")
    assert code == 0
    rows = list(csv.DictReader(io.StringIO(text)))
    assert list(rows[0]) == [column.name for column in PANEL_COLUMNS]
    assert [row["agent_id"] for row in rows] == ["1003", "1005"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--trust",), "--trust belongs to --panel"),
        (("--panel", "none", "--agents", "5"), "5 is not an agent of this run"),
        (("--panel", "none", "--set", "scoring.panel.ttc=-1"), "must not be negative"),
    ],
)
def test_bad_input_is_one_line(folder, arguments, message):
    code, _, errors = invoked(folder, *arguments)
    assert code == 2
    assert message in errors
    assert len(errors.strip().splitlines()) == 1


def test_batches_are_no_run_folders(tmp_path):
    (tmp_path / "batch.json").write_text("{}")
    code, _, errors = invoked(tmp_path, "--panel", "default")
    assert code == 2
    assert "--panel scores run folders, not batches" in errors
