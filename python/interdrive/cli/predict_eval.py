"""`interdrive predict-eval`: prediction quality, measured on recordings."""

from __future__ import annotations

import os
from pathlib import Path

import click

from interdrive.cli.arguments import assigned, claimed_folder, named_files, raw_option, shown
from interdrive.config.binding import bind
from interdrive.errors import InputError


@click.command("predict-eval")
@click.argument("files", nargs=-1, metavar="FILE|FOLDER...")
@click.option(
    "--predictors",
    metavar="all|NAME[,SETTING=VALUE...],NAME",
    default="all",
    help="Predictors: all native ones (without ground_truth), names or module:object, each followed by its settings.",
)
@click.option(
    "--every", metavar="N", type=click.IntRange(min=1), default=5, help="Predict at every N-th time step (5)."
)
@click.option("--split", metavar="TOML", help="File that splits recordings by purpose (training/split.toml).")
@click.option("--part", metavar="NAME", default="validation", help="Part of the split to evaluate (validation).")
@click.option(
    "--set", "assignments", metavar="NAME=VALUE", multiple=True, help="A setting; `interdrive settings` lists them."
)
@raw_option
@click.option("--out", metavar="DIR", help="Folder of the evaluation (a new one under out/).")
@click.option("--overwrite", is_flag=True, help="Replace the evaluation in that folder.")
@click.option("--workers", metavar="N", type=click.IntRange(min=1), help="Processes that share the files (all cores).")
@click.option("--samples", is_flag=True, help="Also write every sample: samples.parquet.")
@click.option("--quiet", is_flag=True, help="Print only errors.")
def predict_eval(
    files: tuple[str, ...],
    predictors: str,
    every: int,
    split: str | None,
    part: str,
    assignments: tuple[str, ...],
    raw: bool,
    out: str | None,
    overwrite: bool,
    workers: int | None,
    samples: bool,
    quiet: bool,
) -> int:
    """Compare predictions with the recorded future of vehicles.

    FILE is a CommonRoad file or the name of a shipped scenario; a FOLDER stands for all files in it. Recordings are
    replayed, no vehicle plans. The results are position errors, likelihood, calibration, standing vehicles and points
    off the road, by category (the name of a file's folder: highway, intersection, urban, junction ...) and overall, as
    tables and Parquet files. With --split there are also results for recorded, simulated and invented traffic. A
    recording found in several files counts once.
    """
    if not files:
        raise InputError("predict-eval: no recordings; give files, folders or names of shipped scenarios")
    choices = named_predictors(predictors)
    settings_given = assigned(assignments, raw=raw)

    from interdrive.cli.prediction_report import print_prediction_evaluation  # noqa: PLC0415 - rich
    from interdrive.cli.report import progress  # noqa: PLC0415
    from interdrive.config.schema import SimulationSettings  # noqa: PLC0415
    from interdrive.prediction_evaluation import evaluate_predictors  # noqa: PLC0415
    from interdrive.prediction_evaluation.folder import EVALUATION_FOLDER, save_evaluation  # noqa: PLC0415

    settings = bind(SimulationSettings(), settings_given)
    read = [*(Path(file) for file in files if Path(file).exists()), *named_files(split, choices, settings_given)]
    with (
        claimed_folder(out, "predict-eval", EVALUATION_FOLDER, overwrite=overwrite, inputs=read) as folder,
        progress(quiet=quiet) as report,
    ):
        found = evaluate_predictors(
            files,
            choices,
            every=every,
            settings=settings,
            split=split,
            part=part,
            workers=workers or os.cpu_count() or 1,
            on_step=report.counted,
        )
        report.say("writing")
        save_evaluation(found, folder, overwrite=overwrite, with_samples=samples)
    if not quiet:
        print_prediction_evaluation(found, shown(folder))
    return 0


def named_predictors(text: str) -> list[str]:
    """Predictors from "NAME[,SETTING=VALUE...],NAME...", each as `simulate` takes it; "all" stands alone.

    Raises:
        InputError: The text does not have this syntax.
    """
    from interdrive.batches.plan import labels_of  # noqa: PLC0415 - numpy

    found = labels_of([text], "predictor")
    for name in found:
        first, *rest = name.split(",")
        if stray := [part for part in (first, *rest) if "=" in part and ("=" in first or first == "all")]:
            raise InputError(
                f"--predictors {text}: {stray[0]} belongs to no predictor; write NAME[,SETTING=VALUE...],NAME"
            )
    return found
