"""`python -m tests.fuzz`: mutated files through everything that interdrive does with a file, until the time is over.

    python -m tests.fuzz --seconds 3600 --jobs 2 --found out/fuzz    # a campaign: `make fuzz`
    python -m tests.fuzz --seconds 60                                # the first mutants of seed 1: `make fuzz-smoke`
    python -m tests.fuzz --seed 1 --only 4711                        # one mutant again, with everything that it says
    python -m tests.fuzz --files FOLDER_OR_FILE                      # these files, unchanged
    python -m tests.fuzz --formats opendrive,sumo --mutants 4000     # maps and recordings of other tools

Regressions are tried first. Exit code 1: something failed; each kind of failure is kept in the folder `--found`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import multiprocessing
import os
import re
import sys
import tempfile
import time
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "support"))  # tests share small documents

from tests.fuzz.isolation import Ending, Limits, isolated
from tests.fuzz.mutants import Mutant, mutant
from tests.fuzz.seeds import documents, further
from tests.fuzz.sources import formats, source_mutant
from tests.fuzz.trial import ACCEPTED, FAILED, REFUSED, tried

if TYPE_CHECKING:
    from collections.abc import Iterator
    from multiprocessing.queues import Queue

HERE = Path(__file__).resolve().parent
REGRESSIONS = HERE / "regressions"
_FRAME = re.compile(r'File "[^"]*?((?:interdrive|commonroad|numpy|pyarrow)/[^"]*)", line \d+, in (\S+)')


def main() -> int:
    """The command."""
    options = _options()
    limits = Limits(memory=options.memory_mb * 10**6, cpu_seconds=options.cpu_seconds)
    seeds = documents(), tuple(data for folder in options.seeds for data in further(folder))
    if options.only is not None:
        one = _mutant(options, options.only, seeds)
        _keep(options.found, "only", one.files, {})
        ending = isolated(one.files, one.main, one.random, limits, one.options if options.formats else None)
        print(json.dumps(asdict(ending), indent=1).replace("\\n", "\n"))
        return int(ending.verdict == FAILED)
    _warm_up(seeds[0][0])
    tally = Tally(options.found)
    for path in _given([*([] if options.formats else [REGRESSIONS]), *options.files]):
        files = {part.name: part.read_bytes() for part in _beside(path)}
        tally.add(path.name, "given", files, isolated(files, path.name, Random(path.name), limits))
        if options.files:
            print(f"{path.name:28} {tally.last.cpu_seconds:6.2f} s {tally.last.memory / 1e6:6.0f} MB "
                  f"{tally.last.verdict}: {tally.last.text.strip().splitlines()[-1:]}", flush=True)  # fmt: skip
    if not options.files:
        _campaign(options, seeds, limits, tally)
    print(tally.table())
    if not options.files and not tally.is_telling:
        print("not one mutant of each kind was accepted and one refused: this says nothing; take more time")
        return 1
    return int(bool(tally.failures))


class Tally:
    """Counts endings and keeps one example of each kind of failure."""

    def __init__(self, found: Path) -> None:
        self.found = found
        self.counts: Counter[tuple[str, str]] = Counter()
        self.refusals: Counter[str] = Counter()
        self.failures: Counter[str] = Counter()
        self.slowest = self.largest = ("", 0.0)
        self.last = Ending("", "", "", 0.0, 0)

    def add(self, name: str, kind: str, files: dict[str, bytes], ending: Ending) -> None:
        """One trial more."""
        self.last = ending
        self.counts[kind, ending.verdict] += 1
        self.slowest = max(self.slowest, (name, ending.cpu_seconds), key=lambda entry: entry[1])
        self.largest = max(self.largest, (name, ending.memory / 1e6), key=lambda entry: entry[1])
        if ending.verdict != FAILED:
            return
        signature = _signature(ending)
        self.failures[signature] += 1
        if self.failures[signature] == 1:
            said = {"trial": name, "arguments": sys.argv[1:], "signature": signature, **asdict(ending)}
            folder = _keep(self.found, hashlib.sha256(signature.encode()).hexdigest()[:10], files, said)
            print(f"FAILED {name}: {signature}\n       kept in {folder}", flush=True)

    @property
    def is_telling(self) -> bool:
        """Whether mutants of each kind were accepted, and others refused."""
        kinds = {kind for kind, _ in self.counts if kind.startswith("source")} or {"xml", "protobuf"}
        return all(self.counts[kind, verdict] for kind in kinds for verdict in (ACCEPTED, REFUSED))

    def table(self) -> str:
        """Counts, as the end of a campaign says them."""
        kinds = sorted({kind for kind, _ in self.counts})
        lines = [f"{'':10} {'tried':>8} {'accepted':>9} {'refused':>8} {'failed':>7}"]
        for kind in kinds:
            row = [self.counts[kind, verdict] for verdict in ("accepted", "refused", "failed")]
            lines.append(f"{kind:10} {sum(row):8} {row[0]:9} {row[1]:8} {row[2]:7}")
        lines.append(f"slowest: {self.slowest[1]:.1f} s of CPU ({self.slowest[0]})")
        lines.append(f"largest: {self.largest[1]:.0f} MB ({self.largest[0]})")
        lines += [f"{count:6} x {signature}" for signature, count in self.failures.most_common()]
        return "\n".join(lines)


def _campaign(
    options: argparse.Namespace, seeds: tuple[tuple[bytes, ...], tuple[bytes, ...]], limits: Limits, tally: Tally
) -> None:
    """Mutants in several processes, each of which forks a child per mutant."""
    context = multiprocessing.get_context("fork")
    queue: Queue[tuple[int, str, dict[str, bytes], Ending] | None] = context.Queue(maxsize=100)
    until = time.monotonic() + options.seconds

    def work(job: int) -> None:
        index = options.first + job
        try:
            while time.monotonic() < until and index < options.first + options.mutants:
                one = _mutant(options, index, seeds)
                given = one.options if options.formats else None
                queue.put((index, one.kind, one.files, isolated(one.files, one.main, one.random, limits, given)))
                index += options.jobs
        finally:
            queue.put(None)

    _mutant(options, 0, seeds)
    # Not daemons: they have children of their own.
    workers = [context.Process(target=work, args=(job,)) for job in range(options.jobs)]
    for worker in workers:
        worker.start()
    ended, shown = 0, time.monotonic()
    while ended < options.jobs:
        item = queue.get()
        if item is None:
            ended += 1
            continue
        index, kind, files, ending = item
        tally.add(f"{options.seed}:{index}", kind, files, ending)
        if time.monotonic() - shown > options.every:
            shown = time.monotonic()
            print(f"{until - shown:6.0f} s left, {sum(tally.counts.values())} tried, "
                  f"{len(tally.failures)} kinds of failures", flush=True)  # fmt: skip
    for worker in workers:
        worker.join()
        if worker.exitcode:
            raise SystemExit(f"the fuzzer itself failed (exit code {worker.exitcode}); its traceback stands above")


def _mutant(options: argparse.Namespace, index: int, seeds: tuple[tuple[bytes, ...], tuple[bytes, ...]]) -> Mutant:
    if options.formats:
        return source_mutant(options.seed, index, options.formats)
    return mutant(options.seed, index, *seeds)


def _formats(text: str) -> tuple[str, ...]:
    names = tuple(formats()) if text == "all" else tuple(text.split(","))
    unknown = set(names) - set(formats())
    if unknown:
        raise argparse.ArgumentTypeError(f"{unknown.pop()} is none of all, {', '.join(formats())}")
    return names


def _warm_up(document: bytes) -> None:
    """One trial in this process, so that children find everything imported and remembered."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "seed.xml")
        path.write_bytes(document)
        verdict, text = tried(path, Path(folder), Random(0), lambda _stage: None)
    if verdict != ACCEPTED:
        raise SystemExit(f"a document without any change is not accepted: {text}")


