"""`interdrive plot`: figures of a run for papers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import click

from interdrive.cli.arguments import shown
from interdrive.errors import InputError


@click.command()
@click.argument("folder", metavar="RUN")
@click.option(
    "--kind",
    metavar="KIND",
    required=True,
    help="run, trajectories, velocity, criticality, messages or scene@SECONDS, for instance scene@3.5.",
)
@click.option("--agents", metavar="ID,ID", help="Agents to draw (all).")
@click.option(
    "--measures",
    metavar="NAME,NAME",
    default="ttc,thw",
    help="With --kind criticality: measures, one panel each (ttc,thw).",
)
@click.option(
    "--columns", type=click.IntRange(1, 2), help="Width in columns: one is 88 mm, two are 180 mm (trajectories: two)."
)
@click.option("--out", metavar="FILE", help="Figure in .pdf, .png or .svg (SCENARIO_KIND.pdf in the working folder).")
@click.option("--quiet", is_flag=True, help="Print only errors.")
def plot(
    folder: str, kind: str, agents: str | None, measures: str, columns: int | None, out: str | None, quiet: bool
) -> None:
    """Draw a figure of a run, as wide as one or two columns of a paper, with vector fonts.

    RUN is a run folder. Text remains text in PDF and SVG, so you can search and edit it.
    """
    numbers = _numbers(agents)
    panels = [name.strip() for name in measures.split(",") if name.strip()]
    if kind == "criticality" and not panels:
        raise InputError("--measures: name at least one, for instance ttc")
    if out is not None and Path(out).suffix.lower() not in (".pdf", ".png", ".svg"):
        raise InputError(f"--out {out}: figures end in .pdf, .png or .svg")

    from interdrive.cli.report import output, progress  # noqa: PLC0415 - rich
    from interdrive.plots import draw_figure, figure_kind, save_figure  # noqa: PLC0415 - matplotlib
    from interdrive.results import read_part, read_results, with_cooperation, with_routes  # noqa: PLC0415 - pyarrow
    from interdrive.results.folder import inputs_of  # noqa: PLC0415
    from interdrive.results.reader import stored_plans  # noqa: PLC0415
    from interdrive.storage import keep_inputs  # noqa: PLC0415

    try:
        name, time = figure_kind(kind)
    except InputError as error:
        raise InputError(f"--{error.location}", error.message) from None
    with progress(quiet=quiet) as bar:
        bar.say(f"reading {folder}")
        results = read_results(folder, in_part=True)
        run = replace(read_part(folder, results), plans=stored_plans(results))
        if name == "messages":
            run = with_cooperation(with_routes(run, results), results)
        bar.say("drawing")
        figure = draw_figure(run, kind, agents=numbers, measures=panels, columns=columns)
        path = Path(out or f"{run.scenario.name}_{name}{f'_{time:g}s' if time is not None else ''}.pdf")
        keep_inputs(path, inputs_of(folder, run))
        save_figure(figure, path)
    if not quiet:
        output().print(f"figure in {shown(path.resolve())}", soft_wrap=True, markup=False)


def _numbers(agents: str | None) -> list[int] | None:
    if agents is None or agents == "all":
        return None
    try:
        return [int(number) for number in agents.split(",") if number.strip()]
    except ValueError:
        raise InputError(f"--agents {agents}: write them as 12,34") from None
