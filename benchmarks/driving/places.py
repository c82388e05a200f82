"""Files of a folder, the places that they show, and the halves of these places."""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from fnmatch import fnmatchcase
from pathlib import Path

SPLIT = Path(__file__).resolve().parents[2] / "training" / "split.toml"
#: The map that a benchmark id states.
MAP = re.compile(r"(?:C-)?([A-Z]{3}_[^_]+-\d+)(?:_|$)")


def scenario_files(folder: Path) -> list[Path]:
    """All scenarios of the categories of a folder, or of the folder itself."""
    return sorted(folder.glob("*/*.xml")) or sorted(folder.glob("*.xml"))


def category_of(path: Path) -> str:
    """The folder of a file; "all" is the row of all categories."""
    return "files" if path.parent.name == "all" else path.parent.name


def places() -> dict[str, tuple[str, ...]]:
    """Names of places, and the patterns of their files."""
    listed = tomllib.loads(SPLIT.read_text(encoding="utf-8"))["place"]
    return {place["name"]: tuple(place["files"]) for place in listed}


def place_of(path: Path, known: dict[str, tuple[str, ...]]) -> str:
    """The place that a file shows: of training/split.toml, else the map that its name states, else its name."""
    for name, files in known.items():
        if any(fnmatchcase(path.stem, one) for one in files):
            return name
    stated = MAP.match(path.stem)
    return stated[1] if stated else path.stem


def halves(files: list[Path], known: dict[str, tuple[str, ...]]) -> dict[str, str]:
    """Places by halves A and B, in turns by name among those of a category, the category of most of their files."""
    categories: dict[str, Counter[str]] = {}
    for path in files:
        categories.setdefault(place_of(path, known), Counter())[category_of(path)] += 1
    ordered = sorted((count.most_common(1)[0][0], name) for name, count in categories.items())
    found, previous = {}, {}
    for category, name in ordered:
        found[name] = previous[category] = "B" if previous.get(category) == "A" else "A"
    return found
