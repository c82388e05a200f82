"""The Parquet file of a batch: written whole, grown by rewriting it in a stream, read as one table."""

from __future__ import annotations

import io
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from interdrive.batches.columns import COLUMNS, TRAFFIC_COLUMNS
from interdrive.errors import ResultsError
from interdrive.scoring import FORMER_COLUMNS, SCORE_COLUMNS
from interdrive.storage import Origin, check_values, replacing, schema_of
from interdrive.storage.arrow_arrays import texts

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import pyarrow.dataset as ds

#: Runs of one file may differ in these; their columns say how each came about.
_ORIGIN = Origin(
    {"of each run": "columns settings, planner, predictor"}, {"of each run": "columns scenario_sha256, digest"}
)

#: Columns of scores, of this format and of the one before, and all columns of the latter that are the same now.
_SCORES = {column.name for column in SCORE_COLUMNS} | {*FORMER_COLUMNS}
_KEPT = (
    {column.name for column in COLUMNS} - _SCORES - {column.name for column in TRAFFIC_COLUMNS}
    | {"fault", "fault_kind", "fault_nuplan", "collision_type", "room"}
    | {"straight_ttc_min", "lane_keeping", "excused", "why"}
)

#: Rows are read and written in portions of about this many.
_PORTION = 32_768

#: So many files of single runs are held in memory at once.
_FILES_AT_ONCE = 256


def encoded(table: pa.Table) -> bytes:
    """A table of one run as a Parquet file.

    It is not compressed: for few rows, setting that up takes three times as long as everything else and saves nothing.
    """
    sink = io.BytesIO()
    pq.write_table(_ORIGIN.marked(table), sink, compression="none", write_statistics=False)
    return sink.getvalue()


def merge(into: Path, parts: Sequence[Path]) -> None:
    """Adds the rows of single runs to a file, which is replaced whole; rows of the same keys leave it.

    Memory does not grow with the number of rows.

    Args:
        into: The file; it need not exist.
        parts: Files of single runs, called `<key>.parquet`.

    Raises:
        ResultsError: A file that cannot be read or written.
    """
    schema = _schema().with_metadata(_ORIGIN.metadata())
    keys = {part.stem for part in parts}
    with replacing(into) as partial, pq.ParquetWriter(partial, schema, compression="zstd") as writer:
        waiting: list[pa.Table] = []
        for batch in _opened(into).iter_batches(batch_size=_PORTION) if into.exists() else ():
            _write(writer, waiting, _chosen(_checked(pa.Table.from_batches([batch]), into), None, keys))
        for start in range(0, len(parts), _FILES_AT_ONCE):
            for part in parts[start : start + _FILES_AT_ONCE]:
                _write(writer, waiting, read_run(part))
        _write(writer, waiting, None)


def _write(writer: pq.ParquetWriter, waiting: list[pa.Table], table: pa.Table | None) -> None:
    """Writes when enough has come together; without a table, what is left."""
    if table is not None and table.num_rows:
        waiting.append(table)
    if waiting and (table is None or sum(item.num_rows for item in waiting) >= _PORTION):
        writer.write_table(pa.concat_tables(waiting).unify_dictionaries().combine_chunks())
        waiting.clear()


def read(
    path: Path, columns: Sequence[str] | None = None, keys: set[str] | None = None, *, but: set[str] | None = None
) -> pa.Table:
    """The table in a file, or some of its columns, or the rows of some runs; `but` are keys of runs to leave out.

    Rows that are not wanted are never held together.

    Raises:
        ResultsError: It is damaged or has other columns.
        FileNotFoundError: It is not there.
    """
    try:
        file = _opened(path)
        wanted = [column.name for column in COLUMNS] if columns is None else list(columns)
        is_former = _is_former(file.schema_arrow.names)
        there = _sources(wanted) if is_former else wanted
        taken = partial(_renewed if is_former else pa.Table.select, columns=wanted)
        if keys is None and not but:
            return _checked(taken(file.read(columns=there)), path)
        found = [
            _chosen(_checked(taken(pa.Table.from_batches([batch])), path), keys, but or set())
            for batch in file.iter_batches(batch_size=_PORTION, columns=there)
        ]
        return joined(found, columns)
    except (pa.ArrowException, OSError) as cause:
        if isinstance(cause, FileNotFoundError):
            raise
        raise ResultsError(f"{path}: cannot be read: {' '.join(str(cause).split())}") from cause


def read_run(path: Path, columns: Sequence[str] | None = None) -> pa.Table:
    """The table in the file of a single run, called `<key>.parquet`, or some of its columns.

    Raises:
        ResultsError: It is damaged, has other columns, or is about another run.
        FileNotFoundError: It is not there.
    """
    check_key(path.stem, path)
    table = read(path, columns)
    if "key" in table.column_names and table["key"].unique().to_pylist() not in ([], [path.stem]):
        raise ResultsError(f"{path}: key: it belongs to another run; the file is damaged")
    return table


def n_keys(path: Path) -> int:
    """Number of runs in a file.

    Raises:
        ResultsError: It is damaged or has other columns.
    """
    return len(pc.unique(read(path, ["key"])["key"].cast(pa.string())))


