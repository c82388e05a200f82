"""Columns of tables, each declared once: schemas, files, checks and reference pages are made from the declarations.

The fields of a `Record` declare the columns of its table; tables without a record are tuples of `Column`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

Kind: TypeAlias = Literal["integer", "number", "truth", "text", "label"]

#: Key of a declaration in the metadata of a field.
DECLARED = "column"


@dataclass(frozen=True)
class Column:
    """One column of a table.

    Attributes:
        name: Its name.
        kind: Type of its values; a label is a text from a short list, and stored as such (dictionary encoded).
        text: What it means.
        unit: Its unit; "1" for a number without unit, which is what integers are unless they state one.
        null: Why a value can be absent; "" if every row has one. Absent values are null in tables.
        infinite: Infinities are values.
        labels: All that a label can be; None for any text.
        coded: The array of the record has positions in `labels`.
        axes: The array of the record has a value per row of the record, per point (or time step), or per row and point;
            in the last two cases the table has a row for each point of each row.
    """

    name: str
    kind: Kind
    text: str
    unit: str = ""
    null: str = ""
    infinite: bool = False
    labels: Sequence[str] | None = None
    coded: bool = False
    axes: Literal["row", "point", "row and point"] = "row"

    def __post_init__(self) -> None:
        if self.kind == "integer" and not self.unit:
            object.__setattr__(self, "unit", "1")
        if (self.kind in ("integer", "number")) != bool(self.unit):
            raise TypeError(f"column {self.name}: a number states its unit (1: it has none), and nothing else does")

    @property
    def nullable(self) -> bool:
        """Whether values can be absent."""
        return bool(self.null)

    @property
    def description(self) -> str:
        """What it means, with its unit."""
        is_said = self.unit in ("", "1") or self.unit.startswith("of the ")
        return self.text if is_said else f"{self.text} [{self.unit}]"

    @property
    def absent(self) -> Any:  # noqa: ANN401 - a value of the column
        """What arrays have where the table has null."""
        return {"integer": -1, "number": float("nan"), "truth": False}.get(self.kind, "")

    @property
    def empty_is_null(self) -> bool:
        """Whether an empty label is no label."""
        return self.labels is not None and "" not in self.labels

    @property
    def sentence(self) -> str:
        """What the array of a record holds."""
        said = f"position in the list of labels, {self.description}" if self.coded else self.description
        if self.null:
            said += f"; {self.absent if self.kind in ('integer', 'number') else 'empty'}: {self.null}"
        shape = {"row": "", "point": ", shape (points,)", "row and point": ", shape (rows, points)"}[self.axes]
        return f"{said[:1].upper()}{said[1:]}{shape}."


def number(text: str, unit: str, **more: Any) -> Mapping[str, Column]:  # noqa: ANN401 - attributes of a column
    """Declares a field of floats. `more` are attributes of `Column`; without a `name` it is that of the field."""
    return _declared("number", text, unit=unit, **more)


def integer(text: str, **more: Any) -> Mapping[str, Column]:  # noqa: ANN401 - attributes of a column
    """Declares a field of integers, as `number` does."""
    return _declared("integer", text, **more)


def truth(text: str, **more: Any) -> Mapping[str, Column]:  # noqa: ANN401 - attributes of a column
    """Declares a field of truths, as `number` does."""
    return _declared("truth", text, **more)


def text(text: str, **more: Any) -> Mapping[str, Column]:  # noqa: ANN401 - attributes of a column
    """Declares a field of texts, as `number` does."""
    return _declared("text", text, **more)


def label(text: str, labels: Sequence[str] | None = None, **more: Any) -> Mapping[str, Column]:  # noqa: ANN401 - as above
    """Declares a field of labels, as `number` does."""
    return _declared("label", text, labels=labels, **more)


def _declared(kind: Kind, text: str, *, name: str = "", **more: Any) -> Mapping[str, Column]:  # noqa: ANN401 - as above
    return {DECLARED: Column(name, kind, text, **more)}


def without(columns: Iterable[Column], names: Iterable[str]) -> tuple[Column, ...]:
    """The columns with other names."""
    left_out = set(names)
    return tuple(column for column in columns if column.name not in left_out)


def named(columns: Iterable[Column], names: Iterable[str]) -> tuple[Column, ...]:
    """The columns with these names, in the order of the names."""
    by_name = {column.name: column for column in columns}
    return tuple(by_name[name] for name in names)


def inserted(columns: Sequence[Column], new: Sequence[Column], before: str) -> tuple[Column, ...]:
    """The columns with new ones before the one of this name."""
    place = [column.name for column in columns].index(before)
    return (*columns[:place], *new, *columns[place:])


def absent_where(null: str, columns: Iterable[Column]) -> tuple[Column, ...]:
    """The same columns in a table that has rows without values, for one more reason."""
    return tuple(replace(column, null=f"{column.null}; {null}" if column.null else null) for column in columns)
