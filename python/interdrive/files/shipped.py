"""The shipped scenarios; `scenarios/make.py` makes them."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from interdrive.errors import InputError


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


def _folder() -> Path:
    return Path(str(files("interdrive"))) / "data"
