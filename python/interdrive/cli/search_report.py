"""Output of `interdrive search`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape

from interdrive.cli.arguments import shown
from interdrive.cli.report import NOTES_MAX, output, print_table, table_of
from interdrive.cli.terminal import say
from interdrive.failure_search import HEAD
from interdrive.failure_search.failures import UNSHRUNK
from interdrive.failure_search.rates import YIELD_HEAD
from interdrive.run.reasons import said_count

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from interdrive.failure_search import Found, Summary


def print_found(found: Found, out: Path) -> None:
    """Prints what a search found, what its runs brought, and the rate of failures with its interval."""
    for left_out in found.left_out[:NOTES_MAX]:
        say(f"left out: {left_out}")
    if len(found.left_out) > NOTES_MAX:
        say(f"left out: {len(found.left_out) - NOTES_MAX} more")
    for name in found.undisturbed:
        say(f"{name} fails without any disturbance")
    for one in found.failures:
        avoided = f"{one.witness} avoids it" if one.witness else "unproven: none of the tried drivers avoids it"
        say(f"{one.folder.name}: {one.scenario}, agent {one.drive.agent_id}, {one.failure}: {one.words}; {avoided}")
        say(f"     {one.disturbance}" + ("" if one.is_small else UNSHRUNK))
    table = table_of(YIELD_HEAD, right=YIELD_HEAD[1:])
    for part in found.yields:
        table.add_row(*part.cells())
    print_table(output(), table, names=1)
    share, low, high = (100.0 * value for value in found.rate)
    n_avoidable = sum(bool(one.witness) for one in found.failures)
    rate = f": {share:.2f} % ({low:.2f} to {high:.2f})" if found.uniform_runs else ""
    say(
        f"{said_count(len(found.failures), 'failure')} kept, {n_avoidable} of them avoidable; "
        f"{found.uniform_failures} of {found.uniform_runs} uniform runs fail{rate}"
    )
    if found.lost_runs:
        say(f"{said_count(found.lost_runs, 'run')} lost, which may fail or not: the interval allows for both")
    if not found.uniform_runs:
        say("nothing was driven: no disturbed world was plausible; widen the space, or choose other files")
    say(f"search in {shown(out.resolve())}")


def print_compared(searches: Sequence[Summary]) -> None:
    """Prints a row for every search."""
    table = table_of(HEAD, right=HEAD[2:])
    for one in searches:
        table.add_row(*map(escape, one.cells()))
    print_table(output(), table, names=2)
