"""`interdrive panel`: drives of the panel stored for a benchmark set."""

from __future__ import annotations

from functools import partial

import click

from interdrive.cli.arguments import named_options, shown
from interdrive.cli.terminal import say

#: Missing files and agents that are listed.
_MISSING_MAX = 12


@click.command()
@click.option("--set", "name", metavar="SET", default="shipped-2", help="Benchmark set (shipped-2).")
@click.option("--split", metavar="test|dev|all", default="dev", help="Part of the set (dev).")
@click.option("--scenarios", metavar="DIR", help="Folder that contains the files of the set (INTERDRIVE_SCENARIOS).")
@click.option("--traffic", metavar="NAME,NAME", help="How the others drive (replay, and the columns of the set).")
@click.option("--predictor", metavar="NAME", default="neural", help="Predictor of all agents (neural).")
@click.option("--workers", metavar="N", type=click.IntRange(min=1), help="Processes (all cores).")
@click.option("--out", metavar="DIR", help="Folder of the panel (out/panel-SET); what is in it is not driven again.")
def panel(
    name: str,
    split: str,
    scenarios: str | None,
    traffic: str | None,
    predictor: str,
    workers: int | None,
    out: str | None,
) -> None:
    """Drive the panel in the place of every agent of a set and store it, so that scores against it run nothing else.

    `interdrive score`, `benchmark` and `adversaries` read the folder with --panel DIR. Its scores are those of a panel
    that is driven anew, bit for bit. Agents are driven in every kind of traffic that the set has as a column.
    """
    from interdrive.benchmarks.panels import store_panel  # noqa: PLC0415 - needs the simulation
    from interdrive.cli.report import progress  # noqa: PLC0415 - rich

    kinds = None if traffic is None else tuple(kind.strip() for kind in traffic.split(","))
    with progress(quiet=False) as report, named_options({"traffic": traffic}):
        found = store_panel(
            set=name,
            split=split,
            scenarios=scenarios,
            traffic=kinds,
            predictor=predictor,
            out=out or f"out/panel-{name}",
            workers=workers,
            on_place=partial(report.counted, "places driven"),
        )
    if found.missing:
        say(f"partial: {len(found.missing)} files or agents are missing")
        for line in found.missing[:_MISSING_MAX]:
            say(f"- {line}")
    say(f"{found.n_places} places, panel in {shown(found.folder)}")
