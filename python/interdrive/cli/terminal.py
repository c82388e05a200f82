r"""Lines for the terminal: the only place where text is made harmless before it is printed.

Names of files, planners and agents, messages of planners and cells of tables may come from unknown authors. Characters
that a terminal interprets, and those that change the direction of writing, are shown as escapes such as \x1b.
"""

from __future__ import annotations

import csv
import io
import sys
from contextlib import nullcontext, suppress
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

#: Line breaks and tabs stay as they are; every other control character is shown.
_LEFT = "\n\t"

#: Marks that change the direction of writing, separators that some terminals take for line breaks, and invisible
#: characters.
_DECEIVING = (
    *(0x00AD, 0x061C, 0x180E, 0xFEFF),
    *(*range(0x200B, 0x2010), *range(0x2028, 0x202F), *range(0x2060, 0x2070), *range(0xFFF9, 0xFFFC)),
    *range(0xE0000, 0xE0080),
)

_SHOWN = {code: f"\\x{code:02x}" for code in (*range(0x20), *range(0x7F, 0xA0)) if chr(code) not in _LEFT}
_SHOWN |= {
    code: f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}" for code in (*_DECEIVING, *range(0xD800, 0xE000))
}
# A byte of a file name that is not UTF-8.
_SHOWN |= {0xDC00 + byte: f"\\x{byte:02x}" for byte in range(0x80, 0x100)}


def visible(text: str) -> str:
    """The text with every character that a terminal would interpret as a visible escape."""
    return text if text.isprintable() else text.translate(_SHOWN)


def say(text: str, *, err: bool = False) -> None:
    """Prints a line on stdout, or on stderr if that can be written."""
    with suppress(OSError) if err else nullcontext():
        click.echo(visible(text), err=err)


def print_csv(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Prints a table as CSV on stdout; its reader may pass it on to a terminal."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    sys.stdout.write(visible(text.getvalue()))
