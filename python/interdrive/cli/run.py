"""`interdrive run`: one scenario from file to run folder."""

from __future__ import annotations

import difflib
import tomllib
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from interdrive.cli.arguments import assigned, new_folder, scenario_named, shown
from interdrive.errors import InputError
from interdrive.settings import bind, dotted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from interdrive.run import Run
    from interdrive.run_settings import SimulationSettings


@dataclass(frozen=True)
class RunChoices:
    """What `run` can be told besides settings; the same names in a configuration file.

    Attributes:
        scenario: Path of a CommonRoad file, or name of a shipped scenario.
        agents: "all", a number, or ids.
        planner: Name of the planner.
        predictor: Name of the predictor.
        seed: For the choice of agents.
        threads: Threads that plan; none: all cores.
        out: Run folder; none: a new one under out/.
        overwrite: Replace the run in that folder.
        png: Draw the trajectories.
        gif: Make a film.
        mp4: Make a film with ffmpeg.
        agent_view: Agent that the film follows.
    """

    scenario: str = ""
    agents: int | tuple[int, ...] | str = "all"
    planner: str = "frenet"
    predictor: str = "lane_following"
    seed: int = 0
    threads: int | None = None
    out: str | None = None
    overwrite: bool = False
    png: bool = False
    gif: bool = False
    mp4: bool = False
    agent_view: int | None = None


@click.command()
@click.argument("file", required=False)
@click.option(
    "--agents", metavar="all|N|ID,ID", help="Who plans: all, a number chosen with the seed, or ids ('7,' is id 7)."
)
@click.option("--planner", metavar="NAME", help="frenet (default), a plug-in, or module:object.")
@click.option("--predictor", metavar="NAME", help="lane_following (default), constant_velocity, ground_truth, ...")
@click.option(
    "--set", "assignments", metavar="NAME=VALUE", multiple=True, help="A setting; `interdrive settings` lists them."
)
@click.option("--config", metavar="TOML", help="File with the same options and settings; the command line wins.")
@click.option("--seed", metavar="N", help="For the choice of agents (0).")
@click.option("--threads", metavar="N", help="Threads that plan (all cores); results do not depend on it.")
@click.option("--out", metavar="DIR", help="Run folder (a new one under out/).")
@click.option("--overwrite", is_flag=True, default=None, help="Replace the run in that folder.")
@click.option("--png", is_flag=True, default=None, help="Draw all trajectories: run.png.")
@click.option("--gif", is_flag=True, default=None, help="Make a film: run.gif.")
@click.option("--mp4", is_flag=True, default=None, help="Make a film: run.mp4 (needs ffmpeg).")
@click.option("--agent-view", metavar="ID", help="The film follows this agent and shows what it considered.")
@click.option("--quiet", is_flag=True, help="Print nothing but errors.")
def run(file: str | None, assignments: tuple[str, ...], config: str | None, quiet: bool, **given: Any) -> int:  # noqa: ANN401
    """Let the vehicles of a scenario plan for themselves.

    FILE is a CommonRoad file or the name of a shipped scenario (t_junction, lane_merge, highway, intersection).
    """
    given["scenario"] = file
    choices, settings = _configured(
        config, {name: value for name, value in given.items() if value is not None}, assignments
    )
    if not choices.scenario:
        raise InputError("run: which scenario? Give a CommonRoad file or the name of a shipped scenario")
    if choices.agent_view is not None and not choices.mp4:
        choices = replace(choices, gif=True)

    from interdrive.cli.report import print_run, progress  # noqa: PLC0415 - rich
    from interdrive.results import save  # noqa: PLC0415
    from interdrive.simulation import simulate  # noqa: PLC0415

    source = scenario_named(choices.scenario)
    folder = _target(choices)
    with progress(quiet=quiet) as report:
        report.say(f"reading {choices.scenario}")
        done = simulate(
            source,
            agents=choices.agents,
            planner=choices.planner,
            predictor=choices.predictor,
            settings=settings,
            seed=choices.seed,
            threads=choices.threads,
            snapshots_of=choices.agent_view,
            on_step=report.step,
        )
        if not done.finished:
            raise KeyboardInterrupt
        report.say("writing")
        save(done, folder, overwrite=choices.overwrite)
        with _kept(folder):
            _draw(done, folder, choices, report.frames)
    if not quiet:
        print_run(done, shown(folder))
    return 1 if "planner_error" in done.outcomes.outcome else 0


def _configured(
    config: str | None, given: Mapping[str, Any], assignments: Sequence[str]
) -> tuple[RunChoices, SimulationSettings]:
    """Choices and settings: defaults, then the file, then the command line."""
    from interdrive.run_settings import SimulationSettings  # noqa: PLC0415

    choices, settings = RunChoices(), SimulationSettings()
    if config is not None:
        in_file, values = _read_config(Path(config))
        try:
            choices, settings = bind(choices, in_file), bind(settings, values)
        except InputError as error:
            raise InputError(f"{config}: {error}") from None
    values_given = assigned(assignments)
    try:
        choices = bind(choices, given)
    except InputError as error:
        raise InputError(f"--{str(error).replace('agent_view', 'agent-view')}") from None
    return choices, bind(settings, values_given)


def _read_config(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Choices and settings of a TOML file.

    Choices stand at the top level or, since TOML cannot have `planner = "frenet"` beside `[planner.frenet]`, in the
    table `[run]`. A relative scenario path starts at the file's folder.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError) as cause:
        raise InputError(f"{path}: not a configuration file: {cause}") from cause
    names = [field.name for field in fields(RunChoices)]
    choices: dict[str, Any] = {}
    settings: dict[str, Any] = {}
    for name, value in dotted(document).items():
        short = name.removeprefix("run.")
        if short in names:
            choices[short] = value
        elif "." in name and short == name:
            settings[name] = value
        else:
            near = difflib.get_close_matches(short, names, n=1)
            raise InputError(f"{path}: {name}: there is no such entry" + (f"; did you mean {near[0]}?" if near else ""))
    beside = path.parent / str(choices.get("scenario", ""))
    if "scenario" in choices and beside.is_file():
        choices["scenario"] = str(beside)
    return choices, settings


def _target(choices: RunChoices) -> Path:
    """The folder to write to; everything that can be refused is refused before the simulation."""
    from interdrive.results import check_target  # noqa: PLC0415

    if choices.mp4:
        from interdrive.plots import check_animation  # noqa: PLC0415

        check_animation("run.mp4")
    if choices.out is not None:
        return check_target(choices.out, overwrite=choices.overwrite)
    return check_target(new_folder(Path(choices.scenario).stem))


def _draw(done: Run, folder: Path, choices: RunChoices, on_frame: Callable[[str], Callable[[int, int], None]]) -> None:
    if not (choices.png or choices.gif or choices.mp4):
        return
    from interdrive.plots import animate_run, draw_run, save_figure  # noqa: PLC0415

    if choices.png:
        save_figure(draw_run(done), folder / "run.png")
    for wanted, name in ((choices.gif, "run.gif"), (choices.mp4, "run.mp4")):
        if wanted:
            animate_run(done, folder / name, choices.agent_view, on_frame=on_frame(name))


@contextmanager
def _kept(folder: Path) -> Iterator[None]:
    """Says that the run itself is safe when drawing is interrupted."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"interrupted while drawing; the run is in {shown(folder)}") from None
