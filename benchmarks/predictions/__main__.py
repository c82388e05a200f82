"""Pictures of predictions and times per call, beside the tables of `interdrive predict-eval`.

    python benchmarks/predictions t_junction lane_merge                       # figures and scenes in out/predictions
    python benchmarks/predictions ../shared/scenarios --split training/split.toml --predictors neural lane_following

Draws, as PDF and PNG, mean distance over time, calibration, and a scene per category: the moment at which most vehicles
turn, brake or start. Prints the time per call as Markdown.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from figures import calibration_figure, error_figure
from scenes import example_scenes, scene_figure
from timing import measured_timings, timing_table

from interdrive.errors import InterdriveError
from interdrive.plots import save_figure
from interdrive.prediction_evaluation import PredictionEvaluation, evaluate_predictors

ROOT = Path(__file__).resolve().parents[2]


def draw(found: PredictionEvaluation, folder: Path) -> list[str]:
    """Draws all figures and returns the names of their files."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = {"error_over_time": error_figure(found), "calibration": calibration_figure(found)}
    drawn |= {f"scene_{scene.category}": scene_figure(scene) for scene in example_scenes(found)}
    files = [(figure, f"{name}.{ending}") for name, figure in drawn.items() for ending in ("pdf", "png")]
    for figure, file in files:
        save_figure(figure, folder / file)
    return [file for _, file in files]


def main() -> int:
    parser = argparse.ArgumentParser(prog="predictions", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("files", nargs="+", help="CommonRoad files, folders of them, names of shipped scenarios")
    parser.add_argument("--predictors", nargs="+", default=["all"])
    parser.add_argument("--every", type=int, default=5, help="time steps between predictions")
    parser.add_argument("--split", type=Path, help="only the validation part of this split")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "predictions")
    arguments = parser.parse_args()
    try:
        found = evaluate_predictors(
            arguments.files,
            arguments.predictors,
            every=arguments.every,
            split=arguments.split,
            workers=arguments.workers,
        )
    except InterdriveError as error:
        print(error, file=sys.stderr)
        return 2
    print(timing_table(measured_timings(found.choices, found.simulation)))
    print(f"\n{', '.join(draw(found, arguments.out))} in {arguments.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
