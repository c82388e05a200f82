"""The folder of an evaluation: its tables, its figures, and how it came about."""

from __future__ import annotations

from hashlib import sha256
from typing import TYPE_CHECKING

from interdrive.files import content_of_input
from interdrive.prediction_evaluation import curves, tables
from interdrive.results import software
from interdrive.storage import FolderKind, Origin, changed_settings, resolved, whole_folder, write_json, write_table
from interdrive.storage.names import readable

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from matplotlib.figure import Figure

    from interdrive.prediction_evaluation.tables import PredictionEvaluation

_MARK = "evaluation.json"
_TABLES = {
    "measures": tables.measures_table,
    "calibration": curves.calibration_table,
    "error_over_time": curves.error_table,
    "timing": tables.timing_table,
    "samples": tables.samples_table,
}
_ENDINGS = (".pdf", ".png")


def _belongs(entry: Path) -> bool:
    name = entry.stem
    return entry.name == _MARK or (
        (entry.suffix == ".parquet" and name in _TABLES)
        or (entry.suffix in _ENDINGS and (name in ("error_over_time", "calibration") or name.startswith("scene_")))
    )


EVALUATION_FOLDER = FolderKind("prediction evaluation", _MARK, _belongs)


def save_evaluation(
    found: PredictionEvaluation,
    folder: str | Path,
    *,
    overwrite: bool = False,
    with_samples: bool = False,
    with_figures: bool = True,
    on_figure: Callable[[str], None] | None = None,
) -> Path:
    """Writes the folder, whole or not at all, and returns its path.

    It holds measures.parquet, calibration.parquet, error_over_time.parquet, timing.parquet, evaluation.json with files,
    settings and versions; figures of error and calibration and a scene per category, as PDF and PNG.

    Args:
        found: What to write.
        folder: A new or empty folder, or the folder of another evaluation.
        overwrite: Replace the other evaluation. A folder with anything else in it is never touched.
        with_samples: Write samples.parquet, too: every sample of every predictor.
        with_figures: Draw.
        on_figure: Called with a line before every figure.

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
        if with_figures:
            _draw(found, partial, on_figure)
    return resolved(folder)


def _origin(found: PredictionEvaluation) -> Origin:
    """What was asked for, settings that are not the defaults, and the content of all files."""
    inputs = {readable(file.name): sha256(content_of_input(file)).hexdigest() for file in found.files}
    asked = {name: value for name, value in found.settings.items() if name != "files"}
    return Origin({"predictors": list(found.predictors), **asked, **changed_settings(found.simulation)}, inputs)


def _draw(found: PredictionEvaluation, folder: Path, on_figure: Callable[[str], None] | None) -> None:
    """Loads matplotlib."""
    from interdrive.plots import save_figure  # noqa: PLC0415
    from interdrive.prediction_evaluation.figures import calibration_figure, error_figure  # noqa: PLC0415
    from interdrive.prediction_evaluation.scenes import example_scenes, scene_figure  # noqa: PLC0415

    def write(name: str, figure: Figure) -> None:
        for ending in _ENDINGS:
            save_figure(figure, folder / f"{name}{ending}")

    def say(text: str) -> None:
        if on_figure is not None:
            on_figure(text)

    say("drawing error and calibration")
    write("error_over_time", error_figure(found))
    write("calibration", calibration_figure(found))
    for scene in example_scenes(found):
        say(f"drawing a scene of {scene.category}")
        write(f"scene_{scene.category}", scene_figure(scene))
