"""Collisions and near misses of the native planners, and what reference drivers would have avoided of them.

python benchmarks/preventability.py FOLDER ... [--every 1] [--agents 10] [--planners cc,idm,...] [--out DIR]

FOLDER holds CommonRoad files, at any depth. Prints the table of docs/research/preventability.md, then each collision
that a careful and competent driver would not have avoided, with its fault. DIR gets conflicts.csv, a row per collision
and near miss, and the folder of each run (`interdrive report` draws it); what is there already is not driven again.
"""

from __future__ import annotations

import argparse
import csv
from collections import Counter
from pathlib import Path
from typing import Any

import interdrive as idr
from interdrive.reference_drivers import DRIVERS
from interdrive.scoring import preventability, score

PLANNERS = "rollout,frenet,idm,idm_mobil,lawful,velocity_adjusting,cc,r157,rss,fsm"


def driven(path: Path, planner: str, agents: int, out: Path | None) -> Any:  # noqa: ANN401 - a run, or None
    """The run of a file, with all its agents where it has fewer; None if nothing in it can be an agent."""
    folder = None if out is None else out / planner / path.stem
    if folder is not None and (folder / "run.json").exists():
        return idr.load(folder)
    for number in (agents, "all"):
        try:
            run = idr.simulate(path, agents=number, planner=planner, predictor="lane_following", threads=1)
        except idr.InputError:
            continue
        if folder is not None:
            run.save(folder)
        return run
    return None


def conflicts(path: Path, planner: str, agents: int, out: Path | None) -> tuple[int, list[dict[str, Any]]]:
    """Number of agents of a file, and a row per conflict: what happened, each verdict, and the fault by blame."""
    run = driven(path, planner, agents, out)
    if run is None:
        return 0, []
    rows = preventability(run).to_arrow().to_pylist()
    collided = [row["agent_id"] for row in rows if row["kind"] == "collision"]
    judged = score(run, collided) if collided else None
    faults = {} if judged is None else dict(zip(judged.ids.tolist(), judged.fault_kind, strict=True))
    for row in rows:
        fault = faults.get(row["agent_id"], "") if row["kind"] == "collision" else ""
        row.update(scenario=path.stem, planner=planner, fault_kind=fault)
    return len(run.agents), rows


def table_row(planner: str, agents: int, rows: list[dict[str, Any]]) -> str:
    """The line of a planner in the table."""
    counts: Counter[str] = Counter()
    for row in rows:
        counts[row["kind"]] += 1
        counts[f"{row['kind']} without a verdict"] += bool(row["undefined"])
        counts["faults"] += bool(row["fault_kind"])
        for driver in DRIVERS:
            counts[f"{row['kind']} {driver}"] += row[f"preventable_{driver}"] is True
    avoided = ", ".join(str(counts[f"collision {driver}"]) for driver in DRIVERS)
    near = " | ".join(str(counts[name]) for name in ("near_miss", "near_miss without a verdict", "near_miss cc"))
    hits = f"{counts['collision']} | {counts['faults']} | {counts['collision without a verdict']}"
    return f"| `{planner}` | {agents} | {hits} | {avoided} | {near} |"


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--every", type=int, default=1, help="take every n-th file")
    parser.add_argument("--agents", type=int, default=10, help="at most so many agents per file")
    parser.add_argument("--planners", default=PLANNERS)
    parser.add_argument("--out", type=Path, help="folder for conflicts.csv and runs with collisions")
    options = parser.parse_args()
    files = sorted(path for folder in options.folders for path in folder.rglob("*.xml"))[:: options.every]
    print(f"{len(files)} files, at most {options.agents} agents each; those without any are left out\n")
    print(
        "| planner | agents | collisions | at fault | no verdict | avoided by cc, r157, rss, fsm "
        "| near misses | no verdict | cc |"
    )
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    rows: list[dict[str, Any]] = []
    for planner in options.planners.split(","):
        agents, found = 0, []
        for path in files:
            n, more = conflicts(path, planner, options.agents, options.out)
            agents, found = agents + n, found + more
        print(table_row(planner, agents, found), flush=True)
        rows += found
    print()
    for row in rows:
        if row["kind"] == "collision" and row["preventable_cc"] is False:
            fault = f" (at fault: {row['fault_kind']})" if row["fault_kind"] else ""
            print(f"{row['scenario']}, {row['planner']}, agent {row['agent_id']}{fault}: {row['words']}")
    if options.out is not None and rows:
        options.out.mkdir(parents=True, exist_ok=True)
        with (options.out / "conflicts.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, rows[0], lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
