"""Where the time goes from the start of `interdrive run` to its first step.

    python benchmarks/start.py [SCENARIO]

The stages are marked inside the command, without changing it; a second run under `-X importtime` lists what imports of
the largest packages cost (their own time and that of what only they need; listing makes them slower).
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

from targets import note

HIGHWAY = "highway/USA_US101-23_1_T-1.xml"
STAGES = (
    "python and the command line",
    "imports for the simulation",
    "reading the file",
    "agents and routes",
    "first step",
)

#: Runs in the measured process: marks are seconds since the epoch.
_MARKED = """
import json, os, sys, time
marks = []
from interdrive.cli import main
marks.append(time.time())
from interdrive import simulation as s
from interdrive.simulation import preparation
marks.append(time.time())
read, init, step = preparation.open_scenario, s.Simulation.__init__, s.Simulation.step
def reading(*a, **k):
    out = read(*a, **k); marks.append(time.time()); return out
def preparing(self, *a, **k):
    init(self, *a, **k); marks.append(time.time())
def stepping(self):
    step(self); marks.append(time.time()); print(json.dumps(marks)); sys.stdout.flush(); os._exit(0)
preparation.open_scenario, s.Simulation.__init__, s.Simulation.step = reading, preparing, stepping
sys.argv = ["interdrive", "run", sys.argv[1], "--agents", "all"]
main()
"""


def stages(scenario: str) -> list[float]:
    """Seconds of each stage, in one process."""
    start = time.time()
    done = subprocess.run([sys.executable, "-c", _MARKED, scenario], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr.strip() or f"{scenario}: the command ended with exit code {done.returncode}")
    marks = [start, *json.loads(done.stdout.strip().splitlines()[-1])]
    return [after - before for before, after in itertools.pairwise(marks)]


def imports(scenario: str) -> list[tuple[str, float]]:
    """Largest packages with the seconds that their imports took."""
    command = [sys.executable, "-X", "importtime", "-c", _MARKED, scenario]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    own: dict[str, float] = {}
    for line in done.stderr.splitlines():
        if line.startswith("import time:") and line.split("|")[0].split(":")[1].strip().isdigit():
            microseconds, _, name = line.removeprefix("import time:").split("|")
            package = name.strip().split(".")[0]
            own[package] = own.get(package, 0.0) + 1e-6 * float(microseconds)
    return sorted(own.items(), key=lambda item: -item[1])[:10]


def main() -> None:
    folder = Path(os.environ.get("INTERDRIVE_SCENARIOS", "../shared/scenarios"))
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenario", nargs="?", help="CommonRoad file or name of a shipped scenario")
    parser.add_argument("--repeat", type=int, default=5)
    arguments = parser.parse_args()
    recorded = folder / HIGHWAY
    scenario = arguments.scenario or (str(recorded) if recorded.is_file() else "highway")
    runs = [stages(scenario) for _ in range(arguments.repeat)]
    middle = [statistics.median(run[k] for run in runs) for k in range(len(STAGES))]
    whole = statistics.median(sum(run) for run in runs)
    print(f"| {Path(scenario).stem}, start to first step | s |")
    print("|---|--:|")
    for name, seconds in zip(STAGES, middle, strict=True):
        print(f"| {name} | {seconds:.3f} |")
    print(f"| together | {whole:.3f} |")
    if Path(HIGHWAY).stem in scenario:
        note("start", whole)
    print("\n| imports, own time | ms |")
    print("|---|--:|")
    for name, seconds in imports(scenario):
        print(f"| {name} | {1e3 * seconds:.0f} |")


if __name__ == "__main__":
    main()
