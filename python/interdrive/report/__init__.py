"""The interactive report: a run, or a batch, as one HTML file that opens offline."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive.batches.store import BatchFolder
from interdrive.errors import InterdriveError, ResultsError
from interdrive.report.batch import batch_contents
from interdrive.report.contents import run_contents
from interdrive.report.page import page, pages_side_by_side
from interdrive.results.folder import inputs_of
from interdrive.results.information import read_information
from interdrive.storage import keep_inputs, replacing, resolved

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["is_batch", "write_batch_report", "write_pair_report", "write_run_report"]


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
    target = _target(folder, path)
    keep_inputs(target, _read(folder))
    contents = run_contents(folder)
    text = page(f"{contents.header['name']} - interdrive", contents)
    with replacing(target) as partial:
        partial.write_text(text, encoding="utf-8", errors="replace")  # names of files need not be text
    return target


def write_pair_report(first: str | Path, second: str | Path, path: str | Path | None = None) -> Path:
    """Writes a page with two runs of the same scenario side by side: one clock, one selection, one place on the map.

    Args:
        first: A run folder.
        second: Another one.
        path: Where to; beside the first folder by default, named after both.

    Returns:
        The path of the page.

    Raises:
        ResultsError: The runs are of different scenarios; and as `write_run_report`.
        InputError: The scenario of a run cannot be read.
    """
    one, other = (Path(folder).resolve() for folder in (first, second))
    target = _target(one, one.with_name(f"{one.name}_{other.name}.html") if path is None else path)
    keep_inputs(target, [*_read(one), *_read(other)])
    scenarios = [read_information(folder)["scenario"] for folder in (one, other)]
    names = [str(scenario["name"]) for scenario in scenarios]
    if len({(scenario["name"], scenario["sha256"]) for scenario in scenarios}) > 1:
        raise ResultsError(f"{first} and {second}: runs of different scenarios, {names[0]} and {names[1]}")
    pages = [(str(folder), page(names[0], run_contents(folder))) for folder in (first, second)]
    with replacing(target) as partial:
        partial.write_text(
            pages_side_by_side(f"{names[0]} - interdrive", pages), encoding="utf-8", errors="replace"
        )  # names of files need not be text
    return target


def _target(folder: str | Path, path: str | Path | None) -> Path:
    """Where a page goes; anything that is no page must not be replaced by one."""
    target = Path(folder) / "report.html" if path is None else Path(path)
    if target.suffix.lower() not in (".html", ".htm"):
        raise ResultsError(f"{target}: a page needs a name that ends in .html or .htm")
    if target.is_dir():
        raise ResultsError(f"{target}: a folder with this name already exists")
    return target


def _read(folder: str | Path) -> list[Path]:
    """The files that the page of a run is made of."""
    resolved(folder)  # circular links are refused by its own name
    source = read_information(Path(folder))["scenario"]["path"]
    return [*inputs_of(folder), *(() if source is None else (Path(source),))]


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
    target = _target(folder, path)
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
    text = page(f"{contents.header['name']} - interdrive batch", contents)
    with replacing(target) as partial:
        partial.write_text(text, encoding="utf-8", errors="replace")  # names of files need not be text
    return target
