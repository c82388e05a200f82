"""`interdrive alks`: the manoeuvres of UN R157 over a grid of parameters."""

from __future__ import annotations

import csv
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from interdrive.cli.arguments import shown
from interdrive.cli.terminal import say
from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from interdrive.alks import Grid, Verdicts
    from interdrive.storage import ArrowTable

_WORDS = {"cut_in": "cut-ins", "cut_out": "cut-outs", "following": "followings"}


@click.command()
@click.argument("manoeuvre", type=click.Choice((*_WORDS, "all")), default="cut_in")
@click.option("--planner", metavar="PLANNER[;...]", default="", help="Planners that drive every case in a world.")
@click.option("--predictor", metavar="PREDICTOR", default="neural", help="Predictor of the planners (neural).")
@click.option("--driver", metavar="DRIVER,...", default="", help="Reference drivers (all that have the manoeuvre).")
@click.option("--grid", metavar="NAME|FILE", default="jrc", help="jrc, jrc_high, jrc_low, or a TOML file.")
@click.option("--driver-only", is_flag=True, help="Only reference drivers, in one dimension.")
@click.option("--boundary", is_flag=True, help="Also find the least gap without a crash, to 0.1 m.")
@click.option("--workers", metavar="N", type=click.IntRange(min=1), help="Processes (all cores).")
@click.option("--out", metavar="DIR", help="Folder for alks.parquet, boundary.csv and figures.")
@click.option("--yes", is_flag=True, help="Drive more than a million cases.")
def alks(
    manoeuvre: str,
    planner: str,
    predictor: str,
    driver: str,
    grid: str,
    driver_only: bool,
    boundary: bool,
    workers: int | None,
    out: str | None,
    yes: bool,
) -> None:
    """Drive cut-ins, cut-outs and car following of UN R157, and say what reference drivers would have avoided.

    MANOEUVRE is cut_in (the default), cut_out, following or all. Reference drivers drive in one dimension, planners on
    a straight road of two lanes where the others replay. The documentation (Test a planner by UN R157) shows how.
    """
    from interdrive.alks import driven, hits, reference, table_of  # noqa: PLC0415 - pyarrow
    from interdrive.alks import grid as read_grid  # noqa: PLC0415
    from interdrive.alks.grids import CASES_MAX  # noqa: PLC0415
    from interdrive.cli.report import progress  # noqa: PLC0415 - rich

    chosen = tuple(_WORDS) if manoeuvre == "all" else (manoeuvre,)
    planners = [] if driver_only else [name for name in planner.split(";") if name]
    if driver_only and planner:
        raise InputError("--driver-only: no planner drives; leave out --planner")
    if boundary and out is None:
        raise InputError("--boundary: say with --out DIR where boundary.csv goes")
    folder = _folder(out)
    grids = [read_grid(name, grid) for name in chosen]
    n_cases = sum(len(one) for one in grids)
    if n_cases > CASES_MAX and not yes:
        raise InputError(f"--grid {grid}: {n_cases:,} cases are more than {CASES_MAX:,}; --yes drives them")
    found: list[Verdicts] = []
    bounds: list[dict[str, object]] = []
    with progress(quiet=False) as report:
        for one in grids:
            if one.skipped:
                say(f"left out {one.skipped:,} cut-ins in which the other is not slower")
            for name in _drivers(one.manoeuvre, driver, is_asked=bool(driver)):
                report.say(f"{_WORDS[one.manoeuvre]} with {name}")
                found.append(reference(one, name))
                if boundary:
                    bounds += _bounds(one, name, hits(one.manoeuvre, name))
            for name in planners:
                said = f"{_WORDS[one.manoeuvre]} with {name}"
                report.say(said)
                found.append(
                    driven(
                        one,
                        name,
                        predictor=predictor,
                        workers=workers,
                        on_cases=partial(_say_how_many, report.say, said, len(one)),
                    )
                )
                if boundary:
                    report.say(f"{said}: boundary")
                    bounds += _bounds(one, name, hits(one.manoeuvre, name, predictor))
    for each in found:
        _tell(each)
    if folder is None:
        return
    _write(folder, found, bounds, table_of(found))
    say(f"tables and figures in {shown(folder.resolve())}")


def _say_how_many(say_so: Callable[[str], None], said: str, n: int, done: int) -> None:
    say_so(f"{said}: {done:,} of {n:,}")


def _folder(out: str | None) -> Path | None:
    if out is None:
        return None
    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as cause:
        raise InputError(f"--out {out}: {cause.strerror or cause}") from None
    return folder


def _drivers(manoeuvre: str, given: str, *, is_asked: bool) -> list[str]:
    from interdrive.alks import has_driver  # noqa: PLC0415
    from interdrive.reference_drivers import DRIVERS  # noqa: PLC0415

    names = given.split(",") if is_asked else list(DRIVERS)
    for name in names:
        if name not in DRIVERS:
            raise InputError(f"--driver {name}: there is no such reference driver; there are {', '.join(DRIVERS)}")
        if is_asked and not has_driver(manoeuvre, name):
            raise InputError(f"--driver {name}: it is defined for cut-ins (UN R157, 5.2.5.2), not for {manoeuvre}")
    return [name for name in names if has_driver(manoeuvre, name)]


def _bounds(grid: Grid, name: str, verdict: Callable[[dict[str, float]], bool]) -> list[dict[str, object]]:
    from interdrive.alks import boundary  # noqa: PLC0415

    if grid.manoeuvre == "following":
        return []
    rows = boundary(grid, verdict)
    return [{"manoeuvre": grid.manoeuvre, "driver": name, **row} for row in rows]


def _tell(found: Verdicts) -> None:
    from interdrive.alks import reference  # noqa: PLC0415

    n, crashes = len(found.grid), int(found.crash.sum())
    text = f"{found.driver} crashes in {crashes:,} of {n:,} {_WORDS[found.grid.manoeuvre]}"
    if found.driver != "cc":
        more = int((found.crash & ~reference(found.grid, "cc").crash).sum())
        text += f"; in {more:,} of them a careful and competent driver would not"
    failed = int(found.failed.sum())
    if failed:
        text += f"; in {failed:,} its planner fails or it leaves the road"
    say(text)


def _write(folder: Path, found: list[Verdicts], bounds: list[dict[str, object]], table: ArrowTable) -> None:
    from interdrive.alks import cut_in_figures  # noqa: PLC0415 - matplotlib
    from interdrive.plots import save_figure  # noqa: PLC0415
    from interdrive.storage import Origin, replacing, write_table  # noqa: PLC0415

    with replacing(folder / "alks.parquet") as part:
        write_table(table, part, Origin())
    if bounds:
        names = ("manoeuvre", "driver", "velocity", "other_velocity", "sideways", "gap", "front_distance")
        with replacing(folder / "boundary.csv") as part, part.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, names, restval="", lineterminator="\n")
            writer.writeheader()
            writer.writerows(bounds)
    for one in found:
        if one.grid.manoeuvre == "cut_in":
            driver = "".join(letter if letter.isalnum() else "_" for letter in one.driver)
            for name, figure in cut_in_figures(one):
                save_figure(figure, folder / f"{name}_{driver}.png")
