"""The folder of an evaluation: its tables, its figures, and how it came about."""

from __future__ import annotations

from typing import TYPE_CHECKING

from interdrive.prediction_evaluation import curves, tables
from interdrive.results import software
from interdrive.storage import check_folder, replacing, write_json, write_table

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


def check_evaluation_target(folder: str | Path, *, overwrite: bool = False) -> Path:
    """The folder an evaluation can be saved to, as an absolute path; useful before a long one.

    Raises:
        ResultsError: if something is there that must not be replaced.
    """
    return check_folder(folder, "prediction evaluation", _MARK, _belongs, overwrite=overwrite)


def _belongs(entry: Path) -> bool:
    name = entry.stem
    return entry.name == _MARK or (
        (entry.suffix == ".parquet" and name in _TABLES)
        or (entry.suffix in _ENDINGS and (name in ("error_over_time", "calibration") or name.startswith("scene_")))
    )


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
        folder: New or empty folder, or one that holds another evaluation.
        overwrite: Replace the other evaluation. A folder with anything else in it is never touched.
        with_samples: Write samples.parquet, too: every sample of every predictor.
        with_figures: Draw.
        on_figure: Called with a line before every figure.

    Raises:
        ResultsError: if the folder cannot be used or written; one line with path and cause.
    """
    target = check_evaluation_target(folder, overwrite=overwrite)
    with replacing(target) as partial:
        partial.mkdir()
        for name, table in _TABLES.items():
            if name != "samples" or with_samples:
                write_table(table(found), partial / f"{name}.parquet")
        about = {"predictors": list(found.predictors), **found.settings, "notes": list(found.notes)}
        write_json({**about, **software()}, partial / _MARK)
        if with_figures:
            _draw(found, partial, on_figure)
    return target


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
