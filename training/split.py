"""The split by place: which scenario files are for what."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

#: Parts that the shipped network is trained on; each is also held out once.
FOLDS = ("a", "b", "c")
PARTS = (*FOLDS, "validation", "none")
CATEGORIES = ("highway", "intersection", "urban", "junction", "other")
TRAFFIC = ("recorded", "simulated", "invented")


@dataclass(frozen=True)
class Place:
    """One place and the files that show it; see `split.toml` for the values."""

    name: str
    files: tuple[str, ...]
    part: str
    category: str
    traffic: str


#: The split.
SPLIT = Path(__file__).with_name("split.toml")


def read_places(path: Path = SPLIT) -> tuple[Place, ...]:
    """All places.

    Raises:
        ValueError: A part, category or kind of traffic that does not exist, or a name that stands twice.
    """
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    places = tuple(Place(**{**entry, "files": tuple(entry["files"])}) for entry in table["place"])
    for place in places:
        for value, allowed in ((place.part, PARTS), (place.category, CATEGORIES), (place.traffic, TRAFFIC)):
            if value not in allowed:
                raise ValueError(f"{path.name}, place {place.name}: {value!r} is none of {', '.join(allowed)}")
    if len({place.name for place in places}) < len(places):
        raise ValueError(f"{path.name}: a place stands there twice")
    return places


def place_of(file: str, places: tuple[Place, ...]) -> Place:
    """The one place that a file shows.

    Args:
        file: Name of the file without folder and ending.
        places: All places.

    Raises:
        ValueError: No place or several claim the file.
    """
    found = [place for place in places if any(fnmatchcase(file, pattern) for pattern in place.files)]
    if len(found) != 1:
        claims = " and ".join(place.name for place in found) or "no place"
        raise ValueError(f"split.toml: {file} belongs to {claims}; it must be exactly one")
    return found[0]
