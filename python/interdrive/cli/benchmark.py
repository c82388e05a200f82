"""`interdrive benchmark`: planners compared by one number on a versioned set of scenarios."""

from __future__ import annotations

import click

from interdrive.cli.arguments import named_options, raw_option
from interdrive.errors import InputError


@click.command()
@click.argument("planner", metavar="PLANNER[,NAME=VALUE...][,PLANNER...]", required=False)
@click.option("--set", "name", metavar="SET", default="shipped-2", help="Set of scenarios (shipped-2).")
@click.option("--split", metavar="test|dev|all", default="dev", help="Part of the set (dev); use test for claims only.")
@click.option("--scenarios", metavar="DIR", help="Folder that contains the files of the set (INTERDRIVE_SCENARIOS).")
@click.option("--list", "listed", metavar="SET", help="List the files of a set and exit.")
@click.option("--workers", metavar="N", type=click.IntRange(min=1), help="Processes (all cores).")
@click.option(
    "--ray",
    metavar="[=ADDRESS]",
    is_flag=False,
    flag_value="auto",
    help="Run on the Ray cluster of this machine, or on the cluster at ADDRESS.",
)
@click.option(
    "--out", metavar="DIR", help="Folder of the results (out/benchmark-SET); existing runs in it are not repeated."
)
@click.option(
    "--panel", metavar="default|none|DIR", default="default", help="Against what agents are scored (default)."
)
@click.option(
    "--columns",
    metavar="all|replay,PLANNER,...",
    help="Who drives the others: a column of scores for each (those of the set).",
)
@click.option("--power", metavar="POINTS", type=float, help="Say how many places separate planners so far apart.")
@raw_option
@click.option("--quiet", is_flag=True, help="Print only errors.")
def benchmark(
    planner: str | None,
    name: str,
    split: str,
    scenarios: str | None,
    listed: str | None,
    workers: int | None,
    ray: str | None,
    out: str | None,
    panel: str,
    columns: str | None,
    power: float | None,
    raw: bool,
    quiet: bool,
) -> None:
    """Score planners on a fixed set of scenarios, one agent at a time, among replayed and among reacting traffic.

    A planner's number is 100 times its mean score over scenarios among reacting traffic, with an interval over places.
    Each kind of traffic is a column; the ranking says how stable it is over places and over traffic.
    Files are identified by their content; if some are missing, the number is partial and has no rank.
    """
    from interdrive.cli.batch_report import batch_progress  # noqa: PLC0415 - rich
    from interdrive.cli.score_report import print_benchmark, print_set  # noqa: PLC0415

    if listed is not None:
        from interdrive.benchmarks import read_set  # noqa: PLC0415

        print_set(read_set(listed))
        return
    if planner is None:
        raise InputError("benchmark: name a planner, or list a set with --list SET")
    from interdrive.benchmarks import benchmark as run_benchmark  # noqa: PLC0415
    from interdrive.cli.terminal import say  # noqa: PLC0415

    with batch_progress(quiet=quiet) as on_progress, named_options({"columns": columns, "power": power}):
        found = run_benchmark(
            planner,
            set=name,
            split=split,
            scenarios=scenarios,
            out=out or f"out/benchmark-{name}",
            panel=panel,
            workers=workers,
            ray=ray,
            raw=raw,
            columns=columns,
            power=power,
            on_recording=None if quiet else lambda recording: say(f"joining the windows of {recording}"),
            on_progress=on_progress,
        )
    if not quiet:
        print_benchmark(found)
