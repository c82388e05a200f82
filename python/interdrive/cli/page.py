"""`interdrive report`: a run or a batch as a page for the browser."""

from __future__ import annotations

import click

from interdrive.cli.arguments import shown


@click.command()
@click.argument("folder", metavar="RUN|BATCH|SEARCH")
@click.argument("other", metavar="[RUN]", required=False)
@click.option("--out", metavar="FILE", help="Path of the page (report.html in the folder).")
@click.option("--quiet", is_flag=True, help="Print only errors.")
def report(folder: str, other: str | None, out: str | None, quiet: bool) -> None:
    """Write one HTML file that shows a run: map, player, profiles, tables. You can open it offline.

    RUN is a run folder. The page states which parts were not recorded; `interdrive run --report` records everything and
    writes the page at once. BATCH is a batch folder: its page shows the comparison of planners, distributions and all
    runs; kept runs get pages of their own, one click away. SEARCH is the folder of a search for failures: its page
    lists them with films, and shows what its runs brought. Two RUNs of one scenario, for instance of two planners, are
    shown side by side with one clock; the page and the command say which settings differ.
    """
    from interdrive.batch_report import is_batch, write_batch_report  # noqa: PLC0415 - matplotlib
    from interdrive.cli.report import print_page, progress  # noqa: PLC0415 - rich
    from interdrive.failure_search import is_search  # noqa: PLC0415 - numpy
    from interdrive.failure_search.page import write_search_report  # noqa: PLC0415 - matplotlib
    from interdrive.report import write_pair_report, write_run_report  # noqa: PLC0415

    with progress(quiet=quiet) as bar:
        bar.say(f"reading {folder}")
        if other is not None:
            path = write_pair_report(folder, other, out)
        elif is_search(folder):
            path = write_search_report(folder, out, on_run=bar.frames("pages of failures"))
        elif is_batch(folder):
            path = write_batch_report(folder, out, on_run=bar.frames("pages of runs"))
        else:
            path = write_run_report(folder, out)
    if not quiet and other is not None:
        from interdrive.cli.report import print_differences  # noqa: PLC0415 - rich

        print_differences(folder, other)
    if not quiet:
        print_page(shown(path.resolve()), path.stat().st_size)
