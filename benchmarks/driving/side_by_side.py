"""The same agents with other predictors, and among traffic that interacts less: see docs/research/log/driving.md.

    python benchmarks/driving/side_by_side.py                          # continues what an earlier call began
    python benchmarks/driving/side_by_side.py --page PAGE        # writes its tables between the markers of a page, too

With all vehicles as agents there is a run for each scenario; alone, there is one for each reachable agent.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import tables

from interdrive.batches import batch
from interdrive.files import scenario_folders

ROOT = Path(__file__).resolve().parents[2]
#: Title of a column, then what `interdrive.batches.batch` is given.
VARIANTS: dict[str, dict[str, Any]] = {
    "neural": {"predictor": "neural", "agents": "all"},
    "lane_following": {"predictor": "lane_following", "agents": "all"},
    "constant_velocity": {"predictor": "constant_velocity", "agents": "all"},
    "alone, others adapt their speed": {"agents": "reachable", "alone": True, "traffic": "velocity_adjusting"},
    "alone, others replay": {"agents": "reachable", "alone": True, "traffic": "recorded"},
}
COLUMNS = ("scenario", "category", "agent_id", "under_test", "outcome", "partner_id")


def ends(
    paths: list[Path], folder: Path, choices: dict[str, Any], workers: int
) -> dict[tuple[str, int], tuple[str, str]]:
    """For every agent under test, by scenario and id: its category and its outcome."""
    done = batch([str(path) for path in paths], folder, workers=workers, **choices)
    lost = sum(count for status, count in done.status.items() if status not in ("finished", "refused"))
    if lost:
        sys.exit(f"{folder}: {lost} runs did not finish")
    return {
        (row["scenario"], row["agent_id"]): (row["category"], row["outcome"])
        for row in done.select(COLUMNS).to_pylist()
        if row["under_test"]
    }


def compared(found: dict[str, dict[tuple[str, int], tuple[str, str]]], counted: set[tuple[str, int]]) -> str:
    """Shares in time, and collisions per 100 agents behind a comma, by category and variant; of the agents counted."""
    lines = [f"| category | agents | {' | '.join(found)} |", "|---|--:|" + "--:|" * len(found)]
    categories = {key: category for rows in found.values() for key, (category, _) in rows.items() if key in counted}
    for name in [*sorted(set(categories.values())), "all"]:
        keys = [key for key, category in sorted(categories.items()) if name in (category, "all")]
        cells = []
        for rows in found.values():
            outcomes = Counter(rows[key][1] for key in keys)
            share, hits = (100 * outcomes[outcome] / len(keys) for outcome in ("goal_reached", "collision"))
            cells.append(f"{share:.1f} %, {hits:.1f}")
        lines.append(f"| {name} | {len(keys)} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(prog="side_by_side", description=(__doc__ or "").splitlines()[0])
    default = next(iter(scenario_folders()), ROOT.parent / "shared" / "scenarios")
    parser.add_argument("folder", type=Path, nargs="?", default=default, help="of folders, one per category")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "driving" / "side_by_side")
    parser.add_argument("--page", type=Path, metavar="FILE", help="the table also goes between markers of this page")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    if arguments.page:
        try:
            tables.put_into(arguments.page.read_text(encoding="utf-8"), "", tables.SIDE_BY_SIDE)
        except (OSError, ValueError) as error:
            print(f"{arguments.page}: {error}", file=sys.stderr)
            return 2
    paths = sorted(arguments.folder.glob("*/"))
    if not any(arguments.folder.glob("*/*.xml")):
        print(f"{arguments.folder}: no scenario (a folder of folders with .xml files is expected)", file=sys.stderr)
        return 2
    found = {
        title: ends(paths, arguments.out / str(number), choices, arguments.workers)
        for number, (title, choices) in enumerate(VARIANTS.items())
    }
    counted = set.intersection(*(set(rows) for rows in found.values()))
    text = compared(found, counted)
    print(text)
    if arguments.page:
        page = arguments.page.read_text(encoding="utf-8")
        arguments.page.write_text(tables.put_into(page, text, tables.SIDE_BY_SIDE), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
