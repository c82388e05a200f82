"""`interdrive score`: one number per agent, its terms, and why."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from interdrive.cli.arguments import assigned, id_list, shown
from interdrive.cli.terminal import print_csv, say
from interdrive.config.binding import bind
from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.run import RunRecord


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
@click.option(
    "--panel",
    metavar="default|none|DIR",
    help="Four drivers drive in the place of each agent (default for one agent); none: nothing drives, the score is "
    "absolute; DIR: stored drives.",
)
@click.option("--no-rerun", is_flag=True, help="With --panel DIR: an agent that the stored panel lacks is an error.")
@click.option("--trust", is_flag=True, help="For a panel: import planners that run.json names as module:object.")
@click.option("--csv", "as_csv", is_flag=True, help="Print the table as CSV.")
def score(
    folder: str,
    agents: str | None,
    assignments: tuple[str, ...],
    panel: str | None,
    no_rerun: bool,
    trust: bool,
    as_csv: bool,
) -> None:
    """Score the agents of a run from 0 to 100, with reasons for lost points.

    RUN is a run folder; score.parquet is written to it unless you give --agents or --set. For a batch folder BATCH, the
    command prints the scores of its planners and counts zeros by reason. The documentation (Scores) defines all parts.

    One agent is scored against a panel, which takes up to six runs; several agents only with --panel, since that takes
    four runs for each. Otherwise scores are absolute: they compare with each other, not with those against a panel.
    """
    from interdrive.cli.score_report import print_batch_scores, print_scores  # noqa: PLC0415 - rich

    if (Path(folder) / "batch.json").exists():
        if agents or assignments or panel or trust or no_rerun:
            raise InputError(f"{folder}: batches are scored as they run; options apply to run folders")
        from interdrive.batches.store import BatchFolder  # noqa: PLC0415 - pyarrow
        from interdrive.comparison.scores import batch_scores  # noqa: PLC0415 - needs the simulation
        from interdrive.comparison.variants import left_out_humans  # noqa: PLC0415

        scores, no_humans = batch_scores(folder), left_out_humans(BatchFolder.open(folder).table())
        print_batch_scores(scores, no_humans=no_humans, as_csv=as_csv)
        return
    from interdrive.cli.report import progress  # noqa: PLC0415 - rich
    from interdrive.panel import PanelFolder  # noqa: PLC0415 - needs the simulation
    from interdrive.panel import score as scored  # noqa: PLC0415
    from interdrive.runs import load  # noqa: PLC0415 - pyarrow
    from interdrive.scoring import ScoringSettings, save_score, score_table  # noqa: PLC0415

    given = {name.removeprefix("scoring."): value for name, value in assigned(assignments).items()}
    settings = bind(ScoringSettings(), given)
    ids = None if agents is None else id_list("--agents", agents)
    if no_rerun and panel in (None, "default", "none"):
        raise InputError("--no-rerun: give the folder of a stored panel with --panel DIR")
    stored = panel if panel in (None, "default", "none") else PanelFolder.open(panel, is_complete=no_rerun)
    run = load(folder)
    with progress(quiet=as_csv) as report:
        found = scored(
            run,
            ids,
            settings,
            panel=stored,
            trust=trust,
            threads=None,
            on_agent=partial(report.counted, "agents scored"),
        )
    if as_csv:
        table = score_table(found)
        print_csv(table.column_names, zip(*table.to_pydict().values(), strict=True))
    else:
        print_scores(found, run.scenario.name)
        _say_preventable(run, found.ids.tolist())
    if ids is None and not given:
        path = save_score(found, folder)
        if not as_csv:
            say(f"table in {shown(path)}")


def _say_preventable(run: RunRecord, ids: Sequence[int]) -> None:
    """Says of each collision whether a careful and competent driver would have avoided it."""
    from interdrive.scoring import preventability  # noqa: PLC0415

    found = preventability(run, ids)
    for number, kind, words in zip(found.agent_id.tolist(), found.kind, found.words, strict=True):
        if kind == "collision":
            say(f"agent {number}: {words}")
