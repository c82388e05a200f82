"""The benchmark: every agent of a set driven alone by every planner, in traffic that replays and that reacts."""

from __future__ import annotations

import json
import math
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive import _core
from interdrive.batches import batch
from interdrive.batches.plan import choices
from interdrive.batches.store import BatchFolder
from interdrive.benchmarks.sets import find_files, read_set
from interdrive.comparison.scores import planner_score
from interdrive.comparison.variants import ALL, arrays
from interdrive.errors import InputError
from interdrive.results import software
from interdrive.storage import replacing, write_json

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from interdrive.batches import Progress
    from interdrive.benchmarks.sets import BenchmarkSet, SetFile
    from interdrive.comparison.scores import PlannerScore
    from interdrive.config.specs import PlannerSpecs, PredictorSpecs

#: Traffic that replays its recording, and traffic that adjusts its speed; the number is that of the last.
NON_REACTIVE, REACTIVE = "recorded", "velocity_adjusting"

#: Layout of benchmark.json and of reference rows.
FORMAT = 1

_MARK = "benchmark.json"


@dataclass(frozen=True)
class Row:
    """One planner in one category, or in all.

    Attributes:
        planner: Label. category: Of the roads, or "all".
        score: Among reacting traffic, 0 to 100. low: End of its interval over places. high: Other end.
        non_reactive: The same number among replayed traffic.
        reached: Agents that reached their goal in time, reacting traffic [%].
        at_fault: Collisions at fault per 100 agents, reacting traffic.
        ttc_critical: Share of time with a TTC under 2 s, reacting traffic [%].
        jerk: Root mean square, mean of agents, reacting traffic [m/s³].
        plan_ms: Wall time per plan, replayed traffic [ms].
        n_scenarios: Scenarios. n_agents: Agents.
        zeros: Agents with a score of 0 by reason, reacting traffic.
        version: Of interdrive that made it.
    """

    planner: str
    category: str
    score: float
    low: float
    high: float
    non_reactive: float
    reached: float
    at_fault: float
    ttc_critical: float
    jerk: float
    plan_ms: float
    n_scenarios: int
    n_agents: int
    zeros: Mapping[str, int]
    version: str


@dataclass(frozen=True)
class Benchmark:
    """What a benchmark found.

    Attributes:
        set: Name of the set. set_sha256: Of what it states. split: Which part of it.
        table: Planners in the order given; per planner all categories together, then each.
        reference: Rows that come with the set, of the same split.
        missing: Files of the split that were not found, one line each; then the numbers are partial.
        command: Repeats it.
        folder: Where results and benchmark.json are.
    """

    set: str
    set_sha256: str
    split: str
    table: tuple[Row, ...]
    reference: tuple[Row, ...]
    missing: tuple[str, ...]
    command: str
    folder: Path

    @property
    def score(self) -> float:
        """The number of the first planner: 100 times its score among reacting traffic."""
        return self.table[0].score

    @property
    def low(self) -> float:
        """Lower end of its interval."""
        return self.table[0].low

    @property
    def high(self) -> float:
        """Upper end of its interval."""
        return self.table[0].high

    @property
    def is_partial(self) -> bool:
        """Files were missing: the numbers have no rank."""
        return bool(self.missing)


def benchmark(
    planner: PlannerSpecs,
    *,
    set: str = "shipped-1",  # noqa: A002 - the word for it
    split: str = "dev",
    scenarios: str | Path | None = None,
    predictor: PredictorSpecs = "neural",
    out: str | Path = "out/benchmark",
    workers: int | None = None,
    ray: str | None = None,
    on_progress: Callable[[Progress], None] | None = None,
) -> Benchmark:
    """Drives every agent of a set alone, among replayed and among reacting traffic, and scores it.

    Worker processes start new interpreters: a script that calls this needs `if __name__ == "__main__":`.

    Args:
        planner: One or several, as for `interdrive.batch`.
        set: Name of the set.
        split: "test", "dev" or "all".
        scenarios: Folder below which the files of the set are; `INTERDRIVE_SCENARIOS` by default.
        predictor: One predictor.
        out: Folder; what is there already is not done again.
        workers: Processes; all cores by default.
        ray: Address of a Ray cluster.
        on_progress: Called while runs end.

    Raises:
        InputError: An unknown set or split, no file of it found, or a planner that cannot be used.
        ResultsError: The folder cannot be used.
    """
    chosen = read_set(set)
    wanted = chosen.of_split(split)
    found, missing = find_files(wanted, scenarios)
    if not found:
        raise InputError(f"set {set}: none of its {len(wanted)} files was found; give their folder with --scenarios")
    there = [file for file in wanted if file.sha256 in found]
    paths = [found[file.sha256] for file in there]
    labels = list(choices(planner, "planner"))
    keys: list[str] = []
    for traffic in (NON_REACTIVE, REACTIVE):
        done = batch(
            paths, Path(out), planner=planner, predictor=predictor, traffic=traffic, alone=True, workers=workers,
            ray=ray, on_progress=on_progress,
        )  # fmt: skip
        keys += done.keys
    rows = arrays(BatchFolder.open(out).table(None, {*keys}))
    rows["variant"] = rows["planner"]
    made = tuple(row for label in labels for row in planner_rows(rows, label, there))
    result = Benchmark(
        set=set,
        set_sha256=chosen.sha256,
        split=split,
        table=made,
        reference=tuple(row for row in reference_rows(chosen, split) if row.planner not in labels),
        missing=tuple(missing),
        command=_command(labels, set, split, scenarios),
        folder=Path(out),
    )
    _save(result, chosen)
    return result


