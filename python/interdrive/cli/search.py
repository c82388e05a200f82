"""`interdrive search`: failures of a planner that are its fault, small, and repeatable."""

from __future__ import annotations

import math
import os
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from interdrive.cli.arguments import assigned, shown
from interdrive.cli.terminal import say

if TYPE_CHECKING:
    from collections.abc import Callable

_TRUST = click.option("--trust", is_flag=True, help="Import planners that the failure names as module:object.")
_RUN_TIMEOUT = click.option(
    "--run-timeout", metavar="S", type=float, default=math.inf, help="A drive may take this long (for ever)."
)


class _Search(click.Group):
    """Searches where the first argument names none of its commands."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Puts the name of the search before arguments that name none."""
        if args and args[0] not in (*self.commands, *ctx.help_option_names):
            args = ["in", *args]
        return super().parse_args(ctx, args)


@click.group(cls=_Search)
def search() -> None:
    """Search disturbances of recordings under which a planner fails by its own fault.

    `interdrive search FILES --planner P --out DIR` searches (`interdrive search in --help` lists the options); the
    other commands repeat what it found. The documentation (Search for failures of a planner) shows how.
    """


@search.command(name="in")
@click.argument("paths", metavar="FILE|FOLDER|NAME...", nargs=-1, required=True)
@click.option("--planner", metavar="PLANNER", required=True, help="The planner under test.")
@click.option("--out", metavar="DIR", required=True, help="Folder of the search; the same one goes on where it was.")
@click.option("--runs", metavar="N", type=click.IntRange(min=1), help="Number of runs (300, or as --minutes allows).")
@click.option("--minutes", metavar="N", type=float, default=math.inf, help="No run begins after this time.")
@click.option("--stop-after", metavar="N", type=click.IntRange(min=1), help="End with this many failures.")
@click.option("--seed", metavar="N", type=click.IntRange(min=0), default=0, help="Chooses what is driven (0).")
@click.option("--agent", metavar="ID", type=int, help="Only this agent (all with another vehicle near).")
@click.option("--traffic", metavar="PLANNER|recorded", default="idm", help="Who drives the other vehicles (idm).")
@click.option("--predictor", metavar="PREDICTOR", default="lane_following", help="Predictor (lane_following).")
@click.option(
    "--set",
    "assignments",
    metavar="NAME=VALUE",
    multiple=True,
    help="A setting of all runs, such as v2x.penetration=1.",
)
@click.option("--space", metavar="TOML", help="File with bounds of what may change.")
@click.option("--errors", type=click.Choice(("default", "none")), default="default", help="Errors of other vehicles.")
@click.option(
    "--method",
    type=click.Choice(("levels", "uniform")),
    default="levels",
    help="Drive what is near a failure more often, or all alike (levels).",
)
@click.option(
    "--keep",
    metavar="N",
    type=click.IntRange(min=1),
    default=3,
    help="Failures of one kind that are made small and kept (3).",
)
@click.option(
    "--shrink/--no-shrink", default=True, help="Make failures small (yes); without, the same command does it later."
)
@click.option("--workers", metavar="N", type=click.IntRange(min=1), help="Processes (one per core).")
@click.option("--run-timeout", metavar="S", type=float, default=math.inf, help="A run may take this long (for ever).")
@click.option("--ray", metavar="[ADDRESS]", is_flag=False, flag_value="auto", help="Use a Ray cluster (auto).")
def search_in(
    paths: tuple[str, ...],
    space: str | None,
    errors: str,
    workers: int | None,
    assignments: tuple[str, ...],
    **options: Any,  # noqa: ANN401 - of click
) -> None:
    """Search. Exit code 0, whether or not it finds something; Ctrl-C keeps what was found."""
    from dataclasses import replace  # noqa: PLC0415

    from interdrive.cli.report import progress  # noqa: PLC0415 - rich
    from interdrive.cli.search_report import print_found  # noqa: PLC0415
    from interdrive.failure_search import Space  # noqa: PLC0415 - numpy
    from interdrive.failure_search import search as searched  # noqa: PLC0415

    chosen = Space() if space is None else Space.read(Path(space))
    if errors == "none":
        chosen = replace(chosen, errors=())
    out = Path(options["out"])
    options["agent_id"] = options.pop("agent")
    with progress(quiet=False) as report:
        report.say("driving what is recorded, undisturbed")
        try:
            found = searched(
                paths,
                options.pop("planner"),
                space=chosen,
                settings=assigned(assignments),
                workers=workers or os.cpu_count() or 1,
                on_run=partial(_say_how_many, report.say, options["runs"]),
                **options,
            )
        except KeyboardInterrupt:
            kept = f"what was found is in {shown(out)}, and the same command goes on"
            raise KeyboardInterrupt(f"interrupted; {kept if out.exists() else 'nothing was driven yet'}") from None
    print_found(found, out)


