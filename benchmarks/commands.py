"""What whole commands take, each in a process of its own: imports, help, runs, and the development set in one call.

    python benchmarks/commands.py [SCENARIOS]

SCENARIOS is the folder of the development set (INTERDRIVE_SCENARIOS, or ../shared/scenarios). Runs have 24 agents, one
thread and `lane_following`, and count the time of the processor; all else is wall time. Medians.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from targets import note

if TYPE_CHECKING:
    from collections.abc import Callable

#: Scenarios of whole runs, by the name of their target.
RUNS = {"run_highway": "highway/USA_US101-23_1_T-1.xml", "run_arterial": "urban/CHN_Sha-3_1_T-1.xml"}
RUN = ("--agents", "24", "--threads", "1", "--predictor", "lane_following", "--quiet", "--out")


def taken(command: list[str]) -> tuple[float, float]:
    """Wall time and the processor's time of a command [s]."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        raise SystemExit(done.stderr.strip() or f"{' '.join(command)}: exit code {done.returncode}")
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenarios", type=Path, nargs="?")
    parser.add_argument("--repetitions", type=int, default=7)
    given = parser.parse_args()
    scenarios = given.scenarios or Path(os.environ.get("INTERDRIVE_SCENARIOS", "../shared/scenarios").split(":")[0])
    interdrive = str(Path(sys.executable).with_name("interdrive"))
    print("| command | s | what |\n|---|--:|---|")

    def tell(name: str, command: Callable[[str], list[str]], *, of_processor: bool, repetitions: int) -> None:
        # The first one fills caches of files. Each has a folder of its own: a batch goes on where it was.
        with tempfile.TemporaryDirectory() as folder:
            all_taken = [taken(command(f"{folder}/{i}"))[of_processor] for i in range(1 + repetitions)]
        seconds = statistics.median(all_taken[1:])
        note(name, seconds)
        print(f"| {name} | {seconds:.3f} | {'CPU' if of_processor else 'wall'}, median of {repetitions} |", flush=True)

    def run(file: str) -> Callable[[str], list[str]]:
        return lambda out: [interdrive, "run", str(scenarios / file), *RUN, out]

    repetitions = given.repetitions
    tell("python", lambda _: [sys.executable, "-c", ""], of_processor=False, repetitions=repetitions)
    tell("import", lambda _: [sys.executable, "-c", "import interdrive"], of_processor=False, repetitions=repetitions)
    tell("help", lambda _: [interdrive, "--help"], of_processor=False, repetitions=repetitions)
    for name, file in RUNS.items():
        tell(name, run(file), of_processor=True, repetitions=repetitions)
    options = ("--predictor", "lane_following", "--workers", "2", "--quiet", "--out")
    batch = [interdrive, "batch", str(scenarios), *options]
    tell("development", lambda out: [*batch, out], of_processor=False, repetitions=1)


if __name__ == "__main__":
    main()
