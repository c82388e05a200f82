"""`interdrive realism`: how far planners drive from recorded people."""

from __future__ import annotations

import os
from pathlib import Path
from typing import cast, get_args

import click

from interdrive.cli.arguments import assigned, claimed_folder, raw_option, shown
from interdrive.errors import InputError


@click.command()
@click.argument("files", nargs=-1, metavar="FILE|FOLDER...")
@click.option(
    "--planner",
    "planners",
    metavar="PLANNER[,NAME=VALUE...][,PLANNER...]",
    default="rollout",
    help="Planners to measure (rollout), each followed by its settings.",
)
@click.option(
    "--drivers", metavar="NAME|FILE", help="Population of which all of these planners have drivers, as drivers=NAME."
)
@click.option("--goals", metavar="INFORMATION", default="turns", help="What agents know: timed, place, route or turns.")
@click.option(
    "--rollouts", metavar="N", type=int, default=8, help="Rollouts of each start, for planners that draw (8)."
)
@click.option("--horizon", metavar="SECONDS", type=float, default=8.0, help="Length of rollouts (8).")
@click.option("--long", metavar="SECONDS", type=float, default=40.0, help="Length of long rollouts (40); 0: none.")
@click.option("--starts", metavar="S,S", help="Times in each recording at which agents begin to plan.")
@click.option("--seed", metavar="N", type=click.IntRange(min=0), default=0, help="Seed of all that is drawn (0).")
@click.option(
    "--set", "assignments", metavar="NAME=VALUE", multiple=True, help="A setting; `interdrive settings` lists them."
)
@raw_option
@click.option("--any-traffic", is_flag=True, help="Take simulated and invented traffic, too.")
@click.option("--out", metavar="DIR", help="Folder of the evaluation (a new one under out/).")
@click.option("--overwrite", is_flag=True, help="Replace the evaluation in that folder.")
@click.option(
    "--workers", metavar="N", type=click.IntRange(min=1), help="Processes that share the windows (all cores)."
)
@click.option("--quiet", is_flag=True, help="Print only errors.")
def realism(
    files: tuple[str, ...],
    planners: str,
    drivers: str | None,
    goals: str,
    rollouts: int,
    horizon: float,
    long: float,
    starts: str | None,
    seed: int,
    assignments: tuple[str, ...],
    raw: bool,
    any_traffic: bool,
    out: str | None,
    overwrite: bool,
    workers: int | None,
    quiet: bool,
) -> int:
    """Measure how far planners drive from recorded people.

    FILE is a CommonRoad file with recorded traffic, a FOLDER stands for all files in it; windows of one recording are
    joined. Vehicles replay until a start, then plan. The results are energy scores of positions, CRPS of speeds,
    distances of distributions, a classifier that tries to tell planners from people, collisions, and how drivers differ
    in long drives; beside the planners stand the recording, constant velocity, and what recorded vehicles in a like
    situation did.
    """
    if not files:
        raise InputError("realism: no recordings; give files or folders")

    from interdrive.cli.realism_report import print_realism  # noqa: PLC0415 - rich
    from interdrive.cli.report import progress  # noqa: PLC0415
    from interdrive.scenario.known_goals import Information  # noqa: PLC0415 - numpy
    from interdrive.traffic_realism import realism as measured  # noqa: PLC0415
    from interdrive.traffic_realism.folder import REALISM_FOLDER, save_realism  # noqa: PLC0415

    if goals not in get_args(Information):
        raise InputError(f"--goals {goals}: expected {', '.join(get_args(Information))}")
    read = [Path(file) for file in files if Path(file).exists()]
    with (
        claimed_folder(out, "realism", REALISM_FOLDER, overwrite=overwrite, inputs=read) as folder,
        progress(quiet=quiet) as report,
    ):
        found = measured(
            files,
            _with_drivers(planners, drivers),
            goals=cast("Information", goals),
            rollouts=rollouts,
            horizon=horizon,
            long=long,
            starts=[] if starts is None else _times(starts),
            seed=seed,
            settings=assigned(assignments),
            raw=raw,
            any_traffic=any_traffic,
            workers=workers or os.cpu_count() or 1,
            on_step=report.counted,
        )
        report.say("writing")
        save_realism(found, folder, overwrite=overwrite)
    if not quiet:
        print_realism(found, shown(folder))
    return 0


def _with_drivers(planners: str, drivers: str | None) -> list[str]:
    """Planners, each with these drivers."""
    from interdrive.batches.plan import labels_of  # noqa: PLC0415 - numpy

    labels = labels_of([planners], "planner")
    if drivers is None:
        return labels
    for label in labels:
        if any(part.strip().startswith("drivers=") for part in label.split(",")):
            raise InputError(f"--drivers {drivers}: planner {label} has drivers of its own")
    return [f"{label},drivers={drivers}" for label in labels]


def _times(text: str) -> list[float]:
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"--starts {text}: write times in seconds as 1,9,17") from None
    if len(set(found)) < len(found):
        raise InputError(f"--starts {text}: a time is given twice")
    return found
