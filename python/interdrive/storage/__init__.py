"""Tables and folders on disk: described columns, checks of input, and atomic writing of files and folders.

pyarrow is loaded on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from interdrive.storage.checks import check_order, check_table, check_values
from interdrive.storage.columns import (
    Column,
    absent_where,
    inserted,
    integer,
    label,
    named,
    number,
    text,
    truth,
    without,
)
from interdrive.storage.folders import (
    FolderKind,
    check_folder,
    check_tables,
    claimed,
    claimed_new,
    keep_inputs,
    whole_folder,
)
from interdrive.storage.frames import Tabled
from interdrive.storage.origin import Origin, changed_settings, is_of, origin_of, units_of
from interdrive.storage.reading import read_json
from interdrive.storage.records import Record
from interdrive.storage.tables import (
    TableWriter,
    arrow_table,
    column_names,
    joined_tables,
    labels,
    read_table,
    schema_of,
    write_parquet,
    write_table,
)
from interdrive.storage.writing import json_text, not_a_link, one_line, replacing, resolved, write_json

if TYPE_CHECKING:
    from interdrive.storage.tables import ArrowTable

__all__ = [
    "ArrowTable",
    "Column",
    "FolderKind",
    "Origin",
    "Record",
    "TableWriter",
    "Tabled",
    "absent_where",
    "arrow_table",
    "changed_settings",
    "check_folder",
    "check_order",
    "check_table",
    "check_tables",
    "check_values",
    "claimed",
    "claimed_new",
    "column_names",
    "inserted",
    "integer",
    "is_of",
    "joined_tables",
    "json_text",
    "keep_inputs",
    "label",
    "labels",
    "named",
    "not_a_link",
    "number",
    "one_line",
    "origin_of",
    "read_json",
    "read_table",
    "replacing",
    "resolved",
    "schema_of",
    "text",
    "truth",
    "units_of",
    "whole_folder",
    "without",
    "write_json",
    "write_parquet",
    "write_table",
]
