"""Rows of known planners that come with a set, one file per set; `benchmarks/reference.py` writes them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interdrive.benchmarks.rows import from_plain

if TYPE_CHECKING:
    from interdrive.benchmarks.rows import Row
    from interdrive.benchmarks.sets import BenchmarkSet


def reference_rows(chosen: BenchmarkSet, split: str) -> list[Row]:
    """Rows of known planners for a split of a set; none if there are no rows for it, or they are of another set."""
    stored = stored_reference(chosen.name)
    if stored.get("set_sha256") != chosen.sha256:
        return []
    files = chosen.of_split(split)
    return [from_plain(row, files) for row in stored["splits"].get(split, {}).get("rows", [])]


def stored_reference(name: str) -> dict[str, Any]:
    """All that comes with a set by its name; empty without any."""
    path = Path(str(__path__[0])) / f"{name}.json"
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return found
