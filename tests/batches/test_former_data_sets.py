"""Data sets of the release before: their score is score_1, and nothing is added to them."""

from __future__ import annotations

import json

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

import interdrive as idr
from interdrive.batches import query
from interdrive.batches.columns import COLUMNS, TRAFFIC_COLUMNS
from interdrive.cli import main
from interdrive.comparison import compare
from interdrive.comparison.scores import batch_scores
from interdrive.scoring import FORMER_COLUMNS, SCORE_COLUMNS

KEPT = (
    "fault",
    "fault_kind",
    "fault_nuplan",
    "collision_type",
    "room",
    "straight_ttc_min",
    "lane_keeping",
    "excused",
    "why",
)


@pytest.fixture(scope="module")
def former(tmp_path_factory):
    """A batch of two planners as the release before left it behind."""
    folder = tmp_path_factory.mktemp("former") / "batch"
    idr.batch(["t_junction"], folder, planner="idm,lawful", agents=1, workers=1)
    new = pq.read_table(folder / "results.parquet")
    later = {column.name for column in (*SCORE_COLUMNS, *TRAFFIC_COLUMNS)} - {*KEPT}
    kept = [column.name for column in COLUMNS if column.name not in later]
    table = new.select(kept).append_column("score", new["score_1"])
    for name in FORMER_COLUMNS:
        table = table.append_column(name, pa.array([0.5] * table.num_rows, pa.float64()))
    pq.write_table(table, folder / "results.parquet")
    (folder / "batch.json").write_text(json.dumps({"format": 5, "interdrive": "0.1.0"}))
    return folder, new


def test_what_they_call_their_score_is_score_1_and_new_columns_are_null(former):
    folder, new = former
    found = idr.read_batch(folder)
    assert found.column_names == [column.name for column in COLUMNS]
    order = {key: at for at, key in enumerate(new["key"].to_pylist())}
    rows = [order[key] for key in found["key"].to_pylist()]
    assert found["score_1"].to_pylist() == new["score_1"].take(rows).to_pylist()
    for name in ("score", "pace", "ttc_term", "hits", "panel", "in_time"):
        assert set(found[name].to_pylist()) == {None}, name
    assert found["lane_keeping"].to_pylist() == new["lane_keeping"].take(rows).to_pylist()
    assert idr.read_batch(folder, ["score_1"]).to_pydict() == {"score_1": found["score_1"].to_pylist()}
    assert idr.read_batch(folder, ["score"])["score"].null_count == new.num_rows


def test_comparisons_scores_and_questions_read_them(former):
    folder, new = former
    table = compare(folder).table.to_pylist()
    assert {row["score"] for row in table} == {None}
    assert all(row["score_1"] is not None for row in table)
    assert all(one.is_former and one.score == one.score_1 for one in batch_scores(folder))
    result = CliRunner().invoke(main, ["score", str(folder)])
    assert result.exit_code == 0
    assert "scored by an earlier release: score 1" in result.stdout
    assert query(folder, "select sum(score_1) from agents").rows[0][0] == pytest.approx(sum(new["score_1"].to_pylist()))


def test_nothing_is_added_to_them(former):
    with pytest.raises(idr.ResultsError, match="a batch of format 5, this version of interdrive writes format 6"):
        idr.batch(["t_junction"], former[0], planner="idm", agents=1, workers=1)


def test_other_columns_are_refused(former, tmp_path):
    folder = tmp_path / "batch"
    folder.mkdir()
    (folder / "batch.json").write_text(json.dumps({"format": 5}))
    table = pq.read_table(former[0] / "results.parquet")
    pq.write_table(table.drop_columns(["harm"]), folder / "results.parquet")
    with pytest.raises(idr.ResultsError, match="neither those of this version nor of the one before"):
        idr.read_batch(folder)
    pq.write_table(table.set_column(0, "key", pa.array([1] * table.num_rows)), folder / "results.parquet")
    with pytest.raises(idr.ResultsError, match="key"):
        idr.read_batch(folder)
