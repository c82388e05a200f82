"""`interdrive search`: failures of a planner that are its fault, small, and repeatable."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from interdrive.cli.arguments import shown
from interdrive.cli.terminal import say

if TYPE_CHECKING:
    from collections.abc import Callable

    from interdrive.failure_search import Found

_TRUST = click.option("--trust", is_flag=True, help="Import planners that the failure names as module:object.")


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
@click.option("--runs", metavar="N", type=click.IntRange(min=1), default=300, help="Number of runs (300).")
@click.option("--seed", metavar="N", type=click.IntRange(min=0), default=0, help="Chooses what is driven (0).")
@click.option("--agent", metavar="ID", type=int, help="Only this agent (all with another vehicle near).")
@click.option("--traffic", metavar="PLANNER|recorded", default="idm", help="Who drives the other vehicles (idm).")
@click.option("--predictor", metavar="PREDICTOR", default="lane_following", help="Predictor (lane_following).")
@click.option("--space", metavar="TOML", help="File with bounds of what may change.")
@click.option("--errors", type=click.Choice(("default", "none")), default="default", help="Errors of other vehicles.")
def search_in(
    paths: tuple[str, ...],
    planner: str,
    out: str,
    runs: int,
    seed: int,
    agent: int | None,
    traffic: str,
    predictor: str,
    space: str | None,
    errors: str,
) -> None:
    """Search. Exit code 0, whether or not it finds something; Ctrl-C keeps what was found."""
    from dataclasses import replace  # noqa: PLC0415

    from interdrive.cli.report import progress  # noqa: PLC0415 - rich
    from interdrive.failure_search import Space  # noqa: PLC0415 - numpy
    from interdrive.failure_search import search as searched  # noqa: PLC0415

    chosen = Space() if space is None else Space.read(Path(space))
    if errors == "none":
        chosen = replace(chosen, errors=())
    with progress(quiet=False) as report:
        try:
            found = searched(
                paths,
                planner,
                runs=runs,
                seed=seed,
                out=out,
                agent_id=agent,
                traffic=traffic,
                predictor=predictor,
                space=chosen,
                on_run=partial(_say_how_many, report.say, runs),
            )
        except KeyboardInterrupt:
            kept = f"interrupted; what was found is in {shown(Path(out))}, and the same command goes on"
            raise KeyboardInterrupt(kept) from None
    _tell(found, Path(out))


def _say_how_many(say_so: Callable[[str], None], runs: int, done: int, failures: int) -> None:
    say_so(f"{done} of {runs} runs, {failures} failures")


def _tell(found: Found, out: Path) -> None:
    for left_out in found.left_out:
        say(f"left out: {left_out}")
    for name in found.undisturbed:
        say(f"{name} fails without any disturbance")
    for one in found.failures:
        avoided = f"{one.witness} avoids it" if one.witness else "unproven: none of the tried drivers avoids it"
        say(f"{one.folder.name}: agent {one.drive.agent_id}, {one.failure}: {one.words}; {avoided}")
        say(f"     {one.disturbance}")
    share, low, high = (100.0 * value for value in found.rate)
    say(
        f"{len(found.failures)} failures kept, {sum(bool(one.witness) for one in found.failures)} of them avoidable; "
        f"{found.uniform_failures} of {found.uniform_runs} uniform runs fail: {share:.2f} % ({low:.2f} to {high:.2f})"
    )
    say(f"search in {shown(out.resolve())}")


@search.command()
@click.argument("folder", metavar="FAILURE")
@_TRUST
def replay(folder: str, trust: bool) -> int:
    """Repeat the failure in folder FAILURE. Exit code 0: its digest is equal; 1: it is not."""
    from interdrive.failure_search import replay as repeated  # noqa: PLC0415 - numpy
    from interdrive.failure_search.failures import read_failure  # noqa: PLC0415

    failure = read_failure(folder)
    run, is_equal = repeated(failure, trust=trust)
    say(f"agent {failure.drive.agent_id}, {failure.failure}: {failure.words}")
    said = "equal" if is_equal else f"different: {run.digest[:12]}..., stored {failure.digest[:12]}..."
    say(f"digest {said}" + ("" if is_equal else f" (found by version {failure.version})"))
    return 0 if is_equal else 1


@search.command()
@click.argument("folder", metavar="DIR")
@click.option("--out", metavar="SUITE", required=True, help="Folder of the suite; failures are added to it.")
def suite(folder: str, out: str) -> None:
    """Collect the failures of the search in folder DIR in a regression suite."""
    from interdrive.failure_search.failures import collect  # noqa: PLC0415 - numpy

    copied = collect(folder, Path(out))
    say(f"{len(copied)} failures in {shown(Path(out).resolve())}")


@search.command()
@click.argument("folder", metavar="SUITE")
@click.option("--planner", metavar="PLANNER", required=True, help="The planner under test.")
@_TRUST
def check(folder: str, planner: str, trust: bool) -> int:
    """Drive the failures of SUITE with a planner. Exit code 0: it fails in none; 1: it fails in some."""
    from interdrive.failure_search import check_failure, failures  # noqa: PLC0415 - numpy

    n_failed = 0
    found = failures(folder)
    for one in found:
        verdict: Any = check_failure(one, planner, trust=trust)
        n_failed += bool(verdict.failure)
        say(f"{one}: {verdict.failure or 'fixed'}" + (f": {verdict.words}" if verdict.failure else ""))
    say(f"{len(found) - n_failed} of {len(found)} fixed")
    return 1 if n_failed else 0
