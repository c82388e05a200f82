"""JSON of other tools: parsed once, with bounds, and points as arrays whatever is in it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import InputError
from interdrive.files.sources.polylines import distinct

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Floats


def json_object(data: bytes, file: str) -> dict[str, Any]:
    """The object that a JSON document is.

    Raises:
        InputError: It is broken, too deep, or no object; one line.
    """
    try:
        found = json.loads(data)
    except json.JSONDecodeError as error:
        raise InputError(
            f"{file}: line {error.lineno}, column {error.colno}: {error.msg}; give a whole file"
        ) from error
    except (UnicodeDecodeError, ValueError) as error:
        raise InputError(f"{file}: is no JSON text ({' '.join(str(error).split())[:80]}); give a whole file") from error
    except RecursionError:
        raise InputError(f"{file}: is nested too deeply; is the file damaged?") from None
    if not isinstance(found, dict):
        raise InputError(f"{file}: is a JSON {type(found).__name__}, not an object; give a scenario or a map")
    return found


def points_of(rows: object) -> Floats:
    """Objects with x and y as a polyline [m], shape (points, 2), without what is no point or equals the one before."""
    points = numbers_of(rows, ("x", "y"))
    points = points[np.isfinite(points).all(axis=1)]
    return points[distinct(points)]


def numbers_of(rows: object, columns: Sequence[str]) -> Floats:
    """Objects with numbers as a table, shape (rows, columns): nan for what is no number, empty for what is no list."""
    if not isinstance(rows, list):
        return np.zeros((0, len(columns)))
    try:
        table = np.array([[row[name] for name in columns] for row in rows], dtype=np.float64)
    except (TypeError, KeyError, ValueError, OverflowError, IndexError):
        table = np.array([[_number(row, name) for name in columns] for row in rows], dtype=np.float64)
    return table.reshape(-1, len(columns))


def _number(row: object, name: str) -> float:
    value = row.get(name) if isinstance(row, dict) else None
    if isinstance(value, bool) or not isinstance(value, int | float):
        return float("nan")
    try:
        return float(value)
    except OverflowError:
        return float("nan")
