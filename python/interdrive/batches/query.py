"""Questions in SQL to the data set of a batch, answered by DuckDB."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from interdrive.batches.columns import RUN_COLUMNS
from interdrive.batches.dataset import lacking
from interdrive.batches.folder import BatchFolder
from interdrive.errors import InputError, MissingExtraError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

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
    """The answer to a question in SQL.

    Tables are `results` (everything), `runs` (one row per run) and `agents` (one row per agent under test).

    Raises:
        ResultsError: The folder is no batch.
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
            connection.execute(f"create view results as {_everything(batch)}")
            columns = ", ".join(column.name for column in RUN_COLUMNS)
            connection.execute(f"create view runs as select distinct {columns} from results")
            connection.execute("create view agents as select * from results where under_test")
            found = connection.execute(text)
            names = tuple(item[0] for item in found.description or ())
            return Answer(names, tuple(found.fetchall()) if names else ())
        except duckdb.Error as cause:
            raise InputError(f"sql: {' '.join(str(cause).split())}") from cause


def _everything(batch: BatchFolder) -> str:
    """A select of all rows: what is merged, without runs that lie beside it, and those."""
    fresh = batch.unmerged()
    selects = []
    if batch.results.exists():
        but = f" where key not in ({_texts(part.stem for part in fresh)})" if fresh else ""
        selects += [f"{select}{but}" for select in _selects([batch.results])]
    selects += _selects(fresh)
    if not selects:
        raise InputError(f"{batch.path}: no run of this batch has ended yet, there is nothing to ask")
    return " union all by name ".join(selects)


def _selects(files: Sequence[Path]) -> list[str]:
    """A select per group of files that lack the same columns, which it adds."""
    groups: dict[tuple[tuple[str, str], ...], list[str]] = {}
    for file in files:
        groups.setdefault(tuple(lacking(file).items()), []).append(str(file))
    return [
        f"select *{''.join(f', {_texts([value])} as {name}' for name, value in added)} "
        f"from read_parquet([{_texts(names)}])"
        for added, names in groups.items()
    ]


def _texts(values: Iterable[str]) -> str:
    return ", ".join("'" + value.replace("'", "''") + "'" for value in values)
