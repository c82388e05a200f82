"""A search as a page: what it found, what its runs brought, and where they were."""

from __future__ import annotations

import base64
import html
import io
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from interdrive.failure_search.allocation import SOURCES
from interdrive.failure_search.failures import UNSHRUNK, trust_option
from interdrive.failure_search.rates import YIELD_HEAD, is_lost, said_rate
from interdrive.failure_search.summary import Summary
from interdrive.plots import save_figure
from interdrive.plots.style import AGENTS, FONT, INK, MM, PAGE, RECORDED, add_legend, empty_figure, plain
from interdrive.report import write_run_report
from interdrive.report.page import page_path, write_page
from interdrive.run.reasons import said_count

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.figure import Figure

_COLORS = {"uniform": RECORDED, "pairs": AGENTS[0], "levels": AGENTS[1], "directed": AGENTS[1]}
_STYLE = """body { font: 15px/1.45 system-ui, sans-serif; color: #222; max-width: 72rem; margin: 1.5rem auto; }
table { border-collapse: collapse; margin: 0.6rem 0 1.4rem; }
th, td { text-align: left; vertical-align: top; padding: 0.25rem 0.9rem 0.25rem 0; border-bottom: 1px solid #ddd; }
td.number { text-align: right; font-variant-numeric: tabular-nums; }
img { max-width: 100%; }
.film { width: 22rem; }
@media (prefers-color-scheme: dark) { body { background: #16181b; color: #ddd; } th, td { border-color: #444; }
  a { color: #7ab8f5; } img { background: #fff; } }"""
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data: 'self' file:"


def search_figure(found: Summary) -> Figure:
    """Kinds of failure over runs, directed runs beside uniform ones; and how near every agent came to a failure.

    Args:
        found: The search.

    Returns:
        A matplotlib figure without pyplot.
    """
    figure = empty_figure(PAGE, 62.0 * MM)
    growth = figure.add_axes((0.065, 0.17, 0.40, 0.68))
    driven = [row for row in found.rows if row["outcome"] is not None]
    parts = [("uniform", [row for row in driven if row["source"] == "uniform"])]
    directed = [row for row in driven if row["source"] != "uniform"]
    if directed:
        parts.append(("directed", directed))
    most = 1
    for name, rows in parts:
        seen: set[str] = set()
        counts = [0]
        for row in rows:
            seen |= {row["signature"]} if row["failure"] else set()
            counts.append(len(seen))
        growth.step(np.arange(len(counts)), counts, where="post", color=_COLORS[name], label=name, linewidth=1.2)
        most = max(most, counts[-1])
    growth.set_ylim(0.0, 1.1 * most)
    growth.set_xlabel("runs of this way", fontsize=FONT)
    growth.set_ylabel("different failures", fontsize=FONT)
    plain(growth, ticks=4)
    growth.legend(fontsize=FONT, frameon=False, loc="lower right")

    coverage = figure.add_axes((0.56, 0.17, 0.42, 0.68))
    least: dict[tuple[str, int], float] = {}
    for row in driven:
        pair = row["scenario"], row["agent_id"]
        least[pair] = min(least.get(pair, np.inf), row["criticality"])
    place = {pair: index for index, pair in enumerate(sorted(least, key=lambda pair: (least[pair], pair)))}
    for name in SOURCES:
        rows = [row for row in driven if row["source"] == name]
        x = [place[row["scenario"], row["agent_id"]] for row in rows]
        y = [row["criticality"] for row in rows]
        coverage.plot(x, y, ls="", marker="o", ms=1.6, mec="none", color=_COLORS[name], alpha=0.7, label=name)
    coverage.axhline(0.0, color=INK, linewidth=0.6)
    coverage.set_xlabel("agents, the nearest to a failure first", fontsize=FONT)
    coverage.set_ylabel("criticality (below 0: fails)", fontsize=FONT)
    plain(coverage, ticks=5)
    handles, _ = coverage.get_legend_handles_labels()
    add_legend(figure, handles, "upper center", ncols=len(SOURCES), markerscale=2.5)
    return figure


