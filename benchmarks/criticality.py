"""Criticality: time for all measures of a run, memory of a large one, and how much faster than CommonRoad-CriMe.

CriMe is measured if its environment is there (`make oracles` makes it): on some time steps of one recorded vehicle,
scaled to all of them. Ours computes all measures at once; every ratio is against that whole time.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

ROOT = Path(__file__).resolve().parent.parent
HIGHWAY, JUNCTION = "highway/USA_US101-23_1_T-1.xml", "t_junction/ZAM_Tjunction-1_42_T-1.xml"
#: The recorded vehicle that CriMe judges, and at how many time steps per measure.
EGO, SAMPLES, SAMPLES_OF_SERIES = 5, 30, 4


def seconds(work: Callable[[], object], repeat: int) -> float:
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def runs(folder: Path, repeat: int) -> None:
    from interdrive.criticality import CriticalitySettings
    from interdrive.simulation import simulate

    print("| run | agents | participants | time steps | conflict areas | ms, 1 thread | ms, 2 threads |")
    print("|---|--:|--:|--:|---|--:|--:|")
    cases = [("highway", 24), ("t_junction", "all")]
    if (folder / HIGHWAY).exists():
        cases = [(str(folder / HIGHWAY), 24), (str(folder / JUNCTION), "all"), *cases]
    for scenario, agents in cases:
        run = simulate(scenario, agents=agents, predictor="lane_following", threads=2)
        areas = "stated" if run.scenario.incomings else "crossing"
        settings = CriticalitySettings(conflict_areas=areas)
        one, two = (seconds(partial(run.criticality, settings=settings, threads=n), repeat) for n in (1, 2))
        print(
            f"| {run.scenario.name} | {int(run.states.is_agent.sum())} | {len(run.states.participant_id)} "
            f"| {run.states.n_steps} | {areas} | {1e3 * one:.1f} | {1e3 * two:.1f} |"
        )


def large(agents: int = 1000, steps: int = 300) -> dict[str, float]:
    """Evaluates a crowd on 20 lanes in this process; seconds and bytes."""
    from interdrive.criticality import evaluate
    from interdrive.criticality.tables import criticality_table
    from interdrive.testing import Car, straight_road, world

    cars = [Car(i + 1, 20.0 + 25.0 * (i // 20), 3.5 * (i % 20), 5.0 + 0.3 * (i % 20)) for i in range(agents)]
    scenario = world(straight_road(2000.0, lanes=20), cars=cars, steps=steps - 1)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.perf_counter()
    found = evaluate(scenario, threads=2)
    took = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    rows = criticality_table(found).num_rows
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {
        "seconds": took,
        "before": before * 1024.0,
        "evaluated": after * 1024.0,
        "table": peak * 1024.0,
        "rows": rows,
    }


def crime(scenario_file: str) -> dict[str, float]:
    """Seconds per measure for one vehicle with all others at all time steps; runs in the environment of the oracles."""
    sys.path.insert(0, str(ROOT / "tests" / "oracles"))
    from commonroad.common.file_reader import CommonRoadFileReader
    from crime import MEASURES, CriMe

    scenario, _ = CommonRoadFileReader(scenario_file).open()
    judge = CriMe(scenario, EGO)
    others = [obstacle.obstacle_id for obstacle in scenario.obstacles if obstacle.obstacle_id != EGO]
    last = scenario.obstacle_by_id(EGO).prediction.final_time_step
    found = {}
    for name in MEASURES:
        # These look at all later time steps each time.
        n = SAMPLES_OF_SERIES if name in ("tet", "tit") else SAMPLES
        steps = [round(i * (last - 2) / n) for i in range(n)]
        start = time.perf_counter()
        measure = judge.measure(name)
        made = time.perf_counter()
        for other in others:
            for step in steps:
                try:
                    measure.compute(other, step, verbose=False)
                except Exception:  # noqa: BLE001 - whatever it raises, it has no value there
                    continue
        found[name] = made - start + (time.perf_counter() - made) / n * last
    return found


def compare(folder: Path, repeat: int) -> None:
    from interdrive.criticality import evaluate
    from interdrive.files import read_scenario

    python = ROOT / ".venv-oracles" / "bin" / "python"
    if not (python.exists() and (folder / JUNCTION).exists()):
        print("CriMe is not measured: `make oracles` makes its environment, INTERDRIVE_SCENARIOS names the recordings")
        return
    scenario = read_scenario(folder / JUNCTION)
    ours = seconds(lambda: evaluate(scenario, [EGO], threads=1), 3 * repeat)
    done = subprocess.run(
        [str(python), __file__, "--crime", str(folder / JUNCTION)], capture_output=True, text=True, check=True
    )
    theirs = json.loads(done.stdout.strip().splitlines()[-1])
    total = sum(theirs.values())
    print(f"\n{scenario.name}, vehicle {EGO}, all time steps: all measures in {1e3 * ours:.2f} ms on one thread.")
    print(f"CriMe 0.4.5 needs {total:.1f} s: {total / ours:.0f} times as long.\n")
    print("| measure | CriMe [s] | times our time for all measures |")
    print("|---|--:|--:|")
    for name, value in theirs.items():
        print(f"| {name} | {value:.2f} | {value / ours:.0f} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--crime", metavar="FILE", help=argparse.SUPPRESS)
    parser.add_argument("--large", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.crime:
        print(json.dumps(crime(arguments.crime)))
        return
    if arguments.large:
        print(json.dumps(large()))
        return
    folder = Path(os.environ.get("INTERDRIVE_SCENARIOS", "../shared/scenarios"))
    runs(folder, arguments.repeat)
    done = subprocess.run([sys.executable, __file__, "--large"], capture_output=True, text=True, check=True)
    crowd = json.loads(done.stdout)
    print(
        f"\n1000 vehicles, 300 time steps, 2 threads: {crowd['seconds']:.2f} s, {crowd['evaluated'] / 2**20:.0f} MiB "
        f"in all ({crowd['before'] / 2**20:.0f} MiB before), {crowd['table'] / 2**20:.0f} MiB with the table of "
        f"{crowd['rows']:.0f} rows."
    )
    compare(folder, arguments.repeat)


if __name__ == "__main__":
    main()
