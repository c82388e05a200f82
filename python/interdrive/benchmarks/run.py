"""The benchmark: every agent of a set driven alone by every planner, in traffic that replays and that reacts."""

from __future__ import annotations

import math
import shlex
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive.batches import batch
from interdrive.batches.plan import choices, traffic_kind
from interdrive.batches.store import BatchFolder
from interdrive.benchmarks.fitted import fitted_notes
from interdrive.benchmarks.passages import PASSAGES, located
from interdrive.benchmarks.ranking import places_needed, ranked
from interdrive.benchmarks.ranking_tables import ranking_tables
from interdrive.benchmarks.reference import reference_rows
from interdrive.benchmarks.rows import from_plain, paper, plain, planner_rows, scenario_scores, standings, with_totals
from interdrive.benchmarks.sets import NON_REACTIVE, REACTIVE, read_set
from interdrive.comparison.variants import rows_of
from interdrive.errors import InputError, ResultsError
from interdrive.panel import DEFAULT, chosen_panel
from interdrive.results import software
from interdrive.storage import one_line, read_json, replacing, write_json

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from interdrive.batches import Progress
    from interdrive.benchmarks.ranking import Ranking
    from interdrive.benchmarks.rows import Row
    from interdrive.benchmarks.sets import BenchmarkSet
    from interdrive.config.specs import PlannerSpecs, PredictorSpecs

#: Layout of benchmark.json and of reference rows; files of format 1 are read, too.
FORMAT = 2

_MARK = "benchmark.json"

