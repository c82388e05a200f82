"""Questions in SQL to the data set of a batch, answered by DuckDB."""

from __future__ import annotations

import threading
from contextlib import suppress
from dataclasses import dataclass
from decimal import Decimal
from typing import TYPE_CHECKING, Any, TypeAlias

from interdrive.batches.columns import RUN_COLUMNS
from interdrive.batches.dataset import key_table, streamed
from interdrive.batches.store import BatchFolder
from interdrive.errors import InputError, InterdriveError, MissingExtraError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from datetime import date, time, timedelta
    from pathlib import Path

    from duckdb import DuckDBPyConnection, DuckDBPyRelation, Statement

#: Tables that a query can name.
TABLES = ("results", "runs", "agents")

#: Limits of a query: wall time [s], memory [bytes].
SECONDS, MEMORY = 60.0, 2.0 * 2**30

#: What to do about them.
RAISE_SECONDS, RAISE_MEMORY = "--timeout SECONDS gives it more time", "--memory SIZE allows more"

#: Memory that DuckDB itself needs [bytes].
_MEMORY_MIN = 50_000_000

#: Number of rows that are read at a time; approximate size of a value in Python [bytes].
_PORTION, _CELL = 1000, 64


#: A value of an answer; DuckDB gives dates and the like as its own types have them in Python.
Cell: TypeAlias = "bool | int | float | str | bytes | date | time | timedelta | list[Cell] | dict[str, Cell] | None"


@dataclass(frozen=True)
class Answer:
    """What came of a query.

    Attributes:
        columns: Their names.
        rows: Values of Python, None where absent.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]


def load_libraries() -> None:
    """Has the libraries reserve their address space, which for Arrow is more than 1 GB at its first allocation."""
    key_table({"x"})
    with suppress(ImportError):
        import duckdb  # noqa: F401, PLC0415 - optional


def query(folder: str | Path, text: str, *, seconds: float = SECONDS, memory: float = MEMORY) -> Answer:
    """The result of a query in SQL, over all runs that have ended by then.

    Tables are `results` (everything), `runs` (one row per run) and `agents` (one row per agent under test). The
    query is one SELECT; it sees these tables and no files, and cannot change anything.

    Args:
        folder: Of the batch.
        text: The query.
        seconds: Time limit of the query [s]; a single call of a function of DuckDB is not interrupted.
        memory: Memory limit of DuckDB [bytes]; the result may take about as much again.

    Raises:
        ResultsError: The folder is no batch, or damaged.
        InputError: The query fails, or exceeds these limits.
        MissingExtraError: DuckDB is not installed.
    """
    if not seconds > 0 or not memory >= _MEMORY_MIN:
        raise InputError(f"sql: expected more than 0 s and at least {_MEMORY_MIN} bytes, not {seconds} and {memory}")
    batch = BatchFolder.open(folder)
    try:
        import duckdb  # noqa: PLC0415 - optional
    except ImportError:
        raise MissingExtraError("duckdb is not installed; pip install interdrive[duckdb]") from None
    with duckdb.connect(":memory:") as connection:
        is_late = threading.Event()

        def stop() -> None:
            is_late.set()
            connection.interrupt()

        # Longer waits than this are for ever.
        alarm = threading.Timer(min(seconds, threading.TIMEOUT_MAX), stop)
        alarm.daemon = True
        try:
            _lay_out(connection, batch, memory)
            alarm.start()
            _check(connection.extract_statements(text))
            return _answer(connection.sql(text), memory)
        except InterdriveError:
            raise
        except Exception as cause:  # those of DuckDB, of Arrow, and of what a query makes of both
            if is_late.is_set():
                raise InputError(f"sql: no result after {seconds:g} s; {RAISE_SECONDS}") from None
            if isinstance(cause, duckdb.OutOfMemoryException | MemoryError) or "Out of Memory" in str(cause):
                raise InputError(f"sql: the query needs more memory than {_size(memory)}; {RAISE_MEMORY}") from None
            raise InputError(f"sql: {_in_short(cause)}") from cause
        finally:
            alarm.cancel()


def _answer(asked: DuckDBPyRelation, memory: float) -> Answer:
    """All rows, read in portions."""
    read = asked.to_arrow_reader if hasattr(asked, "to_arrow_reader") else asked.fetch_arrow_reader  # before 1.4
    portions = read(_PORTION)
    rows: list[tuple[Cell, ...]] = []
    held = 0.0
    for portion in portions:
        columns = [_values(*column) for column in zip(portion.schema.names, portion.columns, strict=True)]
        rows += zip(*columns, strict=True)
        held += _CELL * len(columns) * portion.num_rows + portion.nbytes
        if held > memory:
            raise InputError(
                f"sql: the result has more than {len(rows) - portion.num_rows} rows, which need more memory than "
                f"{_size(memory)}; ask for fewer (limit 1000), or {RAISE_MEMORY}"
            )
    return Answer(tuple(portions.schema.names), tuple(rows))


def _values(name: str, column: Any) -> list[Any]:  # noqa: ANN401 - an Arrow array
    """The values of a column as those of Python."""
    try:
        return [_plain(value) for value in column.to_pylist()]
    except (ArithmeticError, KeyError, NotImplementedError, TypeError, ValueError) as cause:
        why = f"it has values that cannot be shown ({_in_short(cause)}); ask for them as text ({name}::text)"
        raise InputError(f"sql: column {name}: {why}") from None


def _size(memory: float) -> str:
    return f"{memory / 2**20:.0f} MiB"


def _lay_out(connection: DuckDBPyConnection, batch: BatchFolder, memory: float) -> None:
    """Makes the tables, and locks everything else away."""
    connection.execute(f"set memory_limit = '{int(memory)}B'")
    connection.execute("set temp_directory = ''")
    connection.execute("set enable_progress_bar = false")
    fresh, keys = batch.fresh()
    connection.register("_fresh", fresh)
    connection.register("_withdrawn", key_table(keys))
    select = "select * from _fresh"
    if batch.results.exists():
        connection.register("_merged", streamed(batch.results))
        select = f"select * from _merged where key not in (select key from _withdrawn) union all by name {select}"
    elif not keys:
        raise InputError(f"{batch.path}: no run of this batch has ended yet, there is nothing to query")
    columns = ", ".join(column.name for column in RUN_COLUMNS)
    connection.execute(f"create view results as {select}")
    connection.execute(f"create view runs as select distinct {columns} from results")
    connection.execute("create view agents as select * from results where under_test")
    connection.execute("set enable_external_access = false")
    connection.execute("set lock_configuration = true")


def _check(statements: Sequence[Statement]) -> None:
    """Raises InputError unless it is one query."""
    kinds = [statement.type.name for statement in statements]
    if not kinds:
        raise InputError('sql: the query is empty; for instance "select planner, count(*) from agents group by all"')
    if len(kinds) > 1:
        raise InputError(f"sql: one query at a time, not {len(kinds)} statements")
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