def _say_how_many(say_so: Callable[[str], None], runs: int | None, done: int, failures: int) -> None:
    say_so(f"{done}{'' if runs is None else f' of {runs}'} runs, failures: {failures}")


@search.command()
@click.argument("folder", metavar="FAILURE")
@_RUN_TIMEOUT
@_TRUST
def replay(folder: str, trust: bool, run_timeout: float) -> int:
    """Repeat the failure in folder FAILURE. Exit code 0: its digest is equal; 1: it is not."""
    from interdrive.failure_search.failures import read_failure  # noqa: PLC0415 - numpy
    from interdrive.failure_search.repeating import digest_again  # noqa: PLC0415

    failure = read_failure(folder)
    digest = digest_again(failure, trust=trust, run_timeout=run_timeout)
    is_equal = digest == failure.digest
    say(f"agent {failure.drive.agent_id}, {failure.failure}: {failure.words}")
    said = "equal" if is_equal else f"different: {digest[:12]}..., stored {failure.digest[:12]}..."
    say(f"digest {said}" + ("" if is_equal else f" (found by version {failure.version})"))
    return 0 if is_equal else 1


@search.command()
@click.argument("folders", metavar="DIR...", nargs=-1, required=True)
def compare(folders: tuple[str, ...]) -> None:
    """Compare searches: rates of uniform runs, yields of directed ones, failures, each with 95 % intervals."""
    from interdrive.cli.search_report import print_compared  # noqa: PLC0415 - rich
    from interdrive.failure_search import compared  # noqa: PLC0415 - numpy

    print_compared(compared(folders))


@search.command()
@click.argument("folder", metavar="DIR")
@click.argument("paths", metavar="FILE|FOLDER|NAME...", nargs=-1, required=True)
def realism(folder: str, paths: tuple[str, ...]) -> None:
    """Ask a classifier whether the other vehicles of the failures in DIR drive like those recorded in its files.

    The answer is kept in DIR, and `compare` shows it.
    """
    from interdrive.failure_search.likeness import measure  # noqa: PLC0415 - numpy
    from interdrive.failure_search.pairs import paths_of  # noqa: PLC0415

    found = measure(folder, paths_of(list(paths)))
    share = f" ({100.0 * found.share:.0f} %)" if found.vehicles else ""
    say(f"{found.alike} of {found.vehicles} other vehicles{share} look recorded to the classifier")
    say(
        f"so do {100.0 * found.driven:.0f} % of what the traffic drives undisturbed; {found.recorded} recorded and "
        f"{found.simulated} driven snippets of {found.files} files, area under the curve {found.auc:.2f}"
    )


@search.command()
@click.argument("folder", metavar="DIR")
@click.option("--out", metavar="SUITE", required=True, help="Folder of the suite; failures are added to it.")
def suite(folder: str, out: str) -> None:
    """Collect the failures of the search in folder DIR in a regression suite."""
    from interdrive.failure_search.failures import collect  # noqa: PLC0415 - numpy
    from interdrive.run.reasons import said_count  # noqa: PLC0415

    copied = collect(folder, Path(out))
    say(f"{said_count(len(copied), 'failure')} in {shown(Path(out).resolve())}")


@search.command()
@click.argument("folder", metavar="SUITE")
@click.option("--planner", metavar="PLANNER", required=True, help="The planner under test.")
@_RUN_TIMEOUT
@_TRUST
def check(folder: str, planner: str, trust: bool, run_timeout: float) -> int:
    """Drive the failures of SUITE with a planner. Exit code 0: it fails in none; 1: it fails in some."""
    from interdrive.failure_search import failures  # noqa: PLC0415 - numpy
    from interdrive.failure_search.repeating import checked  # noqa: PLC0415

    n_failed = 0
    found = failures(folder)
    for one, verdict in zip(found, checked(found, planner, trust=trust, run_timeout=run_timeout), strict=True):
        n_failed += bool(verdict.failure)
        say(f"{one}: {verdict.failure or 'fixed'}" + (f": {verdict.words}" if verdict.failure else ""))
    say(f"{len(found) - n_failed} of {len(found)} fixed")
    return 1 if n_failed else 0
