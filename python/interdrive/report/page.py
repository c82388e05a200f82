"""One HTML file that needs nothing else: the front end, the header and the arrays."""

from __future__ import annotations

import html
from importlib.resources import files
from typing import TYPE_CHECKING

from interdrive.storage import json_text

if TYPE_CHECKING:
    from interdrive.report.contents import Contents

# The page may load nothing, not even from its own folder; a browser keeps it to that.
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"


def page(title: str, contents: Contents) -> str:
    """The whole page as text."""
    bundle = files("interdrive.report") / "bundle"
    script, style = ((bundle / name).read_text(encoding="utf-8") for name in ("report.js", "report.css"))
    # Inside a script element only "<" can end it.
    header = json_text(contents.header).replace("<", "\\u003c")
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
