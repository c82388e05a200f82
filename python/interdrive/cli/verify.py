"""`interdrive verify`: does a run come out the same again?"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from interdrive.errors import InputError
from interdrive.settings import bind

if TYPE_CHECKING:
    from collections.abc import Mapping


@click.command()
@click.argument("folder", metavar="RUN")
@click.option("--scenario", metavar="FILE", help="Where the scenario file is now, if it was moved.")
@click.option("--threads", metavar="N", type=click.IntRange(min=1), help="Threads that plan (all cores).")
def verify(folder: str, scenario: str | None, threads: int | None) -> int:
    """Repeat the run in folder RUN and compare the digest of all states.

    Exit code 0: equal to the last bit. Exit code 1: different.
    """
    from interdrive.cli.report import print_verdict, progress  # noqa: PLC0415 - rich
    from interdrive.results import information, load  # noqa: PLC0415
    from interdrive.run_settings import SimulationSettings  # noqa: PLC0415
    from interdrive.simulation import simulate  # noqa: PLC0415

    info = load(folder).info
    path = _scenario_file(folder, info, scenario)
    try:
        wanted = info["settings"]
        if not wanted.get("repeatable", True):
            raise InputError(
                f"{folder}: the run used objects made in Python, which run.json cannot name; repeat it there"
            )
        arguments: dict[str, Any] = {
            "agents": wanted["agents"],
            "planner": wanted["planner"],
            "predictor": wanted["predictor"],
            "views": wanted.get("views", {}),
            "seed": wanted["seed"],
            "settings": bind(SimulationSettings(), wanted["settings"]),
        }
    except (KeyError, TypeError, ValueError) as cause:
        raise InputError(f"{folder}: run.json does not say how to repeat the run ({cause!r})") from None
    with progress(quiet=False) as report:
        report.say("repeating the run")
        again = simulate(path, threads=threads, on_step=report.step, **arguments)
        if not again.finished:
            raise KeyboardInterrupt
    equal = again.digest == info["digest"]
    print_verdict(info, information(again), equal=equal)
    return 0 if equal else 1


def _scenario_file(folder: str, info: Mapping[str, Any], given: str | None) -> Path:
    """The file that was simulated, unchanged.

    Raises:
        InputError: It was never a file, is gone, or has changed.
    """
    stored = info["scenario"]
    if given is None and stored["path"] is None:
        raise InputError(f"{folder}: the scenario came from memory, not from a file; repeat the run in Python")
    path = Path(given or stored["path"])
    try:
        # Devices and pipes have no end.
        content = path.read_bytes() if path.is_file() or not path.exists() else b""
    except (OSError, ValueError) as cause:
        reason = getattr(cause, "strerror", None) or cause
        raise InputError(
            f"{path}: the scenario of the run cannot be read ({reason}); --scenario says where it is"
        ) from None
    if hashlib.sha256(content).hexdigest() != stored["sha256"]:
        raise InputError(f"{path}: the scenario file has changed since the run")
    return path