def _chosen(table: pa.Table, keys: set[str] | None, but: set[str]) -> pa.Table:
    own = table["key"].cast(pa.string())
    is_wanted = pc.invert(pc.is_in(own, texts(sorted(but))))
    if keys is not None:
        is_wanted = pc.and_(is_wanted, pc.is_in(own, texts(sorted(keys))))
    return table.filter(is_wanted)


def _is_former(names: Sequence[str]) -> bool:
    return FORMER_COLUMNS[0] in names


def _source(name: str) -> str:
    """Which column of a file of the format before a column is; "" if it had none."""
    return "score" if name == "score_1" else name if name in _KEPT else ""


def _sources(wanted: Sequence[str]) -> list[str]:
    """Which columns the wanted ones are made of; "key" at least, which says how many rows there are."""
    return list(dict.fromkeys(["key", *filter(None, map(_source, wanted))]))


def _renewed(table: pa.Table, columns: Sequence[str]) -> pa.Table:
    """Columns of this version from a file of the format before; what that did not have is null."""
    schema = pa.schema([_schema().field(name) for name in columns])
    values = [
        table[_source(field.name)] if _source(field.name) else pa.nulls(table.num_rows, field.type) for field in schema
    ]
    return pa.table(values, schema=schema)


def streamed(path: Path) -> ds.Dataset | pa.Table:
    """A file whose rows are read in portions while they are asked for; that another one takes its place does no harm.

    A file of the format before is read whole.

    Raises:
        ResultsError: It is damaged or has other columns.
    """
    import pyarrow.dataset as ds  # noqa: PLC0415 - imports pandas where there is one, which takes a second

    if _is_former(_opened(path).schema_arrow.names):
        return read(path)
    form = ds.ParquetFileFormat()
    fragment = form.make_fragment(pa.OSFile(str(path)))
    return ds.FileSystemDataset([fragment], fragment.physical_schema, form)


def key_table(keys: set[str]) -> pa.Table:
    """A table with the column `key` alone."""
    return pa.table({"key": texts(sorted(keys))})


def joined(tables: Sequence[pa.Table], columns: Sequence[str] | None = None) -> pa.Table:
    """Tables below each other."""
    empty = pa.Table.from_batches([], _schema())
    return pa.concat_tables([empty.select(columns or empty.column_names), *tables]).unify_dictionaries()


def in_portions(table: pa.Table) -> Iterator[pa.RecordBatch]:
    """The same rows, some of them at a time."""
    yield from table.to_batches(max_chunksize=_PORTION)


def in_order(table: pa.Table, by: Sequence[str]) -> pa.Table:
    """The rows sorted by columns."""
    plain = {name: table[name] for name in by}
    for name, column in plain.items():
        if pa.types.is_dictionary(column.type):
            plain[name] = column.cast(pa.string())
    return table.take(pc.sort_indices(pa.table(plain), sort_keys=[(name, "ascending") for name in by]))


def _opened(path: Path) -> pq.ParquetFile:
    try:
        found = pq.ParquetFile(path)
    except FileNotFoundError:
        raise
    except (pa.ArrowException, OSError) as cause:
        raise ResultsError(f"{path}: cannot be read: {' '.join(str(cause).split())}") from cause
    expected, schema = _schema(), found.schema_arrow  # which is made anew every time one asks for it
    names = schema.names
    if _is_former(names):
        names = [name for name in names if name not in _SCORES - _KEPT]
        if set(names) != _KEPT:
            raise ResultsError(f"{path}: its columns are neither those of this version nor of the one before")
    elif names != expected.names:
        other = next(iter(set(names) ^ set(expected.names)), "their order")
        raise ResultsError(f"{path}: its columns differ from those of this version ({other} differs)")
    for name in names:
        if _plain(schema.field(name).type) != _plain(expected.field(name).type):
            raise ResultsError(f"{path}: {name}: values of type {_plain(schema.field(name).type)}")
    return found


@cache
def _schema() -> pa.Schema:
    return schema_of(COLUMNS)


def _plain(kind: pa.DataType) -> pa.DataType:
    """Texts from a short list are texts."""
    return kind.value_type if pa.types.is_dictionary(kind) else kind


def _checked(table: pa.Table, path: Path) -> pa.Table:
    """The table, if it holds what batches write: keys become names of files, labels are looked up.

    Raises:
        ResultsError: A value that no batch writes; one line that names file and column.
    """
    there = [column for column in COLUMNS if column.name in table.column_names]
    check_values(table, path, there)
    if "key" in table.column_names:
        for key in pc.unique(table["key"].cast(pa.string())).to_pylist():
            check_key(key, path)
    if {"under_test", "agent_id", "outcome"} <= set(table.column_names):
        agents = table.filter(table["under_test"])
        for name in ("agent_id", "outcome"):
            if agents[name].null_count:
                raise ResultsError(f"{path}: {name}: a value is missing; the file is damaged")
    return table


def check_key(key: str, where: Path) -> None:
    """Raises ResultsError unless the key of a run is 32 hexadecimal digits."""
    if len(key) != 32 or not set(key) <= set("0123456789abcdef"):
        shown = key if len(key) <= 60 else f"{key[:57]}..."
        raise ResultsError(f"{where}: key: {shown!r} is not 32 hexadecimal digits; the file is damaged")
