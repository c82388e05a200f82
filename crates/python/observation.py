"""Writes the table of observed numbers in docs/reference/environments.md from the core's layout.

python crates/python/observation.py [--check]
"""

from __future__ import annotations

import sys
from pathlib import Path

from interdrive import _core
from interdrive.native_settings import ObservationSettings

PAGE = Path(__file__).parents[2] / "docs/reference/environments.md"
MARKS = "<!-- written by crates/python/observation.py -->\n", "<!-- end -->\n"


def table() -> str:
    """One row per number of a block, of the first row where there are several."""
    lines = ["| block | number | unit | divided by |", "|---|---|---|---|"]
    whole = ObservationSettings(edges=32, predictions=True)
    sizes = {name: rows for name, rows, _ in _core.observation_blocks(whole)}
    for block, row, name, unit, scale in _core.observation_layout(whole):
        if row:
            continue
        rows = f" x {sizes[block]}" if sizes[block] else ""
        lines.append(f"| {block}{rows} | {name.removesuffix(', 2 m on')} | {unit} | {scale} |")
    return "\n".join(lines) + "\n"


def page() -> str:
    """The page with the table as it is now."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(MARKS[0])
    return before + MARKS[0] + "\n" + table() + "\n" + MARKS[1] + rest.partition(MARKS[1])[2]


if __name__ == "__main__":
    if "--check" not in sys.argv:
        PAGE.write_text(page(), encoding="utf-8")
    elif PAGE.read_text(encoding="utf-8") != page():
        sys.exit("docs/reference/environments.md is not what the layout says: run crates/python/observation.py")
