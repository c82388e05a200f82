"""`interdrive alks`: the manoeuvres of UN R157 over a grid of parameters."""

from __future__ import annotations

import csv
import hashlib
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from interdrive.cli.arguments import shown
from interdrive.cli.terminal import say
from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from interdrive.alks import Verdicts
    from interdrive.storage import Origin

_WORDS = {"cut_in": "cut-ins", "cut_out": "cut-outs", "following": "followings"}


@click.command()
@click.argument("manoeuvre", type=click.Choice((*_WORDS, "all")), default="cut_in")
@click.option("--planner", metavar="PLANNER[;...]", default="", help="Planners that drive every case in a world.")
@click.option("--predictor", metavar="PREDICTOR", default="neural", help="Predictor of the planners (neural).")
@click.option("--driver", metavar="DRIVER,...", default="", help="Reference drivers (all that have the manoeuvre).")
@click.option("--grid", metavar="NAME|FILE", default="jrc", help="jrc, jrc_high, jrc_low, or a TOML file.")
@click.option("--driver-only", is_flag=True, help="Only reference drivers, in one dimension.")
@click.option("--boundary", is_flag=True, help="Also find where the cases end that a driver avoids, to 0.1 m (m/s²).")
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
    from interdrive.alks import driven, reference  # noqa: PLC0415 - pyarrow
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
    bounds: list[list[dict[str, float]]] = []
    with progress(quiet=False) as report:
        for one in grids:
            if one.skipped:
                say(f"left out {one.skipped:,} cut-ins in which the other is not slower")
            for name in _drivers(one.manoeuvre, driver, is_asked=bool(driver)):
                report.say(f"{_WORDS[one.manoeuvre]} with {name}")
                found.append(reference(one, name))
            for name in planners:
                said = f"{_WORDS[one.manoeuvre]} with {name}"
                report.say(said)
                count = partial(report.counted, said, total=len(one))
                found.append(driven(one, name, predictor=predictor, workers=workers, on_cases=count))
        for each in found if boundary else ():
            said = f"boundary of {_WORDS[each.grid.manoeuvre]} with {each.driver}"
            report.say(said)
            bounds.append(_boundary(each, workers, partial(_say_further, report.say, said)))
    for each in found:
        _tell(each)
    if folder is None:
        return
    with progress(quiet=False) as report:
        origin = _origin(grid, planner, predictor if planners else "")
        _write(folder, found, bounds, origin, report.say)
    say(f"tables and figures in {shown(folder.resolve())}")


def _say_further(say_so: Callable[[str], None], said: str, number: int) -> None:
    say_so(f"{said}: {number:,} further cases")


def _boundary(found: Verdicts, workers: int | None, on_cases: Callable[[int], None]) -> list[dict[str, float]]:
    from interdrive.alks import boundary  # noqa: PLC0415

    return boundary(found, workers=workers, on_cases=on_cases)


def _origin(grid: str, planner: str, predictor: str) -> Origin:
    """How the table came about: the options, and what is in a file of cases."""
    from interdrive.alks import GRIDS  # noqa: PLC0415
    from interdrive.storage import Origin  # noqa: PLC0415

    given = {"grid": grid, "planner": planner, "predictor": predictor}
    inputs = {} if grid in GRIDS else {grid: hashlib.sha256(Path(grid).read_bytes()).hexdigest()}
    return Origin({name: value for name, value in given.items() if value}, inputs)


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


def _write(
    folder: Path,
    found: list[Verdicts],
    bounds: list[list[dict[str, float]]],
    origin: Origin,
    say_so: Callable[[str], None],
) -> None:
    from interdrive.alks import case_figures, table_of  # noqa: PLC0415 - matplotlib
    from interdrive.plots import save_figure  # noqa: PLC0415
    from interdrive.storage import replacing, write_table  # noqa: PLC0415

    with replacing(folder / "alks.parquet") as part:
        write_table(table_of(found), part, origin)
    if bounds:
        names = ("velocity", "other_velocity", "sideways", "gap", "front_distance", "deceleration")
        with replacing(folder / "boundary.csv") as part, part.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, ("manoeuvre", "driver", *names), restval="", lineterminator="\n")
            writer.writeheader()
            for one, rows in zip(found, bounds, strict=True):
                writer.writerows({"manoeuvre": one.grid.manoeuvre, "driver": one.driver, **row} for row in rows)
    for one, rows in zip(found, bounds or [[]] * len(found), strict=True):
        driver = "".join(letter if letter.isalnum() else "_" for letter in one.driver)
        for name, figure in case_figures(one, rows):
            say_so(f"drawing {name} with {one.driver}")
            save_figure(figure, folder / f"{name}_{driver}.png")
