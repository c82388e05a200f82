"""`interdrive criticality`: how close recorded or simulated traffic came to accidents."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from interdrive.cli.arguments import assigned, new_folder, scenario_named, shown
from interdrive.cli.terminal import say
from interdrive.config.binding import bind
from interdrive.errors import InputError

if TYPE_CHECKING:
    from interdrive.criticality import Criticality
    from interdrive.results import Run


@click.command()
@click.argument("what", metavar="FILE|RUN")
@click.option(
    "--participants", metavar="ID,ID", help="Vehicles to evaluate (all agents of a run, all vehicles of a file)."
)
@click.option(
    "--set",
    "assignments",
    metavar="NAME=VALUE",
    multiple=True,
    help="A setting, such as radius=50; docs/criticality.md lists them.",
)
@click.option(
    "--threads", metavar="N", type=click.IntRange(min=1), help="Threads (all cores); results do not depend on it."
)
@click.option("--out", metavar="DIR", help="Folder for the tables (the run folder, or a new one under out/).")
@click.option("--png", is_flag=True, help="Draw the measures over time, and the most critical moment.")
@click.option("--quiet", is_flag=True, help="Print only errors.")
def criticality(
    what: str,
    participants: str | None,
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
    moments.
    """
    from interdrive.cli.report import print_criticality, progress  # noqa: PLC0415 - rich
    from interdrive.criticality import CriticalitySettings, evaluate  # noqa: PLC0415
    from interdrive.criticality.tables import save_criticality  # noqa: PLC0415

    settings = bind(CriticalitySettings(), assigned(assignments))
    judged = _numbers(participants)
    with progress(quiet=quiet) as report:
        report.say(f"reading {what}")
        run, folder = _opened(what, out)
        report.say("evaluating")
        source = run if run.agents else run.scenario
        found = evaluate(source, judged, settings=settings, threads=threads)
        report.say("writing")
        save_criticality(found, folder)
        if png:
            report.say("drawing")
            _draw(run, found, folder)
    if not quiet:
        print_criticality(found, run.scenario.name, shown(folder))
        if png and found.most_critical_moment() is None:
            say("nothing is drawn: no two vehicles were in conflict")
    return 0


def _numbers(ids: str | None) -> list[int] | None:
    if ids is None:
        return None
    try:
        return [int(number) for number in ids.split(",")]
    except ValueError:
        raise InputError(f"--participants {ids}: write them as 12,34") from None


def _opened(what: str, out: str | None) -> tuple[Run, Path]:
    """The run to evaluate, and the folder for the tables."""
    from interdrive.files import read_scenario, shipped_scenario, shipped_scenarios  # noqa: PLC0415
    from interdrive.results import recorded_run, reopen  # noqa: PLC0415 - pyarrow
    from interdrive.storage import not_a_link, resolved  # noqa: PLC0415

    if Path(what).is_dir():
        return reopen(what), not_a_link(out) if out else resolved(what)
    name, target = scenario_named(what), not_a_link(out) if out else None
    path = shipped_scenario(name) if name in shipped_scenarios() and not Path(name).exists() else name
    run = recorded_run(read_scenario(path))
    return run, target or resolved(new_folder(f"{Path(what).stem}-criticality"))


def _draw(run: Run, found: Criticality, folder: Path) -> None:
    from interdrive.plots import draw_critical_moment, draw_criticality, save_figure  # noqa: PLC0415
    from interdrive.plots.style import AGENTS, agent_colors  # noqa: PLC0415

    moment = found.most_critical_moment()
    if moment is None:
        return
    color = agent_colors(run).get(moment.participant_id, AGENTS[0])
    save_figure(draw_criticality(found, moment.participant_id, color=color), folder / "criticality.png")
    save_figure(draw_critical_moment(run, moment), folder / "criticality_moment.png")
