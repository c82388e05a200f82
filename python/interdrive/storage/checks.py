"""Checks the values and the order of stored tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import ResultsError
from interdrive.scenario.limits import LARGEST_ID
from interdrive.storage.tables import decoded

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    import pyarrow as pa

    from interdrive.storage.columns import Column

    Columns = Mapping[str, Any]

#: Largest finite number in a table, in any unit.
_NUMBER_MAX = 1e30


class Damage(Exception):  # noqa: N818 - becomes a ResultsError that names the file
    """Damage of a table, without the name of the file."""


def check_values(table: pa.Table, path: Path, columns: Sequence[Column]) -> None:
    """Raises ResultsError for an impossible value; the line names file and column."""
    try:
        for column in columns:
            _check_column(table[column.name], column)
    except Damage as cause:
        raise ResultsError(f"{path}: {cause}; the file is damaged") from None


def check_table(table: pa.Table, path: Path, columns: Sequence[Column]) -> Columns:
    """The columns of one table as arrays, absent integers as -1.

    Raises:
        ResultsError: As for `check_values`.
    """
    check_values(table, path, columns)
    return {column.name: decoded(table[column.name], column) for column in columns}


def check_order(columns: Columns, path: Path, order: Sequence[str]) -> None:
    """Raises ResultsError unless rows are sorted by these columns, and no two rows have the same values in them.

    Absent numbers are equal to each other.
    """
    n = max(0, len(columns[order[0]]) - 1)
    is_ascending, is_equal = np.zeros(n, dtype=np.bool_), np.ones(n, dtype=np.bool_)
    for name in order:
        step = np.diff(np.nan_to_num(columns[name], nan=-1.0))
        is_ascending |= is_equal & (step > 0)
        is_equal &= step == 0
    wrong = np.flatnonzero(~is_ascending)
    if len(wrong):
        raise ResultsError(
            f"{path}: {', '.join(order)}: row {int(wrong[0]) + 1} is out of order or a duplicate; the file is damaged"
        )


def _check_column(column: pa.ChunkedArray, about: Column) -> None:
    if about.kind == "label":
        texts = column.unique().cast("string")
        if texts.null_count and not about.nullable:
            raise Damage(f"{about.name}: a value is missing")
        known = texts.to_pylist() if about.labels is None else [None, *about.labels]
        unknown = [text for text in texts.to_pylist() if text not in known]
        if unknown:
            raise Damage(f"{about.name}: {unknown[0]!r} is not one of {', '.join(about.labels or ())}")
    elif column.null_count and not about.nullable:
        raise Damage(f"{about.name}: a value is missing")
    elif about.kind == "integer":
        values = decoded(column, about)
        refuse(about.name, values, (values > LARGEST_ID) | (values < -LARGEST_ID), "is too large")
    elif about.kind == "number":
        numbers = decoded(column, about)
        if not about.nullable:
            refuse(about.name, numbers, np.isnan(numbers), "is not a number")
        wrong = np.isfinite(numbers) & (np.abs(numbers) > _NUMBER_MAX)
        if not about.infinite:
            wrong |= np.isinf(numbers)
        refuse(about.name, numbers, wrong, "is too large")


def refuse(name: str, values: Any, wrong: Any, why: str) -> None:  # noqa: ANN401 - arrays
    """Raises Damage for the first value that is wrong."""
    rows = np.flatnonzero(wrong)
    if len(rows):
        raise Damage(f"{name}: {values[rows[0]]} in row {int(rows[0])} {why}")
