"""The folder of an evaluation: its tables, and how it came about."""

from __future__ import annotations

from hashlib import sha256
from typing import TYPE_CHECKING

from interdrive.files import content_of_input
from interdrive.prediction_evaluation import curves, tables
from interdrive.results import software
from interdrive.storage import FolderKind, Origin, changed_settings, resolved, whole_folder, write_json, write_table
from interdrive.storage.names import readable

if TYPE_CHECKING:
    from pathlib import Path

    from interdrive.prediction_evaluation.tables import PredictionEvaluation

_MARK = "evaluation.json"
_TABLES = {
    "measures": tables.measures_table,
    "calibration": curves.calibration_table,
    "error_over_time": curves.error_table,
    "samples": tables.samples_table,
}


def _belongs(entry: Path) -> bool:
    return entry.name == _MARK or (entry.suffix == ".parquet" and entry.stem in _TABLES)


EVALUATION_FOLDER = FolderKind("prediction evaluation", _MARK, _belongs)


def save_evaluation(
    found: PredictionEvaluation, folder: str | Path, *, overwrite: bool = False, with_samples: bool = False
) -> Path:
    """Writes the folder, whole or not at all, and returns its path.

    It holds measures.parquet, calibration.parquet, error_over_time.parquet, and evaluation.json with files, settings
    and versions.

    Args:
        found: What to write.
        folder: A new or empty folder, or the folder of another evaluation.
        overwrite: Replace the other evaluation. A folder with anything else in it is never touched.
        with_samples: Write samples.parquet, too: every sample of every predictor.

    Raises:
        ResultsError: if the folder cannot be used or written; one line with path and cause.
    """
    with whole_folder(folder, EVALUATION_FOLDER, overwrite=overwrite) as partial:
        origin = _origin(found)
        for name, table in _TABLES.items():
            if name != "samples" or with_samples:
                write_table(table(found), partial / f"{name}.parquet", origin)
        about = {"predictors": list(found.predictors), **found.settings, "notes": list(found.notes)}
        write_json({**about, **software()}, partial / _MARK)
    return resolved(folder)


def _origin(found: PredictionEvaluation) -> Origin:
    """What was asked for, settings that are not the defaults, and the content of all files."""
    inputs = {readable(file.name): sha256(content_of_input(file)).hexdigest() for file in found.files}
    asked = {name: value for name, value in found.settings.items() if name != "files"}
    return Origin({"predictors": list(found.predictors), **asked, **changed_settings(found.simulation)}, inputs)
