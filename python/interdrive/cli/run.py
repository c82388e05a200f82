"""`interdrive run`: one scenario from file to run folder."""

from __future__ import annotations

import traceback
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from interdrive.cli.arguments import (
    assigned,
    choices_by_agent,
    claimed_folder,
    named_files,
    raw_option,
    shown,
    source_option,
)
from interdrive.cli.config import RunChoices, read_config
from interdrive.cli.terminal import say
from interdrive.config.binding import bind
from interdrive.config.styles import style_settings
from interdrive.errors import InputError, InterdriveError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from interdrive.cli.report import Report
    from interdrive.config.agent_config import PlannersSpec
    from interdrive.config.plugins import Choice
    from interdrive.config.schema import SimulationSettings
    from interdrive.config.specs import PlannerSpec
    from interdrive.long_runs import WrittenRun
    from interdrive.run.flows import LaneFlow
    from interdrive.runs import Run
    from interdrive.simulation import Simulation


#: Larger runs are written while they are simulated [B].
_HELD_MAX = 128e6

#: Additional recordings for a report or the film of an agent; each can be switched off again.
_RECORDED = {"record.views": True, "record.predictions": True, "record.candidates": 30, "record.messages": "links"}


@click.command()
@click.argument("file", required=False)
@click.option(
    "--agents",
    metavar="all|reachable|problems|N|ID,ID",
    help="Agents: all, reachable (recorded vehicles that are in time), problems (planning problems only), a number "
    "chosen with the seed (0: none of the file), or ids. A single id is an id if there are fewer agents than that; "
    "'7,' always is.",
)
@click.option(
    "--planner",
    metavar="PLANNER[,NAME=VALUE...]",
    help="Planner of the agents: rollout (default), another one listed by `interdrive planners`, or module:object.",
)
@click.option(
    "--agent",
    "by_agent",
    metavar="ID=PLANNER[,NAME=VALUE...]",
    multiple=True,
    help="Planner, settings or view of one agent, for instance 5=rollout,horizon=4,view.sensor_radius=40.",
)
@click.option(
    "--predictor",
    metavar="PREDICTOR[,NAME=VALUE...]",
    help="Predictor: neural (default), another one listed by `interdrive predictors`, or module:object.",
)
@click.option(
    "--style",
    metavar="calm|normal|brisk",
    help="How gently agents with the planner rollout drive; settings under planner.rollout.comfort take precedence.",
)
@click.option(
    "--set", "assignments", metavar="NAME=VALUE", multiple=True, help="A setting; `interdrive settings` lists them."
)
@raw_option
@source_option
@click.option(
    "--config", metavar="TOML", help="File with the same options and settings; the command line takes precedence."
)
@click.option(
    "--traffic",
    metavar="[PLANNER,]NAME=VALUE[,...]",
    help="Generated traffic, such as rate=600 (vehicles per hour and lane) or idm,density=20; names are those of the "
    "settings traffic.NAME. --agents 0 leaves out the vehicles of the file.",
)
@click.option("--v2x", metavar="P", help="Share of the agents that cooperate by V2X, 0 to 1 (v2x.penetration).")
@click.option(
    "--start",
    metavar="STEP",
    help="Time step of the recording at which the run begins, as if the file had been cut there (recording.start).",
)
@click.option(
    "--seed", metavar="N", help="Seed for the choice of agents and for the random numbers of cooperation (0)."
)
@click.option("--threads", metavar="N", help="Number of planning threads (all cores); results do not depend on it.")
@click.option("--out", metavar="DIR", help="Run folder (a new one under out/).")
@click.option("--overwrite", is_flag=True, default=None, help="Replace the run in that folder.")
@click.option("--png", is_flag=True, default=None, help="Draw all trajectories: run.png.")
@click.option("--gif", is_flag=True, default=None, help="Make a film: run.gif.")
@click.option("--mp4", is_flag=True, default=None, help="Make a film: run.mp4 (needs ffmpeg).")
@click.option(
    "--report", is_flag=True, default=None, help="Record views, predictions and candidates; make report.html."
)
@click.option(
    "--profile",
    is_flag=True,
    default=None,
    help="Measure every plan: print what phases, planners and agents cost; profile.parquet.",
)
@click.option(
    "--raise", "raises", is_flag=True, help="Stop at the first exception of a Python planner and print its traceback."
)
@click.option("--quiet", is_flag=True, help="Print only errors.")
def run(
    file: str | None,
    assignments: tuple[str, ...],
    raw: bool,
    source: tuple[str, ...],
    by_agent: tuple[str, ...],
    config: str | None,
    raises: bool,
    quiet: bool,
    **given: Any,  # noqa: ANN401 - texts and flags
) -> int:
    """Simulate a scenario in which vehicles plan for themselves.

    FILE is a CommonRoad file, the name of a shipped scenario (t_junction, lane_merge, highway, intersection, signals,
    town), or a file of another tool (see `interdrive convert --help`).
    """
    given["scenario"] = file
    choices, own, settings = _configured(
        config,
        {name: value for name, value in given.items() if value is not None},
        by_agent,
        assigned(assignments, raw=raw, source=source),
    )
    if not choices.scenario:
        raise InputError("run: no scenario; give a CommonRoad file or the name of a shipped scenario")

    from interdrive.cli.report import progress  # noqa: PLC0415 - rich
    from interdrive.config.binding import flatten  # noqa: PLC0415
    from interdrive.files import scenario_file, scenario_parts  # noqa: PLC0415
    from interdrive.long_runs import write_run  # noqa: PLC0415
    from interdrive.results import RUN_FOLDER, save  # noqa: PLC0415
    from interdrive.runs import RunInterrupted  # noqa: PLC0415
    from interdrive.simulation import Simulation  # noqa: PLC0415

    path = scenario_file(choices.scenario)  # before anything else is done
    if choices.mp4:
        from interdrive.plots import check_animation  # noqa: PLC0415

        check_animation("run.mp4")
    read = [*scenario_parts(path), path]
    read += named_files(config, vars(choices), *map(vars, own.values()), flatten(settings))
    with (
        claimed_folder(
            choices.out,
            Path(choices.scenario).stem,
            RUN_FOLDER,
            overwrite=choices.overwrite,
            inputs=read,
            tables=False,  # checked after the first step
        ) as folder,
        progress(quiet=quiet) as report,
    ):
        report.say(f"reading {choices.scenario}")
        simulation = Simulation(
            choices.scenario,
            agents=choices.agents,
            planner=_planners(choices.planner, own),
            predictor=choices.predictor,
            settings=settings,
            seed=choices.seed,
            threads=choices.threads,
            on_planner_error="raise" if raises else "end_agent",
            on_setup=report.setup,
        )
        written = done = None
        try:
            if settings.traffic.is_on and _is_streamed(simulation, choices):
                written = write_run(
                    simulation, folder, overwrite=choices.overwrite, on_step=_checking_tables(report.step)
                )
            else:
                done = simulation.run(_checking_tables(report.step))
        except RunInterrupted as stop:
            if stop.run.states.n_steps < 2:
                raise KeyboardInterrupt from None
            save(stop.run, folder, overwrite=choices.overwrite)
            raise KeyboardInterrupt(f"{stop}; the run until then is in {shown(folder)}") from None
        except InterdriveError:
            raise
        except Exception:
            if not raises:
                raise
            say(traceback.format_exc(), err=True)
            return 1
        if done is not None:
            _save(done, folder, choices, report)
    if not quiet:
        _print(done, written, shown(folder))
    ended = written.run if written is not None else done
    return 1 if ended is not None and "planner_error" in ended.outcomes.outcome else 0


