"""The folder of a runtime study: all steps, and their summary."""

from __future__ import annotations

from typing import TYPE_CHECKING

from interdrive.results import software
from interdrive.storage import FolderKind, Origin, resolved, whole_folder, write_json, write_table
from interdrive.studies.runtime.summary import growth, summary_table

if TYPE_CHECKING:
    from pathlib import Path

    from interdrive.studies.runtime.measure import RuntimeStudy

_MARK = "runtime.json"
#: The pictures are of older versions.
_FIGURES = tuple(f"{name}.{ending}" for name in ("runtime", "growth") for ending in ("pdf", "png"))
_FILES = ("steps.parquet", "summary.parquet", "summary.csv", _MARK, *_FIGURES)

RUNTIME_FOLDER = FolderKind("runtime study", _MARK, lambda entry: entry.name in _FILES)


def save_runtime(study: RuntimeStudy, folder: str | Path, *, overwrite: bool = False) -> Path:
    """Writes the folder, whole or not at all, and returns its path.

    It holds steps.parquet (one row per step), summary.parquet and summary.csv, and runtime.json (machine, settings,
    growth).

    Raises:
        ResultsError: if the folder cannot be used or written; one line with path and cause.
    """
    with whole_folder(folder, RUNTIME_FOLDER, overwrite=overwrite) as partial:
        origin = Origin(study.settings, study.inputs)
        write_table(study.steps, partial / "steps.parquet", origin)
        summary = summary_table(study)
        for name in ("summary.parquet", "summary.csv"):
            write_table(summary, partial / name, origin)
        grown = {threads: growth(study, threads) for threads in sorted({1, study.threads})}
        write_json(
            {
                "machine": study.machine,
                "settings": study.settings,
                "inputs": dict(study.inputs),
                **software(),
                "threads": study.threads,
                "notes": list(study.notes),
                "growth": {str(threads): vars(one) for threads, one in grown.items() if one is not None},
            },
            partial / _MARK,
        )
    return resolved(folder)
