"""`interdrive solution`: the drives of planning problems as a CommonRoad solution."""

from __future__ import annotations

import math
from pathlib import Path

import click

from interdrive.cli.arguments import shown
from interdrive.cli.terminal import say
from interdrive.errors import InputError


@click.command()
@click.argument("folder", metavar="RUN")
@click.option("--cost", metavar="NAME", default="SM1", help="Cost function of the benchmark id (SM1).")
@click.option("--model", metavar="KS|ST|PM", default="KS", help="Vehicle model (KS).")
@click.option("--vehicle", metavar="N", type=int, default=2, help="Vehicle type that was driven, 1 to 4 (2).")
@click.option("--check", is_flag=True, help="Run the checks of commonroad-drivability-checker, and its costs.")
@click.option("--out", metavar="FILE", help="The document (solution.xml in the run folder).")
def solution(folder: str, cost: str, model: str, vehicle: int, check: bool, out: str | None) -> int:
    """Write the drives of the planning problems in RUN as a CommonRoad solution, for the benchmark site.

    The run must have been made with --agents problems, and all problems must be solved. Exit code 1: a check failed.
    """
    from interdrive.files.solution import write_solution  # noqa: PLC0415 - numpy
    from interdrive.results import load  # noqa: PLC0415 - pyarrow
    from interdrive.storage import replacing  # noqa: PLC0415

    run = load(folder)
    document = write_solution(run, cost=cost, model=model, vehicle=vehicle)
    target = Path(folder) / "solution.xml" if out is None else Path(out)
    with replacing(target) as partial:
        partial.write_bytes(document)
    say(f"solution in {shown(target)}")
    if not check:
        return 0
    from interdrive.files.solution_check import check_solution  # noqa: PLC0415 - optional library

    if run.scenario.path is None:
        raise InputError(f"{folder}: the scenario came from memory; the checker needs its file")
    found = check_solution(document, run.scenario.path)
    for name, why in found.checks.items():
        say(f"{name}: {why or 'passed'}")
    say("valid" if found.is_valid else "not valid")
    if not math.isnan(found.costs):
        say(f"costs ({cost}): {found.costs:.6g}")
    return 0 if found.is_valid else 1