def write_search_report(
    folder: str | Path, path: str | Path | None = None, *, on_run: Callable[[int, int], None] | None = None
) -> Path:
    """Writes the page of a search, and one for every run of a failure and of its witness, into that folder.

    Pages of runs that are there already are left alone. The picture is written as `found.pdf`, too.

    Args:
        folder: Of the search.
        path: Where to; report.html in the folder by default.
        on_run: Called after every failure with the number of failures done and in all.

    Returns:
        The path of the page.

    Raises:
        ResultsError: The folder holds no search, is damaged, or a page cannot be written.
    """
    target = page_path(folder, path)
    found = Summary.of(folder)
    start = target.absolute().parent.resolve()
    links = []
    for done, failure in enumerate(found.failures, start=1):
        own = []
        for name in ("run", "witness"):
            if (failure.folder / name).is_dir():
                one = failure.folder / name / "report.html"
                own.append((name, one if one.is_file() else write_run_report(failure.folder / name)))
        links.append(own)
        if on_run is not None:
            on_run(done, len(found.failures))
    figure = search_figure(found)
    save_figure(figure, Path(folder) / "found.pdf")
    return write_page(_page(found, figure, links, start), target)


def _page(found: Summary, figure: Figure, links: Sequence[Sequence[tuple[str, Path]]], start: Path) -> str:
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=200, metadata={"Software": None})
    picture = base64.b64encode(drawn.getvalue()).decode("ascii")
    title = f"Failures of {found.planner}"
    share, within = said_rate(found.yields[0].rate)
    rate = f"{share} % ({within})" if share else "an unknown share"
    failing = f" Without any disturbance fail {', '.join(found.undisturbed)}." if found.undisturbed else ""
    n_lost = sum(is_lost(row) for row in found.rows)
    lost = f" {said_count(n_lost, 'run')} lost, which may fail or not: the interval allows for both." if n_lost else ""
    about = (
        f"{len(found.rows)} runs; {said_count(len(found.failures), 'failure')} kept, "
        f"{sum(bool(one.witness) for one in found.failures)} of them avoidable. Of the uniform runs {rate} fail, with "
        f"the 95 % interval of Clopper and Pearson.{lost}{html.escape(failing)}"
    )
    body = [
        f"<h1>{html.escape(title)}</h1>",
        f"<p>{about}</p>",
        f'<img alt="Different failures over runs, and criticality by agent" src="data:image/png;base64,{picture}">',
        _yields(found),
        "<h2>Failures</h2>" if found.failures else "<p>No failure was found.</p>",
        *(_failure(found, place, links[place], start) for place in range(len(found.failures))),
    ]
    head = [
        "<!doctype html>",
        '<html lang="en">',
        "<head>",
        '<meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{html.escape(title)} - interdrive search</title>",
        f"<style>{_STYLE}</style>",
        "</head>",
        "<body>",
    ]
    return "\n".join([*head, *body, "</body>", "</html>", ""])


def _yields(found: Summary) -> str:
    rows = []
    for part in found.yields:
        name, *numbers = part.cells()
        cells = "".join(f'<td class="number">{cell}</td>' for cell in numbers)
        rows.append(f"<tr><td>{name}</td>{cells}</tr>")
    head = "".join(f"<th>{name}</th>" for name in YIELD_HEAD)
    return f"<table><tr>{head}</tr>{''.join(rows)}</table>"


def _failure(found: Summary, place: int, links: Sequence[tuple[str, Path]], start: Path) -> str:
    one = found.failures[place]

    def path(of: Path) -> str:
        return html.escape(Path(os.path.relpath(of.resolve(), start)).as_posix())

    avoided = f"<code>{html.escape(one.witness)}</code> avoids it" if one.witness else "no tried driver avoids it"
    pages = ", ".join(f'<a href="{path(page)}">{name}</a>' for name, page in links)
    film = one.folder / "failure.gif"
    shown = f'<img class="film" loading="lazy" alt="Film of the failure" src="{path(film)}">' if film.exists() else ""
    unshrunk = "" if one.is_small else UNSHRUNK
    command = f"interdrive search replay {path(one.folder)}{trust_option(one)}"
    return (
        f"<h3>{html.escape(f'{one.folder.name}: {one.scenario}, agent {one.drive.agent_id}, {one.failure}')}</h3>"
        f"<p>{html.escape(one.words)}; {avoided}.<br>"
        f"Different from the recording: {html.escape(one.disturbance)}{unshrunk}.<br>"
        f"Pages: {pages}. <code>{command}</code></p>{shown}"
    )
