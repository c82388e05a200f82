"""`interdrive study`: the same encounter in every degree of interaction."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from interdrive.cli.arguments import assigned, new_folder, scenario_named, shown
from interdrive.errors import InputError
from interdrive.settings import bind

if TYPE_CHECKING:
    from interdrive.studies import Case


@click.command()
@click.argument("what", metavar="merge|t_junction|FILE")
@click.option("--agent", metavar="ID", type=int, help="Vehicle that always plans (with FILE).")
@click.option("--other", metavar="ID", type=int, help="Recorded vehicle whose behaviour is varied (with FILE).")
@click.option("--planner", metavar="NAME", default="frenet", help="Of the agent and of the interactive other vehicle.")
@click.option("--predictor", metavar="NAME", default="lane_following", help="Of both.")
@click.option(
    "--set", "assignments", metavar="NAME=VALUE", multiple=True, help="A setting; `interdrive settings` lists them."
)
@click.option(
    "--threads",
    metavar="N",
    type=click.IntRange(min=1),
    help="Threads that plan (all cores); results do not depend on it.",
)
@click.option("--out", metavar="DIR", help="Folder of the study (a new one under out/).")
@click.option("--overwrite", is_flag=True, help="Replace the study in that folder.")
@click.option("--quiet", is_flag=True, help="Print nothing but errors.")
def study(
    what: str,
    agent: int | None,
    other: int | None,
    planner: str,
    predictor: str,
    assignments: tuple[str, ...],
    threads: int | None,
    out: str | None,
    overwrite: bool,
    quiet: bool,
) -> int:
    """Let one vehicle meet another that reacts more and more: a table, figures, and the runs.

    The agent always plans. The other vehicle replays its recording (deterministic), adjusts its speed on its recorded
    path (semi-deterministic), or drives with the agent's planner (interactive). Nobody else plans.

    merge and t_junction are the case studies of the paper, on the recorded scenarios below $INTERDRIVE_SCENARIOS and on
    a shipped one. Any other FILE, or name of a shipped scenario, needs --agent and --other.
    """
    cases, notes = _cases(what, agent, other)

    from interdrive.cli.report import print_study, progress  # noqa: PLC0415 - rich
    from interdrive.run_settings import SimulationSettings  # noqa: PLC0415
    from interdrive.studies import case_study, save_study  # noqa: PLC0415
    from interdrive.studies.folder import check_study_target  # noqa: PLC0415

    settings = bind(SimulationSettings(), assigned(assignments))
    folder = check_study_target(
        new_folder(f"study_{Path(what).stem}") if out is None else out, overwrite=overwrite and out is not None
    )
    with progress(quiet=quiet) as report:
        done = []
        for case in cases:
            report.say(f"reading {case.scenario}")
            done.append(
                case_study(
                    case.scenario,
                    agent=case.agent,
                    other=case.other,
                    planner=planner,
                    predictor=predictor,
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


def _cases(what: str, agent: int | None, other: int | None) -> tuple[tuple[Case, ...], tuple[str, ...]]:
    """What to simulate, and what the user should know about it; with a pair, `t_junction` is the shipped scenario."""
    from interdrive.studies import STUDIES, Case, known_cases  # noqa: PLC0415

    if agent is None and other is None and what in STUDIES:
        return known_cases(what)
    if agent is None or other is None:
        raise InputError(
            f"study {what}: which encounter? Give --agent and --other; studies by name: {', '.join(STUDIES)}"
        )
    return (Case(scenario_named(what), agent, other),), ()
