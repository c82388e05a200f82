"""The interactive report of a batch: planners compared, distributions, and every run with its own page."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive.batch_report.contents import batch_contents
from interdrive.batches.store import BatchFolder
from interdrive.errors import InterdriveError
from interdrive.report import write_run_report
from interdrive.report.page import page, page_path, write_page

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["is_batch", "write_batch_report"]


def is_batch(folder: str | Path) -> bool:
    """The folder is one of a batch, of whatever version."""
    return (Path(folder) / "batch.json").is_file()


def write_batch_report(
    folder: str | Path, path: str | Path | None = None, *, on_run: Callable[[int, int], None] | None = None
) -> Path:
    """Writes the page of a batch, and one for every run whose folder was kept, into that folder.

    Pages of runs that are there already are left alone; run folders of a batch do not change. Of a run whose folder is
    damaged the page of the batch says why it has no page.

    Args:
        folder: Of the batch.
        path: Where to; report.html in the folder by default.
        on_run: Called after every page of a run with the number of pages done and in all.

    Returns:
        The path of the batch's page.

    Raises:
        ResultsError: if the folder is no batch, is damaged, of another format or empty, or a page cannot be written.
    """
    target = page_path(folder, path)
    batch = BatchFolder.open(folder)
    kept = batch.table().select(["key", "kept"]).to_pylist()  # all of it: damage is found before anything is written
    keys = sorted({row["key"] for row in kept if row["kept"] and (batch.recording(row["key"]) / "run.json").is_file()})
    start, pages, damaged = target.absolute().parent.resolve(), {}, {}
    for done, key in enumerate(keys, start=1):
        own = batch.recording(key) / "report.html"
        try:
            if not own.is_file():
                write_run_report(batch.recording(key))
            pages[key] = Path(os.path.relpath(own, start)).as_posix()
        except InterdriveError as cause:
            damaged[key] = str(cause)
        if on_run is not None:
            on_run(done, len(keys))
    contents = batch_contents(folder, pages, damaged)
    return write_page(page(f"{contents.header['name']} - interdrive batch", contents), target)