#: All columns that are driven with "all", after those of the set.
ALL_COLUMNS = ("recorded", "velocity_adjusting", "idm", "idm_mobil", "frenet")


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
        traffic: Kinds of traffic that were driven. counted: Those whose mean is the number.
        ranking: Planners in order, and how far that order can be trusted.
        needed: Places that are needed to separate two neighbours, for `power`; empty without it.
        command: Command that repeats the benchmark.
        folder: Folder of the results and benchmark.json.
        notes: One line per thing the user should know.
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
    traffic: tuple[str, ...] = (NON_REACTIVE, REACTIVE)
    counted: tuple[str, ...] = (REACTIVE,)
    ranking: Ranking | None = None
    needed: Mapping[tuple[str, str], int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def score(self) -> float:
        """The number of the first planner: 100 times its score among reacting traffic."""
        return self.table[0].number

    @property
    def low(self) -> float:
        """Lower end of its interval."""
        row = self.table[0]
        return row.low if math.isnan(row.total) else row.total_low

    @property
    def high(self) -> float:
        """Upper end of its interval."""
        row = self.table[0]
        return row.high if math.isnan(row.total) else row.total_high

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
    columns: str | Sequence[str] | None = None,
    power: float | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    on_recording: Callable[[str], None] | None = None,
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
        columns: Kinds of traffic: "all" (`ALL_COLUMNS`), or "replay" and native planners, as text with commas or as a
            list; None: those of the set. Without all that count there is no number.
        power: Points: tells how many places are needed to separate two planners that are so far apart.
        on_progress: Called while runs end.
        on_recording: Called with the name of a recording before it is joined.

    Raises:
        InputError: An unknown set or split, no file of it found, or a planner that cannot be used.
        ResultsError: The folder cannot be used.
    """
    chosen = read_set(set)
    wanted = chosen.of_split(split)
    driven = _columns(columns, chosen)
    if power is not None and not 0.0 < power <= 100.0:
        raise InputError("power", f"must be above 0 and at most 100 points, is {power}")
    there, found, missing = located(chosen, wanted, scenarios, Path(out).parent / PASSAGES, on_recording)
    if not there:
        raise InputError(f"set {set}: none of its {len(wanted)} files was found; give their folder with --scenarios")
    paths = [found[file.sha256] for file in there]
    listed = {file.sha256: file.agents for file in there}
    labels = list(choices(planner, "planner"))
    keys: list[str] = []
    notes = list(fitted_notes(planner, there))
    for traffic in driven:
        among = _planners(planner, traffic)
        if not among:
            continue
        done = batch(
            paths, Path(out), planner=among, predictor=predictor, traffic=traffic, alone=True, listed=listed,
            panel=panel, workers=workers, ray=ray, on_progress=on_progress,
            settings={"recording.raw": True} if raw else None,
        )  # fmt: skip
        keys += done.keys
        notes += [f"among {traffic}: {note}" for note in done.panel_notes]
    rows = rows_of(BatchFolder.open(out).table(None, {*keys}))
    rows["variant"] = rows["planner"]
    standing = standings(rows, labels, there, chosen, driven)
    ranking = ranked(standing)
    made = with_totals(planner_rows(rows, labels, there, driven), ranking, is_weighted=bool(chosen.weights))
    result = Benchmark(
        set=set,
        set_sha256=chosen.sha256,
        split=split,
        table=tuple(made),
        scenarios={label: scenario_scores(rows, label, there) for label in labels},
        reference=() if raw else tuple(row for row in reference_rows(chosen, split) if row.planner not in labels),
        missing=tuple(missing),
        command=_command(labels, set, split, scenarios, panel, raw=raw, columns=None if columns is None else driven),
        folder=Path(out),
        panel=", ".join(chosen_panel(panel)[0]),
        traffic=driven,
        counted=standing.counted,
        ranking=ranking,
        needed={} if power is None else places_needed(standing, power),
        notes=tuple(notes),
    )
    _save(result, chosen)
    fitted = "".join(f". {note}" for note in fitted_notes(planner, there))
    about = f"Set {set} (SHA-256 {chosen.sha256[:12]}), split {split}; {result.command}{fitted}"
    tables = {"ranking": ranking_tables(ranking, chosen, driven, about)}
    humans = [label for label in labels if label == "recorded"]
    if len(humans) < len(labels) and {NON_REACTIVE, REACTIVE} <= {*driven}:
        numbers = {one.planner: one.number for one in ranking.ranks} if chosen.weights else None
        tables["paper"] = [paper(rows, [label for label in labels if label not in humans], there, about, numbers)]
    for name, parts in tables.items():
        texts = {"md": "\n".join(one.markdown() for one in parts), "tex": "\n".join(one.latex() for one in parts)}
        for ending, text in texts.items():
            with replacing(result.folder / f"{name}.{ending}") as partial:
                partial.write_text(text, encoding="utf-8")
    return result


def _columns(given: str | Sequence[str] | None, chosen: BenchmarkSet) -> tuple[str, ...]:
    """Kinds of traffic to drive, in the words of tables."""
    if given is None:
        return chosen.traffic
    names = [name.strip() for name in given.split(",")] if isinstance(given, str) else list(given)
    if names == ["all"]:
        return tuple(dict.fromkeys((*chosen.traffic, *ALL_COLUMNS)))
    found = []
    for name in names:
        if name == "same":
            raise InputError("columns: a planner among its copies is a column of its own; name planners")
        try:
            found.append(str(traffic_kind(name)))
        except InputError as error:
            raise InputError(str(error).replace("traffic:", "columns:").replace("same, ", "")) from None
    return tuple(dict.fromkeys(found))


def _planners(planner: PlannerSpecs, traffic: str) -> PlannerSpecs:
    """Planners that are driven among some traffic: replayed humans only among replayed traffic."""
    if traffic == NON_REACTIVE:
        return planner
    return {label: one for label, one in choices(planner, "planner").items() if label != "recorded"}


def _command(
    labels: Sequence[str],
    name: str,
    split: str,
    scenarios: str | Path | None,
    panel: str | Path,
    *,
    raw: bool,
    columns: Sequence[str] | None = None,
) -> str:
    where = [*(["--scenarios", str(scenarios)] if scenarios else []), *(["--raw"] if raw else [])]
    where += [] if str(panel) == DEFAULT else ["--panel", str(panel)]
    where += [] if columns is None else ["--columns", ",".join(columns)]
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
        "notes": list(found.notes),
        "traffic": list(found.traffic),
        "counted": list(found.counted),
        "ranking": None if found.ranking is None else found.ranking.plain(),
        "places_needed": [{"planners": list(pair), "places": n} for pair, n in found.needed.items()],
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
