"""Output of `interdrive realism`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape

from interdrive.cli.report import output, print_folder, print_notes, print_table, table_of
from interdrive.traffic_realism.tables import sheets

if TYPE_CHECKING:
    from pathlib import Path

    from interdrive.traffic_realism import Realism


def print_realism(found: Realism, folder: Path) -> None:
    """Prints all tables, what was measured, notes and the path of the results."""
    console = output()
    for sheet in sheets(found):
        table = table_of(sheet.head, right=sheet.head[2:], tight=True, title=sheet.title)
        before = ""
        for place, *cells in sheet.rows:
            table.add_row("" if place == before else escape(place), *(escape(cell) for cell in cells))
            before = place
        print_table(console, table, names=2)
        if sheet.note:
            console.print(escape(sheet.note))
        console.print()
    console.print(escape(found.about))
    print_notes(console, found.notes, "realism.json")
    print_folder(console, folder)
