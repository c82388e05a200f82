"""A split of recordings by place: which files are for validation, and which category they have.

The file is TOML with a table `[[place]]` per place: `files` (patterns of file names without ending), `part` (such as
"validation"), `category`. training/split.toml is one.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from interdrive.errors import InputError


@dataclass(frozen=True)
class Place:
    """A place: patterns of the names of its files, what they are for, and their category."""

    files: tuple[str, ...]
    part: str
    category: str


@dataclass(frozen=True)
class Split:
    """All places of a split.

    Attributes:
        path: Where it is from.
        places: In the order of the file.
    """

    path: Path
    places: tuple[Place, ...]

    @property
    def parts(self) -> tuple[str, ...]:
        """The names of the parts, in order of appearance."""
        return tuple(dict.fromkeys(place.part for place in self.places))

    def place_of(self, file: Path) -> Place | None:
        """The first place whose patterns the name of the file matches; None: it is of no place."""
        return next((p for p in self.places if any(fnmatchcase(file.stem, pattern) for pattern in p.files)), None)


def read_split(path: str | Path) -> Split:
    """Reads a split.

    Raises:
        InputError: It cannot be read, or a place lacks something; one line with path and place.
    """
    path = Path(path)
    try:
        table: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as TOML ({error})") from None
    places = table.get("place")
    if not isinstance(places, list) or not places:
        raise InputError(f"{path}: there is no table [[place]]")
    return Split(path, tuple(_place(path, number, entry) for number, entry in enumerate(places, start=1)))


def _place(path: Path, number: int, entry: Any) -> Place:  # noqa: ANN401 - whatever TOML holds
    given = entry if isinstance(entry, dict) else {}
    name = given.get("name", f"number {number}")
    files, part, category = (given.get(key) for key in ("files", "part", "category"))
    if not isinstance(files, list) or not all(isinstance(pattern, str) for pattern in files):
        raise InputError(f"{path}: place {name}: files must be a list of patterns")
    if not isinstance(part, str) or not isinstance(category, str):
        raise InputError(f"{path}: place {name}: part and category must be texts")
    return Place(tuple(files), part, category)
