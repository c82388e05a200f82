"""Scenarios by name: shipped ones, which `scenarios/make.py` makes, and those in the user's folders of scenarios."""

from __future__ import annotations

import difflib
import glob
import os
from importlib.resources import files
from pathlib import Path

from interdrive.errors import InputError

#: Names the user's folders of scenarios, with the separator of PATH between them.
FOLDER_VARIABLE = "INTERDRIVE_SCENARIOS"


def scenario_folders(given: str | os.PathLike[str] | None = None) -> tuple[Path, ...]:
    """The folders that a text names, or without one the variable INTERDRIVE_SCENARIOS; none if it is not set.

    Args:
        given: Folders, with the separator of PATH between them.
    """
    text = os.fspath(given) if given else os.environ.get(FOLDER_VARIABLE, "")
    return tuple(Path(part) for part in text.split(os.pathsep) if part)


def recorded_scenario(name: str) -> Path | None:
    """The first file of that `name`, a path from a folder of INTERDRIVE_SCENARIOS on; None without one."""
    found = (folder / name for folder in scenario_folders())
    return next((path for path in found if path.is_file()), None)


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

    A path to a file means itself. Otherwise it is the name of a shipped scenario, or a file below one of the folders
    that INTERDRIVE_SCENARIOS names: its path from there, or its name with or without .xml.

    Raises:
        InputError: There is no such file, or several below these folders have this name.
    """
    path, name = Path(spec), os.fspath(spec)
    if path.is_file():  # a run folder may have the name of a shipped scenario
        return path
    if name in shipped_scenarios():
        return shipped_scenario(name)
    below = recorded_scenario(name)
    if below is not None:
        return below
    pattern = f"{glob.escape(path.name.removesuffix('.xml'))}.xml"
    named = [(folder, file) for folder in scenario_folders() for file in sorted(folder.rglob(pattern))]
    if len(named) > 1:
        folders = [*dict.fromkeys(folder for folder, _ in named)]
        found = ", ".join(str(file.relative_to(folder) if len(folders) == 1 else file) for folder, file in named)
        raise InputError(name, f"several files below {' and '.join(map(str, folders))} have this name: {found}")
    if named:
        return named[0][1]
    if path.exists():  # a folder, which some callers accept
        return path
    near = difflib.get_close_matches(name, shipped_scenarios(), n=1)
    shipped = f"no shipped scenario has that name ({', '.join(shipped_scenarios())})"
    hint = f"did you mean the shipped scenario {near[0]}?" if near else f"and {shipped}"
    raise InputError(name, f"no such file, {hint}")


def _folder() -> Path:
    return Path(str(files("interdrive"))) / "data"
