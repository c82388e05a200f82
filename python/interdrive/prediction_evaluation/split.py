"""A split of recordings by place: which files are for validation, and which category they have.

The file is TOML with a table `[[place]]` per place: `files` (patterns of file names without ending), `part` (such as
"validation"), `category`, and if one likes `name` and `traffic` (one of `TRAFFIC`). training/split.toml is one.
"""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from interdrive.errors import InputError
from interdrive.files import content_of_input
from interdrive.storage.reading import decoded, parsed_toml

#: Origin of traffic: cameras; a simulation (SUMO); invented by hand or by synthesis; unknown.
UNKNOWN = "unknown"
TRAFFIC = ("recorded", "simulated", "invented", UNKNOWN)


@dataclass(frozen=True)
class Place:
    """A place: one stretch of road, whatever was recorded there and when.

    Attributes:
        name: For messages.
        files: Patterns of the names of its files.
        part: What they are for.
        category: As the evaluation counts them.
        traffic: One of `TRAFFIC`.
    """

    name: str
    files: tuple[str, ...]
    part: str
    category: str
    traffic: str = UNKNOWN

    def has(self, stem: str) -> bool:
        """Whether a file shows it, by its name without ending."""
        return any(fnmatchcase(stem, pattern) for pattern in self.files)


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
        return next((place for place in self.places if place.has(file.stem)), None)


def read_split(path: str | Path) -> Split:
    """Reads a split.

    Raises:
        InputError: It cannot be read, or a place lacks something; one line with path and place.
    """
    path = Path(path)
    content = content_of_input(path)
    try:
        table = parsed_toml(decoded(content))
    except ValueError as error:
        raise InputError(f"{path}: cannot be read as TOML ({error})") from None
    places = table.get("place")
    if not isinstance(places, list) or not places:
        raise InputError(f"{path}: there is no table [[place]]")
    return Split(path, tuple(_place(path, number, entry) for number, entry in enumerate(places, start=1)))


def _place(path: Path, number: int, entry: Any) -> Place:  # noqa: ANN401 - whatever TOML holds
    given = entry if isinstance(entry, dict) else {}
    name = str(given.get("name", f"number {number}"))
    files, part, category = (given.get(key) for key in ("files", "part", "category"))
    if not isinstance(files, list) or not all(isinstance(pattern, str) for pattern in files):
        raise InputError(f"{path}: place {name}: files must be a list of patterns")
    if not isinstance(part, str) or not isinstance(category, str):
        raise InputError(f"{path}: place {name}: part and category must be texts")
    traffic = given.get("traffic", UNKNOWN)
    if not isinstance(traffic, str) or traffic not in TRAFFIC:
        raise InputError(f"{path}: place {name}: traffic is {traffic!r}, but must be one of {', '.join(TRAFFIC)}")
    return Place(name, tuple(files), part, category, traffic)
