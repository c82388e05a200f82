"""Arguments that several commands share: scenario names, settings, folders."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive.config.plugins import read_choice
from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.config.plugins import Choice


def scenario_named(name: str) -> str:
    """Returns a path or the name of a shipped scenario; refuses anything else and suggests the nearest name."""
    from interdrive.files import shipped_scenarios  # noqa: PLC0415 - commonroad-io takes a second to load

    shipped = shipped_scenarios()
    if name in shipped or Path(name).exists():
        return name
    near = difflib.get_close_matches(name, shipped, n=1)
    hint = f"did you mean the shipped scenario {near[0]}?" if near else "and no shipped scenario has that name"
    raise InputError(f"{name}: no such file, {hint}")


def assigned(assignments: Sequence[str]) -> dict[str, str]:
    """Values of `--set` by dotted name."""
    values = {}
    for text in assignments:
        name, equals, value = text.partition("=")
        if not equals:
            raise InputError(f"--set {text}: write it as name=value")
        values[name.strip()] = value.strip()
    return values


def choices_by_agent(texts: Sequence[str]) -> dict[int, Choice]:
    """Choices of `--agent` by id."""
    found: dict[int, Choice] = {}
    for text in texts:
        number, equals, choice = text.partition("=")
        try:
            agent = int(number)
        except ValueError:
            equals = ""
        if not equals:
            raise InputError(f"--agent {text}: write it as ID=PLANNER[,NAME=VALUE...]")
        if agent in found:
            raise InputError(f"--agent {text}: agent {agent} is named twice")
        try:
            found[agent] = read_choice(choice, "planner")
        except InputError as error:
            raise error.within(f"--agent {number}") from None
    return found


def new_folder(name: str) -> Path:
    """A folder under out/ that does not exist yet, numbered if necessary."""
    folder, number = Path("out") / name, 1
    while folder.exists():
        number += 1
        folder = Path("out") / f"{name}-{number}"
    return folder


def shown(folder: Path) -> Path:
    """The folder for display: relative to the working folder if it is inside it."""
    here = Path.cwd()
    return folder.relative_to(here) if folder.is_relative_to(here) else folder
