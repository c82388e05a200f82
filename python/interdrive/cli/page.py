"""`interdrive report`: a run as one page to look at in a browser."""

from __future__ import annotations

import click

from interdrive.cli.arguments import shown


@click.command()
@click.argument("folder", metavar="RUN")
@click.option("--out", metavar="FILE", help="Where the page goes (report.html in the folder).")
@click.option("--quiet", is_flag=True, help="Print nothing but errors.")
def report(folder: str, out: str | None, quiet: bool) -> None:
    """Write one HTML file that shows a run: map, player, profiles, tables. It opens offline by double click.

    RUN is a run folder. What was not recorded is not shown, and the page says so; `interdrive run --report` records
    everything and writes the page at once.
    """
    from interdrive.cli.report import print_page, progress  # noqa: PLC0415 - rich
    from interdrive.report import write_run_report  # noqa: PLC0415 - matplotlib

    with progress(quiet=quiet) as bar:
        bar.say(f"reading {folder}")
        path = write_run_report(folder, out)
    if not quiet:
        print_page(shown(path.resolve()), path.stat().st_size)
