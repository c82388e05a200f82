"""How many roll-outs of the planner `rollout` are judged per plan, see docs/reference/planner_rollout.md.

    python benchmarks/driving/rollouts.py                          # in $INTERDRIVE_SCENARIOS or ../shared/scenarios
    python benchmarks/driving/rollouts.py --agents 24 FILE ...     # 24 agents per scenario

Counts the roll-outs whose contacts were looked at, of every new plan of every agent. A plan also drives roll-outs that
cost too much before that; they are not counted. Prints Markdown; the numbers do not depend on the machine.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from places import category_of, scenario_files

from interdrive.errors import InterdriveError
from interdrive.files import scenario_folders
from interdrive.simulation import simulate

ROOT = Path(__file__).resolve().parents[2]
#: All roll-outs of every plan are kept.
SETTINGS = {"record.candidates": 10_000, "record.candidate_spacing": 1e-3}


def counts(path: Path, agents: int | None) -> list[int]:
    """Roll-outs of every plan of a scenario; of none if it cannot be run."""
    try:
        run = simulate(
            path, agents="all" if agents is None else agents, planner="rollout", settings=SETTINGS, threads=1
        )
    except InterdriveError as error:
        print(f"{path.name}: {error}", file=sys.stderr)
        return []
    found = run.candidates
    if found is None:
        return []
    _, number = np.unique(np.stack([found.time_step, found.agent_id]), axis=1, return_counts=True)
    return [int(one) for one in number]


def main() -> None:
    parser = argparse.ArgumentParser(prog="rollouts", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("files", type=Path, nargs="*")
    parser.add_argument("--agents", type=int, help="per scenario; all vehicles otherwise")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    folder = next(iter(scenario_folders()), ROOT.parent / "shared" / "scenarios")
    files = arguments.files or scenario_files(folder)
    by_name: dict[str, list[int]] = defaultdict(list)
    with ProcessPoolExecutor(arguments.workers) as pool:
        for path, number in zip(files, pool.map(counts, files, [arguments.agents] * len(files)), strict=True):
            by_name[path.stem if arguments.files else category_of(path)] += number
    by_name["all"] = [one for number in by_name.values() for one in number]
    print("| | plans | mean | median | 90 % | 99 % | most |\n|---|--:|--:|--:|--:|--:|--:|")
    for name, number in by_name.items():
        if number:
            quantiles = (f"{one:.0f}" for one in np.quantile(number, (0.5, 0.9, 0.99, 1.0)))
            print(f"| {name} | {len(number)} | {np.mean(number):.1f} | {' | '.join(quantiles)} |")


if __name__ == "__main__":
    main()
