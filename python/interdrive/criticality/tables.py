"""Criticality as tables in long form, and their files in a folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from interdrive.criticality.measures import MEASURES
from interdrive.errors import ResultsError
from interdrive.storage import (
    Column,
    FolderKind,
    Origin,
    arrow_table,
    check_order,
    check_table,
    joined_tables,
    labels,
    origin_of,
    read_table,
    replacing,
    write_table,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.array_types import Bools, Ints
    from interdrive.storage import ArrowTable

_NAMES = tuple(measure.name for measure in MEASURES)

_UNITS = tuple(measure.unit or "1" for measure in MEASURES)

#: Columns of criticality.parquet, one row per judged participant, time step and measure.
COLUMNS = (
    Column("participant_id", "integer", "the evaluated participant"),
    Column("time_step", "integer", "when"),
    Column("measure", "label", "one of interdrive.criticality.MEASURES", labels=_NAMES),
    Column("unit", "label", "unit of the measure; 1: a number without unit", labels=sorted(set(_UNITS))),
    Column(
        "value",
        "number",
        "in the unit of the measure; inf: no conflict",
        "of the measure",
        null="it cannot be computed",
        infinite=True,
    ),
    Column("partner_id", "integer", "the participant that was decisive", null="no participant was"),
    Column(
        "path",
        "label",
        "lanelets of the path that was decisive (12 > 15), or the two that cross in the conflict area (12 x 34)",
        null="no path was",
    ),
)

_TABLE, _EXTREMES = "criticality.parquet", "criticality_extremes.parquet"

#: Columns of criticality_joint.parquet, one row per file, judged participant and measure.
JOINT_COLUMNS = (Column("scenario", "label", "name of the file or run, as the command prints it"), *COLUMNS)

_JOINT = "criticality_joint.parquet"

#: A folder for tables and figures; a run folder gets them, too.
CRITICALITY_FOLDER = FolderKind("criticality evaluation", _TABLE, lambda entry: entry.name.startswith("criticality"))

#: Columns by which their rows are sorted.
_ORDERS = (("participant_id", "time_step", "measure"), ("participant_id", "measure"))


class Evaluated(Protocol):
    """`interdrive.criticality.Criticality`."""

    @property
    def participant_id(self) -> Ints: ...  # noqa: D102
    @property
    def first_time_step(self) -> int: ...  # noqa: D102
    @property
    def present(self) -> Bools: ...  # noqa: D102
    @property
    def series(self) -> Mapping[str, Any]: ...  # noqa: D102
    @property
    def extremes(self) -> Mapping[str, Any]: ...  # noqa: D102
    @property
    def paths(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def origin(self) -> Origin: ...  # noqa: D102


def criticality_table(found: Evaluated) -> ArrowTable:
    """All measures in long form, sorted by participant, time step and measure, as an Arrow table."""
    row, step = np.nonzero(found.present)
    values = {
        field: [getattr(found.series[name], field)[row, step] for name in _NAMES]
        for field in ("value", "partner_id", "path")
    }
    return _long_form(found, row, {"time_step": [found.first_time_step + step] * len(_NAMES), **values})


def criticality_extremes_table(found: Evaluated) -> ArrowTable:
    """The most critical value of every measure per participant, with the columns of `criticality_table`."""
    values = {
        field: [getattr(found.extremes[name], field) for name in _NAMES]
        for field in ("time_step", "value", "partner_id", "path")
    }
    return _long_form(found, np.arange(len(found.participant_id)), values)


def _long_form(found: Evaluated, row: Ints, values: dict[str, list[Any]]) -> ArrowTable:
    """A row per measure for each of some rows of participants; of every column an array per measure is given."""
    measure = np.tile(np.arange(len(_NAMES)), len(row))
    columns = {name: np.stack(parts, axis=1).ravel() for name, parts in values.items()}
    about = {
        "participant_id": np.repeat(found.participant_id[row], len(_NAMES)),
        "measure": labels(_NAMES, measure),
        "unit": labels(_UNITS, measure),
        "path": labels(found.paths, columns.pop("path")),
    }
    return arrow_table(COLUMNS, about | columns)


def save_criticality(found: Evaluated, folder: str | Path) -> None:
    """Writes criticality.parquet and criticality_extremes.parquet into a folder, both or none; older ones are replaced.

    Raises:
        ResultsError: if a file cannot be written; one line with path and cause.
    """
    with replacing(Path(folder) / _TABLE) as series:
        write_table(criticality_table(found), series, found.origin)
        with replacing(Path(folder) / _EXTREMES) as extremes:
            write_table(criticality_extremes_table(found), extremes, found.origin)


def save_joint_criticality(found: Mapping[str, ArrowTable], folder: str | Path) -> Path:
    """Writes criticality_joint.parquet: the most critical values of several evaluations in one table.

    Args:
        found: Tables of `criticality_extremes_table` with their origins, by names of the evaluations.
        folder: Where it is written.

    Returns:
        Its path.

    Raises:
        ResultsError: if the file cannot be written; one line with path and cause.
    """
    tables = []
    for name, extremes in found.items():
        named = labels((name,), np.zeros(extremes.num_rows, dtype=np.int64))
        values = {column: extremes[column].combine_chunks() for column in extremes.column_names}
        tables.append(arrow_table(JOINT_COLUMNS, {"scenario": named, **values}))
    origins = {name: origin_of(extremes) or Origin() for name, extremes in found.items()}
    settings = next((origin.settings for origin in origins.values()), {})
    inputs = {f"{name}: {what}": digest for name, one in origins.items() for what, digest in one.inputs.items()}
    path = Path(folder) / _JOINT
    with replacing(path) as partial:
        write_table(joined_tables(JOINT_COLUMNS, tables), partial, Origin(settings, inputs))
    return path


def stored_criticality(folder: str | Path) -> tuple[ArrowTable, ArrowTable] | None:
    """What `save_criticality` wrote, all values and the most critical ones; None if nothing was written.

    Raises:
        ResultsError: if a file is damaged or has other columns, or only one of them is there.
    """
    paths = Path(folder) / _TABLE, Path(folder) / _EXTREMES
    if not any(path.exists() for path in paths):
        return None
    series, extremes = (_stored(path, order) for path, order in zip(paths, _ORDERS, strict=True))
    if origin_of(series) != origin_of(extremes):
        raise ResultsError(f"{folder}: {_TABLE} and {_EXTREMES} are of different evaluations; evaluate again")
    return series, extremes


def _stored(path: Path, order: tuple[str, ...]) -> ArrowTable:
    table = read_table(path, COLUMNS, added=("unit",))
    there = [column for column in COLUMNS if column.name in table.column_names]
    columns = dict(check_table(table, path, there))
    columns["measure"] = np.array([_NAMES.index(name) for name in columns["measure"].tolist()], dtype=np.int64)
    check_order(columns, path, order)
    return table
