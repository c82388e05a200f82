"""Arrow tables with described columns, as Parquet and CSV. pyarrow is loaded on first use."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from interdrive.errors import ResultsError
from interdrive.storage.names import readable
from interdrive.storage.origin import UNIT, units_of
from interdrive.storage.writing import one_line

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pyarrow as pa

    from interdrive.storage.origin import Origin

    #: For signatures elsewhere: only `interdrive.results` knows pyarrow.
    ArrowTable: TypeAlias = pa.Table


@dataclass(frozen=True)
class Column:
    """One column: its name, its type ("integer", "number", "truth", "text", "label"), and its description with unit.

    Absent values are null, and only `nullable` columns have them; only `infinite` ones have infinities. The unit is
    what the description has in brackets at its end, unless `own_unit` states another one.
    """

    name: str
    kind: str
    text: str
    nullable: bool = False
    infinite: bool = False
    own_unit: str | None = None

    @property
    def unit(self) -> str:
        """The unit; "1" for numbers without one, "" for what is no number."""
        if self.own_unit is not None:
            return self.own_unit
        found = re.search(r"\[([^\]]+)\]$", self.text)
        return found[1] if found else "1" if self.kind in ("integer", "number") else ""


def arrow_table(columns: Sequence[Column], values: Mapping[str, Any]) -> pa.Table:
    """A table with the given columns, whose values are arrays, sequences or Arrow arrays; nan becomes null."""
    import pyarrow as pa  # noqa: PLC0415

    schema = schema_of(columns)
    # from_pandas: nan and masked entries become null.
    arrays = [
        _array(values[field.name], field) if not isinstance(values[field.name], pa.Array) else values[field.name]
        for field in schema
    ]
    return pa.Table.from_arrays(arrays, schema=schema)


def joined_tables(columns: Sequence[Column], tables: Sequence[pa.Table]) -> pa.Table:
    """Tables with the given columns one below the other; without any, a table without rows."""
    import pyarrow as pa  # noqa: PLC0415

    return pa.concat_tables([schema_of(columns).empty_table(), *tables]).unify_dictionaries()


def _array(values: Any, field: pa.Field) -> pa.Array:  # noqa: ANN401 - array or sequence
    import pyarrow as pa  # noqa: PLC0415

    try:
        return pa.array(values, type=field.type, from_pandas=field.nullable)
    except UnicodeEncodeError:
        texts = [readable(text) if isinstance(text, str) else text for text in values]
        return pa.array(texts, type=field.type, from_pandas=field.nullable)


def labels(names: tuple[str, ...], index: Any = None) -> pa.Array:  # noqa: ANN401 - integer array
    """Texts from a short list; `index` picks from `names` (null where negative), without it each name is one row."""
    import pyarrow as pa  # noqa: PLC0415

    places: dict[str, int] = {}
    place = np.array([places.setdefault(name, len(places)) for name in names], dtype=np.int32)
    picked = place if index is None else np.append(place, np.int32(-1))[index]
    indices = pa.array(picked, pa.int32(), mask=picked < 0)
    return pa.DictionaryArray.from_arrays(indices, pa.array([readable(name) for name in places], pa.string()))


def schema_of(columns: Sequence[Column]) -> pa.Schema:
    """The columns as an Arrow schema, with descriptions and units as metadata."""
    import pyarrow as pa  # noqa: PLC0415

    types = {
        "integer": pa.int64(),
        "number": pa.float64(),
        "truth": pa.bool_(),
        "text": pa.string(),
        "label": pa.dictionary(pa.int32(), pa.string()),
    }
    return pa.schema(
        pa.field(
            column.name, types[column.kind], column.nullable, {"description": column.text, UNIT: column.unit.encode()}
        )
        for column in columns
    )


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
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.parquet as pq  # noqa: PLC0415

    numbers = [field.name for field in table.schema if pa.types.is_floating(field.type)]
    named = [field.name for field in table.schema if pa.types.is_dictionary(field.type)]
    # Numbers hardly repeat: splitting their bytes compresses better than looking for repetitions.
    pq.write_table(
        origin.marked(table),
        path,
        compression="zstd",
        compression_level=1,
        use_dictionary=named,
        use_byte_stream_split=numbers,
    )
