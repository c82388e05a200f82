"""Drives every scenario of a folder once per predictor, all agents with one planner, and compares what came of it.

    python benchmarks/predictors.py ../shared/scenarios --out out/closed_loop.parquet

Prints Markdown: agents that reach their goal and collisions per 100 agents by category and predictor, and agent by
agent against `lane_following` (without it, against the first predictor); agents at places whose recordings the shipped
weights of `neural` were trained on, and at others, apart. The Parquet file has a row per predictor and agent, with the
file and whether that is such a place; it is written anew whenever a predictor is through. Results do not depend on the
number of workers. Exit code 1 says that a predictor failed somewhere.
"""

from __future__ import annotations

import argparse
import hashlib
import multiprocessing
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from interdrive.config.plugins import DEFAULT_PLANNER
from interdrive.config.schema import SimulationSettings
from interdrive.config.specs import Resolved
from interdrive.errors import InterdriveError, PredictorError
from interdrive.prediction_evaluation.evaluation import chosen_predictors
from interdrive.prediction_evaluation.recordings import CATEGORIES, Recording, category_of, found_files
from interdrive.prediction_evaluation.split import Split, read_split
from interdrive.simulation import simulate
from interdrive.storage import Column, Origin, arrow_table, labels, replacing, write_table
from interdrive.testing import straight_road, world

COLUMNS = (
    Column("predictor", "label", ""),
    Column("category", "label", ""),
    Column("file", "label", "name of the scenario file"),
    Column("trained_on", "truth", "the shipped weights of neural were trained on recordings of this place"),
    Column("agent_id", "integer", ""),
    Column("outcome", "label", "how it ended"),
    Column("time_step", "integer", "when"),
    Column("partner_id", "integer", "the other participant of a collision", null="no value"),
    Column("partner_is_agent", "truth", "it was driven by a planner, too"),
    Column("off_road", "truth", "the collision was with the edge of the road"),
)
REACHED = ("goal_reached", "goal_reached_late")
#: The split that the shipped weights were trained with, and its parts that were not trained on.
SPLIT = Path(__file__).resolve().parent.parent / "training" / "split.toml"
NOT_TRAINED_ON = ("validation", "none")


@dataclass(frozen=True)
class Ended:
    """How one agent ended."""

    predictor: str
    category: str
    file: str
    trained_on: bool
    agent_id: int
    outcome: str
    time_step: int
    partner_id: int
    partner_is_agent: bool
    off_road: bool


@dataclass(frozen=True)
class Refused:
    """Why a scenario was not driven to its end: it cannot be, or the predictor failed in it."""

    why: str
    is_failure: bool


def drive(path: Path, trained_on: bool, predictor: Resolved, planner: str) -> list[Ended] | Refused:
    """Every agent of a scenario."""
    try:
        run = simulate(path, planner=planner, predictor=predictor, threads=1)
    except InterdriveError as error:
        return Refused(str(error).removeprefix(f"{path}: "), isinstance(error, PredictorError))
    ended = run.outcomes
    agents = set(ended.agent_id.tolist())
    return [
        Ended(
            predictor.label,
            category_of(path),
            path.name,
            trained_on,
            int(ended.agent_id[i]),
            ended.outcome[i],
            int(ended.time_step[i]),
            int(ended.partner_id[i]),
            int(ended.partner_id[i]) in agents,
            bool(ended.off_road[i]),
        )
        for i in range(len(ended.agent_id))
    ]


def is_trained_on(path: Path, split: Split) -> bool:
    """Whether the shipped weights were trained on recordings of the place that a file shows."""
    place = split.place_of(path)
    return place is not None and place.part not in NOT_TRAINED_ON


def drive_all(
    paths: Sequence[Path], split: Split, predictor: object, planner: str, pool: ProcessPoolExecutor
) -> Iterator[tuple[Path, list[Ended] | Refused]]:
    """All scenarios in their order; the large files are begun first."""
    begun = sorted(paths, key=lambda path: (-path.stat().st_size, path))
    futures = {path: pool.submit(drive, path, is_trained_on(path, split), predictor, planner) for path in begun}
    for path in paths:
        yield path, futures[path].result()


def write(rows: Sequence[Ended], path: Path, inputs: Sequence[Path]) -> None:
    values: dict[str, object] = {}
    digests = {one.name: hashlib.sha256(one.read_bytes()).hexdigest() for one in inputs}
    for column in COLUMNS:
        entries = [getattr(row, column.name) for row in rows]
        values[column.name] = labels(tuple(entries)) if column.kind == "label" else entries
    values["partner_id"] = np.ma.masked_equal(values["partner_id"], -1)
    with replacing(path) as partial:
        write_table(arrow_table(COLUMNS, values), partial, Origin(inputs=digests))


