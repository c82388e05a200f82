"""The folder of a study: its tables, and per case the runs and figures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from interdrive.plots import save_figure
from interdrive.results import holds_run, origin_of_run, save, software
from interdrive.storage import FolderKind, Origin, resolved, whole_folder, write_json, write_table
from interdrive.studies.figures import profile_figure, scene_figure
from interdrive.studies.result import DEGREES, study_table

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from interdrive.studies.result import CaseStudy

_TABLES = ("table.parquet", "table.csv")
_MARK = "study.json"
_ENDINGS = ("pdf", "png")
_FIGURES = tuple(f"{name}.{ending}" for name in ("profiles", "scenes") for ending in _ENDINGS)


def _belongs(entry: Path) -> bool:
    if not entry.is_dir():
        return entry.name in (*_TABLES, _MARK)
    return all(inside.name in _FIGURES or (inside.name in DEGREES and holds_run(inside)) for inside in entry.iterdir())


def _origin(studies: Sequence[CaseStudy]) -> Origin:
    """The settings of the interactive runs, all of which have the same; scenarios and states of all runs."""
    settings: dict[str, Any] = {}
    inputs: dict[str, str] = {}
    for study in studies:
        for degree, run in study.runs.items():
            told = origin_of_run(run)
            inputs |= {study.scenario.name: run.scenario.sha256, f"{study.name}/{degree}": run.digest}
            if degree == "interactive":
                settings |= {name: value for name, value in told.settings.items() if name != "agents"}
    return Origin(settings, inputs)


STUDY_FOLDER = FolderKind("study", _MARK, _belongs)


def save_study(
    studies: Sequence[CaseStudy],
    folder: str | Path,
    *,
    overwrite: bool = False,
    on_case: Callable[[str], None] | None = None,
) -> Path:
    """Writes the folder of a study, whole or not at all, and returns its path.

    It holds table.parquet and table.csv, and for every case a folder `<scenario>_<agent>_<other>` with one run folder
    per degree and the figures profiles and scenes, as PDF and PNG.

    Args:
        studies: What to write; their names must differ.
        folder: A new or empty folder, or the folder of another study.
        overwrite: Replace the other study. A folder with anything else in it is never touched.
        on_case: Called with the name of every case before it is written.

    Raises:
        ResultsError: if the folder cannot be used or written; one line with path and cause.
    """
    inputs = [study.scenario.path for study in studies if study.scenario.path is not None]
    with whole_folder(folder, STUDY_FOLDER, overwrite=overwrite, inputs=inputs) as partial:
        table, origin = study_table(studies), _origin(studies)
        for name in _TABLES:
            write_table(table, partial / name, origin)
        for study in studies:
            if on_case is not None:
                on_case(study.name)
            for degree, run in study.runs.items():
                save(run, partial / study.name / degree)
            for name, figure in (("profiles", profile_figure(study)), ("scenes", scene_figure(study))):
                for ending in _ENDINGS:
                    save_figure(figure, partial / study.name / f"{name}.{ending}")
        cases = [
            {
                "folder": study.name,
                "scenario": study.scenario.name,
                "agent": study.agent,
                "other": study.other,
                # What verify repeats is in the run folders.
                "planner": study.planner,
                "predictor": str(study.runs["interactive"].settings["predictor"]),
            }
            for study in studies
        ]
        told = {"settings": dict(origin.settings), "inputs": dict(origin.inputs), **software()}
        write_json({"cases": cases, **told}, partial / _MARK)
    return resolved(folder)
