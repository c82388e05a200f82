"""What a batch costs beyond its runs: the same runs in a loop in one process, and as a batch with one worker.

python benchmarks/batch.py ../shared/scenarios/highway

CPU times are compared, since wall times depend on what else the machine does; both are printed.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from pathlib import Path

from interdrive.batches import BatchFolder, batch
from interdrive.batches.pool import resident_memory
from interdrive.config.plugins import DEFAULT_PLANNER
from interdrive.errors import InterdriveError
from interdrive.files import read_scenario
from interdrive.simulation import simulate


def cpu_seconds() -> float:
    """Of this process and of those that it has waited for."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def loop(files: list[Path], planner: str) -> None:
    for path in files:
        try:
            simulate(read_scenario(path), planner=planner, threads=1).criticality(threads=1)
        except InterdriveError:
            continue


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--planner", default=DEFAULT_PLANNER)
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    files = sorted(arguments.folder.rglob("*.xml"))
    loop(files[:1], arguments.planner)  # imports
    spent, start = cpu_seconds(), time.perf_counter()
    loop(files, arguments.planner)
    pure, pure_wall = cpu_seconds() - spent, time.perf_counter() - start
    with tempfile.TemporaryDirectory() as out:
        memory: list[int] = []
        spent, start = cpu_seconds(), time.perf_counter()
        done = batch(
            files,
            out,
            planner=arguments.planner,
            workers=arguments.workers,
            on_progress=lambda _: memory.append(resident_memory(os.getpid())),
        )
        whole, wall = cpu_seconds() - spent, time.perf_counter() - start
        table = BatchFolder.open(out).table(["key", "read_seconds", "run_seconds"])
    busy = sum(
        {row["key"]: (row["read_seconds"] or 0) + (row["run_seconds"] or 0) for row in table.to_pylist()}.values()
    )
    print(f"{len(done.keys)} runs, {arguments.workers} workers")
    print(f"loop:  {pure:.1f} s CPU, {pure_wall:.1f} s wall")
    print(f"batch: {whole:.1f} s CPU, {wall:.1f} s wall, {100 * (whole / pure - 1):+.1f} % CPU")
    print(f"workers were busy with runs {100 * busy / (wall * arguments.workers):.0f} % of the time")
    first, last = memory[0] / 2**20, memory[-1] / 2**20
    print(f"memory of the parent: {first:.0f} MiB after the first run, {last:.0f} MiB after the last")


if __name__ == "__main__":
    main()
