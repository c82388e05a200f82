"""`interdrive criticality`: how close recorded or simulated traffic came to accidents."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from interdrive.cli.arguments import assigned, id_list, new_folder, shown
from interdrive.cli.terminal import say
from interdrive.config.binding import bind
from interdrive.errors import InterdriveError

if TYPE_CHECKING:
    from collections.abc import Callable

    from interdrive.criticality import Criticality, CriticalMoment
    from interdrive.results import Run

#: Pairs that are printed for several files.
_PAIRS = 20


@dataclass(frozen=True)
class _Source:
    """What is evaluated: its name, how it is opened, and the folder for its tables."""

    name: str
    opened: Callable[[], Run]
    folder: Path


@click.command()
@click.argument("what", metavar="FILE|FOLDER|RUN...", nargs=-1, required=True)
@click.option(
    "--participants", metavar="ID,ID", help="Vehicles to evaluate (all agents of a run, all vehicles of a file)."
)
@click.option("--pairs", metavar="N", type=click.IntRange(min=1), help="Print the N most critical pairs of vehicles.")
@click.option("--measure", metavar="NAME", default="ttc", help="Measure that ranks the pairs (ttc).")
@click.option(
    "--set",
    "assignments",
    metavar="NAME=VALUE",
    multiple=True,
    help="A setting, such as radius=50; the documentation (Settings) lists them.",
)
@click.option(
    "--threads", metavar="N", type=click.IntRange(min=1), help="Threads (all cores); results do not depend on it."
)
@click.option("--out", metavar="DIR", help="Folder for the tables (the run folder, or a new one under out/).")
@click.option("--png", is_flag=True, help="Draw the measures over time, and the most critical moment.")
@click.option("--quiet", is_flag=True, help="Print only errors.")
def criticality(
    what: tuple[str, ...],
    participants: str | None,
    pairs: int | None,
    measure: str,
    assignments: tuple[str, ...],
    threads: int | None,
    out: str | None,
    png: bool,
    quiet: bool,
) -> int:
    """Evaluate all criticality measures for every vehicle and time step, without simulating.

    FILE is a CommonRoad file or the name of a shipped scenario, whose recorded traffic is evaluated. RUN is a run
    folder. The command writes criticality.parquet (every vehicle, time step and measure) and
    criticality_extremes.parquet (the most critical value of each vehicle and measure), and prints the most critical
    moments. FOLDER stands for all files in it and the folders below; each of several files gets its own folder of
    tables, and the most critical pairs of all of them are printed.
    """
    from interdrive.cli.report import print_criticality, print_pairs, progress  # noqa: PLC0415 - rich
    from interdrive.criticality import CriticalitySettings, evaluate, measure_named  # noqa: PLC0415
    from interdrive.criticality.tables import save_criticality  # noqa: PLC0415

    settings = bind(CriticalitySettings(), assigned(assignments))
    judged, rank = None if participants is None else id_list("--participants", participants), measure_named(measure)
    sources, folder = _sources(what, out)
    is_one = len(sources) == 1
    ranked: list[tuple[str, float, CriticalMoment]] = []
    n_refused = 0
    with progress(quiet=quiet) as report:
        for done, source in enumerate(sources):
            report.counted(f"evaluating {source.name}", done, len(sources))
            try:
                run = source.opened()
                found = evaluate(run if run.agents else run.scenario, judged, settings=settings, threads=threads)
                save_criticality(found, source.folder)
            except InterdriveError as error:
                if is_one:
                    raise
                say(f"error: {error}", err=True)
                n_refused += 1
                continue
            moments = found.most_critical_pairs(rank.name, pairs or _PAIRS)
            ranked += [(source.name, found.dt, moment) for moment in moments]
            if png:
                _draw(run, found, source.folder)
    if quiet:
        return 2 if n_refused else 0
    if is_one:
        print_criticality(found, run.scenario.name, shown(folder))
        if png and found.most_critical_moment() is None:
            say("nothing is drawn: no two vehicles were in conflict")
    if pairs or not is_one:
        ranked.sort(key=lambda one: -one[2].value if rank.grows else one[2].value)
        print_pairs(ranked[: pairs or _PAIRS])
    if not is_one:
        say(f"{len(sources) - n_refused} of {len(sources)} files evaluated, tables in {shown(folder)}")
    return 2 if n_refused else 0


def _sources(what: tuple[str, ...], out: str | None) -> tuple[list[_Source], Path]:
    """What the arguments name (runs, files, all files in folders), and the folder that holds all tables."""
    from interdrive.batches.plan import scenario_files  # noqa: PLC0415
    from interdrive.files import open_scenario, scenario_file  # noqa: PLC0415
    from interdrive.results import recorded_run, reopen  # noqa: PLC0415 - pyarrow
    from interdrive.storage import not_a_link, resolved  # noqa: PLC0415

    def recorded(path: str) -> Run:
        return recorded_run(open_scenario(path))

    target = not_a_link(out) if out else None
    runs = [one for one in what if (Path(one) / "run.json").exists()]
    if len(what) == 1 and (runs or not Path(what[0]).is_dir()):
        name = what[0] if runs else str(scenario_file(what[0]))
        folder = target or resolved(name if runs else new_folder(f"{Path(name).stem}-criticality"))
        return [_Source(name, partial(reopen if runs else recorded, name), folder)], folder
    above = target or resolved(new_folder("criticality"))
    files = scenario_files(one for one in what if one not in runs)[0] if len(runs) < len(what) else []
    found = [_Source(one, partial(reopen, one), above / Path(one).resolve().name) for one in runs]
    found += [_Source(file.name, partial(recorded, file.path), above / file.category / file.name) for file in files]
    for number, source in enumerate(found):
        if any(source.folder == other.folder for other in found[:number]):
            found[number] = replace(source, folder=source.folder.with_name(f"{source.folder.name}-{number}"))
    return found, above


def _draw(run: Run, found: Criticality, folder: Path) -> None:
    from interdrive.plots import draw_critical_moment, draw_criticality, save_figure  # noqa: PLC0415
    from interdrive.plots.style import AGENTS, agent_colors  # noqa: PLC0415

    moment = found.most_critical_moment()
    if moment is None:
        return
    color = agent_colors(run).get(moment.participant_id, AGENTS[0])
    save_figure(draw_criticality(found, moment.participant_id, color=color), folder / "criticality.png")
    save_figure(draw_critical_moment(run, moment), folder / "criticality_moment.png")
