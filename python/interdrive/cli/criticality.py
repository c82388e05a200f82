"""`interdrive criticality`: how close recorded or simulated traffic came to accidents."""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from interdrive.cli.arguments import assigned, id_list, raw_option, shown
from interdrive.cli.terminal import say
from interdrive.config.binding import bind
from interdrive.errors import InterdriveError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from interdrive.criticality import Criticality, CriticalMoment
    from interdrive.run import RunRecord

#: Pairs that are printed for several files.
_PAIRS = 20


@dataclass(frozen=True)
class _Source:
    """What is evaluated: its name, how it is opened, and the folder for its tables."""

    name: str
    opened: Callable[[], RunRecord]
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
    "--threads",
    metavar="N",
    type=click.IntRange(min=1),
    help="Number of threads (all cores); results do not depend on it.",
)
@raw_option
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
    raw: bool,
    out: str | None,
    png: bool,
    quiet: bool,
) -> int:
    """Evaluate all criticality measures for every vehicle and time step, without a simulation.

    FILE is a CommonRoad file or the name of a shipped scenario, whose recorded traffic is evaluated. RUN is a run
    folder. The command writes criticality.parquet (every vehicle, time step and measure) and
    criticality_extremes.parquet (the most critical value of each vehicle and measure), and prints the most critical
    moments. FOLDER stands for all files in it and in its subfolders. With several files, each gets its own folder of
    tables, criticality_joint.parquet holds the most critical values of all, and the most critical pairs are printed.
    Pairs that overlap from the start, as in some recordings, are left out.
    """
    from interdrive.cli.report import print_criticality, print_pairs, progress  # noqa: PLC0415 - rich
    from interdrive.criticality import CriticalitySettings, evaluate, measure_named  # noqa: PLC0415
    from interdrive.criticality.tables import (  # noqa: PLC0415
        criticality_extremes_table,
        save_criticality,
        save_joint_criticality,
    )

    settings = bind(CriticalitySettings(), assigned(assignments))
    judged, rank = None if participants is None else id_list("--participants", participants), measure_named(measure)
    ranked: list[tuple[str, float, CriticalMoment]] = []
    n_refused, n_overlapping, joint = 0, 0, {}
    with _sources(what, out, raw=raw) as (sources, folder), progress(quiet=quiet) as report:
        is_one = len(sources) == 1
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
            joint[source.name if source.name not in joint else str(source.folder.relative_to(folder))] = (
                found.origin.marked(criticality_extremes_table(found))
            )
            n_overlapping += len(found.overlapping)
            moments = found.most_critical_pairs(rank.name, pairs or _PAIRS)
            ranked += [(source.name, found.dt, moment) for moment in moments]
            if png:
                _draw(run, found, source.folder)
        if joint and not is_one:
            save_joint_criticality(joint, folder)
    if quiet:
        return 2 if n_refused else 0
    if is_one:
        print_criticality(found, run.scenario.name, shown(folder))
        if png and found.most_critical_moment() is None:
            say("nothing is drawn: no two vehicles were in conflict")
    if pairs or not is_one:
        ranked.sort(key=lambda one: -one[2].value if rank.grows else one[2].value)
        print_pairs(ranked[: pairs or _PAIRS])
        if n_overlapping and not is_one:
            say(f"left out: pairs of vehicles that overlap from the start ({n_overlapping})")
    if not is_one:
        say(f"{len(sources) - n_refused} of {len(sources)} files evaluated, tables in {shown(folder)}")
    return 2 if n_refused else 0


@contextmanager
def _sources(what: tuple[str, ...], out: str | None, *, raw: bool) -> Iterator[tuple[list[_Source], Path]]:
    """What the arguments name (runs, files, all files in folders), and the folder that holds all tables.

    A new folder is claimed.
    """
    from interdrive.batches.plan import scenario_files  # noqa: PLC0415
    from interdrive.criticality.tables import CRITICALITY_FOLDER  # noqa: PLC0415
    from interdrive.files import open_scenario, scenario_file  # noqa: PLC0415
    from interdrive.results import read_part  # noqa: PLC0415 - pyarrow
    from interdrive.run.assemble import recorded_traffic  # noqa: PLC0415
    from interdrive.storage import claimed_new, not_a_link, resolved  # noqa: PLC0415

    def recorded(path: str) -> RunRecord:
        return recorded_traffic(open_scenario(path, raw=raw))

    runs = [one for one in what if (Path(one) / "run.json").exists()]
    is_one = len(what) == 1 and (bool(runs) or not Path(what[0]).is_dir())
    with ExitStack() as stack:

        def place(name: str) -> Path:
            return not_a_link(out) if out else stack.enter_context(claimed_new(Path("out") / name, CRITICALITY_FOLDER))

        if is_one and runs:
            found = [_Source(what[0], partial(read_part, what[0]), not_a_link(out) if out else resolved(what[0]))]
            yield found, found[0].folder
            return
        if is_one:
            file = scenario_file(what[0])
            above = place(f"{file.stem}-criticality")
            yield [_Source(str(file), partial(recorded, str(file)), above)], above
            return
        files = scenario_files(one for one in what if one not in runs)[0] if len(runs) < len(what) else []
        above = place("criticality")
        found = [_Source(one, partial(read_part, one), above / Path(one).resolve().name) for one in runs]
        found += [_Source(file.name, partial(recorded, file.path), above / file.category / file.name) for file in files]
        for number, source in enumerate(found):
            if any(source.folder == other.folder for other in found[:number]):
                found[number] = replace(source, folder=source.folder.with_name(f"{source.folder.name}-{number}"))
        yield found, above


def _draw(run: RunRecord, found: Criticality, folder: Path) -> None:
    from interdrive.plots import draw_critical_moment, draw_criticality, save_figure  # noqa: PLC0415
    from interdrive.plots.style import AGENTS, agent_colors  # noqa: PLC0415

    moment = found.most_critical_moment()
    if moment is None:
        return
    color = agent_colors(run).get(moment.participant_id, AGENTS[0])
    save_figure(draw_criticality(found, moment.participant_id, color=color), folder / "criticality.png")
    save_figure(draw_critical_moment(run, moment), folder / "criticality_moment.png")
