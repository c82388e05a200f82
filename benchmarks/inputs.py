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
import math
import random
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import interdrive as idr
from interdrive.scenario import GoalState, InitialState, PlanningProblem, Shape

#: As long as a goal is away [m], and starts from each other [m].
WAY, APART = 300.0, 12.0


def main() -> None:
    """Prints the tables, or with `--one` what the process that reads one file has measured."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", type=int, default=5, help="draws of traffic for each town")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--first", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        print(json.dumps(one(arguments.folder, arguments.first)))
        return
    print(converted(arguments.folder))
    print(speed(arguments.folder))
    print(drives(arguments.folder, arguments.seeds))


def one(path: Path, first: Path | None) -> dict[str, float]:
    """Seconds of processor time from the call to the scenario, and to the first step; by how much memory rises [B].

    With another file of the format that is read before, what is imported on first use does not count.
    """
    if first is not None:
        idr.read_source(first)
    begun, peak = time.process_time(), _peak()
    scenario = idr.read_source(path)
    read = time.process_time() - begun
    found = {"read": read, "memory": _peak() - peak, "lanelets": float(len(scenario.lanelets.ids)), "step": math.nan}
    busy = with_vehicles(scenario, 30, 1)
    if busy.planning_problems and not len(scenario.obstacles.ids):
        begun = time.process_time()
        idr.Simulation(busy, agents="problems", threads=1).step()
        found["step"] = read + time.process_time() - begun
    return found


def _peak() -> float:
    return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def converted(folder: Path) -> str:
    """How many maps `interdrive convert` writes, and the slowest of them."""
    codes, times = [], {}
    paths = sorted((folder / "xodr").iterdir())
    with tempfile.TemporaryDirectory() as target:
        for path in paths:
            words = ["convert", str(path), "--out", str(Path(target, "map.xml")), "--overwrite", "--quiet"]
            codes.append(subprocess.run([sys.executable, "-m", "interdrive", *words], check=False).returncode)
            times[path.name] = measured(path)["read"]
    slowest = max(times, key=lambda name: times[name])
    return (
        "\n| OpenDRIVE maps | exit code 0 | slowest |\n|--:|--:|---|\n"
        f"| {len(paths)} | {codes.count(0)} | {slowest}, {times[slowest]:.2f} s |"
    )


def speed(folder: Path) -> str:
    """Time and memory of the larger files."""
    rows = ["\n| file | size | lanelets | to the scenario | to the first step | memory / size |"]
    rows.append("|---|--:|--:|--:|--:|--:|")
    for path in [*sorted((folder / "xodr").glob("Town*")), *sorted((folder / "womd").iterdir())]:
        data = path.read_bytes()
        size = len(gzip.decompress(data) if path.suffix == ".gz" else data)
        found = measured(path)
        found["memory"] = measured(path, min(path.parent.iterdir(), key=lambda other: other.stat().st_size))["memory"]
        step = "" if math.isnan(found["step"]) else f"{found['step']:.2f} s"
        rows.append(
            f"| {path.name} | {1e-6 * size:.1f} MB | {found['lanelets']:.0f} | {found['read']:.2f} s | {step} | "
            f"{found['memory'] / size:.1f} |"
        )
    return "\n".join(rows)


def measured(path: Path, first: Path | None = None) -> dict[str, float]:
    """What `one` says in a process of its own."""
    command = [sys.executable, __file__, str(path), "--one", *(("--first", str(first)) if first else ())]
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
