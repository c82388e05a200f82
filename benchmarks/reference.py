"""Stores the rows of a benchmark as reference rows of its set, and writes them into docs/research/scores.md.

    interdrive benchmark rollout,frenet,idm,idm_mobil,recorded --set public-1 --split test --scenarios FOLDER
    python benchmarks/reference.py out/benchmark-public-1   # several folders: a planner needs an environment of its own

Rows of the same planner and split are replaced, other ones stay. A partial benchmark is refused. A planner that drives
otherwise since then has rows that a test finds (`tests/scoring/test_reference.py`): run both commands again.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interdrive.benchmarks import read_set, set_names
from interdrive.benchmarks.reference import reference_rows, stored_reference

if TYPE_CHECKING:
    from interdrive.benchmarks import Row

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "python" / "interdrive" / "benchmarks" / "reference"
PAGE = ROOT / "docs" / "research" / "scores.md"
HEADINGS = (
    *(
        "planner",
        "R",
        "95 %",
        "NR",
        "R, score 1",
        "NR, score 1",
        "reached %",
        "at fault per 100",
        "TTC < 2 s %",
        "jerk",
    ),
    *("agents", "left out", "agents at 0"),
)


def merged(old: dict[str, Any], new: dict[str, Any]) -> dict[str, Any]:
    """Reference rows with those of another benchmark.json."""
    if new["partial"]:
        sys.exit(f"{new['set']}: partial, {len(new['missing'])} files are missing")
    if old.get("set_sha256") != new["set_sha256"]:
        old = {name: new[name] for name in ("format", "set", "set_sha256")} | {"splits": {}}
    part = old["splits"].setdefault(new["split"], {"rows": [], "scenarios": {}})
    replaced = {row["planner"] for row in new["rows"]}
    part["rows"] = sorted(
        [row for row in part["rows"] if row["planner"] not in replaced] + new["rows"], key=lambda row: row["planner"]
    )
    part["scenarios"] = dict(sorted((part["scenarios"] | new["scenarios"]).items()))
    return old


def table(name: str, split: str) -> str:
    """The rows of all categories together as Markdown, the best planner first, replayed humans last.

    Nothing without rows.
    """
    rows = [row for row in reference_rows(read_set(name), split) if row.category == "all"]
    if not rows:
        return ""
    lines = ["| " + " | ".join(HEADINGS) + " |", "|---|" + "--:|" * (len(HEADINGS) - 2) + "---|"]
    lines += ["| " + " | ".join(cells(row)) + " |" for row in sorted(rows, key=rank)]
    return "\n".join(lines)


def rank(row: Row) -> tuple[bool, bool, float]:
    """Place in the table: replayed humans have no number, rows of earlier releases have score 1 alone."""
    if math.isnan(row.score):
        return True, math.isnan(row.score_1), -row.score_1
    return False, False, -row.score


def by_category(name: str, split: str) -> str:
    """The number of each planner by category as Markdown; score 1 where no row has another one."""
    rows = [row for row in reference_rows(read_set(name), split) if row.category != "all"]
    known = [row for row in rows if not math.isnan(row.score)]
    number, heading = ("score", "category") if known else ("score_1", "category, score 1")
    rows = known or [row for row in rows if not math.isnan(row.score_1)]
    if not rows:
        return ""
    categories = sorted({row.category for row in rows})
    planners = sorted({row.planner for row in rows})
    scores = {(row.planner, row.category): f"{getattr(row, number):.1f}" for row in rows}
    sizes = {
        category: max((row.n_scenarios, row.n_agents) for row in rows if row.category == category)
        for category in categories
    }
    lines = [
        f"| {heading} | scenarios, agents | " + " | ".join(f"`{planner}`" for planner in planners) + " |",
        "|---|--:|" + "--:|" * len(planners),
    ]
    for category in categories:
        values = " | ".join(scores.get((planner, category), "") for planner in planners)
        lines.append(f"| {category} | {sizes[category][0]}, {sizes[category][1]} | {values} |")
    return "\n".join(lines)


def cells(row: Row) -> list[str]:
    """A line of the table."""
    values = (
        *(row.score, None, row.non_reactive, row.score_1, row.score_1_non_reactive),
        *(row.reached, row.at_fault, row.ttc_critical, row.jerk),
    )
    found = ["" if value is None or math.isnan(value) else f"{value:.1f}" for value in values]
    found[1] = "" if math.isnan(row.low) else f"{row.low:.1f} to {row.high:.1f}"
    zeros = ", ".join(f"{count} {name}" for name, count in row.zeros.items())
    return [f"`{row.planner}`", *found, str(row.n_agents), str(row.n_left_out), zeros]


def documented(text: str) -> str:
    """The page with all tables that it has a place for."""
    for name in set_names():
        for split in ("test", "dev"):
            for kind, made in (("rows", table), ("categories", by_category)):
                place = f"reference-{name}-{split}-{kind}"
                head, begun, rest = text.partition(f"<!-- {place} -->\n")
                if begun:
                    _, end, tail = rest.partition(f"<!-- /{place} -->")
                    text = f"{head}{begun}\n{made(name, split)}\n\n{end}{tail}"
    return text


def main() -> None:
    """Stores and documents rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="*", type=Path, help="of benchmarks; none: only write the page")
    for folder in parser.parse_args().folders:
        new = json.loads((folder / "benchmark.json").read_text(encoding="utf-8"))
        content = merged(stored_reference(new["set"]), new)
        target = FOLDER / f"{new['set']}.json"
        target.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        print(f"{len(new['rows'])} rows in {target}")
    PAGE.write_text(documented(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
