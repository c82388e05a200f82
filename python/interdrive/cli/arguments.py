"""Arguments that several commands share: scenario names, settings, folders."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from interdrive.config.plugins import read_choice
from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.config.plugins import Choice


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


def id_list(option: str, text: str) -> list[int]:
    """Ids as written behind an option: 12,34."""
    try:
        return [int(number) for number in text.split(",")]
    except ValueError:
        raise InputError(f"{option} {text}: write them as 12,34") from None


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
