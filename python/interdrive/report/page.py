"""One HTML file that needs nothing else: the front end, the header and the arrays."""

from __future__ import annotations

import html
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive.errors import ResultsError
from interdrive.storage import json_text, replacing

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.report.contents import Contents

# The page may load nothing, not even from its own folder; a browser keeps it to that.
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"


#: Whatever one page says, the other one hears.
_RELAY = """addEventListener("message", (event) => {
  for (let i = 0; i < frames.length; i++) if (frames[i] !== event.source) frames[i].postMessage(event.data, "*");
});"""

_SIDE_BY_SIDE = """html, body { height: 100%; margin: 0; }
body { display: flex; flex-direction: column; font: 14px system-ui, sans-serif; }
section { flex: 1; display: flex; flex-direction: column; min-width: 0; }
h1 { font-size: 1rem; margin: 0.4rem 0.8rem; }
.differ { margin: 0; padding: 0.3rem 0.8rem; border-bottom: 1px solid #bbb; }
.differ div { max-height: 20vh; overflow: auto; }
.differ table { border-collapse: collapse; }
.differ th, .differ td { text-align: left; padding: 0 1rem 0.1rem 0; font-weight: normal; overflow-wrap: anywhere; }
.runs { flex: 1; display: flex; min-height: 0; }
iframe { flex: 1; border: 0; border-right: 1px solid #bbb; width: 100%; }
@media (max-width: 900px) { .runs { flex-direction: column; } }"""


def pages_side_by_side(
    title: str, pages: Sequence[tuple[str, str]], differ: Sequence[tuple[str, str, str]] = ()
) -> str:
    """One page with two in it, each with its name; they share their clock (frontend/src/link.ts).

    Args:
        title: Of the page.
        pages: Name and text of each.
        differ: What differs between them: a name, and the value in each.
    """
    shown = (
        f'<section><h1>{html.escape(name)}</h1><iframe title="{html.escape(name)}" srcdoc="{html.escape(text)}">'
        "</iframe></section>"
        for name, text in pages
    )
    return "\n".join(
        (
            _head(title, _SIDE_BY_SIDE),
            "<body>",
            f"<script>{_RELAY}</script>",
            _differences(differ),
            '<div class="runs">',
            *shown,
            "</div>",
            "</body>",
            "</html>",
            "",
        )
    )


def _differences(differ: Sequence[tuple[str, str, str]]) -> str:
    if not differ:
        return '<p class="differ">Both runs have the same settings.</p>'
    rows = "".join(f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>" for row in differ)
    head = "<tr><th></th><th>left</th><th>right</th></tr>"
    n = len(differ)
    said = "1 setting differs" if n == 1 else f"{n} settings differ"
    return f'<details class="differ"><summary>{said}</summary><div><table>{head}{rows}</table></div></details>'


def page(title: str, contents: Contents) -> str:
    """The whole page as text."""
    bundle = files("interdrive.report") / "bundle"
    script, style = ((bundle / name).read_text(encoding="utf-8") for name in ("report.js", "report.css"))
    # Inside a script element only "<" can end it.
    header = json_text(contents.header).replace("<", "\\u003c")
    return "\n".join(
        (
            _head(title, style),
            "<body>",
            '<div id="report"><noscript>This page needs JavaScript.</noscript></div>',
            f'<script type="application/json" id="header">{header}</script>',
            f'<script type="text/plain" id="arrays">{contents.arrays}</script>',
            f"<script>{script}</script>",
            "</body>",
            "</html>",
            "",
        )
    )


def page_path(folder: str | Path, path: str | Path | None) -> Path:
    """Where the page of a folder goes; anything that is no page must not be replaced by one."""
    target = Path(folder) / "report.html" if path is None else Path(path)
    if target.suffix.lower() not in (".html", ".htm"):
        raise ResultsError(f"{target}: a page needs a name that ends in .html or .htm")
    if target.is_dir():
        raise ResultsError(f"{target}: a folder with this name already exists")
    return target


def write_page(text: str, path: Path) -> Path:
    """Writes a page, whole or not at all, and returns its path."""
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8", errors="replace")  # names of files need not be text
    return path


def _head(title: str, style: str) -> str:
    return "\n".join(
        (
            "<!doctype html>",
            '<html lang="en">',
            "<head>",
            '<meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="generator" content="interdrive">',
            f"<title>{html.escape(title)}</title>",
            '<link rel="icon" href="data:,">',
            f"<style>{style}</style>",
            "</head>",
        )
    )