def planner_rows(rows: Mapping[str, Any], label: str, there: Sequence[SetFile]) -> list[Row]:
    """All categories together, then each of several."""
    categories = sorted({file.category for file in there})
    found = []
    for category in [ALL, *categories] if len(categories) > 1 else [ALL]:
        part = [file for file in there if category in (ALL, file.category)]
        found.append(_row(rows, label, category, part))
    return found


def _row(rows: Mapping[str, Any], label: str, category: str, part: Sequence[SetFile]) -> Row:
    agents = {file.sha256: {(0, number) for number in file.agents} for file in part}
    places = {file.sha256: file.place for file in part}
    scores: dict[str, PlannerScore] = {}
    tested: dict[str, Any] = {}
    scenario, number = rows["scenario_sha256"].astype(str), rows["agent_id"]
    listed = np.array(
        [name in agents and (math.isnan(who) or (0, int(who)) in agents[name])
         for name, who in zip(scenario.tolist(), number.tolist(), strict=True)], dtype=np.bool_
    )  # fmt: skip
    for traffic in (NON_REACTIVE, REACTIVE):
        mine = (rows["planner"] == label) & (rows["traffic"] == traffic) & listed
        # What traffic did in these runs does not count, nor do runs of agents that the set does not list.
        scores[traffic] = planner_score(rows, mine, agents, places)
        tested[traffic] = mine & (rows["under_test"] == 1)
    reactive = scores[REACTIVE]

    def mean(name: str, traffic: str, scale: float) -> float:
        values = rows[name][tested[traffic]].astype(np.float64)
        known = values[np.isfinite(values)]
        return scale * float(known.mean()) if len(known) else math.nan

    return Row(
        planner=label,
        category=category,
        score=reactive.score,
        low=reactive.low,
        high=reactive.high,
        non_reactive=scores[NON_REACTIVE].score,
        reached=reactive.reached,
        at_fault=reactive.at_fault,
        ttc_critical=mean("ttc_critical", REACTIVE, 100.0),
        jerk=mean("jerk_rms", REACTIVE, 1.0),
        plan_ms=mean("plan_seconds", NON_REACTIVE, 1000.0),
        n_scenarios=reactive.n_scenarios,
        n_agents=reactive.n_agents,
        zeros=reactive.zeros,
        version=_core.__version__,
    )


def reference_rows(chosen: BenchmarkSet, split: str) -> list[Row]:
    """Rows that come with a set."""
    from interdrive.benchmarks import reference  # noqa: PLC0415 - a folder of data

    path = Path(str(reference.__path__[0])) / f"{chosen.name}.json"
    if not path.exists():
        return []
    stored = json.loads(path.read_text(encoding="utf-8"))
    if stored["set_sha256"] != chosen.sha256:
        return []
    return [Row(**_numbers(row)) for row in stored["splits"].get(split, [])]


def _numbers(row: dict[str, Any]) -> dict[str, Any]:
    """Absent numbers are null in JSON."""
    texts = ("planner", "category", "zeros", "version")
    return {name: math.nan if value is None and name not in texts else value for name, value in row.items()}


def plain(row: Row) -> dict[str, Any]:
    """A row for JSON, numbers that are absent as null."""
    return {
        name: None if isinstance(value, float) and math.isnan(value) else dict(value) if name == "zeros" else value
        for name, value in vars(row).items()
    }


def _command(labels: Sequence[str], name: str, split: str, scenarios: str | Path | None) -> str:
    where = ["--scenarios", str(scenarios)] if scenarios else []
    return shlex.join(["interdrive", "benchmark", ",".join(labels), "--set", name, "--split", split, *where])


def _save(found: Benchmark, chosen: BenchmarkSet) -> None:
    content = {
        "format": FORMAT,
        "set": found.set,
        "set_sha256": found.set_sha256,
        "text": chosen.text,
        "split": found.split,
        "partial": found.is_partial,
        "missing": list(found.missing),
        "command": found.command,
        "rows": [plain(row) for row in found.table],
        **software(),
    }
    with replacing(found.folder / _MARK) as partial:
        write_json(content, partial)
