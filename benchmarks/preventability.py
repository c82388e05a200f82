"""Collisions and near misses of the native planners, and what reference drivers would have avoided of them.

python benchmarks/preventability.py FOLDER ... [--every 4] [--agents 10] [--planners cc,idm,...]

FOLDER holds CommonRoad files, at any depth. Prints the table of docs/research/preventability.md, then each collision
that a careful and competent driver would not have avoided.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import interdrive as idr
from interdrive.reference_drivers import DRIVERS
from interdrive.scoring import preventability

PLANNERS = "rollout,frenet,idm,idm_mobil,lawful,velocity_adjusting,cc,r157,rss,fsm"


def judged(path: Path, planner: str, agents: int | str) -> tuple[int, Counter[str], list[str]]:
    """Number of agents, counts by what happened and verdict, and a line per collision that `cc` has, too."""
    counts: Counter[str] = Counter()
    lines: list[str] = []
    try:
        run = idr.simulate(path, agents=agents, planner=planner, predictor="lane_following", threads=1)
    except idr.InputError:
        return 0, counts, lines
    found = preventability(run)
    for row, kind in enumerate(found.kind):
        counts[kind] += 1
        counts[f"{kind} without a verdict"] += bool(found.undefined[row])
        for driver in DRIVERS:
            counts[f"{kind} {driver}"] += int(found.preventable[driver][row] == 1.0)
        if kind == "collision" and found.preventable["cc"][row] == 0.0:
            lines.append(f"{path.stem}, {planner}, agent {found.agent_id[row]}: {found.words[row]}")
    return len(run.agents), counts, lines


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--every", type=int, default=4, help="take every n-th file")
    parser.add_argument("--agents", type=int, default=10, help="at most so many agents per file")
    parser.add_argument("--planners", default=PLANNERS)
    options = parser.parse_args()
    files = sorted(path for folder in options.folders for path in folder.rglob("*.xml"))[:: options.every]
    print(f"{len(files)} files, at most {options.agents} agents each\n")
    print(
        "| planner | agents | collisions | no verdict | avoided by cc, r157, rss, fsm | near misses | no verdict | cc |"
    )
    print("|---|--:|--:|--:|--:|--:|--:|--:|")
    lines: list[str] = []
    for planner in options.planners.split(","):
        agents, counts = 0, Counter[str]()
        for path in files:
            n, more, told = judged(path, planner, options.agents)
            agents, lines = agents + n, lines + told
            counts.update(more)
        avoided = ", ".join(str(counts[f"collision {driver}"]) for driver in DRIVERS)
        near = " | ".join(str(counts[name]) for name in ("near_miss", "near_miss without a verdict", "near_miss cc"))
        hits = f"{counts['collision']} | {counts['collision without a verdict']}"
        print(f"| `{planner}` | {agents} | {hits} | {avoided} | {near} |", flush=True)
    print("\n" + "\n".join(lines))


if __name__ == "__main__":
    main()
