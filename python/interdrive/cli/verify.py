"""`interdrive verify`: repeats a run and compares the digests."""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from interdrive.cli.terminal import say, visible
from interdrive.config.binding import bind
from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.results.information import RunInformation
    from interdrive.scenario import Scenario


@click.command()
@click.argument("folder", metavar="RUN")
@click.option("--scenario", metavar="FILE", help="Current path of the scenario file, if it was moved.")
@click.option("--threads", metavar="N", type=click.IntRange(min=1), help="Number of planning threads (all cores).")
@click.option("--trust", is_flag=True, help="Import planners and predictors that run.json names as module:object.")
def verify(folder: str, scenario: str | None, threads: int | None, trust: bool) -> int:
    """Repeat the run in folder RUN and compare the digest of all states.

    Exit code 0: equal to the last bit. Exit code 1: different. Planners and predictors that run.json names as
        module:object are code that runs with your rights: confirm when asked, or give --trust.
    """
    from interdrive.cli.report import print_verdict, progress  # noqa: PLC0415 - rich
    from interdrive.config.agent_config import modules_named  # noqa: PLC0415
    from interdrive.config.schema import SimulationSettings  # noqa: PLC0415
    from interdrive.results import information, read_results  # noqa: PLC0415
    from interdrive.simulation import simulate  # noqa: PLC0415

    info = read_results(folder).info
    simulated = _scenario(folder, info, scenario)
    try:
        wanted: dict[str, Any] = {**info["settings"]}
        if not info.get("finished", True):
            raise InputError(f"{folder}: the run was interrupted, so a repetition would differ")
        if not wanted.get("repeatable", True):
            raise InputError(f"{folder}: the run used Python objects that run.json cannot name; repeat it in Python")
        arguments: dict[str, Any] = {
            "agents": wanted["agents"],
            "planner": wanted["planner"],
            "predictor": wanted["predictor"],
            "views": wanted.get("views", {}),
            "rules": wanted.get("rules", {}),
            "v2x": wanted.get("v2x", {}),
            "seed": wanted["seed"],
            "settings": bind(SimulationSettings(), wanted["settings"]),
        }
    except (KeyError, TypeError, ValueError) as cause:
        raise InputError(f"{folder}: run.json does not say how to repeat the run ({cause!r})") from None
    _check_sumo(folder, info)
    if not trust:
        ask_before_import(folder, modules_named(wanted["planner"], wanted["predictor"]))
    with progress(quiet=False) as report:
        report.say("repeating the run")
        again = simulate(simulated, threads=threads, on_step=report.step, **arguments)
        if not again.finished:
            raise KeyboardInterrupt
    equal = again.digest == info["digest"]
    print_verdict(info, information(again), equal=equal)
    return 0 if equal else 1


def _check_sumo(folder: str, info: RunInformation) -> None:
    """Raises InputError if another version of SUMO would drive the traffic."""
    if info.get("sumo") is None:
        return
    from interdrive.sumo.process import installed_version  # noqa: PLC0415 - few runs have it

    made, here = (info.get("versions") or {}).get("libsumo"), installed_version()
    if made != here:
        raise InputError(
            f"{folder}: was made with SUMO {made}, and other versions drive otherwise; here is {here}: "
            f"pip install libsumo=={made}"
        )


def ask_before_import(folder: str, modules: Sequence[str]) -> None:
    """Asks before running code that a folder names, because the folder may come from an unknown author.

    Raises:
        InputError: The answer is no, or stdin is not a terminal.
    """
    if not modules:
        return
    names = visible(", ".join(modules))
    if sys.stdin is not None and sys.stdin.isatty():
        say(f"run.json names code outside interdrive: {names}. It will be imported and run with your rights.", err=True)
        if click.confirm("Go on?", err=True):
            return
        raise InputError(f"{folder}: not repeated")
    raise InputError(
        f"{folder}: run.json names code outside interdrive ({names}), which would be imported and run; "
        "add --trust if you trust this folder"
    )


def _scenario(folder: str, info: RunInformation, given: str | None) -> Path | Scenario:
    """The file that was simulated, unchanged; what was made of a file of another format.

    Raises:
        InputError: The scenario did not come from a file, or the file is missing or has changed.
    """
    from interdrive.files import content_of_file  # noqa: PLC0415 - numpy
    from interdrive.results.reader import source_again  # noqa: PLC0415

    stored = info["scenario"]
    if given is None and stored["path"] is None:
        raise InputError(f"{folder}: the scenario came from memory, not from a file; repeat the run in Python")
    path = Path(given or stored["path"] or "")
    source = info.get("source")
    if source is not None:
        if not path.exists():
            raise InputError(f"{path}: the source of the run is gone; give its present path with --scenario")
        again = source_again(path, source, info)
        if again is None:
            raise InputError(f"{path}: it, or a file that was read with it, has changed since the run")
        return again
    try:
        content = content_of_file(path)
    except (OSError, ValueError) as cause:
        reason = getattr(cause, "strerror", None) or cause
        raise InputError(
            f"{path}: the scenario of the run cannot be read ({reason}); give its present path with --scenario"
        ) from None
    if hashlib.sha256(content).hexdigest() != stored["sha256"]:
        raise InputError(f"{path}: the scenario file has changed since the run")
    return path
