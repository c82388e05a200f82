"""Maps and recordings of other tools: what is read, how fast, with how much memory, and whether agents get through.

python benchmarks/inputs.py FOLDER

FOLDER holds maps and recordings by format: `xodr`, `womd` and others. Prints the tables of docs/research/inputs.md.
Every file is read in its own process.
"""

from __future__ import annotations

import argparse
import dataclasses
import gzip
import json
import random
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import interdrive as idr
from interdrive.scenario import GoalState, InitialState, PlanningProblem, Shape

#: Reads a file: seconds from the call to the scenario, to the first step, and bytes that the peak rose by.
READ = """
import json, resource, sys, time
begun = time.perf_counter()
import interdrive as idr
options = json.loads(sys.argv[2])
peak = lambda: 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
if sys.argv[3]:
    idr.read_source(sys.argv[3], **options)  # so that what is imported on first use is not counted
before, called = peak(), time.perf_counter()
scenario = idr.read_source(sys.argv[1], **options)
print(json.dumps({"read": time.perf_counter() - called, "whole": time.perf_counter() - begun,
                  "memory": peak() - before, "lanelets": len(scenario.lanelets.ids)}))
"""
#: As long as a goal is away [m], and starts from each other [m].
WAY, APART = 300.0, 12.0


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", type=int, default=5, help="draws of traffic for each town")
    arguments = parser.parse_args()
    print(converted(arguments.folder))
    print(speed(arguments.folder))
    print(drives(arguments.folder, arguments.seeds))


def converted(folder: Path) -> str:
    """How many maps `interdrive convert` writes, and the slowest of them."""
    codes, times = [], {}
    paths = sorted((folder / "xodr").iterdir())
    with tempfile.TemporaryDirectory() as target:
        for path in paths:
            words = ["convert", str(path), "--out", str(Path(target, "map.xml")), "--overwrite", "--quiet"]
            codes.append(subprocess.run([sys.executable, "-m", "interdrive", *words], check=False).returncode)
            times[path.name] = read(path)["read"]
    slowest = max(times, key=lambda name: times[name])
    return f"\n| OpenDRIVE maps | exit code 0 | slowest |\n|--:|--:|---|\n| {len(paths)} | {codes.count(0)} | {slowest}, {times[slowest]:.2f} s |"


def speed(folder: Path) -> str:
    """Time and memory of the larger files."""
    rows = ["\n| file | size | lanelets | read | whole process | memory / size |", "|---|--:|--:|--:|--:|--:|"]
    for path in [*sorted((folder / "xodr").glob("Town*")), *sorted((folder / "womd").iterdir())]:
        data = path.read_bytes()
        size = len(gzip.decompress(data) if path.suffix == ".gz" else data)
        found = read(path)
        warm = read(path, first=smallest(path))
        rows.append(
            f"| {path.name} | {1e-6 * size:.1f} MB | {found['lanelets']:.0f} | {found['read']:.2f} s | "
            f"{found['whole']:.2f} s | {warm['memory'] / size:.1f} |"
        )
    return "\n".join(rows)


def smallest(path: Path) -> str:
    """The smallest file of the same format."""
    return str(min(path.parent.iterdir(), key=lambda other: other.stat().st_size))


def read(path: Path, first: str = "") -> dict[str, float]:
    """What `READ` measures of a file."""
    command = [sys.executable, "-c", READ, str(path), json.dumps({}), first]
    found: dict[str, float] = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return found


def drives(folder: Path, seeds: int) -> str:
    """Agents in time on towns with traffic that is drawn here, and in recorded scenes."""
    rows = ["\n| maps | agents | in time | collisions |", "|---|--:|--:|--:|"]
    for path in sorted((folder / "xodr").glob("Town*")):
        roads = idr.read_source(path)
        outcomes = [
            outcome
            for seed in range(1, seeds + 1)
            for outcome in idr.simulate(with_vehicles(roads, 30, seed), agents="problems").outcomes.outcome
        ]
        rows.append(row(path.name, outcomes))
    scenes = sorted((folder / "womd").iterdir())
    rows.append(
        row(
            f"{len(scenes)} scenes of Waymo",
            [outcome for path in scenes for outcome in idr.simulate(path, agents="all").outcomes.outcome],
        )
    )
    return "\n".join(rows)


def row(name: str, outcomes: list[str]) -> str:
    """A line of the table of agents."""
    return f"| {name} | {len(outcomes)} | {outcomes.count('goal_reached')} | {outcomes.count('collision')} |"


def with_vehicles(roads: idr.Scenario, n: int, seed: int) -> idr.Scenario:
    """Roads with at most `n` vehicles that start at random, far enough from each other, and drive some way each."""
    drawn, lanelets = random.Random(seed), roads.lanelets
    middles = [0.5 * (left + right) for left, right in zip(lanelets.left, lanelets.right, strict=True)]
    along = [np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(middle, axis=0).T)))) for middle in middles]
    driven = [row for row, kinds in enumerate(lanelets.types) if "crosswalk" not in kinds]
    starts = [row for row in driven if along[row][-1] > 15.0 and lanelets.successors[row]]
    rows = {number: row for row, number in enumerate(lanelets.ids.tolist())}
    problems: list[PlanningProblem] = []
    for first in drawn.sample(starts, len(starts)):
        x, y = (float(np.interp(6.0, along[first], axis)) for axis in middles[first].T)
        near = (np.hypot(x - one.initial_state.x, y - one.initial_state.y) < APART for one in problems)
        if len(problems) == n or any(near):
            continue
        way, length = [first], 0.0
        while length < WAY and (ahead := [rows[one] for one in lanelets.successors[way[-1]] if rows[one] not in way]):
            way.append(drawn.choice(ahead))
            length += float(along[way[-1]][-1])
        goal = way[-1]
        piece = int(np.searchsorted(along[first], 6.0))
        ahead = middles[first][piece] - middles[first][piece - 1]
        limit = float(lanelets.speed_limit[first])
        start = InitialState(0, x, y, float(np.arctan2(ahead[1], ahead[0])), min(8.0, limit if limit > 0.0 else 8.0))
        outline = np.concatenate((lanelets.left[goal], lanelets.right[goal][::-1]))
        aim = GoalState((Shape("polygon", vertices=outline),), (int(lanelets.ids[goal]),), (1, 900))
        problems.append(PlanningProblem(1001 + len(problems), start, (aim,)))
    return dataclasses.replace(roads, planning_problems=tuple(problems))


if __name__ == "__main__":
    main()
