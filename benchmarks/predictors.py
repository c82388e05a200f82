"""Drives every scenario of a folder once per predictor, all agents with one planner, and compares what came of it.

    python benchmarks/predictors.py ../shared/scenarios --out out/closed_loop.parquet

Prints Markdown: agents that reach their goal and collisions per 100 agents by category and predictor, and agent by
agent against the first predictor. The Parquet file has a row per predictor and agent; it is written anew whenever a
predictor is through. Results do not depend on the number of workers.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from interdrive.errors import InterdriveError
from interdrive.prediction_evaluation.evaluation import chosen_predictors
from interdrive.prediction_evaluation.recordings import CATEGORIES, Recording, category_of, found_files
from interdrive.predictors.calls import name_of
from interdrive.results import Column, arrow_table, labels, replacing, write_table
from interdrive.run_settings import SimulationSettings
from interdrive.simulation import simulate
from interdrive.testing import straight_road, world

COLUMNS = (
    Column("predictor", "label", ""),
    Column("category", "label", ""),
    Column("file", "label", "name of the scenario file"),
    Column("agent_id", "integer", ""),
    Column("outcome", "label", "how it ended"),
    Column("time_step", "integer", "when"),
    Column("partner_id", "integer", "the other participant of a collision", nullable=True),
    Column("partner_is_agent", "truth", "it was driven by a planner, too"),
    Column("off_road", "truth", "the collision was with the edge of the road"),
)
REACHED = ("goal_reached", "goal_reached_late")


@dataclass(frozen=True)
class Ended:
    """How one agent ended."""

    predictor: str
    category: str
    file: str
    agent_id: int
    outcome: str
    time_step: int
    partner_id: int
    partner_is_agent: bool
    off_road: bool


def drive(path: Path, predictor: object, planner: str) -> list[Ended] | str:
    """Every agent of a scenario; or why it cannot be driven."""
    try:
        run = simulate(path, planner=planner, predictor=predictor, threads=1)
    except InterdriveError as error:
        return str(error).removeprefix(f"{path}: ")
    ended = run.outcomes
    agents = set(ended.agent_id.tolist())
    return [
        Ended(
            name_of(predictor),
            category_of(path),
            path.name,
            int(ended.agent_id[i]),
            ended.outcome[i],
            int(ended.time_step[i]),
            int(ended.partner_id[i]),
            int(ended.partner_id[i]) in agents,
            bool(ended.off_road[i]),
        )
        for i in range(len(ended.agent_id))
    ]


def drive_all(
    paths: Sequence[Path], predictor: object, planner: str, pool: ProcessPoolExecutor
) -> Iterator[tuple[Path, list[Ended] | str]]:
    """All scenarios in their order; the large files are begun first."""
    begun = sorted(paths, key=lambda path: (-path.stat().st_size, path))
    futures = {path: pool.submit(drive, path, predictor, planner) for path in begun}
    for path in paths:
        yield path, futures[path].result()


def write(rows: Sequence[Ended], path: Path) -> None:
    values: dict[str, object] = {}
    for column in COLUMNS:
        entries = [getattr(row, column.name) for row in rows]
        values[column.name] = labels(tuple(entries)) if column.kind == "label" else entries
    values["partner_id"] = np.ma.masked_equal(values["partner_id"], -1)
    with replacing(path) as partial:
        write_table(arrow_table(COLUMNS, values), partial)


def summary(rows: Sequence[Ended], names: Sequence[str]) -> Iterator[str]:
    """Markdown: a line per category and predictor."""
    yield "| category | predictor | scenarios | agents | reach their goal | in time | collisions per 100 agents |"
    yield "|---|---|--:|--:|--:|--:|--:|"
    there = {row.category for row in rows}
    order = [*(name for name in CATEGORIES if name in there), *sorted(there - set(CATEGORIES)), "all"]
    for category in order:
        for name in names:
            part = [row for row in rows if row.predictor == name and category in (row.category, "all")]
            if not part:
                continue
            reached = sum(row.outcome in REACHED for row in part)
            in_time = sum(row.outcome == "goal_reached" for row in part)
            crashed = sum(row.outcome == "collision" for row in part)
            yield (
                f"| {category} | {name} | {len({row.file for row in part})} | {len(part)} "
                f"| {100 * reached / len(part):.1f} % | {100 * in_time / len(part):.1f} % "
                f"| {100 * crashed / len(part):.2f} |"
            )


def kinds(rows: Sequence[Ended], names: Sequence[str]) -> Iterator[str]:
    """Markdown: what was hit, and other ends."""
    yield "| predictor | hit an agent | hit recorded traffic | hit the road's edge | infeasible | other ends |"
    yield "|---|--:|--:|--:|--:|--:|"
    for name in names:
        part = [row for row in rows if row.predictor == name]
        hits = [row for row in part if row.outcome == "collision"]
        edge = sum(row.off_road for row in hits)
        agent = sum(row.partner_is_agent and not row.off_road for row in hits)
        infeasible = sum(row.outcome == "infeasible" for row in part)
        other = sum(row.outcome not in (*REACHED, "collision", "infeasible") for row in part)
        yield f"| {name} | {agent} | {len(hits) - edge - agent} | {edge} | {infeasible} | {other} |"


def pairs(rows: Sequence[Ended], names: Sequence[str]) -> Iterator[str]:
    """Markdown: the same agent with another predictor."""
    yield f"| predictor | reaches its goal, not with {names[0]} | other way round | collides, not with it | other way |"
    yield "|---|--:|--:|--:|--:|"
    ends = {name: {(r.file, r.agent_id): r.outcome for r in rows if r.predictor == name} for name in names}
    for name in names[1:]:
        both = [(ends[name][key], ends[names[0]][key]) for key in ends[name] if key in ends[names[0]]]
        gained = sum(a in REACHED and b not in REACHED for a, b in both)
        lost = sum(a not in REACHED and b in REACHED for a, b in both)
        hits = sum(a == "collision" and b != "collision" for a, b in both)
        spared = sum(a != "collision" and b == "collision" for a, b in both)
        yield f"| {name} | {gained} | {lost} | {hits} | {spared} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sources", nargs="+", help="files, folders, shipped scenarios")
    parser.add_argument("--predictors", default="lane_following all", help="names with settings, separated by blanks")
    parser.add_argument("--planner", default="frenet")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out/closed_loop.parquet"))
    arguments = parser.parse_args()
    try:
        paths = [path for path, _ in found_files(arguments.sources)]
        settings = SimulationSettings()
        nowhere = Recording(world(straight_road()), settings)
        choices, notes = chosen_predictors(arguments.predictors.split(), settings, nowhere)
    except InterdriveError as error:
        sys.exit(f"error: {error}")
    names = [name_of(choice) for choice in choices]
    rows: list[Ended] = []
    refused: dict[str, str] = {}
    with ProcessPoolExecutor(arguments.workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        for choice in choices:
            start = time.perf_counter()
            for path, found in drive_all(paths, choice, arguments.planner, pool):
                if isinstance(found, str):
                    refused[path.name] = found
                else:
                    rows += found
            write(rows, arguments.out)
            print(f"{name_of(choice)}: {time.perf_counter() - start:.0f} s", file=sys.stderr)
    for table in (summary, kinds, pairs):
        print("\n".join(table(rows, names)), end="\n\n")
    print(f"Planner {arguments.planner}, all agents. {len(refused)} files cannot be driven.")
    print("\n".join([f"- {name}: {why}" for name, why in refused.items()] + [f"- {note}" for note in notes]))


if __name__ == "__main__":
    main()
