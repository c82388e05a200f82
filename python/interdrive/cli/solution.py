"""`interdrive solution`: the drives of planning problems as a CommonRoad solution."""

from __future__ import annotations

import math
from datetime import datetime
from pathlib import Path

import click

from interdrive.cli.arguments import shown
from interdrive.cli.terminal import say
from interdrive.errors import InputError


@click.command()
@click.argument("folder", metavar="RUN")
@click.option("--cost", metavar="NAME", default="SM1", help="Cost function of the benchmark id (SM1).")
@click.option("--model", metavar="KS|ST|PM", default="KS", help="Vehicle model (KS).")
@click.option("--vehicle", metavar="N", type=int, help="Vehicle type, 1 to 4; must be the type that was driven.")
@click.option(
    "--date", metavar="DATE", help="Date of the computation, such as 2026-01-31 or 2026-01-31T12:00:00 (left out)."
)
@click.option("--processor", metavar="NAME", help="Processor of the computation (left out).")
@click.option(
    "--check", is_flag=True, help="Run the official checks and cost functions (commonroad-drivability-checker)."
)
@click.option("--out", metavar="FILE", help="The document (solution.xml in the run folder).")
def solution(
    folder: str,
    cost: str,
    model: str,
    vehicle: int | None,
    date: str | None,
    processor: str | None,
    check: bool,
    out: str | None,
) -> int:
    """Export the solved planning problems of RUN as a CommonRoad solution for the benchmark site.

    The run must have been made with --agents problems, and all problems must be solved. The vehicle is type 2 (BMW
    320i) unless you run with --set agents.vehicle_type=1, 3 or 4. Exit code 1: a check failed.
    """
    from interdrive.files.solution import write_solution  # noqa: PLC0415 - numpy
    from interdrive.results.folder import inputs_of  # noqa: PLC0415
    from interdrive.runs import load  # noqa: PLC0415 - pyarrow
    from interdrive.storage import keep_inputs, replacing  # noqa: PLC0415

    run = load(folder)
    document = write_solution(run, cost=cost, model=model, vehicle=vehicle, date=_date(date), processor=processor)
    target = Path(folder) / "solution.xml" if out is None else Path(out)
    keep_inputs(target, inputs_of(folder, run))
    with replacing(target) as partial:
        partial.write_bytes(document)
    say(f"solution in {shown(target)}")
    if not check:
        return 0
    from interdrive.files.solution_check import check_solution  # noqa: PLC0415 - optional library

    if run.scenario.path is None or run.scenario.source is not None:
        raise InputError(f"{folder}: the scenario is no CommonRoad file, which the checker needs")
    found = check_solution(document, run.scenario.path)
    for name, why in found.checks.items():
        say(f"{name}: {why or 'passed'}")
    say("valid" if found.is_valid else "not valid")
    costs = "cannot be computed by the official function" if math.isnan(found.costs) else f"{found.costs:.6g}"
    say(f"costs ({cost}): {costs}")
    return 0 if found.is_valid else 1


def _date(text: str | None) -> datetime | None:
    """A date as it is written in ISO 8601."""
    try:
        return None if text is None else datetime.fromisoformat(text)
    except ValueError:
        raise InputError(f"--date {text}: expected a date such as 2026-01-31 or 2026-01-31T12:00:00") from None
