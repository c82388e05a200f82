"""Questions in SQL to the data set of a batch, answered by DuckDB."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal
from typing import TYPE_CHECKING, Any

from interdrive.batches.columns import RUN_COLUMNS
from interdrive.batches.dataset import key_table, streamed
from interdrive.batches.folder import BatchFolder
from interdrive.errors import InputError, MissingExtraError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from duckdb import DuckDBPyConnection, Statement

#: Tables that a question can name.
TABLES = ("results", "runs", "agents")


@dataclass(frozen=True)
class Answer:
    """What came of a question.

    Attributes:
        columns: Their names.
        rows: Values of Python, None where absent.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]


def query(folder: str | Path, text: str) -> Answer:
    """The answer to a question in SQL, of all runs that have ended when it is asked.

    Tables are `results` (everything), `runs` (one row per run) and `agents` (one row per agent under test). The
    question is one SELECT; it sees these tables and no files, and cannot change anything.

    Raises:
        ResultsError: The folder is no batch, or damaged.
        InputError: The question cannot be answered.
        MissingExtraError: DuckDB is not installed.
    """
    batch = BatchFolder.open(folder)
    try:
        import duckdb  # noqa: PLC0415 - optional
    except ImportError:
        raise MissingExtraError("duckdb is not installed; pip install interdrive[duckdb]") from None
    with duckdb.connect(":memory:") as connection:
        try:
            _lay_out(connection, batch)
            _check(connection.extract_statements(text))
            found = connection.sql(text).to_arrow_table()
        except duckdb.Error as cause:
            raise InputError(f"sql: {_in_short(cause)}") from cause
    columns = [[_plain(value) for value in column.to_pylist()] for column in found.columns]
    return Answer(tuple(found.column_names), tuple(zip(*columns, strict=True)))


def _lay_out(connection: DuckDBPyConnection, batch: BatchFolder) -> None:
    """Makes the tables, and locks everything else away."""
    fresh, keys = batch.fresh()
    connection.register("_fresh", fresh)
    connection.register("_withdrawn", key_table(keys))
    select = "select * from _fresh"
    if batch.results.exists():
        connection.register("_merged", streamed(batch.results))
        select = f"select * from _merged where key not in (select key from _withdrawn) union all by name {select}"
    elif not keys:
        raise InputError(f"{batch.path}: no run of this batch has ended yet, there is nothing to ask")
    columns = ", ".join(column.name for column in RUN_COLUMNS)
    connection.execute(f"create view results as {select}")
    connection.execute(f"create view runs as select distinct {columns} from results")
    connection.execute("create view agents as select * from results where under_test")
    connection.execute("set enable_external_access = false")
    connection.execute("set lock_configuration = true")


def _check(statements: Sequence[Statement]) -> None:
    """Raises InputError unless it is one question."""
    kinds = [statement.type.name for statement in statements]
    if not kinds:
        raise InputError('sql: what is the question? For instance "select planner, count(*) from agents group by all"')
    if len(kinds) > 1:
        raise InputError(f"sql: one question at a time, not {len(kinds)} statements")
    if kinds != ["SELECT"]:
        raise InputError(
            f"sql: this is a {kinds[0]} statement; only SELECT is answered, and nothing is written "
            "(for a file: --csv, or read results.parquet with other tools)"
        )


def _in_short(cause: Exception) -> str:
    """What DuckDB says, on one line and without the picture of where."""
    return " ".join(str(cause).partition("\n\nLINE ")[0].partition("Traceback")[0].split())


def _plain(value: object) -> object:
    """Sums of integers are decimals without places to Arrow."""
    return int(value) if isinstance(value, Decimal) and value.as_tuple().exponent == 0 else value
