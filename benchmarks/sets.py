"""Writes a new version of a benchmark set: python benchmarks/sets.py NAME [SCENARIOS [RECORDINGS]].

Existing sets never change. SCENARIOS holds the files and INVENTORY.csv, which says where they come from. Places,
categories and parts are those of training/split.toml; `validation` is the split test. Files without an agent are left
out.

public-2 also needs RECORDINGS, a folder with windows of long recordings and a table windows.csv (place, name, sha256,
repository, path, commit, part). Its agents are drawn, and tasks that one solves in time by standing are left out.
"""

from __future__ import annotations

import csv
import hashlib
import json
import sys
from pathlib import Path

import numpy as np

import interdrive
from interdrive import Scenario, SimulationSettings, read_scenario, shipped_scenario
from interdrive.adversaries.drivers import ADVERSARIES
from interdrive.errors import InterdriveError
from interdrive.files import join
from interdrive.prediction_evaluation.split import read_split
from interdrive.recordings import part_of
from interdrive.scenario.agents import select
from interdrive.scenario.native import core_road

ROOT = Path(__file__).resolve().parent.parent
TEXTS = {
    "public": "Public CommonRoad files: 1 to 71 vehicles each, recorded, simulated and invented traffic. They are not "
    "shipped; every file names the repository and commit that has it.",
    "shipped": "The scenarios that come with interdrive: works at once, too few for claims.",
}
#: What public-2 says beyond its files.
CLASSES = """traffic = ["recorded", "velocity_adjusting", "idm"]
counted = ["velocity_adjusting", "idm"]

[weights]
motorway = 0.3
junction = 0.3
town = 0.3
constructed = 0.1
"""
TEXT_2 = (
    "Planners among several kinds of traffic: public CommonRoad files, and passages through long recordings that are "
    "joined from windows (MONA motorway and on-ramp, inD Bendplatz; their terms of use are their own). Nothing is "
    "shipped; every file and window names the repository and commit that has it."
)
#: Places of public files that are neither towns nor invented.
ROADS = {
    "A9 near Munich": "motorway",
    "US 101, Los Angeles": "motorway",
    "Peachtree Street, Atlanta": "junction",
    "Lankershim Boulevard, Los Angeles": "junction",
}
#: Recordings: name of the place in windows.csv, class, category, split.
RECORDED = {
    "MONAEast": ("MONA-East", "motorway", "highway", "test"),
    "MONAMerge": ("MONA-Merge", "motorway", "merge", "dev"),
    "AachenBendplatz": ("inD Bendplatz, Aachen", "junction", "intersection", "test"),
}
#: At most so many agents of a file and of a recording, drawn with this seed, each present for so long at least [s].
OF_FILE, OF_RECORDING, SEED, PRESENT_MIN = 5, 60, 20261127, 4.0
#: So much of its time may a driver take, as `step.grace_factor`.
GRACE = 1.7

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


def stands_in_time(scenario: Scenario, number: int) -> bool:
    """One that stands reaches the goal of the agent in time: the task tells nothing apart."""
    stand = next(one.planner for one in ADVERSARIES if one.name == "Stand")
    run = interdrive.simulate(scenario, agents=[number], planner=stand, predictor="constant_velocity", threads=1)
    return run.outcomes.outcome == ("goal_reached",)


def public_2(folder: Path, recordings: Path) -> list[str]:
    """Entries of public-2."""
    whole = interdrive.benchmarks.read_set("public-1").files
    rng, found = np.random.default_rng(SEED), []
    paths = {hashlib.sha256(path.read_bytes()).hexdigest(): path for path in folder.rglob("*.xml")}
    for file in whole:
        if file.category == "format_edge_cases":
            continue
        scenario = read_scenario(paths[file.sha256])
        drawn = rng.permutation(file.agents)[: 2 * OF_FILE].tolist()
        ids = sorted([one for one in drawn if not stands_in_time(scenario, one)][:OF_FILE])
        if ids:
            road = "constructed" if file.traffic == "invented" else ROADS.get(file.place, "town")
            values = {**vars(file), "source": list(file.source), "agents": ids, "class": road}
            found.append(table("file", {name: values[name] for name in (*FIELDS, "agents", "class")}))
        print(file.name, len(ids), flush=True)
    for place in RECORDED:
        found.append(recording(place, recordings, rng))
    return found


#: Fields of a file in a set.
FIELDS = ("name", "sha256", "source", "category", "place", "traffic", "split")


def recording(place: str, folder: Path, rng: np.random.Generator) -> str:
    """A long recording with its passages."""
    name, road, category, split = RECORDED[place]
    with (folder / "windows.csv").open(encoding="utf-8") as windows:
        rows = [row for row in csv.DictReader(windows) if row["place"] == place and row["part"] == "public"]
    parts = [[row[key] for key in ("name", "sha256", "repository", "path", "commit")] for row in rows]
    joined = join([next(folder.rglob(f"{part[0]}.xml")) for part in parts])
    obstacles, passages = joined.obstacles, []
    for row in rng.permutation(len(obstacles.ids)).tolist():
        there, number = np.flatnonzero(obstacles.valid[row]), int(obstacles.ids[row])
        if obstacles.is_static[row] or len(there) * joined.dt < PRESENT_MIN or np.diff(there).max(initial=1) > 1:
            continue
        first, end = int(there[0]), int(there[0]) + int(np.ceil(GRACE * (len(there) - 1))) + 2
        part = part_of(joined, first, min(end, obstacles.valid.shape[1]))
        try:
            if stands_in_time(part, number):
                continue
        except InterdriveError:
            continue
        passages.append([number, first, end])
        if len(passages) == OF_RECORDING:
            break
    print(place, len(passages), flush=True)
    values = {"name": place, "category": category, "place": name, "traffic": "recorded", "split": split, "class": road}
    return table("recording", {**values, "parts": parts, "passages": sorted(passages)})


def table(kind: str, values: dict[str, object]) -> str:
    """An entry as TOML."""
    return f"[[{kind}]]\n" + "".join(f"{name} = {json.dumps(value)}\n" for name, value in values.items() if value)


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
    return table("file", values)


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
    kind, text, more = name.partition("-")[0], "", ""
    if name == "public-2":
        entries, text, more = public_2(Path(sys.argv[2]), Path(sys.argv[3])), TEXT_2, CLASSES
    else:
        entries, text = shipped() if kind == "shipped" else public(Path(sys.argv[2])), TEXTS[kind]
    head = f"# Made by benchmarks/sets.py with interdrive {interdrive.__version__}. Never edited: hashes are known.\n"
    target.write_text(f"{head}text = {json.dumps(text)}\n{more}\n" + "\n".join(entries), encoding="utf-8")
    print(f"{len(entries)} files in {target}")


if __name__ == "__main__":
    main()
