"""`interdrive score` on runs and batches, and scores in batches, comparisons and pages."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest
from click.testing import CliRunner

import interdrive as idr
from interdrive.cli import main
from interdrive.comparison.scores import batch_scores, planner_score
from interdrive.report.contents import run_contents
from interdrive.results import save
from interdrive.scoring.total import GATES


def invoked(*arguments):
    result = CliRunner().invoke(main, ["score", *map(str, arguments)])
    return result.exit_code, result.stdout, result.stderr


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    run = idr.simulate("t_junction", agents=[1003, 1005], planner="idm")
    return save(run, tmp_path_factory.mktemp("scores") / "run")


@pytest.fixture(scope="module")
def batch(tmp_path_factory):
    out = tmp_path_factory.mktemp("scores") / "batch"
    idr.batch(["t_junction"], planner="idm,recorded", agents=2, out=out, workers=1, keep="all")
    return out


def test_a_run_gets_its_table_and_pages_show_it(folder):
    code, text, _ = invoked(folder)
    assert code == 0
    assert "1003" in text
    assert (folder / "score.parquet").exists()
    agents = {p["id"]: p for p in run_contents(folder).header["participants"] if p["agent"] >= 0}
    assert agents[1003]["score"] == idr.score(idr.load(folder)).score[0]


def test_other_settings_and_chosen_agents_are_printed_only(folder, tmp_path):
    before = (folder / "score.parquet").exists()
    code, text, _ = invoked(folder, "--agents", 1005, "--set", "scoring.panel.comfort=0", "--csv")
    rows = list(csv.DictReader(io.StringIO(text)))
    assert (code, [row["agent_id"] for row in rows]) == (0, ["1005"])
    assert (folder / "score.parquet").exists() == before


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--agents", "x"], "--agents x: write them as 12,34"),
        (["--agents", "7"], "7 is not an agent of this run"),
        (["--set", "scoring.jerk=3"], "jerk"),
        (["--set", "scoring.overspeed=0"], "overspeed: must be positive, is 0.0"),
    ],
)
def test_bad_input_is_one_line(folder, arguments, said):
    code, _, text = invoked(folder, *arguments)
    assert (code, text.count("\n")) == (2, 1)
    assert said in text


def test_a_folder_that_is_no_run_is_refused_in_one_line(tmp_path):
    code, _, text = invoked(tmp_path)
    assert (code, text.count("\n")) == (2, 1)


def test_batches_have_scores_and_put_scenarios_together(batch):
    rows = idr.read_batch(batch).to_pylist()
    # Agent 2001 is a planning problem without a recording.
    assert [row["score_1"] for row in rows if row["planner"] == "recorded" and row["agent_id"] != 2001] == [1.0]
    assert {row["panel"] for row in rows} == {"", None}
    found = {one.variant: one for one in batch_scores(batch)}
    idm = [row["score"] for row in rows if row["planner"] == "idm"]
    assert found["idm"].score == pytest.approx(100.0 * np.mean(idm))
    human = found["recorded"]  # 2001 has no recording
    assert (human.zeros, human.n_agents, human.n_left_out, human.n_common) == ({}, 1, 1, 1)
    code, text, _ = invoked(batch, "--csv")
    assert (code, [row["variant"] for row in csv.DictReader(io.StringIO(text))]) == (0, ["idm", "recorded"])
    assert (batch / "recordings" / rows[0]["key"] / "score.parquet").exists()
    assert invoked(batch, "--agents", 1)[0] == 2


def test_an_agent_that_was_lost_counts_as_0_and_scenarios_count_alike():
    rows = {
        "variant": np.array(["a"] * 4, dtype=object),
        "traffic": np.array(["recorded"] * 4, dtype=object),
        "agents": np.array(["alone"] * 4, dtype=object),
        "status": np.array(["finished", "finished", "finished", "crashed"], dtype=object),
        "scenario_sha256": np.array(["x", "x", "y", "y"], dtype=object),
        "seed": np.zeros(4),
        "agent_id": np.array([1.0, 2.0, 1.0, np.nan]),
        "under_test": np.array([1.0, 1.0, 1.0, np.nan]),
        "outcome": np.array(["goal_reached", "collision", "goal_reached", None], dtype=object),
        "off_road": np.array([0.0, 1.0, 0.0, np.nan]),
        **{f"gate_{name}": np.array([1.0, 1.0, 1.0, np.nan]) for name in GATES},
        "fault": np.array([0.0, 0.0, 0.0, np.nan]),
        "fault_nuplan": np.zeros(4),
        "fault_kind": np.array(["", "", "", None], dtype=object),
        "score": np.array([1.0, 0.0, 0.8, np.nan]),
        "score_1": np.array([0.5, 0.0, 0.8, np.nan]),
        "panel": np.array(["", "", "", None], dtype=object),
    }
    found = planner_score(rows, np.ones(4, dtype=bool), {"x": {(0, 1), (0, 2)}, "y": {(0, 1), (0, 7)}})
    assert found.by_scenario == {"x": 0.5, "y": 0.4}
    assert found.score == pytest.approx(45.0)
    assert (found.n_agents, found.zeros, found.reached) == (4, {"lost": 1, "off_road": 1}, 50.0)
    assert np.isnan([found.low, found.high]).all(), "two places have no interval"
