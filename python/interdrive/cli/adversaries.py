"""`interdrive adversaries`: whether drivers with vices rank below honest ones."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import click


@click.command()
@click.option("--set", "name", metavar="SET", default="shipped-2", help="Benchmark set (shipped-2).")
@click.option("--split", metavar="test|dev|all", default="dev", help="Part of the set (dev).")
@click.option("--scenarios", metavar="DIR", help="Folder that contains the files of the set (INTERDRIVE_SCENARIOS).")
@click.option("--files", metavar="N", type=int, help="Largest number of files, spread over the set (all).")
@click.option("--agents", metavar="N", type=int, default=2, help="Largest number of agents per file (2).")
@click.option("--workers", metavar="N", type=int, help="Processes (all cores).")
@click.option("--panel", metavar="DIR", help="Stored panel, which is not driven again (DIR/panel of --out).")
@click.option("--out", metavar="DIR", default="out/adversaries", help="Folder for adversaries.json (out/adversaries).")
def adversaries(
    name: str,
    split: str,
    scenarios: str | None,
    files: int | None,
    agents: int,
    workers: int | None,
    panel: str | None,
    out: str,
) -> int:
    """Check that the score against a panel tells bad drivers from honest ones in the same places.

    Every adversary must lose against the honest driver on which it is based, and rank below all honest drivers where
    its vice acts. Exit code 0: all do; 1: some do not.
    """
    from interdrive.adversaries import rank_adversaries  # noqa: PLC0415 - needs the simulation
    from interdrive.cli.report import progress  # noqa: PLC0415 - rich
    from interdrive.cli.score_report import print_adversaries  # noqa: PLC0415

    with progress(quiet=False) as report:
        found = rank_adversaries(
            set=name,
            split=split,
            scenarios=scenarios,
            files=files,
            agents=agents,
            workers=workers,
            out=out,
            panel=panel,
            on_place=partial(report.counted, "agents driven"),
        )
    print_adversaries(found, Path(out))
    return 0 if found.n_below == len(found.judged) else 1
