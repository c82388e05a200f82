"""Collisions and near misses of the native planners, and what reference drivers would have avoided of them.

python benchmarks/preventability.py FOLDER ... [--every 1] [--agents 10] [--planners cc,idm,...] [--traffic PLANNER]
    [--set SET --split PART] [--out DIR]

FOLDER holds CommonRoad files, at any depth; with --set only those of a part of a benchmark set count. With --traffic
each agent is driven alone, while all others that can be agents have that planner. Prints the table of
docs/research/preventability.md, then each collision that a careful and competent driver would not have avoided, with
its fault. DIR gets conflicts.csv, a row per collision and near miss, and without --traffic the folder of each run
(`interdrive report` draws it); what is there already is not driven again.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import interdrive as idr
from interdrive.benchmarks.sets import read_set
from interdrive.reference_drivers import DRIVERS
from interdrive.scoring import preventability, score

if TYPE_CHECKING:
    from collections.abc import Iterator

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
        if number != "all" and len(run.agents) < number:
            continue  # where there are fewer, a number may be the id of one
        if folder is not None:
            run.save(folder)
        return run
    return None


def alone(path: Path, planner: str, agents: int, traffic: str) -> Iterator[tuple[Any, int]]:
    """Runs of a file in each of which one agent has the planner, and the agent."""
    every = idr.Simulation(path, agents="all", threads=1)
    known = [agent.id for agent in every.agents]
    chosen = idr.Simulation(path, agents=min(agents, len(known)), seed=1, threads=1)
    recorded = set(every.scenario.obstacles.ids.tolist())
    for agent in chosen.agents:
        others = [number for number in known if number != agent.id and number in recorded]
        run = idr.simulate(
            path,
            agents=[agent.id, *others],
            planner={agent.id: planner, "default": traffic},
            predictor="lane_following",
            threads=1,
        )
        yield run, agent.id


def conflicts(path: Path, planner: str, options: argparse.Namespace) -> tuple[int, list[dict[str, Any]]]:
    """Number of agents of a file, and a row per conflict: what happened, each verdict, and the fault by blame."""
    if options.traffic is None:
        run = driven(path, planner, options.agents, options.out)
        return (0, []) if run is None else (len(run.agents), judged(run, None, path, planner))
    agents, rows = 0, list[dict[str, Any]]()
    try:
        for run, number in alone(path, planner, options.agents, options.traffic):
            agents, rows = agents + 1, rows + judged(run, [number], path, planner)
    except idr.InputError as error:
        print(f"{path.stem}, {planner}: {error}", file=sys.stderr)
    return agents, rows


def judged(run: Any, ids: list[int] | None, path: Path, planner: str) -> list[dict[str, Any]]:  # noqa: ANN401 - a run
    """A row per conflict of the agents, or of all."""
    rows: list[dict[str, Any]] = preventability(run, ids).to_arrow().to_pylist()
    collided = [row["agent_id"] for row in rows if row["kind"] == "collision"]
    scores = score(run, collided) if collided else None
    faults = {} if scores is None else dict(zip(scores.ids.tolist(), scores.fault_kind, strict=True))
    for row in rows:
        fault = faults.get(row["agent_id"], "") if row["kind"] == "collision" else ""
        row.update(scenario=path.stem, planner=planner, fault_kind=fault)
    return rows


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
    parser.add_argument("--traffic", metavar="PLANNER", help="each agent alone, the others with this planner")
    parser.add_argument("--set", metavar="SET", help="only files of this benchmark set")
    parser.add_argument("--split", metavar="PART", default="test", help="its part: test, dev or all (test)")
    parser.add_argument("--out", type=Path, help="folder for conflicts.csv and runs with collisions")
    options = parser.parse_args()
    files = sorted(path for folder in options.folders for path in folder.rglob("*.xml"))
    if options.set is not None:
        part = read_set(options.set).of_split(options.split)
        here = {path.stem: path for path in files}
        files = [here[file.name] for file in part if file.name in here]
    files = files[:: options.every]
    print(f"{len(files)} files, at most {options.agents} agents each; those without any are left out\n")
    print(
        "| planner | agents | collisions | at fault | no verdict | avoided by cc, r157, rss, fsm "
        "| near misses | no verdict | cc |"
    )
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    rows: list[dict[str, Any]] = []
    for planner in options.planners.split(","):
        agents, found = 0, list[dict[str, Any]]()
        for path in files:
            n, more = conflicts(path, planner, options)
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