def _save(done: Run, folder: Path, choices: RunChoices, report: Report) -> None:
    """Writes a run that was held, and what is drawn of it."""
    from interdrive.results import save  # noqa: PLC0415 - pyarrow

    report.say("writing")
    save(done, folder, overwrite=choices.overwrite)
    with _kept(folder):
        _draw(done, folder, choices, report.frames)
        if choices.report:
            from interdrive.report import write_run_report  # noqa: PLC0415 - matplotlib

            report.say("writing report.html")
            write_run_report(folder)


def _print(done: Run | None, written: WrittenRun | None, folder: Path) -> None:
    """Prints what became of the run, which was held or written meanwhile."""
    from interdrive.cli.report import print_run  # noqa: PLC0415 - rich

    flows: Sequence[LaneFlow] = ()
    if written is not None:
        done, flows = written.run, written.flows
        print_run(done, folder, written.harm.harm)
    elif done is not None:
        print_run(done, folder)
        if done.demand is not None:
            from interdrive.run.flows import lane_flows  # noqa: PLC0415 - numpy

            flows = lane_flows(done)
    if flows:
        from interdrive.cli.traffic_report import print_flows  # noqa: PLC0415 - rich

        print_flows(flows)
    if done is not None and done.profile is not None:
        from interdrive.cli.profile_report import print_costs  # noqa: PLC0415 - rich

        print_costs(done)


