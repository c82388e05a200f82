"""`interdrive compare`: the planners of a batch by category, and their differences."""

from __future__ import annotations

from pathlib import Path

import click

from interdrive.cli.arguments import shown
from interdrive.cli.terminal import say
from interdrive.errors import InputError


@click.command()
@click.argument("folder", metavar="DIR")
@click.option("--planner", "planners", metavar="PLANNER[,PLANNER...]", multiple=True, help="Planners to compare (all).")
@click.option("--samples", metavar="N", type=int, default=5000, help="Bootstrap samples (5000).")
@click.option("--group", metavar="place|file|agent", default="place", help="What intervals draw together (place).")
@click.option("--level", metavar="P", type=float, default=0.95, help="Coverage of the intervals (0.95).")
@click.option("--seed", metavar="N", type=click.IntRange(min=0), default=0, help="Seed of the samples (0).")
@click.option("--out", metavar="DIR", help="Folder for tables and figure (comparison/ in the batch).")
@click.option("--latex", is_flag=True, help="Print the table for a paper as LaTeX (package booktabs) instead.")
@click.option("--quiet", is_flag=True, help="Print only errors.")
def compare(
    folder: str,
    planners: tuple[str, ...],
    samples: int,
    group: str,
    level: float,
    seed: int,
    out: str | None,
    latex: bool,
    quiet: bool,
) -> None:
    """Compare the planners of the batch in DIR: outcomes, harm, criticality, comfort and plan time by category.

    The comparison covers the agents that all of these planners drove. Intervals of differences come from resampled
    places (paired bootstrap). The command writes the table and the differences as Parquet, CSV and Markdown, scores and
    differences for a paper as LaTeX and Markdown, and a figure as PDF and PNG.
    For the table alone: compare DIR --latex > table.tex.
    """
    from interdrive.batches import labels_of  # noqa: PLC0415
    from interdrive.cli.batch_report import print_comparison  # noqa: PLC0415 - rich
    from interdrive.comparison import compare as compared  # noqa: PLC0415
    from interdrive.comparison.folder import save_comparison  # noqa: PLC0415

    chosen = labels_of(list(planners), "planner") if planners else None
    found = compared(folder, planners=chosen, samples=samples, level=level, seed=seed, group=group)
    target = save_comparison(found, Path(folder) / "comparison" if out is None else out, overwrite=out is None)
    if latex:
        if not found.paper:
            raise InputError(f"compare {folder}: no agent has a score, so there is no table for a paper")
        say("\n".join(one.latex() for one in found.paper).rstrip())
    elif not quiet:
        print_comparison(found, shown(target))
