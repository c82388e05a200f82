"""Makes the scenarios that come with the package. `--check` only tells whether the files are what this script makes."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import highway
import intersection
import lane_merge
import signals
import t_junction
import town
from document import document

FOLDER = Path(__file__).resolve().parent.parent / "python" / "interdrive" / "data"
SCENARIOS = {module.__name__: module.make for module in (highway, intersection, lane_merge, signals, t_junction, town)}


def main(arguments: list[str] | None = None) -> int:
    """Writes the files, or compares them; the number of files that differ is the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing, fail if a file is not up to date")
    parser.add_argument("names", nargs="*", default=list(SCENARIOS), help="which ones: " + ", ".join(SCENARIOS))
    options = parser.parse_args(arguments)
    different = 0
    for name in options.names:
        text = document(SCENARIOS[name]())
        path = FOLDER / f"{name}.xml"
        if not options.check:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
            sys.stdout.write(f"{path.name}: {len(text) / 1000:.0f} kB\n")
        elif not path.is_file() or path.read_text(encoding="utf-8") != text:
            different += 1
            sys.stdout.write(f"{path.name} is not what scenarios/make.py makes; run it\n")
    return different


if __name__ == "__main__":
    sys.exit(main())
