"""The folder of a study of flow: its table, figure and what was asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from interdrive.config.binding import flatten
from interdrive.config.schema import SimulationSettings
from interdrive.plots import save_figure
from interdrive.results import software
from interdrive.storage import FolderKind, Origin, resolved, whole_folder, write_json, write_table
from interdrive.studies.flow.figure import flow_figure

if TYPE_CHECKING:
    from pathlib import Path

    from interdrive.studies.flow.measure import FlowStudy

_MARK = "flow.json"
_TABLES = ("table.parquet", "table.csv")
_FIGURES = ("flow.pdf", "flow.png")

FLOW_FOLDER = FolderKind("study of flow", _MARK, lambda entry: entry.name in (*_TABLES, *_FIGURES, _MARK))


def save_flow(study: FlowStudy, folder: str | Path, *, overwrite: bool = False) -> Path:
    """Writes the folder of a study of flow, whole or not at all, and returns its path.

    It holds the table as Parquet and CSV, the figure flow as PDF and PNG, and flow.json (planners, predictor, times,
    settings of the runs).

    Args:
        study: The study.
        folder: A new or empty folder, or that of another study of flow.
        overwrite: Replace the other one.

    Raises:
        ResultsError: The folder cannot be used or written; one line with path and cause.
    """
    usual = flatten(SimulationSettings())
    changed = {name: value for name, value in study.settings.items() if value != usual.get(name)}
    origin = Origin({**changed, "planner": ",".join(study.planners), "seed": study.seed}, {})
    with whole_folder(folder, FLOW_FOLDER, overwrite=overwrite) as partial:
        for name in _TABLES:
            write_table(study.table, partial / name, origin)
        for name in _FIGURES:
            save_figure(flow_figure(study), partial / name)
        write_json(
            {
                "planners": list(study.planners),
                "predictor": study.predictor,
                "duration": study.duration,
                "warm_up": study.warm_up,
                "seed": study.seed,
                "settings": dict(study.settings),
                **software(),
            },
            partial / _MARK,
        )
    return resolved(folder)
