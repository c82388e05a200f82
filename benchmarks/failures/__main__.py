"""Failure search on planners with planted faults, and the table of searches that were done with the command.

python benchmarks/failures [--planners Late,...] [--runs 300] [--seeds 5] [--workers 1] [--out DIR] [--page PAGE]
python benchmarks/failures --detected [--planners Late,...] [--runs 300] [--seeds 5] [--out DIR] [--page PAGE]
python benchmarks/failures --searches DIR ... [--build NAME] [--page PAGE]
python benchmarks/failures --overhead [--runs 300] [--seeds 5] [--page PAGE]

With --searches, the rows of `interdrive search compare`, and the failures of each, in sections of that build. Otherwise
the planted planners of planted.py are searched on t_junction with each seed. With --detected a search ends with its
first failure, and printed is in which run that is; without, the rates of uniform and directed runs, and their ratio.
With --overhead, the time of a search beside that of the same drives. Searches that are there already are not driven
again. --page writes the tables into a page, between the marks with their names.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import re
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))  # of worker processes, too

import interdrive as idr
from interdrive.failure_search import HEAD, Failure, Space, Summary
from interdrive.failure_search.disturbed_worlds import disturbed
from interdrive.failure_search.evaluation import Drivers
from interdrive.failure_search.pairs import pairs_of, paths_of, scenario_at
from interdrive.failure_search.trials import Setup, change_at, drive_at

FAULTS = ("BlindRight", "Late", "Standing", "Sound")
SCENARIO = "t_junction"
#: No line of a log is longer [bytes].
_LINE = 100_000


def planted(names: list[str], runs: int, seeds: int, workers: int, out: Path) -> list[list[str]]:
    """A row for every planner with a planted fault: medians and totals over the seeds."""
    rows = []
    for name in names:
        found = []
        for seed in range(seeds):
            folder = out / f"{name}-{seed}"
            # Rates do not depend on what is kept, and how small.
            what = {"runs": runs, "seed": seed, "keep": 1, "shrink": False}
            idr.search(SCENARIO, f"planted:{name}", out=folder, workers=workers, **what)
            found.append(Summary.of(folder))
            print(f"{name} seed {seed}: {found[-1].cells()}", file=sys.stderr, flush=True)
        rows.append(row_of(name, found))
    return rows


def row_of(name: str, found: list[Summary]) -> list[str]:
    """The cells of a planner."""
    uniform = [one.yields[0] for one in found]
    directed = [one.yields[-1] for one in found]
    failed, driven = sum(one.failures for one in uniform), sum(one.runs for one in uniform)
    share = failed / driven
    # A seed without a uniform failure has no ratio of its own; the rate of all seeds is what uniform runs bring.
    ratios = [one.rate[0] / share if share else math.inf if one.failures else math.nan for one in directed]
    first = [next((row["index"] + 1 for row in one.rows if row["folder"]), 0) for one in found]
    kinds = sorted({failure.failure for one in found for failure in one.failures})
    directed_failed, directed_runs = sum(one.failures for one in directed), sum(one.runs for one in directed)
    return [
        name,
        f"{failed} of {driven}",
        f"{100.0 * share:.2f}",
        f"{directed_failed} of {directed_runs}",
        f"{100.0 * directed_failed / directed_runs:.2f}",
        f"{statistics.median(ratios):.1f}" if not math.isnan(statistics.median(ratios)) else "",
        f"{sum(n > 0 for n in first)} of {len(found)}",
        f"{max(first)}" if all(first) else "",
        ", ".join(kinds),
    ]


def detected(names: list[str], runs: int, seeds: int, workers: int, out: Path) -> list[list[str]]:
    """A row for every planner with a planted fault: in which run of a seed the first failure was found."""
    rows = []
    for name in names:
        first, kinds = [], set()
        for seed in range(seeds):
            found = idr.search(
                SCENARIO,
                f"planted:{name}",
                runs=runs,
                seed=seed,
                out=out / f"{name}-{seed}",
                workers=workers,
                stop_after=1,
                shrink=False,
            )
            first.append(found.runs if found.failures else 0)
            kinds |= {one.failure for one in found.failures}
            print(f"{name} seed {seed}: run {first[-1]}", file=sys.stderr, flush=True)
        hits = sorted(n for n in first if n)
        median = f"{statistics.median(hits):g}" if hits else ""
        rows.append([name, f"{len(hits)} of {seeds}", median, f"{max(hits)}" if hits else "", ", ".join(sorted(kinds))])
    return rows


def overhead(planner: str, scenario: str, runs: int, seeds: int) -> str:
    """Time of a search beside the time of driving its worlds until the agent ends, on one process; medians.

    Each world is driven again soon after the search has driven it, so that both times are of the same machine. Runs
    that fail are left out: their films take seconds.
    """
    ratios, searched, driven, draws = [], [], [], []
    for seed in range(1, 1 + seeds):
        folder = Path(tempfile.mkdtemp()) / "overhead"
        again = _Again(folder, planner, scenario)
        # What is imported and read once; so does the next call, until its first run is over.
        idr.search(scenario, planner, runs=1, out=folder, seed=seed, shrink=False)
        idr.search(scenario, planner, runs=2 + runs, out=folder, seed=seed, shrink=False, on_run=again)
        one, other = (1e3 * statistics.mean(column) for column in zip(*again.times, strict=True))
        searched.append(one)
        driven.append(other)
        ratios.append(100.0 * (one / other - 1.0))
        draws += again.draws
    said = f"{runs} runs of `{planner}` on `{scenario}` with {seeds} seed{'s' if seeds > 1 else ''}"
    return (
        f"{said}, each world driven again soon after the\n"
        f"search did: {statistics.median(searched):.1f} ms of processor time per run in the search, "
        f"{statistics.median(driven):.1f} ms to drive the same world\n"
        f"until the agent ends (medians), {statistics.median(ratios):.0f} % more "
        f"({min(ratios):.0f} to {max(ratios):.0f} %), {statistics.mean(draws):.2f} draws per run."
    )


class _Again:
    """Drives each world of a search again after the next one, as its callback, and notes the processor times of both.

    The world that is driven again is never the one that was driven just before: whoever drives finds nothing of it in
    the caches of the processor.
    """

    def __init__(self, folder: Path, planner: str, scenario: str) -> None:
        """The search in a folder, of a planner in traffic of `idm`."""
        space = Space().with_v2x(is_on=False)
        self._pairs, _, _ = pairs_of(paths_of(scenario), space.others, None)
        self._setup = Setup(Drivers(planner, "idm", "lane_following"), space, 0)
        self._folder, self._left = folder, math.nan
        self._before: tuple[float, dict[str, Any]] | None = None
        self.times: list[tuple[float, float]] = []
        self.draws: list[int] = []

    def __call__(self, _n: int, _failures: int) -> None:
        """Drives the world before the last one of the search."""
        in_search = time.process_time() - self._left
        before, self._before = self._before, (in_search, last_logged(self._folder))
        if before is not None and not math.isnan(before[0]):
            self._drive(*before)
        self._left = time.process_time()

    def _drive(self, in_search: float, row: dict[str, Any]) -> None:
        pair = self._pairs[row["pair"]]
        change = change_at(self._setup, pair, row["point"])
        scenario = disturbed(scenario_at(pair.path), change)
        drive = drive_at(self._setup, pair, change, scenario)
        begin = time.process_time()
        drive.simulation(scenario).run_until_ended(drive.agent_id)
        if not row["failure"]:
            self.times.append((in_search, time.process_time() - begin))
            self.draws.append(row["draws"])


def last_logged(folder: Path) -> dict[str, Any]:
    """The last run in the log of a search, which is still being written."""
    with (folder / "evaluations.jsonl").open("rb") as log:
        log.seek(max(log.seek(0, os.SEEK_END) - _LINE, 0))
        found: dict[str, Any] = json.loads(log.read().splitlines()[-1])
    return found


def searches(folders: list[str]) -> tuple[list[list[str]], list[list[str]]]:
    """The rows of `interdrive search compare`, and one for every failure."""
    found = [Summary.of(folder) for folder in folders]
    rows = [list(one.cells())[1:] for one in found]
    failures = [
        [
            f"`{one.planner}`",
            failure.scenario or failure.signature.split()[0],
            str(failure.drive.agent_id),
            failure.failure,
            failure.words.removeprefix("at fault: "),
            _changes(failure),
            f"`{failure.witness}`" if failure.witness else "unproven",
        ]
        for one in found
        for failure in one.failures
    ]
    return rows, failures


def _changes(failure: Failure) -> str:
    """What is different from the recording; of a failure that is not small only how much."""
    return failure.disturbance if failure.is_small else f"{failure.disturbance.count(';') + 1} changes, not made small"


def table(head: tuple[str, ...], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def written(page: Path, section: str, text: str) -> None:
    """Puts a text between the marks of a section of a page."""
    begin, end = f"<!-- {section}: written by benchmarks/failures -->", f"<!-- end of {section} -->"
    old = page.read_text(encoding="utf-8")
    new, n = re.subn(
        f"{re.escape(begin)}.*?{re.escape(end)}", lambda _: f"{begin}\n\n{text}\n\n{end}", old, flags=re.DOTALL
    )
    if n != 1:
        sys.exit(f"{page}: there is no {begin}")
    page.write_text(new, encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--planners", default=",".join(FAULTS))
    parser.add_argument("--runs", type=int, default=300)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("out/failures"))
    parser.add_argument("--detected", action="store_true")
    parser.add_argument("--overhead", action="store_true")
    parser.add_argument("--searches", nargs="+")
    parser.add_argument("--build", default="")
    parser.add_argument("--page", type=Path)
    given = parser.parse_args()
    parts: dict[str, str] = {}
    if given.searches:
        rows, failures = searches(given.searches)
        build = f" of {given.build}" if given.build else ""
        parts[f"shipped planners{build}"] = table(HEAD[1:], rows)
        head = ("planner", "scenario", "agent", "kind", "what happened", "different from the recording", "avoided by")
        parts[f"their failures{build}"] = table(head, failures) if failures else "None."
    elif given.overhead:
        parts["overhead"] = "\n\n".join(
            overhead(planner, scenario, given.runs, given.seeds)
            for scenario in (SCENARIO, "highway")
            for planner in ("idm", "rollout")
        )
    elif given.detected:
        rows = detected(given.planners.split(","), given.runs, given.seeds, given.workers, given.out)
        parts["detected"] = table(("planted", "found in", "median run", "last run", "kinds"), rows)
    else:
        head = (
            *("planted", "uniform fail", "[%]", "directed fail", "[%]", "times uniform (median)"),
            *("found in", "at the latest in run", "kinds"),
        )
        rows = planted(given.planners.split(","), given.runs, given.seeds, given.workers, given.out)
        parts["planted faults"] = table(head, rows)
    for name, text in parts.items():
        print(f"{name}\n\n{text}\n")
        if given.page is not None:
            written(given.page, name, text)


if __name__ == "__main__":
    main()
