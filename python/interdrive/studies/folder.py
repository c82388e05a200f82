"""The folder of a study: its tables, and per case the runs and figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from interdrive.plots import save_figure
from interdrive.results import holds_run, save
from interdrive.storage import check_folder, replacing, write_json, write_table
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


def check_study_target(folder: str | Path, *, overwrite: bool = False) -> Path:
    """The folder a study can be saved to, as an absolute path; useful before long simulations.

    Raises:
        ResultsError: if something is there that must not be replaced.
    """
    return check_folder(folder, "study", _MARK, _belongs, overwrite=overwrite)


def _belongs(entry: Path) -> bool:
    if not entry.is_dir():
        return entry.name in (*_TABLES, _MARK)
    return all(inside.name in _FIGURES or (inside.name in DEGREES and holds_run(inside)) for inside in entry.iterdir())


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
        folder: New or empty folder, or one that holds another study.
        overwrite: Replace the other study. A folder with anything else in it is never touched.
        on_case: Called with the name of every case before it is written.

    Raises:
        ResultsError: if the folder cannot be used or written; one line with path and cause.
    """
    target = check_study_target(folder, overwrite=overwrite)
    with replacing(target) as partial:
        partial.mkdir()
        table = study_table(studies)
        for name in _TABLES:
            write_table(table, partial / name)
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
        write_json({"cases": cases}, partial / _MARK)
    return target
