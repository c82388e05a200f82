"""Writes a new version of a benchmark set: python benchmarks/sets.py NAME [SCENARIOS]; existing ones never change.

SCENARIOS holds the files and INVENTORY.csv, which says where they come from. Places, categories and parts are those of
training/split.toml; `validation` is the split test. Files without an agent are left out.
"""

from __future__ import annotations

import csv
import hashlib
import json
import sys
from pathlib import Path

import interdrive
from interdrive import SimulationSettings, read_scenario, shipped_scenario
from interdrive.errors import InterdriveError
from interdrive.prediction_evaluation.split import read_split
from interdrive.scenario.agents import select
from interdrive.scenario.native import core_road

ROOT = Path(__file__).resolve().parent.parent
TEXTS = {
    "public": "Public CommonRoad files: 1 to 71 vehicles each, recorded, simulated and invented traffic. They are not "
    "shipped; every file names the repository and commit that has it.",
    "shipped": "The scenarios that come with interdrive: works at once, too few for claims.",
}
#: Shipped scenarios that are small enough; all are invented.
SHIPPED = {"t_junction": "junction", "lane_merge": "merge", "highway": "highway", "intersection": "intersection"}


def agents(path: Path) -> list[int]:
    """Ids of all agents of a file; none where it cannot be driven."""
    settings = SimulationSettings()
    try:
        scenario = read_scenario(path)
        found = select(
            scenario,
            core_road(scenario, settings.road),
            "all",
            agent_settings=settings.agents,
            goal_settings=settings.goal,
            max_steps=settings.step.steps_at_most(scenario),
            seed=0,
        )[0]
    except InterdriveError as error:
        print(f"{path.name}: {error}")
        return []
    return sorted(agent.id for agent in found)


def entry(path: Path, source: list[str], category: str, place: str, traffic: str, split: str) -> str | None:
    """A file of the set as TOML."""
    ids = agents(path)
    if not ids:
        return None
    values = {
        "name": path.stem,
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "source": source,
        "category": category,
        "place": place,
        "traffic": traffic,
        "split": split,
        "agents": ids,
    }
    return "[[file]]\n" + "".join(f"{name} = {json.dumps(value)}\n" for name, value in values.items() if value)


def public(folder: Path) -> list[str]:
    """Entries of the public files."""
    split = read_split(ROOT / "training" / "split.toml")
    with (folder / "INVENTORY.csv").open(encoding="utf-8") as table:
        rows = sorted(csv.DictReader(table), key=lambda row: row["path"])
    found = []
    for row in rows:
        path = folder / row["path"]
        place = split.place_of(path)
        name, traffic = (place.name, place.traffic) if place else (path.stem, "unknown")
        part = "test" if place is not None and place.part == "validation" else "dev"
        source = [row["source_repo"], row["source_path"], row["source_commit"]]
        found.append(entry(path, source, row["category"], name, traffic, part))
    return [one for one in found if one is not None]


def shipped() -> list[str]:
    """Entries of the shipped scenarios."""
    found = [entry(shipped_scenario(name), [], category, name, "invented", "dev") for name, category in SHIPPED.items()]
    return [one for one in found if one is not None]


def main() -> None:
    """Writes the set."""
    name = sys.argv[1]
    target = ROOT / "python" / "interdrive" / "benchmarks" / "sets" / f"{name}.toml"
    if target.exists():
        sys.exit(f"{target}: a released set is never changed; take the next number")
    kind = name.partition("-")[0]
    entries = shipped() if kind == "shipped" else public(Path(sys.argv[2]))
    head = f"# Made by benchmarks/sets.py with interdrive {interdrive.__version__}. Never edited: hashes are known.\n"
    target.write_text(f"{head}text = {json.dumps(TEXTS[kind])}\n\n" + "\n".join(entries), encoding="utf-8")
    print(f"{len(entries)} files in {target}")


if __name__ == "__main__":
    main()
