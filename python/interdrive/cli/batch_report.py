"""Output about batches: progress with rate and remaining time, and the final table. Loads rich."""

from __future__ import annotations

from collections import Counter
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from interdrive.cli.report import NOTES_MAX, STYLES, errors, output, print_folder, print_notes, print_table, table_of
from interdrive.run import OUTCOMES
from interdrive.run.reasons import said_count

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from rich.console import Console
    from rich.progress import Task

    from interdrive.batches import Answer, BatchSummary
    from interdrive.batches import Progress as Reached
    from interdrive.comparison import Comparison
    from interdrive.comparison.tables import Sheet
    from interdrive.storage import ArrowTable

#: Width of comparisons that are not printed to a terminal.
_COMPARISON_WIDTH = 170

#: Answers are printed up to this many rows.
_ANSWER_ROWS_MAX = 100

#: Columns that distinguish rows of the table, if they have more than one value.
_VARIANTS = ("planner", "predictor", "traffic", "agents")


#: Number of rows that are converted to Python at a time.
_PORTION = 4096

#: Columns that `print_batch` needs.
PRINTED = (*_VARIANTS, "status", "outcome", "under_test", "key", "scenario", "error")


class _Rate(ProgressColumn):
    """Runs per second."""

    def render(self, task: Task) -> Text:
        """The text of the column."""
        return Text(f"{task.speed:.2f} runs/s" if task.speed else "", style="progress.data.speed")


@contextmanager
def batch_progress(*, quiet: bool) -> Iterator[Callable[[Reached], None]]:
    """A progress bar on stderr that disappears at the end; shown only if stderr is a terminal."""
    console = errors()
    columns = (BarColumn(), MofNCompleteColumn(), _Rate(), TimeRemainingColumn(), TextColumn("{task.description}"))
    with Progress(
        *columns, console=console, transient=True, disable=quiet or not console.is_terminal, speed_estimate_period=120.0
    ) as bar:
        task = bar.add_task("starting", total=None)

        def on_progress(reached: Reached) -> None:
            failures = f"[bold red]{reached.failures} failed[/], " if reached.failures else ""
            bar.update(
                task, completed=reached.done, total=reached.total, description=f"{failures}{escape(reached.text)}"
            )

        yield on_progress


def print_batch(done: BatchSummary, rows: ArrowTable, folder: Path) -> None:
    """Prints outcomes of runs and agents per planner, unfinished runs, notes, and the path of the results."""
    console = output()
    shown = [name for name in _VARIANTS if name == "planner" or len(rows[name].unique()) > 1]
    runs: dict[tuple[Any, ...], dict[str, str]] = {}
    ended: dict[tuple[Any, ...], Counter[str]] = {}
    lost: dict[str, tuple[str, ...]] = {}
    for row in _each(rows):
        variant = tuple(row[name] for name in shown)
        runs.setdefault(variant, {})[row["key"]] = row["status"]
        ended.setdefault(variant, Counter())
        if row["under_test"]:
            ended[variant][row["outcome"]] += 1
        if row["status"] != "finished":
            lost[row["key"]] = (row["scenario"], row["planner"], row["status"], row["error"])
    outcomes = [outcome for outcome in OUTCOMES if any(count[outcome] for count in ended.values())]
    table = table_of(shown)
    for name in ("runs", "refused", "failed", "agents", *outcomes):
        table.add_column(name.replace("_", " "), justify="right", style=STYLES.get(name, ""))
    for variant, of_run in runs.items():
        status, count = Counter(of_run.values()), ended[variant]
        table.add_row(
            *(escape(str(value)) for value in variant),
            str(len(of_run)),
            str(status["refused"]),
            str(len(of_run) - status["refused"] - status["finished"]),
            str(sum(count.values())),
            *(str(count[outcome]) for outcome in outcomes),
        )
    print_table(console, table, len(shown))
    _print_unfinished(console, list(lost.values()))
    print_notes(console, done.notes, "BatchSummary.notes")
    fresh = len(done.keys) - done.found
    there = f", {done.found} already existed" if done.found else ""
    console.print(f"{said_count(fresh, 'run')} in {done.seconds:.1f} s{there}")
    print_folder(console, folder)


def _each(rows: ArrowTable) -> Iterator[dict[str, Any]]:
    """Yields rows one by one, converted to Python in portions."""
    for portion in rows.to_batches(max_chunksize=_PORTION):
        yield from portion.to_pylist()


def _print_unfinished(console: Console, lost: list[tuple[str, ...]]) -> None:
    order = sorted(lost, key=lambda row: row[2] == "refused")
    for scenario, planner, status, error in order[:NOTES_MAX]:
        style = "dim" if status == "refused" else "red"
        console.print(f"[{style}]{status}[/]: {escape(f'{scenario}, {planner}: {error}')}", soft_wrap=True)
    if len(order) > NOTES_MAX:
        console.print(f"{len(order) - NOTES_MAX} more unfinished runs are in results.parquet", style="dim")


def print_answer(answer: Answer) -> None:
    """Prints a table of values; where it is wider than the console, row by row."""
    console = output()
    table = table_of(())
    rows = [[_cell(value) for value in row] for row in answer.rows[:_ANSWER_ROWS_MAX]]
    for k, name in enumerate(answer.columns):
        is_number = any(isinstance(row[k], int | float) and not isinstance(row[k], bool) for row in answer.rows)
        table.add_column(escape(name), justify="right" if is_number else "left", overflow="fold")
    widths = [max(map(len, column)) + 2 for column in zip(answer.columns, *rows, strict=True)]
    if sum(widths) - 2 <= console.width:
        for row in rows:
            table.add_row(*map(escape, row))
        console.print(table)
    else:
        for number, row in enumerate(rows):
            console.print(f"row {number + 1}", style="bold")
            grid = Table.grid(padding=(0, 2, 0, 0))
            for name, value in zip(answer.columns, row, strict=True):
                grid.add_row(f"  {escape(name)}", escape(value))
            console.print(grid)
    hidden = len(answer.rows) - _ANSWER_ROWS_MAX
    if hidden > 0:
        console.print(f"{hidden} more rows; --csv prints all", style="dim")


def _cell(value: object) -> str:
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def print_comparison(found: Comparison, folder: Path) -> None:
    """Prints planners by category, differences over all categories, and caveats."""
    from interdrive.comparison.tables import sheets_of  # noqa: PLC0415 - needs the simulation

    console = output()
    if not console.is_terminal:
        console.width = _COMPARISON_WIDTH
    for one in found.sets:
        console.print(f"[bold]{escape(one.title)}[/] (traffic {one.traffic}, agents {one.agents})", soft_wrap=True)
        console.print(escape(one.size), soft_wrap=True)
        for sheet in sheets_of(found, one):
            console.print(f"\n{escape(sheet.title)}", style="italic")
            print_table(console, _table_of(sheet), sheet.texts)
            if sheet.note:
                console.print(escape(sheet.note), soft_wrap=True)
        console.print()
    console.print("Caveats:", style="bold")
    for line in found.caveats:
        console.print(f"- {escape(line)}")
    console.print(f"tables, text and figure in {escape(str(folder))}", soft_wrap=True)


def _table_of(sheet: Sheet) -> Table:
    table = table_of(sheet.head, right=sheet.head[sheet.texts :], tight=True)
    for row in sheet.rows:
        table.add_row(*(f"[bold]{escape(cell.text)}[/]" if cell.strong else escape(cell.text) for cell in row))
    return table
