"""The folder of an evaluation: tables, figure, page, and how it came about."""

from __future__ import annotations

import base64
from hashlib import sha256
from html import escape
from typing import TYPE_CHECKING

from interdrive.files import content_of_input
from interdrive.results import software
from interdrive.storage import FolderKind, Origin, resolved, whole_folder, write_json, write_table
from interdrive.storage.html import html_table
from interdrive.storage.names import readable
from interdrive.traffic_realism.tables import markdown, sheets

if TYPE_CHECKING:
    from pathlib import Path

    from interdrive.traffic_realism.result import Realism

_MARK = "realism.json"
_TABLES = ("table", "scores", "distances", "classifier")
_FILES = (
    *(_MARK, "realism.html", "table.md", "table.csv", "distributions.pdf", "distributions.png"),
    *(f"{name}.parquet" for name in _TABLES),
)

REALISM_FOLDER = FolderKind("evaluation of realism", _MARK, lambda entry: entry.name in _FILES)

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Realism</title><style>
body {{ font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 75em; padding: 0 1em; color: #222 }}
table {{ border-collapse: collapse; margin: 1em 0 }}
th, td {{ padding: 0.15em 0.7em; text-align: right; border-bottom: 1px solid #e3e3e3 }}
th:first-child, td:first-child, th:nth-child(2), td:nth-child(2) {{ text-align: left }}
img {{ max-width: 100% }}
</style></head><body>
<h1>How far planners drive from recorded people</h1>
<p>{about}</p>
{tables}
<h2>Distributions</h2>
<img alt="Distributions of recorded and simulated vehicles" src="data:image/png;base64,{picture}">
<h2>Notes</h2>
<ul>{notes}</ul>
</body></html>
"""


def save_realism(found: Realism, folder: str | Path, *, overwrite: bool = False) -> Path:
    """Writes the folder, whole or not at all.

    It holds realism.json, table (Parquet, CSV, Markdown), scores.parquet, distances.parquet, classifier.parquet,
    distributions (PDF, PNG) and realism.html.

    Args:
        found: What to write.
        folder: A new or empty folder, or the folder of another evaluation of realism.
        overwrite: Replace the other evaluation. A folder with anything else in it is never touched.

    Returns:
        The folder.

    Raises:
        ResultsError: If the folder cannot be used or written.
    """
    from interdrive.plots import save_figure  # noqa: PLC0415 - loads matplotlib
    from interdrive.traffic_realism.figure import draw_distributions  # noqa: PLC0415

    with whole_folder(folder, REALISM_FOLDER, overwrite=overwrite) as partial:
        origin = _origin(found)
        for name in _TABLES:
            write_table(getattr(found, name), partial / f"{name}.parquet", origin)
        write_table(found.table, partial / "table.csv", origin)
        (partial / "table.md").write_text(markdown(found), encoding="utf-8")
        figure = draw_distributions(found)
        for ending in ("pdf", "png"):
            save_figure(figure, partial / f"distributions.{ending}")
        picture = (partial / "distributions.png").read_bytes()
        (partial / "realism.html").write_text(_page(found, picture), encoding="utf-8")
        write_json({**found.json(), **software()}, partial / _MARK)
    return resolved(folder)


def _page(found: Realism, picture: bytes) -> str:
    tables = ""
    for sheet in sheets(found):
        rows = [dict(zip(sheet.head, row, strict=True)) for row in sheet.rows]
        tables += f"<h2>{escape(sheet.title)}</h2>{html_table(sheet.head, rows)}<p>{escape(sheet.note)}</p>"
    return _PAGE.format(
        about=escape(found.about),
        tables=tables,
        picture=base64.b64encode(picture).decode("ascii"),
        notes="".join(f"<li>{escape(note)}</li>" for note in found.notes),
    )


def _origin(found: Realism) -> Origin:
    """What was asked for, and the content of all files."""
    inputs = {readable(file.name): sha256(content_of_input(file)).hexdigest() for file in found.files}
    return Origin(dict(found.settings), inputs)
