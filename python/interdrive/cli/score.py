"""`interdrive score`: one number per agent, its terms, and why."""

from __future__ import annotations

from pathlib import Path

import click

from interdrive.cli.arguments import assigned, id_list, shown
from interdrive.cli.terminal import print_csv, say
from interdrive.config.binding import bind
from interdrive.errors import InputError


@click.command()
@click.argument("folder", metavar="RUN|BATCH")
@click.option("--agents", metavar="ID,ID", help="Agents to score (all).")
@click.option(
    "--set",
    "assignments",
    metavar="NAME=VALUE",
    multiple=True,
    help="A bound, weight or reaction, such as scoring.comfort.jerk=6; the documentation (Scores) lists them.",
)
@click.option("--csv", "as_csv", is_flag=True, help="Print the table as CSV.")
def score(folder: str, agents: str | None, assignments: tuple[str, ...], as_csv: bool) -> None:
    """Score the agents of a run from 0 to 100, with reasons for lost points.

    RUN is a run folder; score.parquet is written to it unless you give --agents or --set. For a batch folder BATCH, the
    command prints the scores of its planners and counts zeros by reason. The documentation (Scores) defines the terms.
    """
    from interdrive.cli.score_report import print_batch_scores, print_scores  # noqa: PLC0415 - rich

    if (Path(folder) / "batch.json").exists():
        if agents or assignments:
            raise InputError(f"{folder}: batches are scored as they run; --agents and --set apply to run folders")
        from interdrive.batches.store import BatchFolder  # noqa: PLC0415 - pyarrow
        from interdrive.comparison.scores import batch_scores  # noqa: PLC0415 - needs the simulation
        from interdrive.comparison.variants import left_out_humans  # noqa: PLC0415

        scores, no_humans = batch_scores(folder), left_out_humans(BatchFolder.open(folder).table())
        print_batch_scores(scores, no_humans=no_humans, as_csv=as_csv)
        return
    from interdrive.runs import load  # noqa: PLC0415 - pyarrow
    from interdrive.scoring import ScoringSettings, save_score, score_table  # noqa: PLC0415
    from interdrive.scoring import score as scored  # noqa: PLC0415

    given = {name.removeprefix("scoring."): value for name, value in assigned(assignments).items()}
    settings = bind(ScoringSettings(), given)
    ids = None if agents is None else id_list("--agents", agents)
    run = load(folder)
    found = scored(run, ids, settings)
    if as_csv:
        table = score_table(found)
        print_csv(table.column_names, zip(*table.to_pydict().values(), strict=True))
    else:
        print_scores(found, run.scenario.name)
    if ids is None and not given:
        path = save_score(found, folder)
        if not as_csv:
            say(f"table in {shown(path)}")
