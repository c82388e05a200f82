"""The run folder: its Parquet columns, its one writer and its one reader. pyarrow is loaded on first use.

A run folder holds outcomes.parquet, states.parquet, plans.parquet, timing.parquet, run.json and scenario.xml; and
views.parquet, predictions.parquet and candidates.parquet if the settings `record.*` request them. Equal runs give equal
bytes. Absent numbers are null.
"""

from __future__ import annotations

from interdrive.results.columns import COLUMNS
from interdrive.results.folder import RUN_FOLDER, Results, check_target, holds_run, read_results, save
from interdrive.results.information import FORMAT, RunInformation, information, origin_of_run, software
from interdrive.results.reader import read_part, read_run, sumo_names, with_cooperation, with_demand, with_routes
from interdrive.results.tables import (
    candidates_table,
    outcome_table,
    plans_table,
    predictions_table,
    routes_table,
    states_table,
    timing_table,
)

__all__ = [
    "COLUMNS",
    "FORMAT",
    "RUN_FOLDER",
    "Results",
    "RunInformation",
    "candidates_table",
    "check_target",
    "holds_run",
    "information",
    "origin_of_run",
    "outcome_table",
    "plans_table",
    "predictions_table",
    "read_part",
    "read_results",
    "read_run",
    "routes_table",
    "save",
    "software",
    "states_table",
    "sumo_names",
    "timing_table",
    "with_cooperation",
    "with_demand",
    "with_routes",
]
