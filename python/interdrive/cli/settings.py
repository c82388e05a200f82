"""`interdrive settings`: all settings for `--set` and configuration files."""

from __future__ import annotations

import click


@click.command()
@click.argument("word", default="")
def settings(word: str) -> None:
    """List all settings with defaults and meaning, or only those with WORD in their name or meaning."""
    from interdrive.cli.report import print_settings  # noqa: PLC0415 - rich
    from interdrive.config.binding import described  # noqa: PLC0415
    from interdrive.config.schema import SimulationSettings  # noqa: PLC0415
    from interdrive.errors import InputError  # noqa: PLC0415

    found = described(SimulationSettings())
    rows = [row for row in found if word.lower() in f"{row[0]} {row[3]}".lower()]
    if not rows:
        raise InputError(f"{word}: no setting has this word in its name or text")
    print_settings(rows)
