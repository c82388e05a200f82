"""The benchmark: every agent of a set driven alone by every planner, in traffic that replays and that reacts."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive.batches import batch
from interdrive.batches.plan import choices
from interdrive.batches.store import BatchFolder
from interdrive.benchmarks.reference import reference_rows
from interdrive.benchmarks.rows import NON_REACTIVE, REACTIVE, from_plain, paper, plain, planner_rows, scenario_scores
from interdrive.benchmarks.sets import find_files, read_set
from interdrive.comparison.variants import rows_of
from interdrive.errors import InputError, ResultsError
from interdrive.panel import DEFAULT, chosen_panel
from interdrive.results import software
from interdrive.storage import one_line, read_json, replacing, write_json

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from interdrive.batches import Progress
    from interdrive.benchmarks.rows import Row
    from interdrive.benchmarks.sets import BenchmarkSet
    from interdrive.config.specs import PlannerSpecs, PredictorSpecs

#: Layout of benchmark.json and of reference rows; files of format 1 are read, too.
FORMAT = 2

_MARK = "benchmark.json"


@dataclass(frozen=True)
class Benchmark:
    """The result of a benchmark.

    Attributes:
        set: Name of the set. set_sha256: Hash of its contents. split: Part of the set.
        table: Planners in the order given; per planner all categories together, then each.
        scenarios: 100 times the mean score of the agents of each scenario, by planner, scenario name and traffic.
        reference: Published rows of the set, for the same split.
        missing: Files of the split that were not found, one line each; then the numbers are partial.
        panel: Drivers of the panel; "" without one.
        command: Command that repeats the benchmark.
        folder: Folder of the results and benchmark.json.
    """

    set: str
    set_sha256: str
    split: str
    table: tuple[Row, ...]
    scenarios: Mapping[str, Mapping[str, Mapping[str, float]]]
    reference: tuple[Row, ...]
    missing: tuple[str, ...]
    command: str
    folder: Path
    panel: str = ""

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
    set: str = "shipped-2",  # noqa: A002 - the word for it
    split: str = "dev",
    scenarios: str | Path | None = None,
    predictor: PredictorSpecs = "neural",
    out: str | Path = "out/benchmark",
    panel: str | Path = DEFAULT,
    workers: int | None = None,
    ray: str | None = None,
    raw: bool = False,
    on_progress: Callable[[Progress], None] | None = None,
) -> Benchmark:
    """Drives every agent of a set alone, among replayed and among reacting traffic, and scores it.

    Worker processes start new interpreters: a script that calls this needs `if __name__ == "__main__":`.

    Args:
        planner: One or several, as for `interdrive.batch`.
        set: Name of the set.
        split: "test", "dev" or "all".
        scenarios: Folder that contains the files of the set; None: `INTERDRIVE_SCENARIOS`.
        predictor: One predictor.
        out: Folder of the results; existing runs in it are not repeated.
        panel: Against what agents are scored, as for `interdrive.batch`; the folder of a stored panel of the set takes
            the panel's runs off.
        workers: Processes; all cores by default.
        ray: Address of a Ray cluster.
        raw: Read recordings without repairs. The reference rows of the set, which are of repaired recordings, are then
            left out.
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
            paths, Path(out), planner=planner, predictor=predictor, traffic=traffic, alone=True, panel=panel,
            workers=workers, ray=ray, on_progress=on_progress, settings={"recording.raw": True} if raw else None,
        )  # fmt: skip
        keys += done.keys
    rows = rows_of(BatchFolder.open(out).table(None, {*keys}))
    rows["variant"] = rows["planner"]
    made = tuple(planner_rows(rows, labels, there))
    result = Benchmark(
        set=set,
        set_sha256=chosen.sha256,
        split=split,
        table=made,
        scenarios={label: scenario_scores(rows, label, there) for label in labels},
        reference=() if raw else tuple(row for row in reference_rows(chosen, split) if row.planner not in labels),
        missing=tuple(missing),
        command=_command(labels, set, split, scenarios, panel, raw=raw),
        folder=Path(out),
        panel=", ".join(chosen_panel(panel)[0]),
    )
    _save(result, chosen)
    if driven := [label for label in labels if label != "recorded"]:
        about = f"Set {set} (SHA-256 {chosen.sha256[:12]}), split {split}; {result.command}"
        table = paper(rows, driven, there, about)
        for ending, text in (("md", table.markdown()), ("tex", table.latex())):
            with replacing(result.folder / f"paper.{ending}") as partial:
                partial.write_text(text, encoding="utf-8")
    return result


def _command(
    labels: Sequence[str], name: str, split: str, scenarios: str | Path | None, panel: str | Path, *, raw: bool
) -> str:
    where = [*(["--scenarios", str(scenarios)] if scenarios else []), *(["--raw"] if raw else [])]
    where += [] if str(panel) == DEFAULT else ["--panel", str(panel)]
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
        "panel": found.panel,
        "rows": [plain(row) for row in found.table],
        "scenarios": found.scenarios,
        **software(),
    }
    with replacing(found.folder / _MARK) as partial:
        write_json(content, partial)


def read_benchmark(folder: str | Path) -> tuple[Row, ...]:
    """The rows of the benchmark.json in a `folder`; of an earlier release, with its score as `score_1`.

    Raises:
        ResultsError: There is none, or it is damaged.
        InputError: It is of a set that is not known.
    """
    path = Path(folder) / _MARK
    try:
        content = read_json(path)
        if content["format"] not in (1, FORMAT):
            raise ResultsError(
                f"{path}: format {content['format']} is newer than what this interdrive reads ({FORMAT})"
            )
        there = read_set(content["set"]).of_split(content["split"])
        return tuple(from_plain(row, there) for row in content["rows"])
    except (OSError, ValueError, KeyError, TypeError) as cause:
        raise ResultsError(f"{path}: cannot be read: {one_line(cause)}") from cause
