"""`interdrive sql`: queries on the data set of a batch."""

from __future__ import annotations

import os
import resource
import threading
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from interdrive.cli.batch import bytes_of
from interdrive.cli.terminal import print_csv, say

if TYPE_CHECKING:
    from collections.abc import Iterator


#: Margins of the process beyond the memory limit [bytes] and the time limit [s] of a query.
_MARGIN, _GRACE = 1_000_000_000, 3.0


@click.command()
@click.argument("folder", metavar="DIR")
@click.argument("text", metavar="SQL")
@click.option("--csv", "as_csv", is_flag=True, help="Print all rows as CSV.")
@click.option(
    "--timeout", metavar="SECONDS", type=click.FloatRange(min=0.0, min_open=True), help="Time limit of the query (60)."
)
@click.option("--memory", metavar="SIZE", help="Memory limit of the query (2G).")
def sql(folder: str, text: str, as_csv: bool, timeout: float | None, memory: str | None) -> None:
    """Query the data set of the batch in DIR with SQL; needs the extra duckdb.

    The tables are results (a row per run and agent), runs (a row per run) and agents (a row per agent under test):

        interdrive sql out/batch "select planner, outcome, count(*) from agents group by all order by all"
    """
    given = None if memory is None else bytes_of(memory)

    from interdrive.batches.query import MEMORY, SECONDS, load_libraries, query  # noqa: PLC0415
    from interdrive.cli.batch_report import print_answer  # noqa: PLC0415 - rich

    seconds, size = SECONDS if timeout is None else timeout, MEMORY if given is None else given
    load_libraries()  # the limit below is relative to the address space in use
    with _limited(seconds, size):
        answer = query(folder, text, seconds=seconds, memory=size)
    if as_csv:
        print_csv(answer.columns, answer.rows)
    else:
        print_answer(answer)


@contextmanager
def _limited(seconds: float, memory: float) -> Iterator[None]:
    """Ends the process where DuckDB does not enforce a limit itself: within a call of one of its functions."""
    from interdrive.batches.query import RAISE_SECONDS  # noqa: PLC0415

    def give_up() -> None:
        say(f"error: sql: no answer after {seconds:g} s; {RAISE_SECONDS}", err=True)
        os._exit(2)

    watch = threading.Timer(min(seconds + _GRACE, threading.TIMEOUT_MAX), give_up)
    watch.daemon = True
    watch.start()
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    with suppress(OSError, ValueError):  # not every system knows or allows it
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        wanted = used + int(memory) + _MARGIN
        if soft == resource.RLIM_INFINITY or wanted < soft:
            resource.setrlimit(resource.RLIMIT_AS, (wanted, hard))
    try:
        yield
    finally:
        watch.cancel()
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
