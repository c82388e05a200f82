"""`interdrive planners` and `interdrive predictors`: available plug-ins and their settings."""

from __future__ import annotations

from dataclasses import is_dataclass
from typing import Any

import click


@click.command()
@click.argument("name", required=False)
def planners(name: str | None) -> None:
    """List all planners, one per line; with NAME, list the settings of that planner.

    NAME is a built-in planner, a planner of an installed distribution, or module:object. You can append its settings to
    the name, for all agents (--planner idm,time_gap=2.0) or for one (--agent 5=idm,time_gap=2.0).
    """
    from interdrive.planners import NATIVE, RECORDS  # noqa: PLC0415

    _show(name, "planner", NATIVE, RECORDS)


@click.command()
@click.argument("name", required=False)
def predictors(name: str | None) -> None:
    """List all predictors, one per line; with NAME, list the settings of that predictor.

    NAME is a built-in predictor, a predictor of an installed distribution, or module:object. You can append its
    settings to the name: --predictor lane_following,modes_max=1.
    """
    from interdrive.predictors import NATIVE, RECORDS  # noqa: PLC0415

    _show(name, "predictor", NATIVE, RECORDS)


def _show(name: str | None, what: str, native: dict[str, str], records: dict[str, type]) -> None:
    from interdrive.cli.report import print_plugins, print_settings, print_text  # noqa: PLC0415 - rich
    from interdrive.config.binding import described, description  # noqa: PLC0415
    from interdrive.config.plugins import find, listed  # noqa: PLC0415

    if name is None:
        print_plugins(listed(native, what))
        print_text(f"`interdrive {what}s NAME` lists the settings of one; choose your own as module:object.")
        return
    found: Any = records[name] if name in records else find(name, tuple(native), what)
    text = description(found)
    print_text(f"{name}: {native[name]}\n\n{text}" if name in native else f"{name}: {text or 'no docstring'}")
    rows = described(found) if is_dataclass(found) else []
    if rows:
        print_text("")
        print_settings(rows)
    else:
        print_text("\nIt has no settings.")
