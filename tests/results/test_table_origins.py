"""Every table that the program writes says units, settings that are not the defaults, version and inputs."""

from __future__ import annotations

import csv
import hashlib
import json
import shutil

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

import interdrive as idr
from interdrive.cli import main
from interdrive.config.binding import bind
from interdrive.criticality.tables import stored_criticality
from interdrive.files import shipped_scenario
from interdrive.results import read_results
from interdrive.scoring import stored_score
from interdrive.storage import changed_settings, is_of, origin_of

SHORT = ("--planner", "idm", "--set", "step.max_steps=3", "--quiet")
SCENARIO = hashlib.sha256(shipped_scenario("t_junction").read_bytes()).hexdigest()


def invoke(*arguments):
    done = CliRunner().invoke(main, [str(one) for one in arguments], catch_exceptions=False)
    assert done.exit_code in (0, 1), done.output
    return done


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder in which every command that writes a table has written its tables."""
    folder = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        invoke("run", "t_junction", "--agents", "2", *SHORT, "--seed", "3", "--out", "run")
        invoke("criticality", "run", "--set", "deceleration=3", "--quiet")
        invoke("score", "run")
        invoke("criticality", "lane_merge", "--quiet", "--out", "recorded")
        invoke("batch", "t_junction", "--agents", "1", *SHORT, "--workers", "1", "--keep", "all", "--out", "batch")
        invoke("compare", "batch", "--samples", "100", "--quiet")
        invoke("predict-eval", "t_junction", "--every", "40", "--predictors", "constant_velocity",
               "--samples", "--workers", "1", "--quiet", "--out", "predicted")  # fmt: skip
        invoke("study", "lane_merge", "--agent", "1001", "--other", "1002", *SHORT, "--out", "study")
    return folder


def origins(folder, pattern):
    found = {path: pq.read_table(path) for path in sorted(folder.glob(pattern))}
    assert found, pattern
    return found


@pytest.mark.long
def test_every_column_of_every_parquet_file_has_its_unit_its_meaning_and_why_it_is_null(made):
    for path, table in origins(made, "**/*.parquet").items():
        for field in table.schema:
            told = field.metadata or {}
            is_number = pa.types.is_floating(field.type) or pa.types.is_integer(field.type)
            assert bool(told[b"unit"]) == is_number, (path, field.name, told)
            assert told[b"description"], (path, field.name)
            assert bool(told.get(b"null")) == field.nullable, (path, field.name)


def test_every_parquet_file_has_version_settings_and_inputs(made):
    for path, table in origins(made, "**/*.parquet").items():
        told = origin_of(table)
        assert told is not None, path
        assert told.version == idr.__version__
        assert told.inputs, path


@pytest.mark.parametrize(
    ("pattern", "column", "unit"),
    [
        ("run/outcomes.parquet", "impact_speed", "m/s"),
        ("run/states.parquet", "orientation", "rad"),
        ("run/states.parquet", "x", "m"),
        ("run/violations.parquet", "value", "of the rule"),
        ("run/score.parquet", "room", "m"),
        ("run/score.parquet", "straight_ttc_min", "s"),
        ("run/score.parquet", "score", "1"),
        ("run/criticality.parquet", "value", "of the measure"),
        ("batch/results.parquet", "jerk_rms", "m/s³"),
        ("batch/results.parquet", "thw_min", "s"),
        ("batch/comparison/table.parquet", "goal_reached", "%"),
        ("batch/comparison/table.parquet", "plan_ms", "ms"),
        ("predicted/samples.parquet", "fde_3", "m"),
        ("predicted/samples.parquet", "nll", "nat"),
        ("study/table.parquet", "max_btn", "1"),
    ],
)
def test_units_are_those_of_the_values(made, pattern, column, unit):
    for table in origins(made, pattern).values():
        assert table.schema.field(column).metadata[b"unit"].decode() == unit


def test_the_tables_of_a_run_say_what_was_chosen(made):
    for name in ("states", "outcomes", "plans", "timing", "routes"):
        told = origin_of(pq.read_table(made / "run" / f"{name}.parquet"))
        assert told.settings == {"agents": 2, "planner": "idm", "seed": 3, "step.max_steps": 3}
        assert told.inputs["scenario"] == SCENARIO
        assert told.inputs["run"] == json.loads((made / "run" / "run.json").read_text())["digest"]


def test_criticality_says_its_settings_and_the_unit_of_every_value(made):
    for name in ("criticality", "criticality_extremes"):
        table = pq.read_table(made / "run" / f"{name}.parquet")
        assert origin_of(table).settings == {"deceleration": 3.0}
        rows = {(row["measure"], row["unit"]) for row in table.select(["measure", "unit"]).to_pylist()}
        assert {("ttc", "s"), ("btn", "1"), ("a_long_req", "m/s²"), ("dce", "m")} <= rows
        assert not origin_of(pq.read_table(made / "recorded" / f"{name}.parquet")).settings


def test_a_study_says_settings_version_and_inputs(made):
    told = json.loads((made / "study" / "study.json").read_text())
    assert told["settings"]["step.max_steps"] == 3
    assert told["settings"]["planner"]
    assert told["versions"]["interdrive"] == idr.__version__
    assert told["inputs"]["lane_merge"] == hashlib.sha256(shipped_scenario("lane_merge").read_bytes()).hexdigest()


def test_csv_begins_with_the_origin_and_the_units_and_is_a_table_behind_them(made):
    for path in (made / "study" / "table.csv", made / "batch" / "comparison" / "differences.csv"):
        lines = path.read_text(encoding="utf-8").splitlines()
        head = [line for line in lines if line.startswith("# ")]
        assert lines[: len(head)] == head
        assert head[0] == f"# interdrive {idr.__version__}"
        assert [line.partition(":")[0] for line in head[1:]] == [
            "# settings that differ from the defaults",
            "# SHA-256 of inputs",
            "# units",
        ]
        rows = list(csv.DictReader(lines[len(head) :]))
        assert list(rows[0] if rows else []) in ([], pq.read_table(path.with_suffix(".parquet")).column_names)
    assert "step.max_steps=3" in (made / "study" / "table.csv").read_text(encoding="utf-8")


def test_a_markdown_table_ends_with_its_origin(made):
    text = (made / "batch" / "comparison" / "comparison.md").read_text(encoding="utf-8")
    assert f"\ninterdrive {idr.__version__}\n" in text
    assert "settings that differ from the defaults: samples=100" in text


def test_tables_of_two_evaluations_do_not_pass_for_one(made, tmp_path):
    shutil.copytree(made / "run", tmp_path / "run")
    shutil.copyfile(made / "recorded" / "criticality.parquet", tmp_path / "run" / "criticality.parquet")
    with pytest.raises(idr.ResultsError, match="are of different evaluations; evaluate again"):
        stored_criticality(tmp_path / "run")


def older(path, *, without=()):
    """Rewrites a file as older versions did: without origin and units, and without newer columns."""
    table = pq.read_table(path).replace_schema_metadata(None).drop_columns(list(without))
    bare = [pa.field(one.name, one.type, one.nullable) for one in table.schema]
    pq.write_table(pa.Table.from_arrays(table.columns, schema=pa.schema(bare)), path)


def test_folders_of_older_versions_are_read(made, tmp_path):
    shutil.copytree(made / "run", tmp_path / "run")
    for path in (tmp_path / "run").glob("*.parquet"):
        older(path, without=("unit",) if path.name.startswith("criticality") else ())
    idr.load(tmp_path / "run")
    assert stored_criticality(tmp_path / "run") is not None
    invoke("report", tmp_path / "run", "--quiet")
    shutil.copytree(made / "batch", tmp_path / "batch")
    older(tmp_path / "batch" / "results.parquet")
    invoke("compare", tmp_path / "batch", "--samples", "100", "--quiet")


def test_a_table_of_another_run_is_not_shown_as_that_of_this_one(made, tmp_path):
    shutil.copytree(made / "run", tmp_path / "run")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        invoke("run", "t_junction", "--agents", "1", *SHORT, "--out", "other")
    for name in ("score", "criticality", "criticality_extremes"):
        shutil.copyfile(made / "run" / f"{name}.parquet", tmp_path / "other" / f"{name}.parquet")
    digest = read_results(tmp_path / "other").info["digest"]
    assert not is_of(stored_criticality(tmp_path / "other")[0], digest)
    assert not is_of(stored_score(tmp_path / "other"), digest)
    invoke("report", tmp_path / "other", "--quiet")  # evaluates anew


def test_changed_settings_are_told_by_dotted_names():
    assert changed_settings(idr.SimulationSettings()) == {}
    assert changed_settings(bind(idr.SimulationSettings(), {"step.max_steps": 7})) == {"step.max_steps": 7}
