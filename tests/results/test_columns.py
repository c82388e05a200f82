"""A column is declared once: schema, files, reading, checks, docstring, reference page and data set follow."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import interdrive as idr
from interdrive.batches import COLUMNS as DATA_SET
from interdrive.comparison import DIFFERENCE_COLUMNS, TABLE_COLUMNS
from interdrive.criticality.tables import COLUMNS as CRITICALITY
from interdrive.prediction_evaluation.tables import MEASURE_COLUMNS, SAMPLE_COLUMNS
from interdrive.results import COLUMNS
from interdrive.run import Outcomes
from interdrive.scoring import SCORE_COLUMNS
from interdrive.storage import (
    Column,
    Origin,
    Record,
    arrow_table,
    check_table,
    integer,
    label,
    number,
    read_table,
    text,
    truth,
    write_parquet,
)
from interdrive.studies.cooperation import COLUMNS as COOPERATION
from interdrive.studies.runtime.measure import STEP_COLUMNS

ROOT = Path(__file__).parents[2]
EVERY = {
    **COLUMNS,
    "batch": DATA_SET,
    "criticality": CRITICALITY,
    "score": SCORE_COLUMNS,
    "comparison": TABLE_COLUMNS,
    "differences": DIFFERENCE_COLUMNS,
    "measures": MEASURE_COLUMNS,
    "samples": SAMPLE_COLUMNS,
    "cooperation": COOPERATION,
    "steps": STEP_COLUMNS,
}


@dataclass(frozen=True)
class Visits(Record):
    """Visits of a place."""

    visitor_id: np.ndarray = field(metadata=integer("who came", null="nobody"))
    _day = Column("day", "integer", "number of the day")
    stay: np.ndarray = field(metadata=number("how long it stayed", "s", null="it is still there"))
    welcome: np.ndarray = field(metadata=truth("whether it was expected"))
    weather: np.ndarray = field(metadata=label("weather then", ("rain", "sun"), coded=True))
    mood: tuple[str, ...] = field(metadata=label("how it was", ("good", "bad"), null="it did not say"))
    words: tuple[str, ...] = field(metadata=text("what it said"))


VISITS = Visits(
    np.array([3, -1]), np.array([2.5, np.nan]), np.array([True, False]), np.array([1, 0]), ("good", ""), ("hello", "")
)


def visits():
    return arrow_table(Visits.columns, {**VISITS.arrays, "day": [1, 2]})


@pytest.mark.parametrize("name", EVERY)
def test_every_column_says_its_unit_or_that_it_has_none_and_what_it_means(name):
    for column in EVERY[name]:
        assert column.text, column.name
        assert bool(column.unit) == (column.kind in ("integer", "number")), column.name
        assert "[" not in column.text or name == "violations", column.name  # a unit in the text is no unit


@pytest.mark.parametrize(("kind", "unit"), [("number", ""), ("text", "m"), ("truth", "1")])
def test_a_number_without_unit_and_a_unit_without_number_are_refused(kind, unit):
    with pytest.raises(TypeError, match="column x: a number states its unit"):
        Column("x", kind, "something", unit)


def test_the_table_of_a_record_has_a_column_per_declaration_in_their_order(tmp_path):
    assert visits().to_pylist() == [
        {"visitor_id": 3, "day": 1, "stay": 2.5, "welcome": True, "weather": "sun", "mood": "good", "words": "hello"},
        {"visitor_id": None, "day": 2, "stay": None, "welcome": False, "weather": "rain", "mood": None, "words": ""},
    ]


def test_a_file_says_unit_meaning_and_reason_for_null_of_its_columns(tmp_path):
    write_parquet(visits(), tmp_path / "visits.parquet", Origin())
    schema = pq.read_schema(tmp_path / "visits.parquet")
    assert schema.field("stay").metadata == {
        b"description": b"how long it stayed [s]",
        b"unit": b"s",
        b"null": b"it is still there",
    }
    assert schema.field("words").metadata[b"unit"] == b""
    assert b"null" not in schema.field("day").metadata


def test_a_record_is_read_back_from_the_file_of_its_table(tmp_path):
    path = tmp_path / "visits.parquet"
    write_parquet(visits(), path, Origin())
    again = Visits.of(read_table(path, Visits.columns))
    for name in Visits.stored:
        assert type(getattr(again, name)) is type(getattr(VISITS, name))
        np.testing.assert_array_equal(getattr(again, name), getattr(VISITS, name))


def test_a_missing_column_and_an_unknown_label_are_refused_in_one_line(tmp_path):
    path = tmp_path / "visits.parquet"
    write_parquet(visits().drop_columns(["stay"]), path, Origin())
    with pytest.raises(idr.ResultsError, match="the columns are not those of a run"):
        read_table(path, Visits.columns)
    with pytest.raises(idr.ResultsError, match="mood: 'good' is not one of bad; the file is damaged"):
        check_table(visits(), path, (Column("mood", "label", "how it was", null="none", labels=("bad",)),))


def test_a_class_documents_the_arrays_that_it_declares():
    assert "    stay: How long it stayed [s]; nan: it is still there.\n" in Visits.__doc__
    assert "    visitor_id: Who came; -1: nobody.\n" in Visits.__doc__


def test_a_column_that_one_place_names_is_in_schema_files_batches_and_references(tmp_path):
    named = subprocess.run(
        ["git", "grep", "-l", "off_lanelets_s", "--", "python/*.py", "crates/*.rs"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    ).stdout.split()  # fmt: skip
    if named:  # the sources may lie in no repository
        assert [path for path in named if path.endswith(".py")] == ["python/interdrive/run/arrays.py"]
        assert len(named) <= 3
    assert "off_lanelets_s: How long it was more than road.gap_tolerance [s]." in Outcomes.__doc__
    assert "off_lanelets_s" in [column.name for column in DATA_SET]
    run = idr.simulate("t_junction", agents=1, planner="idm", settings={"step.max_steps": 3})
    read = idr.load(run.save(tmp_path / "run"))
    np.testing.assert_array_equal(read.outcomes.off_lanelets_s, run.outcomes.off_lanelets_s)
    assert pq.read_schema(tmp_path / "run" / "outcomes.parquet").field("off_lanelets_s").metadata[b"unit"] == b"s"
    sys.path.insert(0, str(ROOT / "docs" / "extensions"))
    try:
        import generated_pages
    finally:
        sys.path.pop(0)
    row = "| `off_lanelets_s` | double | s | how long it was more than road.gap_tolerance |"
    assert row in generated_pages.run_folder()
    assert row in generated_pages.data_set()
