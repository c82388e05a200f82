"""Arrow tables with described columns, as Parquet and CSV. pyarrow is loaded on first use."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from interdrive.errors import ResultsError
from interdrive.storage.arrow_arrays import numbers, texts, truths, values_of
from interdrive.storage.names import readable
from interdrive.storage.origin import UNIT, units_of
from interdrive.storage.writing import one_line

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pyarrow as pa

    from interdrive.storage.columns import Column
    from interdrive.storage.origin import Origin

    #: For signatures elsewhere: only `interdrive.results` knows pyarrow.
    ArrowTable: TypeAlias = pa.Table


def arrow_table(columns: Sequence[Column], values: Mapping[str, Any]) -> pa.Table:
    """A table with the given columns, whose values are arrays, sequences or Arrow arrays, as records have them."""
    import pyarrow as pa  # noqa: PLC0415

    schema = schema_of(columns)
    arrays = [_array(values[column.name], column, field) for column, field in zip(columns, schema, strict=True)]
    return pa.Table.from_arrays(arrays, schema=schema)


def joined_tables(columns: Sequence[Column], tables: Sequence[pa.Table]) -> pa.Table:
    """Tables with the given columns one below the other; without any, a table without rows."""
    import pyarrow as pa  # noqa: PLC0415

    return pa.concat_tables([empty_table(columns), *tables]).unify_dictionaries()


def empty_table(columns: Sequence[Column]) -> pa.Table:
    """A table with the given columns and no rows."""
    return arrow_table(columns, {column.name: () for column in columns})


def _array(values: Any, column: Column, field: pa.Field) -> pa.Array:  # noqa: ANN401 - array or sequence
    import pyarrow as pa  # noqa: PLC0415

    if isinstance(values, pa.Array):
        return values
    if column.kind == "label":
        if column.coded and column.labels is not None:
            return labels(column.labels, values)
        return labels(values, absent=("",) if column.empty_is_null else ())
    if column.kind == "text":
        return texts([None if _is_absent(text) else readable(text) for text in values])
    kind: type = {"integer": np.int64, "number": np.float64, "truth": np.bool_}[column.kind]
    if isinstance(values, np.ndarray) and values.dtype != object:
        absent = np.zeros(len(values), dtype=np.bool_)
        if column.nullable:
            absent = values != values  # noqa: PLR0124 - nan
        if column.nullable and column.kind == "integer":
            absent |= values == column.absent
    else:
        # Where every row has a value, nan is one.
        absent = np.array([_is_absent(one) if column.nullable else one is None for one in values], dtype=np.bool_)
        values = np.array([column.absent if gone else one for one, gone in zip(values, absent, strict=True)])
    if len(values) and values.dtype.kind not in ("b" if column.kind == "truth" else "iuf"):
        raise TypeError(f"column {column.name}: {values.dtype} is no {column.kind}")
    if column.kind == "truth":
        return truths(values, absent)
    if values.dtype.kind == "f" and column.kind == "integer":
        values = np.where(absent, column.absent, values)
        if (values % 1 != 0).any():
            raise TypeError(f"column {column.name}: {values.dtype} with fractions is no integer")
    return numbers(values.astype(kind, copy=False), absent)


def _is_absent(value: object) -> bool:
    return value is None or value != value  # noqa: PLR0124 - nan


def labels(names: Sequence[str | None], index: Any = None, absent: Sequence[str] = ()) -> pa.Array:  # noqa: ANN401
    """Texts from a short list; `index` picks from `names` (null where negative), without it each name is one row.

    None, and names that are `absent`, are null.
    """
    import pyarrow as pa  # noqa: PLC0415

    kept = [name for name in dict.fromkeys(names) if name is not None and name not in absent]
    places: dict[str | None, int] = {
        None: -1,
        **dict.fromkeys(absent, -1),
        **{name: place for place, name in enumerate(kept)},
    }
    place = np.array([places[name] for name in names], dtype=np.int32)
    picked = place if index is None else np.append(place, np.int32(-1))[np.asarray(index, dtype=np.int64)]
    return pa.DictionaryArray.from_arrays(numbers(picked, picked < 0), texts([readable(name) for name in kept]))


def decoded(values: pa.ChunkedArray, column: Column) -> Any:  # noqa: ANN401 - an array
    """The values of a column of a table as an array, with `Column.absent` for null."""
    return values_of(values, column.absent)


def schema_of(columns: Sequence[Column]) -> pa.Schema:
    """The columns as an Arrow schema, with meaning, unit and reason for null as metadata."""
    import pyarrow as pa  # noqa: PLC0415

    types = {
        "integer": pa.int64(),
        "number": pa.float64(),
        "truth": pa.bool_(),
        "text": pa.string(),
        "label": pa.dictionary(pa.int32(), pa.string()),
    }

    def about(column: Column) -> dict[bytes, bytes]:
        told = {b"description": column.description, UNIT: column.unit, b"null": column.null}
        return {key: value.encode() for key, value in told.items() if value or key != b"null"}

    return pa.schema(pa.field(one.name, types[one.kind], one.nullable, about(one)) for one in columns)


def read_table(path: Path, columns: Sequence[Column], *, added: Sequence[str] = ()) -> pa.Table:
    """A Parquet file of a run, as an Arrow table.

    Args:
        path: The file.
        columns: What it has to hold.
        added: Names of columns that files of older versions do not have.

    Raises:
        ResultsError: if it is missing, damaged or has other columns; one line.
    """
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.parquet as pq  # noqa: PLC0415

    if path.exists() and not path.is_file():
        raise ResultsError(f"{path}: not a file")
    try:
        with pq.ParquetFile(path) as file:  # pq.read_table would import pandas, where there is one
            table = file.read()
    except FileNotFoundError:
        raise ResultsError(f"{path}: this file of the run is missing") from None
    except (OSError, pa.ArrowException) as cause:
        raise ResultsError(f"{path}: cannot be read: {one_line(cause)}") from cause
    there = [column for column in columns if column.name not in added or column.name in table.column_names]
    if not table.schema.equals(schema_of(there), check_metadata=False):
        raise ResultsError(f"{path}: the columns are not those of a run ({', '.join(table.column_names)})")
    return table


def column_names(path: Path) -> tuple[str, ...]:
    """Names of the columns of a Parquet file; none if it cannot be read."""
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.parquet as pq  # noqa: PLC0415

    try:
        return tuple(pq.read_schema(path).names)
    except (OSError, pa.ArrowException):
        return ()


def write_table(table: pa.Table, path: Path, origin: Origin) -> None:
    """Writes a table as Parquet, or as CSV if the path ends in .csv; its origin and units come with it.

    CSV begins with lines behind "# ".
    """
    if path.suffix != ".csv":
        write_parquet(table, path, origin)
        return
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.csv  # noqa: PLC0415

    units = ", ".join(f"{name} [{unit}]" for name, unit in units_of(table.schema).items())
    sink = pa.BufferOutputStream()
    for line in (*origin.lines, f"units: {units}"):
        sink.write(f"# {readable(' '.join(line.split()))}\n".encode())
    pa.csv.write_csv(table, sink, pa.csv.WriteOptions(quoting_style="needed"))
    path.write_bytes(sink.getvalue().to_pybytes())


def write_parquet(table: pa.Table, path: Path, origin: Origin) -> None:
    """Writes a table as Parquet, with its origin as metadata of the schema."""
    import pyarrow.parquet as pq  # noqa: PLC0415

    pq.write_table(origin.marked(table), path, **_encoding(table.schema))


def _encoding(schema: pa.Schema) -> dict[str, Any]:
    import pyarrow as pa  # noqa: PLC0415

    numbers = [field.name for field in schema if pa.types.is_floating(field.type)]
    named = [field.name for field in schema if pa.types.is_dictionary(field.type)]
    # Numbers hardly repeat: splitting their bytes compresses better than looking for repetitions.
    return {
        "compression": "zstd",
        "compression_level": 1,
        "use_dictionary": named,
        "use_byte_stream_split": numbers,
    }


class TableWriter:
    """Writes a table as Parquet part by part: what is written is no longer held.

    Attributes:
        num_rows: Number of rows until now.
    """

    def __init__(self, path: Path, columns: Sequence[Column], origin: Origin) -> None:
        """Begins the file.

        Args:
            path: The file.
            columns: Of all parts.
            origin: How the table comes about, as far as that is known before it is whole.
        """
        import pyarrow.parquet as pq  # noqa: PLC0415

        schema = schema_of(columns).with_metadata(origin.metadata())
        self.num_rows = 0
        self._origin = origin
        # Least and largest values of every column of every part would grow with the number of parts.
        self._writer = pq.ParquetWriter(path, schema, write_statistics=False, **_encoding(schema))

    def write(self, part: pa.Table) -> None:
        """Adds rows."""
        if part.num_rows:
            self._writer.write_table(self._origin.marked(part))
            self.num_rows += part.num_rows

    def close(self) -> None:
        """Ends the file."""
        self._writer.close()
