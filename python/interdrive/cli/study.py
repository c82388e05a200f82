"""`interdrive study`: one encounter at increasing levels of interaction; time per step."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from interdrive.cli.arguments import assigned, claimed_folder, named_files, raw_option, shown
from interdrive.config.binding import bind
from interdrive.config.plugins import DEFAULT_PLANNER
from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from interdrive.cli.report import Report
    from interdrive.config.schema import SimulationSettings
    from interdrive.storage import FolderKind
    from interdrive.studies import Case


_ENCOUNTER = "an encounter"
#: Options that do not belong to every study, and the studies to which they belong.
_BELONGS = {
    "agent": (_ENCOUNTER,),
    "other": (_ENCOUNTER,),
    "agents": ("runtime",),
    "town": ("runtime",),
    "steps": ("runtime",),
    "repetitions": ("runtime",),
    "seeds": ("cooperation",),
    "density": ("flow",),
    "quick": ("runtime", "cooperation", "flow"),
}


class _Common(NamedTuple):
    """Options of every study.

    Attributes:
        out: Folder of the study; None: a new one.
        overwrite: Whether the study in it may be replaced.
    """

    planner: str | None
    predictor: str | None
    assignments: tuple[str, ...]
    threads: int | None
    out: str | None
    overwrite: bool
    raw: bool
    quiet: bool

    def settings(self, base: Mapping[str, Any] | None = None) -> SimulationSettings:
        """The settings, on top of those that the study begins with."""
        from interdrive.config.schema import SimulationSettings  # noqa: PLC0415

        return bind(SimulationSettings(), {**(base or {}), **assigned(self.assignments, raw=self.raw)})

    @contextmanager
    def folder(self, name: str, known_by: FolderKind, read: Iterable[Path | str] = ()) -> Iterator[tuple[Path, Report]]:
        """The folder that the study is written to, and what says how far it is.

        Args:
            name: Of a new folder.
            known_by: File by which a study of this kind is known.
            read: Files that the study reads.
        """
        from interdrive.cli.report import progress  # noqa: PLC0415 - rich

        read = [*read, *named_files(self.planner, self.predictor, assigned(self.assignments))]
        with (
            claimed_folder(self.out, name, known_by, overwrite=self.overwrite, inputs=read) as folder,
            progress(quiet=self.quiet) as report,
        ):
            yield folder, report


@click.command()
@click.argument("what", metavar="merge|t_junction|runtime|cooperation|flow|FILE")
@click.option("--agent", metavar="ID", type=int, help="Vehicle that always plans (with FILE).")
@click.option("--other", metavar="ID", type=int, help="Recorded vehicle whose behaviour is varied (with FILE).")
@click.option(
    "--planner",
    metavar="NAME",
    help="Planner of the agent and of the interactive other vehicle (rollout; with flow several, NAME,NAME).",
)
@click.option("--predictor", metavar="NAME", help="Predictor (neural; with runtime lane_following).")
@click.option(
    "--set", "assignments", metavar="NAME=VALUE", multiple=True, help="A setting; `interdrive settings` lists them."
)
@click.option(
    "--threads",
    metavar="N",
    type=click.IntRange(min=1),
    help="Number of planning threads (all cores); results do not depend on it.",
)
@raw_option
@click.option("--agents", metavar="N,N,...", help="runtime: numbers of agents (1,2,4,8,16,24 and all).")
@click.option("--town", metavar="N,N,...", help="runtime: numbers of agents in the town (24,100,300,1000; 0: none).")
@click.option("--steps", metavar="N", type=click.IntRange(min=1), help="runtime: time steps per run (50).")
@click.option("--repetitions", metavar="N", type=click.IntRange(min=1), help="runtime: runs of each kind (3).")
@click.option("--seeds", metavar="N", type=click.IntRange(min=1), help="cooperation: number of seeds (2).")
@click.option("--density", "densities", metavar="N,N,...", help="flow: vehicles per km and lane (5 to 100).")
@click.option("--quick", is_flag=True, help="runtime, cooperation, flow: a short version as a test (a minute).")
@click.option("--out", metavar="DIR", help="Folder of the study (a new one under out/).")
@click.option("--overwrite", is_flag=True, help="Replace the study in that folder.")
@click.option("--quiet", is_flag=True, help="Print only errors.")
def study(
    what: str,
    agent: int | None,
    other: int | None,
    planner: str | None,
    predictor: str | None,
    assignments: tuple[str, ...],
    raw: bool,
    threads: int | None,
    agents: str | None,
    town: str | None,
    steps: int | None,
    repetitions: int | None,
    seeds: int | None,
    densities: str | None,
    quick: bool,
    out: str | None,
    overwrite: bool,
    quiet: bool,
) -> int:
    """Replay one encounter at increasing levels of interaction, with a table, figures, and the runs.

    The agent always plans. The other vehicle replays its recording (deterministic), adjusts its speed on its recorded
    path (semi-deterministic), or drives with the agent's planner (interactive). No other vehicle plans.

    merge and t_junction are the case studies of the paper, on recorded scenarios in $INTERDRIVE_SCENARIOS and on a
    shipped one. Any other FILE or shipped scenario needs --agent and --other.

    runtime measures the time per step over the number of agents, with one thread and with all threads, in four
    scenarios and in the shipped town with up to 1000 agents, with tables and figures.

    flow drives rings of one and two lanes at several densities: flow and speed over density (fundamental diagram), with
    capacities and the speed of jam waves.

    cooperation compares shares of equipped agents, delays and losses of messages over scenarios and seeds. Agents get
    no orders at junctions unless you set rules.precedence=true.
    """
    kind = what if what in ("runtime", "cooperation", "flow") else _ENCOUNTER
    numbers = {"agents": agents, "town": town, "steps": steps, "repetitions": repetitions}
    given = {"agent": agent, "other": other, **numbers, "seeds": seeds, "density": densities, "quick": quick or None}
    for option, value in given.items():
        if value is not None and kind not in _BELONGS[option]:
            owners = [one if one == _ENCOUNTER else f"`interdrive study {one}`" for one in _BELONGS[option]]
            raise InputError(f"study {what}: --{option} belongs to {' or '.join(owners)}")
    common = _Common(planner, predictor, assignments, threads, out, overwrite, raw, quiet)
    if kind == "flow":
        return _flow(common, densities, quick=quick)
    if kind == "cooperation":
        return _cooperation(common, seeds or 2, quick=quick)
    if kind == "runtime":
        return _runtime(common, agents, town, steps, repetitions, quick=quick)
    return _encounter(common, what, agent, other)


def _encounter(common: _Common, what: str, agent: int | None, other: int | None) -> int:
    from interdrive.cli.report import print_study  # noqa: PLC0415 - rich
    from interdrive.files import scenario_file  # noqa: PLC0415
    from interdrive.studies import STUDY_FOLDER, case_study, save_study  # noqa: PLC0415

    cases, notes = _cases(what, agent, other)
    settings = common.settings()
    read = [scenario_file(case.scenario) for case in cases]
    with common.folder(f"study_{Path(what).stem}", STUDY_FOLDER, read) as (folder, report):
        done = []
        for case in cases:
            report.say(f"reading {case.scenario}")
            done.append(
                case_study(
                    case.scenario,
                    agent=case.agent,
                    other=case.other,
                    planner=common.planner or DEFAULT_PLANNER,
                    predictor=common.predictor or "neural",
                    settings=settings,
                    threads=common.threads,
                    on_step=report.step,
                )
            )
        save_study(done, folder, overwrite=common.overwrite, on_case=lambda name: report.say(f"drawing {name}"))
    if not common.quiet:
        print_study(done, notes, shown(folder))
    ended = [outcome for one in done for run in one.runs.values() for outcome in run.outcomes.outcome]
    return 1 if "planner_error" in ended else 0


def _flow(common: _Common, densities: str | None, *, quick: bool) -> int:
    from interdrive.batches import labels_of  # noqa: PLC0415
    from interdrive.cli.traffic_report import print_capacities  # noqa: PLC0415 - rich
    from interdrive.studies.flow import DENSITIES, FLOW_FOLDER, flow_study, save_flow  # noqa: PLC0415

    try:
        wanted = tuple(float(part) for part in densities.split(",")) if densities is not None else ()
    except ValueError:
        wanted = (-1.0,)
    if any(not 1.0 <= density <= 180.0 for density in wanted):
        raise InputError(f"--density {densities}: write vehicles per km from 1 to 180, such as 10,30,60")
    settings = common.settings()
    names = labels_of([common.planner or DEFAULT_PLANNER], "planner")
    with common.folder("study_flow", FLOW_FOLDER) as (folder, report):
        report.say("driving")
        done = flow_study(
            names,
            densities=wanted or ((10.0, 30.0, 60.0) if quick else DENSITIES),
            lanes=(1,) if quick else (1, 2),
            duration=40.0 if quick else 150.0,
            warm_up=20.0 if quick else 90.0,
            predictor=common.predictor or "lane_following",
            settings=settings,
            threads=common.threads,
            on_run=report.counted,
        )
        report.say("drawing")
        save_flow(done, folder, overwrite=common.overwrite)
    if not common.quiet:
        print_capacities(done, shown(folder))
    return 0


def _cooperation(common: _Common, seeds: int, *, quick: bool) -> int:
    from interdrive.cli.report import print_cooperation  # noqa: PLC0415 - rich
    from interdrive.studies.cooperation import (  # noqa: PLC0415
        COOPERATION_FOLDER,
        WITHOUT_ORDERS,
        cooperation_files,
        cooperation_study,
        cooperation_variants,
        save_cooperation,
    )

    settings = common.settings(WITHOUT_ORDERS)
    files, notes = cooperation_files(quick=quick)
    with common.folder("study_cooperation", COOPERATION_FOLDER, files) as (folder, report):
        report.say("reading")
        done = cooperation_study(
            files,
            cooperation_variants(quick=quick),
            seeds=1 if quick else seeds,
            planner=common.planner or DEFAULT_PLANNER,
            predictor=common.predictor or "neural",
            settings=settings,
            threads=common.threads,
            notes=notes,
            on_run=report.counted,
        )
        report.say("drawing")
        save_cooperation(done, folder, overwrite=common.overwrite)
    if not common.quiet:
        print_cooperation(done, shown(folder))
    return 0


def _runtime(
    common: _Common, agents: str | None, town: str | None, steps: int | None, repetitions: int | None, *, quick: bool
) -> int:
    from dataclasses import replace  # noqa: PLC0415

    from interdrive.cli.report import print_runtime  # noqa: PLC0415 - rich
    from interdrive.studies.runtime import (  # noqa: PLC0415
        COUNTS,
        RUNTIME_FOLDER,
        TOWN_COUNTS,
        runtime_cases,
        runtime_study,
        save_runtime,
    )

    counts = _numbers("agents", agents) or ((1, 8, 24) if quick else COUNTS)
    in_town = _numbers("town", town) or ((24, 100) if quick else TOWN_COUNTS)
    settings = common.settings()
    cases, notes = runtime_cases(counts, tuple(n for n in in_town if n), to_all=not quick and agents is None)
    if common.predictor is not None:
        cases = tuple(replace(case, predictor=common.predictor) for case in cases if case.predictor != "neural")
    with common.folder("study_runtime", RUNTIME_FOLDER, [case.path for case in cases]) as (folder, report):
        report.say("reading")
        done = runtime_study(
            cases,
            steps=steps or (10 if quick else 50),
            repetitions=repetitions or (1 if quick else 3),
            threads=common.threads,
            planner=common.planner or DEFAULT_PLANNER,
            settings=settings,
            on_run=report.counted,
            notes=notes,
        )
        save_runtime(done, folder, overwrite=common.overwrite)
    if not common.quiet:
        print_runtime(done, shown(folder))
    return 0


def _numbers(option: str, text: str | None) -> tuple[int, ...]:
    if text is None:
        return ()
    try:
        found = sorted({int(part) for part in text.split(",") if part.strip()})
    except ValueError:
        found = [-1]
    if not found or found[0] < (0 if option == "town" else 1):
        raise InputError(f"--{option} {text}: write numbers of agents, such as 1,8,24")
    return tuple(found)


def _cases(what: str, agent: int | None, other: int | None) -> tuple[tuple[Case, ...], tuple[str, ...]]:
    """Cases to simulate, and notes for the user; with a pair, `t_junction` is the shipped scenario."""
    from interdrive.files import scenario_file  # noqa: PLC0415 - commonroad-io takes a second to load
    from interdrive.studies import STUDIES, Case, known_cases  # noqa: PLC0415

    if agent is None and other is None and what in STUDIES:
        return known_cases(what)
    if agent is None or other is None:
        raise InputError(f"study {what}: no encounter; give --agent and --other; studies by name: {', '.join(STUDIES)}")
    return (Case(str(scenario_file(what)), agent, other),), ()
