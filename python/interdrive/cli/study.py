"""`interdrive study`: one encounter at increasing levels of interaction; time per step."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from interdrive.cli.arguments import assigned, claimed_folder, named_files, raw_option, shown
from interdrive.config.binding import bind
from interdrive.config.plugins import DEFAULT_PLANNER
from interdrive.errors import InputError

if TYPE_CHECKING:
    from interdrive.studies import Case


class _Target(NamedTuple):
    """Folder of the study, or None for a new one; and whether the study in it may be replaced."""

    out: str | None
    overwrite: bool


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
    if densities is not None and what != "flow":
        raise InputError(f"study {what}: --density belongs to `interdrive study flow`")
    if what == "flow":
        others = {"agent": agent, "other": other, "agents": agents, "town": town, "steps": steps, "seeds": seeds}
        refused = [name for name, value in {**others, "repetitions": repetitions}.items() if value is not None]
        if refused:
            raise InputError(f"study flow: it has no option --{refused[0]}")
        return _flow(
            planner, predictor, densities, assignments, threads, _Target(out, overwrite), quick=quick, quiet=quiet
        )
    if what == "cooperation":
        for_others = {"agent": agent, "other": other, "agents": agents, "town": town, "steps": steps}
        refused = [name for name, value in {**for_others, "repetitions": repetitions}.items() if value is not None]
        if refused:
            raise InputError(f"study cooperation: it has no option --{refused[0]}")
        target = _Target(out, overwrite)
        return _cooperation(
            seeds or 2, planner, predictor, assignments, threads, target, raw=raw, quick=quick, quiet=quiet
        )
    if seeds is not None:
        raise InputError(f"study {what}: --seeds belongs to `interdrive study cooperation`")
    for_runtime = {"agents": agents, "town": town, "steps": steps, "repetitions": repetitions, "quick": quick or None}
    given = [f"--{name}" for name, value in for_runtime.items() if value is not None]
    if what == "runtime" and (agent is not None or other is not None):
        raise InputError("study runtime: --agent and --other belong to an encounter; --agents gives numbers of agents")
    if what != "runtime" and given:
        raise InputError(f"study {what}: {given[0]} belongs to `interdrive study runtime`")
    target = _Target(out, overwrite)
    if what == "runtime":
        asked = _Asked(agents, town, steps, repetitions, quick)
        return _runtime(asked, planner, predictor, assignments, threads, target, raw=raw, quiet=quiet)
    cases, notes = _cases(what, agent, other)

    from interdrive.cli.report import print_study, progress  # noqa: PLC0415 - rich
    from interdrive.config.schema import SimulationSettings  # noqa: PLC0415
    from interdrive.files import scenario_file  # noqa: PLC0415
    from interdrive.studies import STUDY_FOLDER, case_study, save_study  # noqa: PLC0415

    settings = bind(SimulationSettings(), assigned(assignments, raw=raw))
    read = [*(scenario_file(case.scenario) for case in cases), *named_files(planner, predictor, assigned(assignments))]
    with (
        claimed_folder(out, f"study_{Path(what).stem}", STUDY_FOLDER, overwrite=overwrite, inputs=read) as folder,
        progress(quiet=quiet) as report,
    ):
        done = []
        for case in cases:
            report.say(f"reading {case.scenario}")
            done.append(
                case_study(
                    case.scenario,
                    agent=case.agent,
                    other=case.other,
                    planner=planner or DEFAULT_PLANNER,
                    predictor=predictor or "neural",
                    settings=settings,
                    threads=threads,
                    on_step=report.step,
                )
            )
        save_study(done, folder, overwrite=overwrite, on_case=lambda name: report.say(f"drawing {name}"))
    if not quiet:
        print_study(done, notes, shown(folder))
    ended = [outcome for one in done for run in one.runs.values() for outcome in run.outcomes.outcome]
    return 1 if "planner_error" in ended else 0


def _flow(
    planner: str | None,
    predictor: str | None,
    densities: str | None,
    assignments: tuple[str, ...],
    threads: int | None,
    target: _Target,
    *,
    quick: bool,
    quiet: bool,
) -> int:
    from interdrive.batches import labels_of  # noqa: PLC0415
    from interdrive.cli.report import progress  # noqa: PLC0415 - rich
    from interdrive.cli.traffic_report import print_capacities  # noqa: PLC0415
    from interdrive.config.schema import SimulationSettings  # noqa: PLC0415
    from interdrive.studies.flow import DENSITIES, FLOW_FOLDER, flow_study, save_flow  # noqa: PLC0415

    try:
        wanted = tuple(float(part) for part in densities.split(",")) if densities is not None else ()
    except ValueError:
        wanted = (-1.0,)
    if any(not 1.0 <= density <= 180.0 for density in wanted):
        raise InputError(f"--density {densities}: write vehicles per km from 1 to 180, such as 10,30,60")
    settings = bind(SimulationSettings(), assigned(assignments))
    names = labels_of([planner or DEFAULT_PLANNER], "planner")
    with (
        claimed_folder(target.out, "study_flow", FLOW_FOLDER, overwrite=target.overwrite) as folder,
        progress(quiet=quiet) as report,
    ):
        report.say("driving")
        done = flow_study(
            names,
            densities=wanted or ((10.0, 30.0, 60.0) if quick else DENSITIES),
            lanes=(1,) if quick else (1, 2),
            duration=40.0 if quick else 150.0,
            warm_up=20.0 if quick else 90.0,
            predictor=predictor or "lane_following",
            settings=settings,
            threads=threads,
            on_run=report.counted,
        )
        report.say("drawing")
        save_flow(done, folder, overwrite=target.overwrite)
    if not quiet:
        print_capacities(done, shown(folder))
    return 0


def _cooperation(
    seeds: int,
    planner: str | None,
    predictor: str | None,
    assignments: tuple[str, ...],
    threads: int | None,
    target: _Target,
    *,
    raw: bool,
    quick: bool,
    quiet: bool,
) -> int:
    from interdrive.cli.report import print_cooperation, progress  # noqa: PLC0415 - rich
    from interdrive.config.schema import SimulationSettings  # noqa: PLC0415
    from interdrive.studies.cooperation import (  # noqa: PLC0415
        COOPERATION_FOLDER,
        WITHOUT_ORDERS,
        cooperation_files,
        cooperation_study,
        cooperation_variants,
        save_cooperation,
    )

    settings = bind(SimulationSettings(), WITHOUT_ORDERS | assigned(assignments, raw=raw))
    files, notes = cooperation_files(quick=quick)
    read = [*files, *named_files(planner, predictor, assigned(assignments))]
    with (
        claimed_folder(
            target.out, "study_cooperation", COOPERATION_FOLDER, overwrite=target.overwrite, inputs=read
        ) as folder,
        progress(quiet=quiet) as report,
    ):
        report.say("reading")
        done = cooperation_study(
            files,
            cooperation_variants(quick=quick),
            seeds=1 if quick else seeds,
            planner=planner or DEFAULT_PLANNER,
            predictor=predictor or "neural",
            settings=settings,
            threads=threads,
            notes=notes,
            on_run=report.counted,
        )
        report.say("drawing")
        save_cooperation(done, folder, overwrite=target.overwrite)
    if not quiet:
        print_cooperation(done, shown(folder))
    return 0


class _Asked(NamedTuple):
    """Options of the runtime study."""

    agents: str | None
    town: str | None
    steps: int | None
    repetitions: int | None
    quick: bool


def _runtime(
    asked: _Asked,
    planner: str | None,
    predictor: str | None,
    assignments: tuple[str, ...],
    threads: int | None,
    target: _Target,
    *,
    raw: bool,
    quiet: bool,
) -> int:
    from dataclasses import replace  # noqa: PLC0415

    from interdrive.cli.report import print_runtime, progress  # noqa: PLC0415 - rich
    from interdrive.config.schema import SimulationSettings  # noqa: PLC0415
    from interdrive.studies.runtime import (  # noqa: PLC0415
        COUNTS,
        RUNTIME_FOLDER,
        TOWN_COUNTS,
        runtime_cases,
        runtime_study,
        save_runtime,
    )

    quick = asked.quick
    counts = _numbers("agents", asked.agents) or ((1, 8, 24) if quick else COUNTS)
    town = _numbers("town", asked.town) or ((24, 100) if quick else TOWN_COUNTS)
    settings = bind(SimulationSettings(), assigned(assignments, raw=raw))
    cases, notes = runtime_cases(counts, tuple(n for n in town if n), to_all=not quick and asked.agents is None)
    if predictor is not None:
        cases = tuple(replace(case, predictor=predictor) for case in cases if case.predictor != "neural")
    read = [*(case.path for case in cases), *named_files(planner, predictor, assigned(assignments))]
    with (
        claimed_folder(target.out, "study_runtime", RUNTIME_FOLDER, overwrite=target.overwrite, inputs=read) as folder,
        progress(quiet=quiet) as report,
    ):
        report.say("reading")
        done = runtime_study(
            cases,
            steps=asked.steps or (10 if quick else 50),
            repetitions=asked.repetitions or (1 if quick else 3),
            threads=threads,
            planner=planner or DEFAULT_PLANNER,
            settings=settings,
            on_run=report.counted,
            notes=notes,
        )
        save_runtime(done, folder, overwrite=target.overwrite)
    if not quiet:
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
