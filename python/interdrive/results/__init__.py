"""The run folder: its Parquet columns, its one writer and its one reader. pyarrow is loaded on first use.

A run folder holds outcomes.parquet, states.parquet, plans.parquet, timing.parquet, run.json and scenario.xml; and
views.parquet, predictions.parquet and candidates.parquet if the settings `record.*` asked for them. The same run gives
the same bytes. Absent numbers are null.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from interdrive.results.columns import COLUMNS
from interdrive.results.folder import Results, check_target, holds_run, load, save
from interdrive.results.information import FORMAT, information, software
from interdrive.results.schema import read_json
from interdrive.results.tables import (
    candidates_table,
    outcome_table,
    plans_table,
    predictions_table,
    states_table,
    timing_table,
    views_table,
)
from interdrive.results.tabular import Column, arrow_table, labels, read_table, write_parquet, write_table
from interdrive.results.validation import check_order, check_table, check_values
from interdrive.results.writing import check_folder, json_text, not_a_link, one_line, replacing, resolved, write_json

if TYPE_CHECKING:
    from interdrive.results.tabular import ArrowTable

__all__ = [
    "COLUMNS",
    "FORMAT",
    "ArrowTable",
    "Column",
    "Results",
    "arrow_table",
    "candidates_table",
    "check_folder",
    "check_order",
    "check_table",
    "check_target",
    "check_values",
    "holds_run",
    "information",
    "json_text",
    "labels",
    "load",
    "not_a_link",
    "one_line",
    "outcome_table",
    "plans_table",
    "predictions_table",
    "read_json",
    "read_table",
    "replacing",
    "resolved",
    "save",
    "software",
    "states_table",
    "timing_table",
    "views_table",
    "write_json",
    "write_parquet",
    "write_table",
]
