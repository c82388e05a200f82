"""`interdrive preventability`: what reference drivers would have avoided."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from interdrive.cli.arguments import id_list, shown
from interdrive.cli.terminal import print_csv, say
from interdrive.errors import InputError, InterdriveError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

#: Of more conflicts than this, only those that a careful and competent driver would have avoided are shown.
_ROWS_MAX = 40
_CELLS = {True: "avoids", False: "hits", None: "-"}


@click.command()
@click.argument("folder", metavar="RUN|BATCH")
@click.option("--agents", metavar="ID,ID", help="Agents to judge (all).")
@click.option("--workers", metavar="N", type=click.IntRange(min=1), help="Processes that share a batch (all cores).")
@click.option("--csv", "as_csv", is_flag=True, help="Print the table as CSV.")
def preventability(folder: str, agents: str | None, workers: int | None, as_csv: bool) -> None:
    """Say which collisions and near misses reference drivers would have avoided.

    RUN is a run folder; preventability.parquet is written to it unless you give --agents, and beside it the drives that
    the verdicts rest on. BATCH is a batch folder, of which the kept runs are judged (--keep all); a table counts the
    verdicts by planner. The drivers are the competent and careful human of UN R157, the minimum of its paragraph
    5.2.5.2, RSS and the fuzzy safety model; the documentation (Reference drivers) defines them.
    """
    ids = None if agents is None else id_list("--agents", agents)
    if not (Path(folder) / "batch.json").exists():
        if workers is not None:
            raise InputError(f"{folder}: --workers applies to batch folders")
        _judge_run(folder, ids, as_csv=as_csv)
        return
    if ids is not None:
        raise InputError(f"{folder}: --agents applies to run folders")
    _judge_batch(folder, workers, as_csv=as_csv)


def _judge_run(folder: str, ids: list[int] | None, *, as_csv: bool) -> None:
    from interdrive.runs import load  # noqa: PLC0415 - pyarrow
    from interdrive.scoring.preventability import preventability as judged  # noqa: PLC0415

    run = load(folder)
    found = judged(run, ids)
    rows = found.to_arrow().to_pylist()
    about = {"scenario": run.scenario.name}
    _print([{**about, **row} for row in rows], list(about), as_csv=as_csv)
    if not as_csv:
        _say_counts(rows)
    if ids is None:
        path = found.save(folder)
        if not as_csv:
            say(f"table in {shown(path)}")


def _judge_batch(folder: str, workers: int | None, *, as_csv: bool) -> None:
    from interdrive.batches.store import BatchFolder, recordings_in  # noqa: PLC0415 - pyarrow
    from interdrive.cli.report import progress  # noqa: PLC0415 - rich

    names = ("scenario", "planner", "seed", "key")
    table = BatchFolder.open(folder).table(names).to_pylist()
    about = {row["key"]: {"scenario": row["scenario"], "planner": row["planner"], "seed": row["seed"]} for row in table}
    kept = [recordings_in(folder) / key for key in about]
    kept = [path for path in kept if (path / "run.json").exists()]
    if not kept:
        raise InputError(f"{folder}: the batch keeps no runs; repeat it with --keep all")
    rows, broken = [], 0
    with progress(quiet=as_csv) as report:
        for number, (path, found) in enumerate(_all_judged(kept, workers), start=1):
            report.counted("runs judged", number, len(kept))
            if isinstance(found, str):
                broken += 1
                say(f"left out: {found}", err=True)
            else:
                rows += [{**about[path.name], "run": path.name, **row} for row in found]
    _print(rows, ["scenario", "planner", "seed", "run"], as_csv=as_csv)
    if not as_csv:
        _print_counts(rows, {each["planner"] for each in about.values()})
    if broken:
        raise click.exceptions.Exit(1)


def _all_judged(kept: list[Path], workers: int | None) -> Iterator[tuple[Path, list[dict[str, Any]] | str]]:
    import multiprocessing  # noqa: PLC0415
    import os  # noqa: PLC0415
    from concurrent.futures import ProcessPoolExecutor  # noqa: PLC0415

    n_workers = min(workers or os.cpu_count() or 1, len(kept))
    if n_workers == 1:
        yield from zip(kept, map(_judged, kept), strict=True)
        return
    # Started afresh: threads of the core do not survive a fork.
    with ProcessPoolExecutor(n_workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield from zip(kept, pool.map(_judged, kept), strict=True)


def _judged(folder: Path) -> list[dict[str, Any]] | str:
    """The rows of a run, or in one line why there are none."""
    from interdrive.runs import load  # noqa: PLC0415 - pyarrow
    from interdrive.scoring.preventability import preventability as judged  # noqa: PLC0415

    try:
        rows: list[dict[str, Any]] = judged(load(folder)).to_arrow().to_pylist()
    except InterdriveError as error:
        return str(error)
    except (OSError, ValueError, LookupError) as error:  # a damaged file that no check knows
        return " ".join(f"{folder}: {error}".split())
    return rows


def _print(rows: Sequence[dict[str, Any]], about: list[str], *, as_csv: bool) -> None:
    """Prints the verdicts; `about` are the columns that say of which run each is."""
    from interdrive.cli.report import output, print_table, print_text, table_of  # noqa: PLC0415 - rich
    from interdrive.reference_drivers import DRIVERS  # noqa: PLC0415
    from interdrive.scoring.preventability import PREVENTABILITY_COLUMNS  # noqa: PLC0415

    if as_csv:
        names = [*about, *(column.name for column in PREVENTABILITY_COLUMNS)]
        print_csv(names, [[row[column] for column in names] for row in rows])
        return
    chosen = [row for row in rows if row["preventable_cc"] is True] if len(rows) > _ROWS_MAX else list(rows)
    numbers = ("agent", "with", "time step")
    table = table_of((*about, "what", *numbers, *DRIVERS), right=("seed", *numbers))
    for row in chosen[:_ROWS_MAX]:
        verdicts = (_CELLS[row[f"preventable_{driver}"]] for driver in DRIVERS)
        named, ids = ([str(row[name]) for name in names] for names in (about, ("agent_id", "partner_id", "time_step")))
        table.add_row(*named, row["kind"].replace("_", " "), *ids, *verdicts)
    if table.row_count:
        print_table(output(), table, 1)
    # Below the table, as sentences in a narrow column are hard to read.
    for row in chosen[:_ROWS_MAX]:
        where = ", ".join(str(row[name]) for name in about[:3]) + ", " if len(about) > 1 else ""
        print_text(f"{where}agent {row['agent_id']} with {row['partner_id']}: {row['words']}")
    hidden = len(rows) - table.row_count
    if hidden:
        print_text(f"{hidden} more with --csv")


def _say_counts(rows: Sequence[dict[str, Any]]) -> None:
    """One line each for collisions and near misses."""
    from interdrive.cli.report import print_text  # noqa: PLC0415 - rich

    for kind, one, many in (("collision", "collision", "collisions"), ("near_miss", "near miss", "near misses")):
        judged = [row["preventable_cc"] for row in rows if row["kind"] == kind]
        known = [verdict for verdict in judged if verdict is not None]
        what = one if len(judged) == 1 else many
        print_text(
            f"{len(judged)} {what}: a careful and competent driver avoids {sum(known)} and hits in "
            f"{len(known) - sum(known)}; {len(judged) - len(known)} without a verdict"
        )


def _print_counts(rows: Sequence[dict[str, Any]], planners: set[str]) -> None:
    """By planner: collisions, those without a verdict, and how many each driver avoids; near misses beside them."""
    from interdrive.cli.report import output, print_table, table_of  # noqa: PLC0415 - rich
    from interdrive.reference_drivers import DRIVERS  # noqa: PLC0415

    of: dict[tuple[str, str], list[dict[str, Any]]] = defaultdict(list)
    for row in rows:
        of[row["planner"], row["kind"]].append(row)
    headings = ("planner", "what", "number", "no verdict", *(f"{name} avoids" for name in DRIVERS))
    table = table_of(headings, right=headings[2:])
    for planner in sorted(planners):
        for kind, what in (("collision", "collisions"), ("near_miss", "near misses")):
            here = of[planner, kind]
            avoided = (sum(row[f"preventable_{name}"] is True for row in here) for name in DRIVERS)
            counts = (len(here), sum(bool(row["undefined"]) for row in here), *avoided)
            table.add_row(planner, what, *map(str, counts))
    print_table(output(), table, 2)