def summary(rows: Sequence[Ended], names: Sequence[str]) -> Iterator[str]:
    """Markdown: a line per category and predictor, then for all places, those that `neural` was trained on, others."""
    yield "| category | predictor | scenarios | agents | reach their goal | in time | collisions per 100 agents |"
    yield "|---|---|--:|--:|--:|--:|--:|"
    there = {row.category for row in rows}
    order = [*(name for name in CATEGORIES if name in there), *sorted(there - set(CATEGORIES))]
    parts = {name: [row for row in rows if row.category == name] for name in order} | {
        "all": rows,
        "all, neural was trained there": [row for row in rows if row.trained_on],
        "all, neural was not trained there": [row for row in rows if not row.trained_on],
    }
    for category, those in parts.items():
        for name in names:
            part = [row for row in those if row.predictor == name]
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
    reference = "lane_following" if "lane_following" in names else names[0]
    yield f"| predictor | reaches its goal, not with {reference} | other way | collides, not with it | other way |"
    yield "|---|--:|--:|--:|--:|"
    ends = {name: {(r.file, r.agent_id): r.outcome for r in rows if r.predictor == name} for name in names}
    for name in (name for name in names if name != reference):
        both = [(ends[name][key], ends[reference][key]) for key in ends[name] if key in ends[reference]]
        gained = sum(a in REACHED and b not in REACHED for a, b in both)
        lost = sum(a not in REACHED and b in REACHED for a, b in both)
        hits = sum(a == "collision" and b != "collision" for a, b in both)
        spared = sum(a != "collision" and b == "collision" for a, b in both)
        yield f"| {name} | {gained} | {lost} | {hits} | {spared} |"


def notes_of(paths: Sequence[Path], split: Split, refused: dict[tuple[str, str], Refused]) -> Iterator[str]:
    """Markdown: what `neural` was trained on, where predictors failed, which files cannot be driven."""
    known = [path for path in paths if is_trained_on(path, split)]
    names = sorted({place.name for path in known if (place := split.place_of(path)) is not None})
    yield f"neural was trained at the places of {len(known)} of the {len(paths)} files: {', '.join(names) or 'none'}."
    failures = {key: found for key, found in refused.items() if found.is_failure}
    if failures:
        yield f"\nA predictor failed in {len(failures)} runs, whose agents are not counted:\n"
        yield from (f"- {file}: {found.why}" for (file, _), found in failures.items())
    others = {file: found.why for (file, _), found in refused.items() if not found.is_failure}
    yield f"\n{len(others)} files cannot be driven.\n"
    yield from (f"- {file}: {why}" for file, why in others.items())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sources", nargs="+", help="files, folders, shipped scenarios")
    parser.add_argument("--predictors", default="all", help="names with settings, separated by blanks")
    parser.add_argument("--planner", default=DEFAULT_PLANNER)
    parser.add_argument("--split", type=Path, default=SPLIT, help="what the weights of neural were trained with")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out/closed_loop.parquet"))
    arguments = parser.parse_args()
    try:
        paths = [path for path, _ in found_files(arguments.sources)]
        split = read_split(arguments.split)
        settings = SimulationSettings()
        nowhere = Recording(world(straight_road()), settings)
        choices, notes = chosen_predictors(arguments.predictors.split(), settings, nowhere)
    except InterdriveError as error:
        sys.exit(f"error: {error}")
    names = [choice.label for choice in choices]
    rows: list[Ended] = []
    refused: dict[tuple[str, str], Refused] = {}
    with ProcessPoolExecutor(arguments.workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        for choice in choices:
            start = time.perf_counter()
            for path, found in drive_all(paths, split, choice, arguments.planner, pool):
                if isinstance(found, Refused):
                    refused[path.name, choice.label] = found
                else:
                    rows += found
            write(rows, arguments.out, paths)
            print(f"{choice.label}: {time.perf_counter() - start:.0f} s", file=sys.stderr)
    for table in (summary, kinds, pairs):
        print("\n".join(table(rows, names)), end="\n\n")
    print(f"Planner {arguments.planner}, all agents.")
    print("\n".join([*notes_of(paths, split, refused), *(f"- {note}" for note in notes)]))
    if any(found.is_failure for found in refused.values()):
        sys.exit(1)


if __name__ == "__main__":
    main()