def _is_streamed(simulation: Simulation, choices: RunChoices) -> bool:
    """Whether a run is written while it is simulated: it may become large, and nothing needs it as a whole."""
    from interdrive.long_runs import can_be_streamed, size_at_most  # noqa: PLC0415 - numpy

    draws = choices.png or choices.gif or choices.mp4 or choices.report
    return not draws and size_at_most(simulation) > _HELD_MAX and can_be_streamed(simulation)


def _checking_tables(on_step: Callable[[int, int, int, int], None]) -> Callable[[int, int, int, int], None]:
    """Calls also `check_tables`, whose imports take a tenth of a second: so after the first step, not before it."""
    from interdrive.storage import check_tables  # noqa: PLC0415

    def stepped(*numbers: int) -> None:
        on_step(*numbers)
        check_tables()

    return stepped


def _configured(
    config: str | None, given: Mapping[str, Any], by_agent: Sequence[str], values_given: dict[str, str]
) -> tuple[RunChoices, dict[int, Choice], SimulationSettings]:
    """Choices for all agents, choices per agent, and settings: defaults, then the file, then the command line."""
    from interdrive.config.schema import SimulationSettings, with_traffic  # noqa: PLC0415

    choices = RunChoices()
    values: dict[str, Any] = {}
    own: dict[int, Choice] = {}
    if config is not None:
        in_file, own, values = read_config(Path(config))
        try:
            choices = bind(choices, in_file)
        except InputError as error:
            raise error.within(config) from None
    try:
        choices = bind(choices, given)
    except InputError as error:
        raise InputError(f"--{error.location.replace('_', '-')}", error.message) from None
    style = style_settings(choices.style)
    settings = bind(
        SimulationSettings(), {**style, **(_RECORDED if choices.report else {}), "record.profile": choices.profile}
    )
    try:
        settings = bind(settings, values)
    except InputError as error:
        raise error.within(str(config)) from None
    if choices.v2x is not None:
        values_given = {"v2x.penetration": str(choices.v2x), **values_given}
    if choices.start is not None:
        values_given = {"recording.start": str(choices.start), **values_given}
    _refuse_twice(choices.traffic, values_given)
    settings = bind(with_traffic(settings, choices.traffic), values_given)
    return choices, own | choices_by_agent(by_agent), settings


def _refuse_twice(traffic: str | None, values_given: Mapping[str, str]) -> None:
    """Refuses settings of generated traffic that both --traffic and --set give."""
    from interdrive.config.plugins import read_choice  # noqa: PLC0415

    if traffic is None:
        return
    choice = read_choice(traffic, "traffic")
    for name in (*(("planner",) if choice.chosen is not None else ()), *choice.settings):
        if f"traffic.{name}" in values_given:
            raise InputError(f"--traffic {traffic}: {name} is given by --set traffic.{name}, too; leave one out")


def _planners(planner: str, own: dict[int, Choice]) -> PlannersSpec:
    """The planner of all agents, and those of single ones."""
    found: dict[int | str, PlannerSpec] = {"default": planner}
    return found | own if own else planner


def _draw(done: Run, folder: Path, choices: RunChoices, on_frame: Callable[[str], Callable[[int, int], None]]) -> None:
    if not (choices.png or choices.gif or choices.mp4):
        return
    from interdrive.plots import animate_run, draw_run, save_figure  # noqa: PLC0415

    if choices.png:
        save_figure(draw_run(done), folder / "run.png")
    for wanted, name in ((choices.gif, "run.gif"), (choices.mp4, "run.mp4")):
        if wanted:
            animate_run(done, folder / name, on_frame=on_frame(name))


@contextmanager
def _kept(folder: Path) -> Iterator[None]:
    """States where the stored run is if drawing is interrupted or fails."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"interrupted while drawing; the run is in {shown(folder)}") from None
    except InterdriveError as error:
        raise type(error)(f"{error}; the run is in {shown(folder)}") from error
