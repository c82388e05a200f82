"""`interdrive calibrate`: a population of drivers that is fitted to recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

import click

from interdrive.cli.arguments import assigned, raw_option, shown
from interdrive.errors import InputError

if TYPE_CHECKING:
    from interdrive.calibration import Calibration


@click.command()
@click.argument("files", nargs=-1, metavar="FILE|FOLDER...")
@click.option("--planner", metavar="PLANNER", default="idm", help="Whose drivers they are: idm (default) or idm_mobil.")
@click.option(
    "--out",
    metavar="DIR|FILE.toml",
    required=True,
    help="Folder of the calibration; the same one goes on where it was. Or the drivers' file, beside a folder FILE.",
)
@click.option("--hold-out", metavar="PLACE,PLACE", help="Places that only check the result.")
@click.option(
    "--split", metavar="TOML", help="File that says what is fitted, what chooses, and what checks the result."
)
@click.option("--folds", type=click.Choice(("place",)), help="Also leave out each place in turn, and measure there.")
@click.option("--stage", type=click.Choice(("A", "B")), default="B", help="Last stage (B): A leaves out the world.")
@click.option("--evaluations", metavar="N", type=int, default=600, help="Populations of stage A (600).")
@click.option("--drives", metavar="N", type=int, default=60, help="Populations of stage B (60).")
@click.option("--long", metavar="SECONDS", type=float, default=40.0, help="Length of long drives (40); 0: none.")
@click.option("--rollouts", metavar="N", type=int, default=8, help="Rollouts of each start of the check (8).")
@click.option("--seed", metavar="N", type=click.IntRange(min=0), default=0, help="Seed of all that is drawn (0).")
@click.option(
    "--set", "assignments", metavar="NAME=VALUE", multiple=True, help="A setting; `interdrive settings` lists them."
)
@raw_option
@click.option("--any-traffic", is_flag=True, help="Take simulated and invented traffic, too.")
@click.option("--licence", metavar="WORDS", default="", help="Terms of the recordings, for the file.")
@click.option("--workers", metavar="N", type=click.IntRange(min=1), default=1, help="Processes that drive (1).")
@click.option("--quiet", is_flag=True, help="Print only errors.")
def calibrate(
    files: tuple[str, ...],
    planner: str,
    out: str,
    hold_out: str | None,
    split: str | None,
    folds: str | None,
    stage: str,
    evaluations: int,
    drives: int,
    long: float,
    rollouts: int,
    seed: int,
    assignments: tuple[str, ...],
    raw: bool,
    any_traffic: bool,
    licence: str,
    workers: int,
    quiet: bool,
) -> int:
    """Fit a population of drivers to recordings.

    FILE is a CommonRoad file with recorded traffic, a FOLDER stands for all files in it; windows of one recording are
    joined. Stage A lets vehicles follow the leaders that they have in the recording; stage B drives the best
    populations in the world, for seconds and for longer, so that safety and the spread of drivers count. The result,
    drivers.toml, is measured on the places that are held out, and called realistic on none that it was fitted on. With
    folds, those that are fitted without a place are in DIR/folds/PLACE.
    Ctrl-C keeps what was found; the same command goes on.
    """
    if not files:
        raise InputError("calibrate: no recordings; give files or folders")

    from interdrive.calibration import calibrate as calibrated  # noqa: PLC0415 - numpy
    from interdrive.cli.report import progress  # noqa: PLC0415 - rich

    with progress(quiet=quiet) as report:
        try:
            found = calibrated(
                files,
                planner,
                out=out,
                hold_out=_places(hold_out),
                split=split,
                folds=cast("Literal['place'] | None", folds),
                stage=cast("Literal['A', 'B']", stage),
                evaluations=evaluations,
                drives=drives,
                long=long,
                rollouts=rollouts,
                seed=seed,
                settings=assigned(assignments),
                raw=raw,
                any_traffic=any_traffic,
                licence=licence,
                workers=workers,
                on_step=report.counted,
            )
        except KeyboardInterrupt:
            folder = Path(out).with_suffix("") if out.endswith(".toml") else Path(out)
            kept = f"interrupted; what was found is in {shown(folder)}, and the same command goes on"
            raise KeyboardInterrupt(kept) from None
    if not quiet:
        _tell(found)
    return 0


def _places(text: str | None) -> list[str]:
    """Names between commas."""
    found = [] if text is None else [name.strip() for name in text.split(",")]
    if not all(found):
        raise InputError(f"--hold-out {text}: write places as DEU_MONAMerge,DEU_AachenBendplatz")
    return found


def _tell(found: Calibration) -> None:
    from rich.markup import escape  # noqa: PLC0415

    from interdrive.cli.report import output, print_notes, print_table, table_of  # noqa: PLC0415
    from interdrive.cli.terminal import say  # noqa: PLC0415
    from interdrive.traffic_realism.tables import sheets  # noqa: PLC0415

    console = output()
    head = ("number", "usual", "fitted", "nearly as good", "identified")
    table = table_of(head, right=head[1:], title=f"Drivers of {found.planner}, fitted on {', '.join(found.places)}")
    for row in found.rows:
        table.add_row(*(escape(cell) for cell in row))
    print_table(console, table, names=1)
    for stage, (usual, fitted) in found.objectives.items():
        number = found.evaluations[stage]
        say(f"stage {stage}: {number} populations, objective {usual:.3f} before and {fitted:.3f} after")
    say(f"it consists of {', '.join(f'{name} {value:.3f}' for name, value in found.parts.items())}")
    if found.realism is not None:
        sheet = next(iter(sheets(found.realism)))
        table = table_of(sheet.head, right=sheet.head[2:], tight=True, title=sheet.title)
        for cells in sheet.rows:
            table.add_row(*(escape(cell) for cell in cells))
        print_table(console, table, names=2)
    for place, one in found.verdicts.items():
        say(f"{place}: {one}")
    for place, fold in found.folds.items():
        rows = [] if fold.realism is None else fold.realism.rows
        said = "".join(f"energy after 5 s {row.energy[5]:.2f} m, " for row in rows if "drivers=" in row.planner)
        say(f"{place}, left out: {said}{fold.verdicts[place]}")
    print_notes(console, found.notes, "calibration.json")
    say(f"drivers in {shown(found.file)}")
