"""Scenarios by name: shipped ones, which `scenarios/make.py` makes, and those in the user's folder of scenarios."""

from __future__ import annotations

import difflib
import glob
import os
from importlib.resources import files
from pathlib import Path

from interdrive.errors import InputError

#: Names the user's folder of scenarios.
FOLDER_VARIABLE = "INTERDRIVE_SCENARIOS"


def shipped_scenarios() -> tuple[str, ...]:
    """Names of the shipped scenarios, sorted."""
    return tuple(sorted(path.stem for path in _folder().glob("*.xml")))


def shipped_scenario(name: str) -> Path:
    """The file of a shipped scenario.

    Args:
        name: One of `shipped_scenarios()`.

    Returns:
        Its path.

    Raises:
        InputError: There is no such scenario; the message lists the names.
    """
    if name not in shipped_scenarios():
        raise InputError(f"no shipped scenario '{name}'; there are {', '.join(shipped_scenarios())}")
    return _folder() / f"{name}.xml"


def scenario_file(spec: str | os.PathLike[str]) -> Path:
    """The file that a path or name means.

    A path to a file means itself. Otherwise it is the name of a shipped scenario, or a file below the folder that
    INTERDRIVE_SCENARIOS names: its path from there, or its name with or without .xml.

    Raises:
        InputError: There is no such file, or several below that folder have this name.
    """
    path, name = Path(spec), os.fspath(spec)
    if path.is_file():  # a run folder may have the name of a shipped scenario
        return path
    if name in shipped_scenarios():
        return shipped_scenario(name)
    folder = os.environ.get(FOLDER_VARIABLE)
    if folder:
        below, stem = Path(folder) / path, path.name.removesuffix(".xml")
        named = [below] if below.is_file() else sorted(Path(folder).rglob(f"{glob.escape(stem)}.xml"))
        if len(named) > 1:
            found = ", ".join(str(file.relative_to(folder)) for file in named)
            raise InputError(name, f"several files below {folder} have this name: {found}")
        if named:
            return named[0]
    if path.exists():  # a folder, which some callers accept
        return path
    near = difflib.get_close_matches(name, shipped_scenarios(), n=1)
    shipped = f"no shipped scenario has that name ({', '.join(shipped_scenarios())})"
    hint = f"did you mean the shipped scenario {near[0]}?" if near else f"and {shipped}"
    raise InputError(name, f"no such file, {hint}")


def _folder() -> Path:
    return Path(str(files("interdrive"))) / "data"
