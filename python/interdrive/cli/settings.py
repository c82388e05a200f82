"""`interdrive settings`: all settings for `--set` and configuration files."""

from __future__ import annotations

import click


@click.command()
@click.argument("prefix", default="")
def settings(prefix: str) -> None:
    """List all settings with defaults and meaning, or those whose name starts with PREFIX."""
    from interdrive.cli.report import print_settings  # noqa: PLC0415 - rich
    from interdrive.config.binding import described  # noqa: PLC0415
    from interdrive.config.schema import SimulationSettings  # noqa: PLC0415
    from interdrive.errors import InputError  # noqa: PLC0415

    rows = [row for row in described(SimulationSettings()) if row[0].startswith(prefix)]
    if not rows:
        raise InputError(f"{prefix}: no setting starts with this name")
    print_settings(rows)
