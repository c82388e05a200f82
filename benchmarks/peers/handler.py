"""interdrive and the CommonRoad scenario handler of FRENETIX on the same scenario and the same agents, in one run.

The peer is a checkout of TUM-AVS/Frenetix-Motion-Planner 2024.4 that you have made; it is copied to a temporary folder
and run there in an environment of its own, which is made once from public packages (about 6 GB, most of it PyTorch):

    git clone --branch 2024.4 https://github.com/TUM-AVS/Frenetix-Motion-Planner ../frenetix-motion-planner
    .venv/bin/python benchmarks/peers/handler.py ../frenetix-motion-planner

Both plan at every step with sampling planners; the peer predicts with Wale-Net, interdrive with `lane_following`.
Agents are those that the peer accepts. Plots and logs of the peer are off.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from environment import environment, measured
from rows import Row, print_rows

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from targets import note

HIGHWAY = "highway/USA_US101-23_1_T-1.xml"
HERE = Path(__file__).resolve().parent
#: What the checkout's pyproject.toml asks for, without what its simulation never imports.
REQUIREMENTS = [
    "commonroad-drivability-checker~=2024.1.0",
    "commonroad-io>=2024.2,<2025",
    "commonroad-route-planner~=2024.2.1",
    "commonroad-vehicle-models>=3.0.2,<4",
    "frenetix==0.4.0",
    "imageio>=2.31.2,<3",
    "matplotlib~=3.8.1",
    "methodtools~=0.4.7",
    "numpy>=1.24.2,<2",
    "omegaconf>=2.1.1,<3",
    "onnxruntime~=1.18.1",
    "pandas~=2.0.3",
    "psutil>=5.9.6",
    "pygeos~=0.14",
    "rich>=13.7.1,<14",
    "scipy>=1.9.3,<1.14",
    "shapely>=2.0.6,<3",
    "torch~=2.2.1",
    "triangle>=20200424",
    "wale-net~=3.0.3",
]


def peer(checkout: Path, arguments: argparse.Namespace, processes: int) -> dict[str, Any]:
    """The peer's run."""
    python = environment("frenetix-motion-planner", REQUIREMENTS)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "checkout"
        shutil.copytree(checkout, copy, ignore=shutil.ignore_patterns(".git", "doc", "logs", "example_scenarios"))
        options = {
            "agents": arguments.agents,
            "steps": arguments.steps,
            "seconds": arguments.seconds,
            "processes": processes,
            "replan-every": arguments.replan_every,
            "started": time.time(),
        }
        command = [str(python), str(HERE / "handler_inside.py"), str(arguments.scenario.resolve())]
        command += [part for name, value in options.items() for part in (f"--{name}", str(value))]
        return measured(command, arguments.seconds + 300.0, copy)


def ours(
    scenario: str,
    agents: int | list[int],
    threads: int,
    replan_every: int,
    steps: int | None = None,
    planner: str = "frenet",
) -> dict[str, Any]:
    """The run of interdrive with the same agents, to its end or for some steps; `frenet` samples as the peer does."""
    asked = json.dumps([scenario, agents, threads, replan_every, steps, planner, time.time()])
    return measured([sys.executable, str(HERE / "handler.py"), "--ours", asked], 600.0)


def drive(
    scenario: str,
    agents: int | list[int],
    threads: int,
    replan_every: int,
    steps: int | None,
    planner: str,
    started: float,
) -> dict[str, Any]:
    """Runs in a process of its own."""
    import resource
    from collections import Counter

    from interdrive.config.binding import bind
    from interdrive.config.schema import SimulationSettings
    from interdrive.simulation import Simulation

    settings = bind(SimulationSettings(), {"step.replan_every": replan_every})
    simulation = Simulation(
        scenario, agents=agents, planner=planner, predictor="lane_following", threads=threads, settings=settings
    )
    seconds: list[float] = []
    first_step = 0.0
    while not simulation.is_done and (steps is None or simulation.time_step < steps):
        driving = len(simulation.driving)
        begin = time.perf_counter()
        simulation.step()
        took = time.perf_counter() - begin
        # Steps count while nearly all drive, as they do in the first steps, which is all that the peer makes.
        if driving >= 0.9 * len(simulation.agents):
            seconds.append(took)
        first_step = first_step or time.time() - started
    outcomes = Counter(simulation.record().outcomes.outcome)
    memory = 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {
        "agents": [agent.id for agent in simulation.agents],
        "seconds": seconds,
        "first_step": first_step,
        "memory": memory,
        "outcomes": outcomes,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkout", nargs="?", type=Path, help="checkout of TUM-AVS/Frenetix-Motion-Planner 2024.4")
    folder = Path(os.environ.get("INTERDRIVE_SCENARIOS", "../shared/scenarios"))
    parser.add_argument("--scenario", type=Path, default=folder / HIGHWAY, help="CommonRoad file")
    parser.add_argument("--agents", type=int, default=24)
    parser.add_argument("--steps", type=int, default=6, help="of the peer, at most")
    parser.add_argument("--seconds", type=float, default=120.0, help="for the peer's steps, at most")
    parser.add_argument("--processes", type=int, nargs="*", default=[1, 3], help="of the peer, one run each")
    parser.add_argument("--replan-every", type=int, default=1, help="steps (the peer's own default is 3)")
    parser.add_argument("--ours", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.ours:
        print(json.dumps(drive(*json.loads(arguments.ours))))
        return
    if arguments.checkout is None or not (arguments.checkout / "cr_scenario_handler").is_dir():
        parser.error("give a checkout of TUM-AVS/Frenetix-Motion-Planner 2024.4; see docs/research/performance.md")
    if not arguments.scenario.is_file():
        parser.error(f"{arguments.scenario}: no such file; --scenario names a CommonRoad file")
    rows, agents = [], []
    for processes in arguments.processes:
        found = peer(arguments.checkout, arguments, processes)
        agents = found["agents"]
        rows.append(Row(f"FRENETIX scenario handler 2024.4, {processes} process{'es' * (processes > 1)}", found))
    for threads in sorted({1, os.cpu_count() or 1}):
        found = ours(str(arguments.scenario), agents, threads, arguments.replan_every)
        rows.append(Row(f"interdrive, frenet, {threads} thread{'s' * (threads > 1)}", found))
    print(f"{arguments.scenario.stem}, {len(agents)} agents, a plan every {arguments.replan_every} steps\n")
    print_rows(rows, len(agents))
    best = min(row.step for row in rows[: len(arguments.processes)])
    fastest = min(row.step for row in rows[len(arguments.processes) :])
    print(f"\nThe best of the peer takes {best / fastest:.0f} times as long per step as the best of interdrive.")
    if arguments.scenario.stem == Path(HIGHWAY).stem:
        note("peer_ratio", best / fastest)


if __name__ == "__main__":
    main()
