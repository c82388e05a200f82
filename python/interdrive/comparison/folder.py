"""The folder of a comparison: tables, caveats, figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from interdrive.comparison.tables import markdown
from interdrive.storage import FolderKind, resolved, whole_folder, write_table

if TYPE_CHECKING:
    from pathlib import Path

    from interdrive.comparison.result import Comparison

#: Files of a comparison on disk; the first one marks its folder.
_MARK = "caveats.txt"
_FILES = (
    *(_MARK, "comparison.md", "comparison.pdf", "comparison.png", "paper.md", "paper.tex"),
    *(f"{name}.{ending}" for name in ("table", "differences") for ending in ("parquet", "csv")),
)
_FOLDER = FolderKind("comparison", _MARK, lambda entry: entry.name in _FILES)


def save_comparison(found: Comparison, folder: str | Path, *, overwrite: bool = False) -> Path:
    """Writes table and differences (Parquet, CSV, together as Markdown), caveats, figure (PDF, PNG), paper (LaTeX).

    Args:
        found: What to write.
        folder: A new or empty folder, or the folder of another comparison.
        overwrite: Replace the other comparison. A folder with anything else in it is never touched.

    Returns:
        The folder.

    Raises:
        ResultsError: If the folder cannot be used or written.
    """
    from interdrive.comparison.figure import draw_comparison  # noqa: PLC0415 - loads matplotlib
    from interdrive.plots import save_figure  # noqa: PLC0415

    with whole_folder(folder, _FOLDER, overwrite=overwrite) as partial:
        for name, table in (("table", found.table), ("differences", found.differences)):
            for ending in ("parquet", "csv"):
                write_table(table, partial / f"{name}.{ending}", found.origin)
        (partial / _MARK).write_text("".join(f"{line}\n" for line in found.caveats), encoding="utf-8")
        told = "".join(f"\n{line}\n" for line in found.origin.lines)
        (partial / "comparison.md").write_text(markdown(found) + told, encoding="utf-8")
        for ending, texts in (
            ("md", [one.markdown() for one in found.paper]),
            ("tex", [one.latex() for one in found.paper]),
        ):
            (partial / f"paper.{ending}").write_text("\n".join(texts), encoding="utf-8")
        figure = draw_comparison(found)
        for ending in ("pdf", "png"):
            save_figure(figure, partial / f"comparison.{ending}")
    return resolved(folder)
