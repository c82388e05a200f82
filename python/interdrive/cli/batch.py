"""`interdrive batch`: many runs into one data set."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from interdrive.cli.arguments import assigned, raw_option, shown, source_option
from interdrive.cli.config import BatchChoices, read_config
from interdrive.config.binding import bind
from interdrive.config.styles import style_settings
from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.config.schema import SimulationSettings

_UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}

#: Words for the behaviour of recorded vehicles that are not under test.
_OTHERS = ("replay", "recorded", "velocity_adjusting", "same")


@click.command()
@click.argument("paths", nargs=-1, metavar="PATHS...")
@click.option(
    "--planner",
    metavar="PLANNER[,NAME=VALUE...][,PLANNER...]",
    multiple=True,
    help="Planners under test (rollout); each is run on every scenario.",
)
@click.option(
    "--predictor", metavar="PREDICTOR[,...]", multiple=True, help="Predictors (neural); each is run on every scenario."
)
@click.option(
    "--agents",
    metavar="all|reachable|N",
    help="Vehicles under test: all (default), reachable ones, or at most N per scenario.",
)
@click.option(
    "--traffic",
    metavar="replay|same|PLANNER[,NAME=VALUE...]",
    help="Behaviour of all other vehicles: replay, the planner under test, or a native planner (idm, ...); and, or "
    "alone, generated traffic by every seed, such as rate=600 (names of the settings traffic.NAME).",
)
@click.option("--alone", is_flag=True, default=None, help="Simulate each agent under test in a run of its own.")
@click.option(
    "--panel",
    metavar="none|default|DIR",
    help="With --alone: score against four drivers in the place of each agent, or against stored drives (none).",
)
@click.option("--seeds", metavar="N", help="Number of seeds for the choice of agents, or for generated traffic (1).")
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
@click.option("--out", metavar="DIR", help="Folder of the batch; existing runs in it are not repeated.")
@click.option("--workers", metavar="N", help="Processes (all cores).")
@click.option("--run-timeout", metavar="S", help="Time limit of a run [s]; its process is then replaced.")
@click.option("--memory", metavar="SIZE", help="Memory limit of a process, for instance 2G.")
@click.option(
    "--keep",
    metavar="none|failed|all",
    help="Run folders to keep: none, failed (an agent did not reach its goal), or all.",
)
@click.option("--retry", is_flag=True, default=None, help="Repeat runs that did not finish.")
@click.option(
    "--ray",
    metavar="[=ADDRESS]",
    is_flag=False,
    flag_value="auto",
    help="Run on the Ray cluster of this machine, or on the cluster at ADDRESS.",
)
@click.option("--quiet", is_flag=True, help="Print only errors.")
def batch(
    paths: tuple[str, ...],
    assignments: tuple[str, ...],
    raw: bool,
    source: tuple[str, ...],
    config: str | None,
    quiet: bool,
    **given: Any,  # noqa: ANN401 - texts and flags
) -> int:
    """Run every combination of scenario, planner, predictor and seed, on all cores, into one data set.

    PATHS are CommonRoad files, files of other tools, folders of them, or names of shipped scenarios. If you repeat the
    command, only missing runs are done. Exit code 1: a run failed or a planner broke. Refused scenario files are rows
    of the table and not failures.
    """
    given["paths"] = paths or None
    choices, settings = _configured(
        config,
        {name: value for name, value in given.items() if value not in (None, ())},
        assigned(assignments, raw=raw, source=source),
    )
    if choices.out is None:
        raise InputError("batch: no folder; give one with --out")
    memory = bytes_of(choices.memory) if choices.memory is not None else math.inf

    from interdrive.batches import batch as run_batch  # noqa: PLC0415
    from interdrive.cli.batch_report import PRINTED, batch_progress, print_batch  # noqa: PLC0415 - rich

    with batch_progress(quiet=quiet) as on_progress:
        try:
            done = run_batch(
                choices.paths,
                choices.out,
                planner=list(choices.planner),
                predictor=list(choices.predictor),
                agents=choices.agents,
                traffic=_others(choices.traffic),
                alone=choices.alone,
                seeds=choices.seeds,
                settings=settings,
                workers=choices.workers,
                run_timeout=choices.run_timeout,
                memory=memory,
                keep=choices.keep,
                panel=choices.panel,
                retry=choices.retry,
                ray=choices.ray,
                on_progress=on_progress,
            )
        except KeyboardInterrupt:
            raise KeyboardInterrupt(
                f"interrupted; finished runs are in {shown(Path(choices.out).resolve())}, "
                "repeat the command to do the missing ones"
            ) from None
    table = done.select(PRINTED)
    if not quiet:
        print_batch(done, table, shown(done.folder))
    broken = sum(count for status, count in done.status.items() if status not in ("finished", "refused"))
    return 1 if broken or "planner_error" in table["outcome"].unique().to_pylist() else 0


def bytes_of(text: str) -> float:
    """A size such as "2G" or "500M" in bytes.

    Raises:
        InputError: The text is not a size.
    """
    found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([KMGT]?)(?:i?B)?", text.strip(), re.IGNORECASE)
    if found is None:
        raise InputError(f"--memory {text}: write a size such as 2G or 500M")
    return float(found.group(1)) * _UNITS[found.group(2).upper()]


def _configured(
    config: str | None, given: Mapping[str, Any], values_given: Mapping[str, str]
) -> tuple[BatchChoices, SimulationSettings]:
    """Choices and settings: defaults, then the file, then the command line."""
    from interdrive.config.schema import SimulationSettings, with_traffic  # noqa: PLC0415

    choices = BatchChoices()
    values: dict[str, Any] = {}
    if config is not None:
        in_file, own, values = read_config(Path(config), BatchChoices, "batch")
        if own:
            raise InputError(f"{config}: agent.{next(iter(own))}: a batch has one planner for all agents under test")
        try:
            choices = bind(choices, in_file)
        except InputError as error:
            raise error.within(config) from None
    try:
        choices = bind(choices, given)
    except InputError as error:
        raise InputError(f"--{error.location.replace('_', '-')}", error.message) from None
    settings = bind(SimulationSettings(), style_settings(choices.style))
    try:
        settings = bind(settings, values)
    except InputError as error:
        raise error.within(str(config)) from None
    return choices, bind(with_traffic(settings, _generated(choices.traffic)), values_given)


def _others(traffic: str | None) -> str | None:
    """The part of `--traffic` that is about recorded vehicles."""
    if traffic is None or "=" not in traffic:
        return traffic
    own = traffic.partition(",")[0]
    return own if own in _OTHERS else None


def _generated(traffic: str | None) -> str | None:
    """The part of `--traffic` that is about generated traffic; None: there is none."""
    own, _, rest = (traffic or "").partition(",")
    if "=" not in (traffic or ""):
        return None
    return rest if own in _OTHERS else traffic
