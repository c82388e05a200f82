"""`interdrive check`: what scenario files hold."""

from __future__ import annotations

import click

from interdrive.errors import InterdriveError


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILE...")
def check(files: tuple[str, ...]) -> int:
    """Print what scenario files hold: size, traffic, and who can become an agent or why not.

    A FILE that cannot be used gets one line on stderr; the others are printed all the same.
    """
    from interdrive.check import inspect  # noqa: PLC0415
    from interdrive.cli.report import print_inspection  # noqa: PLC0415
    from interdrive.files import read_scenario, shipped_scenario, shipped_scenarios  # noqa: PLC0415

    refused = False
    for name in files:
        try:
            path = shipped_scenario(name) if name in shipped_scenarios() else name
            print_inspection(inspect(read_scenario(path)))
        except InterdriveError as error:
            click.echo(f"error: {' '.join(str(error).split())}", err=True)
            refused = True
    return 2 if refused else 0