def _signature(ending: Ending) -> str:
    """What tells kinds of failures apart: stage, exception without its numbers, innermost function."""
    frames = _FRAME.findall(ending.text)
    where = f" in {frames[-1][1]} ({frames[-1][0]})" if frames else ""
    last = (ending.text.strip().splitlines() or [""])[-1]
    last = re.sub(r"/\S*/interdrive-fuzz-[^/\s]*/", "", last)
    return f"{ending.stage}: {re.sub(r'[-+.e0-9]*[0-9]', '#', last)[:160]}{where}"


def _keep(found: Path, name: str, files: dict[str, bytes], said: dict[str, object]) -> Path:
    folder = found / name
    folder.mkdir(parents=True, exist_ok=True)
    for file, data in files.items():
        (folder / file).write_bytes(data)
    if said:
        text = json.dumps(said, indent=1, default=str).replace("\\n", "\n")
        (folder / "failure.txt").write_text(text, encoding="utf-8", errors="replace")
    return folder


def _given(paths: list[Path]) -> Iterator[Path]:
    for path in paths:
        if not path.exists():
            raise SystemExit(f"{path}: no such file")
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            # Of the three files of a protobuf scenario the one with the traffic is opened.
            if file.suffix == ".xml" or (file.suffix == ".pb" and file.with_name(f"{file.stem}-SC.pb").exists()):
                yield file


def _beside(path: Path) -> list[Path]:
    """Of a protobuf scenario all files of its folder; else the file."""
    return sorted(path.parent.glob("*.pb")) if path.suffix == ".pb" else [path]


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="when no new mutant is begun")
    parser.add_argument("--mutants", type=int, default=10**9, help="largest number of mutants")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="mutants that are tried at a time")
    parser.add_argument("--seed", type=int, default=1, help="of the campaign; its mutants are numbered from 0")
    parser.add_argument("--first", type=int, default=0, help="number of the first mutant")
    parser.add_argument("--only", type=int, help="number of the only mutant")
    parser.add_argument("--files", type=Path, nargs="*", default=[], help="these files or folders, unchanged")
    parser.add_argument("--seeds", type=Path, nargs="*", default=[], help="folders with further documents to change")
    parser.add_argument("--formats", type=_formats, default=(), help="of other tools, instead of CommonRoad files: all")
    parser.add_argument("--found", type=Path, default=Path("out/fuzz"), help="where failures are kept")
    parser.add_argument("--memory-mb", type=int, default=2000, help="resident memory of a trial")
    parser.add_argument("--cpu-seconds", type=int, default=20, help="time of a trial")
    parser.add_argument("--every", type=float, default=30.0, help="seconds between lines of progress")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
