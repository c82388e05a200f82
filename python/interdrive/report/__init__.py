"""The interactive report: a run, or two side by side, as one HTML file that opens offline."""

from __future__ import annotations

from pathlib import Path

from interdrive.errors import ResultsError
from interdrive.report.contents import run_contents
from interdrive.report.differences import differing_settings
from interdrive.report.page import page, page_path, pages_side_by_side, write_page
from interdrive.results.folder import inputs_of
from interdrive.results.information import read_information
from interdrive.storage import keep_inputs, resolved

__all__ = ["write_pair_report", "write_run_report"]


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
    target = page_path(folder, path)
    keep_inputs(target, _read(folder))
    contents = run_contents(folder)
    return write_page(page(f"{contents.header['name']} - interdrive", contents), target)


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
    target = page_path(one, one.with_name(f"{one.name}_{other.name}.html") if path is None else path)
    keep_inputs(target, [*_read(one), *_read(other)])
    told = [read_information(folder) for folder in (one, other)]
    scenarios = [info["scenario"] for info in told]
    names = [str(scenario["name"]) for scenario in scenarios]
    if len({(scenario["name"], scenario["sha256"]) for scenario in scenarios}) > 1:
        raise ResultsError(f"{first} and {second}: runs of different scenarios, {names[0]} and {names[1]}")
    pages = [(str(folder), page(names[0], run_contents(folder))) for folder in (first, second)]
    return write_page(pages_side_by_side(f"{names[0]} - interdrive", pages, differing_settings(*told)), target)


def _read(folder: str | Path) -> list[Path]:
    """The files that the page of a run is made of."""
    resolved(folder)  # circular links are refused by its own name
    source = read_information(Path(folder))["scenario"]["path"]
    return [*inputs_of(folder), *(() if source is None else (Path(source),))]
