"""The split by place: which scenario files are for what."""

from __future__ import annotations

from pathlib import Path

from interdrive.prediction_evaluation.split import UNKNOWN, Place, read_split

__all__ = ["CATEGORIES", "FOLDS", "PARTS", "SPLIT", "Place", "place_of", "read_places"]

#: Parts that the shipped network is trained on; each is also held out once.
FOLDS = ("a", "b", "c")
PARTS = (*FOLDS, "validation", "none")
CATEGORIES = ("highway", "intersection", "urban", "junction", "other")

#: The split.
SPLIT = Path(__file__).with_name("split.toml")


def read_places(path: Path = SPLIT) -> tuple[Place, ...]:
    """All places.

    Raises:
        InputError: It cannot be read, or a kind of traffic does not exist.
        ValueError: A part or category that does not exist, traffic that is not stated, or a name that stands twice.
    """
    places = read_split(path).places
    for place in places:
        for value, allowed in ((place.part, PARTS), (place.category, CATEGORIES)):
            if value not in allowed:
                raise ValueError(f"{path.name}, place {place.name}: {value!r} is not one of {', '.join(allowed)}")
        if place.traffic == UNKNOWN:
            raise ValueError(f"{path.name}, place {place.name}: traffic is not stated")
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
    found = [place for place in places if place.has(file)]
    if len(found) != 1:
        claims = " and ".join(place.name for place in found) or "no place"
        raise ValueError(f"split.toml: {file} belongs to {claims}; it must be exactly one")
    return found[0]
