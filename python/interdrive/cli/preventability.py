"""`interdrive preventability`: what reference drivers would have avoided."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from interdrive.cli.arguments import id_list, shown
from interdrive.cli.terminal import print_csv, say
from interdrive.errors import InputError

if TYPE_CHECKING:
    from interdrive.scoring.preventability import Preventability


@click.command()
@click.argument("folder", metavar="RUN|BATCH")
@click.option("--agents", metavar="ID,ID", help="Agents to judge (all).")
@click.option("--csv", "as_csv", is_flag=True, help="Print the table as CSV.")
def preventability(folder: str, agents: str | None, as_csv: bool) -> None:
    """Say which collisions and near misses reference drivers would have avoided.

    RUN is a run folder; preventability.parquet is written to it unless you give --agents. BATCH is a batch folder, of
    which the kept runs are judged (--keep all). The drivers are the competent and careful human of UN R157, the minimum
    of its paragraph 5.2.5.2, RSS and the fuzzy safety model; the documentation (Reference drivers) defines them.
    """
    from interdrive.cli.report import progress  # noqa: PLC0415 - rich
    from interdrive.runs import load  # noqa: PLC0415 - pyarrow
    from interdrive.scoring.preventability import preventability as judged  # noqa: PLC0415

    ids = None if agents is None else id_list("--agents", agents)
    if not (Path(folder) / "batch.json").exists():
        run = load(folder)
        found = judged(run, ids)
        _print([(run.scenario.name, found)], as_csv=as_csv)
        if ids is None:
            path = found.save(folder)
            if not as_csv:
                say(f"table in {shown(path)}")
        return
    if ids is not None:
        raise InputError(f"{folder}: --agents applies to run folders")
    kept = sorted(path.parent for path in Path(folder).rglob("run.json"))
    if not kept:
        raise InputError(f"{folder}: the batch keeps no runs; repeat it with --keep all")
    several = []
    with progress(quiet=as_csv) as report:
        for number, each in enumerate(kept, start=1):
            report.say(f"run {number} of {len(kept)}")
            run = load(each)
            several.append((run.scenario.name, judged(run)))
    _print(several, as_csv=as_csv)


def _print(found: list[tuple[str, Preventability]], *, as_csv: bool) -> None:
    """Prints the verdicts of runs, each with the name of its scenario."""
    from interdrive.cli.report import output, print_table, print_text, table_of  # noqa: PLC0415 - rich
    from interdrive.reference_drivers import DRIVERS  # noqa: PLC0415
    from interdrive.scoring.preventability import PREVENTABILITY_COLUMNS  # noqa: PLC0415

    rows = [(name, row) for name, one in found for row in one.to_arrow().to_pylist()]
    names = [column.name for column in PREVENTABILITY_COLUMNS]
    if as_csv:
        print_csv(["scenario", *names], [[name, *(row[column] for column in names)] for name, row in rows])
        return
    numbers = ("agent", "with", "time step")
    table = table_of(("scenario", "what", *numbers, *DRIVERS, "words"), right=numbers)
    cell = {True: "avoids", False: "hits", None: "-"}
    for name, row in rows:
        verdicts = (cell[row[f"preventable_{driver}"]] for driver in DRIVERS)
        about = (str(row[column]) for column in ("agent_id", "partner_id", "time_step"))
        table.add_row(name, row["kind"].replace("_", " "), *about, *verdicts, row["words"])
    if rows:
        print_table(output(), table, 1)
    for kind, one, many in (("collision", "collision", "collisions"), ("near_miss", "near miss", "near misses")):
        judged = [row["preventable_cc"] for _, row in rows if row["kind"] == kind]
        known = [verdict for verdict in judged if verdict is not None]
        what = one if len(judged) == 1 else many
        print_text(
            f"{len(judged)} {what}: a careful and competent driver avoids {sum(known)} and hits in "
            f"{len(known) - sum(known)}; {len(judged) - len(known)} without a verdict"
        )
