"""Configuration files of `run` and `batch`: the same choices and settings as on the command line."""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from interdrive.config.binding import dotted
from interdrive.config.plugins import DEFAULT_PLANNER, read_choice
from interdrive.errors import InputError

if TYPE_CHECKING:
    from pathlib import Path

    from interdrive.config.plugins import Choice


@dataclass(frozen=True)
class RunChoices:
    """Options of `run` besides settings, with their names in a configuration file; its help describes them."""

    scenario: str = ""
    agents: int | tuple[int, ...] | str = "all"
    planner: str = DEFAULT_PLANNER
    predictor: str = "neural"
    style: str = "normal"
    traffic: str | None = None
    v2x: float | None = None
    start: int | None = None
    seed: int = 0
    threads: int | None = None
    out: str | None = None
    overwrite: bool = False
    png: bool = False
    gif: bool = False
    mp4: bool = False
    report: bool = False
    profile: bool = False


@dataclass(frozen=True)
class BatchChoices:
    """Options of `batch` besides settings, with their names in a configuration file; its help describes them."""

    paths: tuple[str, ...] = ()
    planner: tuple[str, ...] = (DEFAULT_PLANNER,)
    predictor: tuple[str, ...] = ("neural",)
    style: str = "normal"
    agents: int | str = "all"
    traffic: str | None = None
    alone: bool = False
    seeds: int = 1
    out: str | None = None
    workers: int | None = None
    run_timeout: float = math.inf
    memory: str | None = None
    keep: str = "none"
    panel: str = "none"
    retry: bool = False
    ray: str | None = None


def read_config(
    path: Path, kind: type[RunChoices | BatchChoices] = RunChoices, table: str = "run"
) -> tuple[dict[str, Any], dict[int, Choice], dict[str, Any]]:
    """Reads the choices for all agents, the choices per agent, and the settings of a TOML file.

    Choices are at the top level or, since TOML cannot have `planner = "frenet"` beside `[planner.frenet]`, in the
    table `[run]` or `[batch]`. The table `[agent.5]` holds the choices for agent 5: `planner = "frenet"` and settings
    of that planner by their names. Relative scenario paths start at the folder of the file.

    Args:
        path: The file.
        kind: The choices that the command has.
        table: Name of their table.

    Raises:
        InputError: The file does not exist or is not TOML, or an entry does not exist (the message names the nearest
            one).
    """
    from interdrive.files import content_of_input  # noqa: PLC0415 - numpy
    from interdrive.storage.reading import decoded, parsed_toml  # noqa: PLC0415

    content = content_of_input(path)
    try:
        document = parsed_toml(decoded(content))
    except ValueError as cause:
        raise InputError(f"{path}: not a configuration file: {cause}") from None
    names = [field.name for field in fields(kind)]
    own = _per_agent(path, document.pop("agent", {}))
    choices: dict[str, Any] = {}
    settings: dict[str, Any] = {}
    for name, value in dotted(document).items():
        short = name.removeprefix(f"{table}.")
        if short in names:
            choices[short] = value
        elif "." in name and short == name:
            settings[name] = value
        else:
            near = difflib.get_close_matches(short, names, n=1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(sorted(names))}, and settings"
            raise InputError(f"{path}: {name}: no such entry; {hint}")
    for name in ("paths", "planner", "predictor"):
        if kind is BatchChoices and isinstance(choices.get(name), str):
            choices[name] = [choices[name]]  # commas inside the text have another meaning
    if isinstance(choices.get("paths"), list):
        choices["paths"] = [
            str(path.parent / str(item)) if (path.parent / str(item)).exists() else item for item in choices["paths"]
        ]
    beside = path.parent / str(choices.get("scenario", ""))
    if "scenario" in choices and beside.is_file():
        choices["scenario"] = str(beside)
    return choices, own, settings


def _per_agent(path: Path, tables: object) -> dict[int, Choice]:
    found: dict[int, Choice] = {}
    if not isinstance(tables, dict):
        raise InputError(f"{path}: agent: write a table per agent, for instance [agent.5]")
    for key, table in tables.items():
        if not isinstance(table, dict) or not key.removeprefix("-").isdecimal():
            raise InputError(f"{path}: agent.{key}: write a table per agent, for instance [agent.5]")
        if not isinstance(table.get("planner", ""), str):
            raise InputError(f"{path}: agent.{key}.planner: expected a text, not {table['planner']!r}")
        try:
            found[int(key)] = read_choice(table, "planner")
        except InputError as error:
            raise error.within(str(path), f"agent.{key}") from None
    return found
