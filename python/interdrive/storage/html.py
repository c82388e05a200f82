"""Tables as HTML, for notebooks."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence


def html_table(columns: Sequence[str], rows: Iterable[Mapping[str, float | str | None]]) -> str:
    """A table with these columns; floats have four significant digits, None is empty, text is escaped."""
    from html import escape  # noqa: PLC0415 - a long table of entities

    def cell(value: float | str | None) -> str:
        text = "" if value is None else f"{value:.4g}" if isinstance(value, float) else escape(str(value))
        return f"<td>{text}</td>"

    head = "".join(f"<th>{escape(name)}</th>" for name in columns)
    body = "".join(f"<tr>{''.join(cell(row.get(name)) for name in columns)}</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def html_head(columns: Sequence[str], rows: Sequence[Mapping[str, float | str | None]], n_rows: int) -> str:
    """The first rows of a table with `n_rows`; columns that are empty in all of these rows are left out."""
    filled = [name for name in columns if any(row.get(name) not in (None, "") for row in rows)]
    more = f"<p>{n_rows - len(rows)} more rows</p>" if n_rows > len(rows) else ""
    return html_table(filled or columns, rows) + more
