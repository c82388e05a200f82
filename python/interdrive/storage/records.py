"""Records of arrays whose fields declare the columns of a table, and what follows from that: the table, and back."""

from __future__ import annotations

from dataclasses import Field, fields, replace
from inspect import cleandoc
from itertools import compress
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from interdrive.storage.columns import DECLARED, Column
from interdrive.storage.tables import decoded, labels

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Self

    from interdrive.array_types import Bools
    from interdrive.storage.tables import ArrowTable

_TYPES = {"integer": np.int64, "number": np.float64, "truth": np.bool_}


class Record:
    """A dataclass of arrays; a field declares the column that its array is in the table.

        impact_speed: Floats = field(metadata=number("relative speed at a collision", "m/s", null="no collision"))

    An attribute that is a `Column` and no field is a column without array: it is computed when the table is made. The
    order is that of the table. What the fields declare is added to the docstring of the class.
    """

    #: Columns of the table.
    columns: ClassVar[tuple[Column, ...]]
    #: Columns that have an array, by the fields of these.
    stored: ClassVar[Mapping[str, Column]]

    def __init_subclass__(cls) -> None:
        """Reads the declarations."""
        stored, columns = {}, []
        for name, value in vars(cls).items():
            declared = value.metadata.get(DECLARED) if isinstance(value, Field) else None
            if declared is not None:
                stored[name] = replace(declared, name=declared.name or name)
                columns.append(stored[name])
            elif isinstance(value, Column):
                columns.append(value)
        cls.stored, cls.columns = stored, tuple(columns)
        if stored and cls.__doc__ is not None:
            head = cleandoc(cls.__doc__)
            lines = [f"    {name}: {column.sentence}" for name, column in stored.items()]
            cls.__doc__ = "\n".join([head, *(() if "\nAttributes:\n" in head else ("", "Attributes:")), *lines, ""])

    @property
    def arrays(self) -> dict[str, Any]:
        """Arrays by the names of their columns; for a table with a row for each row of the record."""
        return {column.name: getattr(self, name) for name, column in self.stored.items()}

    def where(self, holds: Bools) -> Self:
        """The record of the rows for which something holds; arrays along points alone stay."""
        whole: Any = self
        found: dict[str, Any] = {}
        for name in (one.name for one in fields(whole)):
            value, column = getattr(self, name), self.stored.get(name)
            if column is not None and column.axes == "point":
                continue
            if isinstance(value, np.ndarray):
                found[name] = value[holds]
            elif isinstance(value, tuple):
                found[name] = tuple(compress(value, holds.tolist()))
        made: Self = replace(whole, **found)
        return made

    def spread(self, row: Any, point: Any) -> dict[str, Any]:  # noqa: ANN401 - integer arrays
        """The same for a table with a row for each entry of `row` and `point`, positions in the arrays."""
        found = {}
        for name, column in self.stored.items():
            values = getattr(self, name)
            if isinstance(values, tuple):
                found[column.name] = labels(values, row)
            else:
                at = {"row": row, "point": point, "row and point": (row, point)}[column.axes]
                found[column.name] = values[at]
        return found

    @classmethod
    def of(cls, table: ArrowTable, **others: Any) -> Self:  # noqa: ANN401 - values of fields
        """The record whose `arrays` a table has; `others` are the fields without column."""
        found = {name: _array(decoded(table[column.name], column), column) for name, column in cls.stored.items()}
        return cls._made(found | others)

    @classmethod
    def gathered(
        cls,
        table: ArrowTable,
        row: Any,  # noqa: ANN401 - integer array
        point: Any,  # noqa: ANN401 - integer array
        shape: tuple[int, int],
        absent: Mapping[str, object] | None = None,
        **others: Any,  # noqa: ANN401 - values of fields
    ) -> Self:
        """The record that was `spread`.

        Args:
            table: The table.
            row: Row of the record for each row of the table.
            point: The same for points.
            shape: Numbers of rows and points of the record.
            absent: What fields have in rows of the record that the table does not have.
            others: Fields without column.
        """
        found = {}
        for name, column in cls.stored.items():
            if name in others:
                continue
            values = decoded(table[column.name], column)
            if column.axes == "point":
                found[name] = np.unique(values)
            else:
                is_grid = column.axes == "row and point"
                nothing = (absent or {}).get(name, column.absent)
                array = np.full(shape if is_grid else shape[0], nothing, dtype=values.dtype)
                array[(row, point) if is_grid else row] = values
                found[name] = _array(array, column)
        return cls._made(found | others)

    @classmethod
    def empty(cls, **others: Any) -> Self:  # noqa: ANN401 - values of fields
        """The record of a table without rows."""
        found: dict[str, Any] = {}
        for name, column in cls.stored.items():
            shape = (0, 0) if column.axes == "row and point" else (0,)
            kind = "integer" if column.coded else column.kind
            found[name] = np.empty(shape, dtype=_TYPES[kind]) if kind in _TYPES else ()
        return cls._made(found | others)

    @classmethod
    def _made(cls, found: Mapping[str, Any]) -> Self:
        make: Any = cls
        made: Self = make(**found)
        return made


def _array(values: Any, column: Column) -> Any:  # noqa: ANN401 - arrays
    """What a record holds of a column: texts as a tuple, or positions of labels."""
    if column.coded and column.labels is not None:
        places = {name: place for place, name in enumerate(column.labels)}
        return np.array([places[name] for name in values.tolist()], dtype=np.int64)
    return tuple(values.tolist()) if column.kind in ("text", "label") else values
