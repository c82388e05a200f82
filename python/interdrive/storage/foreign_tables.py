"""Tables of other programs: Parquet and CSV as arrays by column, and back. pyarrow is loaded on first use."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import InputError
from interdrive.storage.arrow_arrays import values_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import pyarrow as pa
    from numpy.typing import NDArray

    from interdrive.array_types import Floats, Ints

#: How Parquet files begin.
PARQUET_MARK = b"PAR1"
#: More rows are no recording that can be read here.
MOST_ROWS = 50_000_000


@dataclass(frozen=True)
class ForeignTable:
    """A table with columns of any names.

    Attributes:
        file: Its name in messages.
        table: The columns.
    """

    file: str
    table: pa.Table

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.table.column_names)

    def __len__(self) -> int:
        """Number of rows."""
        return int(self.table.num_rows)

    def require(self, names: Iterable[str]) -> None:
        """Refuses the table unless it has these columns."""
        for name in names:
            if self.names.count(name) != 1:
                found = ", ".join(known[:20] for known in self.names[:12]) + (" ..." if len(self.names) > 12 else "")
                problem = "has no column" if name not in self.names else "has more than one column"
                raise InputError(f"{self.file}: {problem} {name} (found: {found})")

    def numbers(self, name: str) -> Floats:
        """A column as numbers, nan where a cell is empty; all nan without such a column, shape (rows,)."""
        import pyarrow as pa  # noqa: PLC0415

        if name not in self.names:
            return np.full(len(self), np.nan)
        self.require((name,))
        column = self.table.column(name)
        try:
            if pa.types.is_dictionary(column.type):
                column = column.cast(column.type.value_type)
            numbers = values_of(column.cast(pa.float64(), safe=False))
        except (pa.ArrowException, ValueError, TypeError):
            raise InputError(f"{self.file}: the column {name} has a value that is no number; correct it") from None
        return numbers

    def words(self, name: str) -> tuple[tuple[str, ...], Ints]:
        """The different texts of a column in the order of their first rows, and which of them each row has.

        An empty cell has the text "". Whole numbers are written without a fraction.
        """
        import pyarrow as pa  # noqa: PLC0415

        self.require((name,))
        column = self.table.column(name)
        try:
            if pa.types.is_dictionary(column.type):
                column = column.cast(column.type.value_type)
            if pa.types.is_floating(column.type):
                values = values_of(column.cast(pa.float64()))
                if ((values == np.round(values)) & (np.abs(values) < 2.0**53)).all():
                    column = column.cast(pa.int64())
            encoded = column.cast(pa.large_string()).combine_chunks().dictionary_encode()
            texts = [str(text) for text in encoded.dictionary.to_pylist()]
            rows = values_of(encoded.indices, -1)
        except (pa.ArrowException, ValueError, TypeError):
            raise InputError(f"{self.file}: the column {name} is no text; correct it") from None
        if (rows < 0).any():
            texts = texts if "" in texts else [*texts, ""]
            rows[rows < 0] = texts.index("")
        return tuple(texts), rows.astype(np.int64)


def foreign_table(data: bytes, file: str, columns: Sequence[str] = ()) -> ForeignTable:
    """A Parquet or CSV file.

    Args:
        data: Its bytes; Parquet is recognised by its mark.
        file: Its name in messages.
        columns: Columns of Parquet that are read where the file has them; none: all.

    Raises:
        InputError: It is neither, broken, or too large; one line that names it.
    """
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.csv  # noqa: PLC0415
    import pyarrow.parquet as pq  # noqa: PLC0415

    if not data.strip():
        raise InputError(f"{file}: is empty; give a table with a first line of names")
    is_parquet = data.startswith(PARQUET_MARK)
    try:
        if is_parquet:
            opened = pq.ParquetFile(io.BytesIO(data))
            _require_rows(opened.metadata.num_rows, file)
            known = [name for name in opened.schema_arrow.names if not columns or name in columns]
            table = opened.read(columns=known)
        else:
            table = pyarrow.csv.read_csv(io.BytesIO(data))
            _require_rows(table.num_rows, file)
    except (pa.ArrowException, OSError, ValueError, MemoryError, OverflowError, KeyError) as error:
        kind = "Parquet" if is_parquet else "CSV"
        reason = " ".join(str(error).split())[:120]
        raise InputError(f"{file}: is no whole {kind} table ({reason}); give a whole file") from error
    found = ForeignTable(file, table)
    try:
        _ = found.names
    except UnicodeDecodeError:
        raise InputError(f"{file}: a name of a column is no UTF-8 text; save the table as UTF-8") from None
    return found


def header_of(data: bytes) -> tuple[str, ...]:
    """Names in the first line of a CSV file; empty where that is no text."""
    try:
        line = data[:65536].split(b"\n", 1)[0].decode("utf-8-sig").strip()
    except UnicodeDecodeError:
        return ()
    return tuple(name.strip().strip('"') for name in line.split(","))


def _require_rows(n: int, file: str) -> None:
    if n > MOST_ROWS:
        raise InputError(f"{file}: has {n} rows; at most {MOST_ROWS} are possible, cut it")


def csv_table(columns: Mapping[str, NDArray[Any]]) -> bytes:
    """Columns as CSV with a first line of names; numbers read back are the same, bit for bit."""
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.csv  # noqa: PLC0415

    sink = pa.BufferOutputStream()
    table = pa.table({name: pa.array(values) for name, values in columns.items()})
    sink.write(f"{','.join(columns)}\n".encode())  # Arrow would put names in quotes
    pyarrow.csv.write_csv(table, sink, pyarrow.csv.WriteOptions(include_header=False, quoting_style="needed"))
    content: bytes = sink.getvalue().to_pybytes()
    return content
