"""`interdrive explain`: why agents ended as they did, in words."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from interdrive.cli.arguments import shown
from interdrive.errors import InputError, InterdriveError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Floats
    from interdrive.batches.stories import TestedRun
    from interdrive.runs import Run


@click.command()
@click.argument("folder", metavar="RUN|BATCH")
@click.argument("names", nargs=-1, metavar="[KEY] [AGENT]")
@click.option("--png", metavar="FILE", help="Also draw its speed and phases to this .png file.")
@click.option("--pdf", metavar="FILE", help="Also draw its speed and phases to this .pdf file.")
def explain(folder: str, names: tuple[str, ...], png: str | None, pdf: str | None) -> None:
    """Explain why the agents of a run ended as they did.

    With a batch you get one line per run, and one for each of its agents that did not arrive. KEY is the beginning of
    the key of a run, as that list shows it, or the name of a scenario that only one run has; AGENT an id.

    RUN is a run folder. Without AGENT you get one line per agent; with the id of an agent, its story: what it did when,
    behind which vehicle or before which light, when its planner found nothing safer than full braking, which rules
    of the road it broke, its most critical moments, and whether reference drivers would have avoided its collisions and
    near misses. A figure shows the speed of the careful and competent one as a dashed line.
    """
    files = [(png, ".png"), (pdf, ".pdf")]
    for name, ending in files:
        if name is not None and Path(name).suffix.lower() != ending:
            raise InputError(f"--{ending[1:]} {name}: the file must end in {ending}")
    wanted = [Path(name) for name, _ in files if name is not None]
    folder, number = _named(folder, names, bool(wanted))
    if not folder:
        return
    if number is None and wanted:
        raise InputError("explain: a figure shows one agent; name it after the run folder")

    from interdrive.cli.report import print_text  # noqa: PLC0415 - rich
    from interdrive.results.story import ending as ending_of  # noqa: PLC0415
    from interdrive.results.story import story  # noqa: PLC0415
    from interdrive.runs import load  # noqa: PLC0415 - pyarrow

    run = load(folder)
    lines = [ending_of(run, one.id) for one in run.agents] if number is None else story(run, number)
    instead: list[tuple[str, Floats, Floats]] = []
    if number is not None:
        from interdrive.scoring import preventability  # noqa: PLC0415

        found = preventability(run, [number])
        lines += [f"  {words}" for words in found.words]
        rows = sorted(range(len(found)), key=lambda row: found.kind[row])
        drives = [found.witness(row, "cc") for row in rows]
        instead = [("a careful and competent driver", one.time, one.velocity) for one in drives if one is not None]
        lines += _scored(folder, run, number)
    print_text("\n".join(lines) or "the run has no agents")
    if number is not None and wanted:
        from interdrive.plots import save_figure  # noqa: PLC0415 - matplotlib
        from interdrive.plots.story import draw_story  # noqa: PLC0415
        from interdrive.results.folder import inputs_of  # noqa: PLC0415
        from interdrive.storage import keep_inputs  # noqa: PLC0415

        figure = draw_story(run, number, instead[:1])
        for path in wanted:
            keep_inputs(path, inputs_of(folder, run))
            save_figure(figure, path)
            print_text(f"figure in {shown(path.resolve())}")


def _named(folder: str, names: tuple[str, ...], draws: bool) -> tuple[str, int | None]:
    """The run folder and the agent that are meant; "" if a batch was told instead."""
    from interdrive.batch_report import is_batch  # noqa: PLC0415

    if not is_batch(folder):
        if len(names) > 1:
            raise InputError(f"explain {folder}: it is one run; write the id of an agent behind it, nothing more")
        return folder, _number(names[0] if names else None)
    if len(names) > 2:
        raise InputError(f"explain {folder}: write the key of a run and the id of an agent behind it, nothing more")
    from interdrive.batches.stories import run_named, tested_runs  # noqa: PLC0415

    runs = tested_runs(folder)
    if not names:
        if draws:
            raise InputError("explain: a figure shows one agent; name its run and it behind the batch")
        _tell(folder, runs)
        return "", None
    run = run_named(runs, names[0])
    number = _number(names[1] if len(names) > 1 else None)
    if run.status != "finished":
        raise InputError(f"run {run.short} of {run.scenario}: {run.status}: {run.error}")
    if run.folder is not None:
        return str(run.folder), number
    if number is not None or draws:
        raise InputError(
            f"run {run.short} of {run.scenario}: its run folder was not kept; "
            "repeat the batch with --keep all, which does such runs once more"
        )
    _tell(folder, [run], every=True)
    return "", None


def _tell(folder: str, runs: Sequence[TestedRun], *, every: bool = False) -> None:
    """Prints runs, and of their agents those that did not arrive, or every one."""
    from interdrive.cli.report import print_text  # noqa: PLC0415 - rich

    lines = []
    for run in runs:
        lines.append(run.line)
        lines += [f"  {text}" for _, text, arrived in run.endings if every or not arrived]
    print_text("\n".join(lines) or "the batch has no runs")
    if lines and not every:
        print_text(f"interdrive explain {folder} KEY AGENT tells the story of one agent")


def _scored(folder: str, run: Run, number: int) -> list[str]:
    """The score of an agent and why, as it is stored in the folder, or from the run alone; nothing without a route."""
    from interdrive.scoring import score, score_table, stored_score  # noqa: PLC0415
    from interdrive.storage import is_of  # noqa: PLC0415

    try:
        table = stored_score(folder)
        if table is None or not is_of(table, run.digest):
            table = score_table(score(run, [number]))
    except InterdriveError:
        return []
    row = next((row for row in table.to_pylist() if row["agent_id"] == number), None)
    if row is None or row["score"] is None:
        return []
    against = f"against {row['panel']}" if row["panel"] else "absolute"
    return [f"  score {100.0 * row['score']:.1f}, {against}: {row['why'] or 'full score'}"]


def _number(agent: str | None) -> int | None:
    if agent is None:
        return None
    try:
        return int(agent)
    except ValueError:
        raise InputError(f"explain {agent}: write the id of an agent, such as 605") from None
