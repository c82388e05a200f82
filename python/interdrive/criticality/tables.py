"""Criticality as tables in long form, and their files in a folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.criticality.measures import MEASURES
from interdrive.storage import Column, arrow_table, check_order, check_table, labels, read_table, replacing, write_table

if TYPE_CHECKING:
    from interdrive.criticality.evaluate import Criticality
    from interdrive.storage import ArrowTable

_NAMES = tuple(measure.name for measure in MEASURES)

#: Columns of criticality.parquet, one row per judged participant, time step and measure.
COLUMNS = (
    Column("participant_id", "integer", "the evaluated participant"),
    Column("time_step", "integer", "when"),
    Column("measure", "label", "one of interdrive.criticality.MEASURES"),
    Column(
        "value",
        "number",
        "in the unit of the measure; inf: no conflict, null: cannot be computed",
        nullable=True,
        infinite=True,
    ),
    Column("partner_id", "integer", "the participant that was decisive", nullable=True),
    Column(
        "path",
        "label",
        "lanelets of the path that was decisive (12 > 15), or the two that cross in the conflict area (12 x 34)",
        nullable=True,
    ),
)

_TABLE, _EXTREMES = "criticality.parquet", "criticality_extremes.parquet"

#: Columns by which their rows are sorted.
_ORDERS = (("participant_id", "time_step", "measure"), ("participant_id", "measure"))


def criticality_table(found: Criticality) -> ArrowTable:
    """All measures in long form, sorted by participant, time step and measure, as an Arrow table."""
    row, step = np.nonzero(found.present)
    n = len(MEASURES)

    def stacked(field: str) -> Any:  # noqa: ANN401 - array of numbers
        return np.stack([getattr(found.series[name], field)[row, step] for name in _NAMES], axis=1).ravel()

    partner = stacked("partner_id")
    return arrow_table(
        COLUMNS,
        {
            "participant_id": np.repeat(found.participant_id[row], n),
            "time_step": np.repeat(found.first_time_step + step, n),
            "measure": labels(_NAMES, np.tile(np.arange(n), len(row))),
            "value": stacked("value"),
            "partner_id": np.ma.masked_equal(partner, -1),
            "path": labels(found.paths, stacked("path")),
        },
    )


def criticality_extremes_table(found: Criticality) -> ArrowTable:
    """The most critical value of every measure per participant, with the columns of `criticality_table`."""
    n = len(MEASURES)

    def stacked(field: str) -> Any:  # noqa: ANN401 - array of numbers
        return np.stack([getattr(found.extremes[name], field) for name in _NAMES], axis=1).ravel()

    return arrow_table(
        COLUMNS,
        {
            "participant_id": np.repeat(found.participant_id, n),
            "time_step": stacked("time_step"),
            "measure": labels(_NAMES, np.tile(np.arange(n), len(found.participant_id))),
            "value": stacked("value"),
            "partner_id": np.ma.masked_equal(stacked("partner_id"), -1),
            "path": labels(found.paths, stacked("path")),
        },
    )


def save_criticality(found: Criticality, folder: str | Path) -> None:
    """Writes criticality.parquet and criticality_extremes.parquet into a folder, both or none; older ones are replaced.

    Raises:
        ResultsError: if a file cannot be written; one line with path and cause.
    """
    with replacing(Path(folder) / _TABLE) as series:
        write_table(criticality_table(found), series)
        with replacing(Path(folder) / _EXTREMES) as extremes:
            write_table(criticality_extremes_table(found), extremes)


def stored_criticality(folder: str | Path) -> tuple[ArrowTable, ArrowTable] | None:
    """What `save_criticality` wrote, all values and the most critical ones; None if nothing was written.

    Raises:
        ResultsError: if a file is damaged or has other columns, or only one of them is there.
    """
    paths = Path(folder) / _TABLE, Path(folder) / _EXTREMES
    if not any(path.exists() for path in paths):
        return None
    series, extremes = (_stored(path, order) for path, order in zip(paths, _ORDERS, strict=True))
    return series, extremes


def _stored(path: Path, order: tuple[str, ...]) -> ArrowTable:
    table = read_table(path, COLUMNS)
    columns = dict(check_table(table, path, COLUMNS, {"measure": _NAMES}))
    columns["measure"] = np.array([_NAMES.index(name) for name in columns["measure"].tolist()], dtype=np.int64)
    check_order(columns, path, order)
    return table
