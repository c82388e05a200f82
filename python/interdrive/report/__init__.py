"""The interactive report: a run as one HTML file that opens offline, with map, player, profiles and tables."""

from __future__ import annotations

from pathlib import Path

from interdrive.errors import ResultsError
from interdrive.report.contents import run_contents
from interdrive.report.page import page
from interdrive.results import replacing

__all__ = ["write_run_report"]


def write_run_report(folder: str | Path, path: str | Path | None = None) -> Path:
    """Writes the page of a run, whole or not at all.

    Args:
        folder: A run folder.
        path: Where to; report.html in the folder by default.

    Returns:
        The path of the page.

    Raises:
        ResultsError: if the folder is no run folder, is damaged or of another format, or the page cannot be written.
        InputError: if the scenario of the run cannot be read.
    """
    target = Path(folder) / "report.html" if path is None else Path(path)
    if target.is_dir():
        raise ResultsError(f"{target}: a folder of that name is in the way")
    contents = run_contents(folder)
    text = page(f"{contents.header['name']} - interdrive", contents)
    with replacing(target) as partial:
        partial.write_text(text, encoding="utf-8")
    return target
