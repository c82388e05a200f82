"""Tables and folders on disk: described columns, checks of input, and atomic writing of files and folders.

pyarrow is loaded on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from interdrive.storage.checks import check_order, check_table, check_values
from interdrive.storage.tables import Column, arrow_table, labels, read_table, schema_of, write_parquet, write_table
from interdrive.storage.writing import (
    check_folder,
    json_text,
    not_a_link,
    one_line,
    read_json,
    replacing,
    resolved,
    write_json,
)

if TYPE_CHECKING:
    from interdrive.storage.tables import ArrowTable

__all__ = [
    "ArrowTable",
    "Column",
    "arrow_table",
    "check_folder",
    "check_order",
    "check_table",
    "check_values",
    "json_text",
    "labels",
    "not_a_link",
    "one_line",
    "read_json",
    "read_table",
    "replacing",
    "resolved",
    "schema_of",
    "write_json",
    "write_parquet",
    "write_table",
]
