"""One table: time per step and phase, start to first step, memory; median of runs, each in its own process.

The scenario is the six-lane highway of the development set if it is there (INTERDRIVE_SCENARIOS, default
../shared/scenarios), and always the shipped ones.
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
from pathlib import Path
from typing import Any

from targets import note

HIGHWAY = "highway/USA_US101-23_1_T-1.xml"


def measure(scenario: str, agents: str, threads: int, predictor: str, steps: int) -> dict[str, float]:
    """Runs once in this process; times in seconds, memory in bytes."""
    start = time.perf_counter()
    import numpy as np

    from interdrive.run import PHASES
    from interdrive.simulation import Simulation

    number = agents if agents == "all" else int(agents)
    simulation = Simulation(scenario, agents=number, threads=threads, predictor=predictor)
    simulation.step()
    first_step = time.perf_counter() - start
    begin, native = time.perf_counter(), simulation.world.native_seconds
    while not simulation.is_done and simulation.time_step < steps:
        simulation.step()
    native = simulation.world.native_seconds - native
    python = 1.0 - native / (time.perf_counter() - begin)
    run = simulation.record()
    n_steps = len(run.timings.time_step) // len(PHASES)
    seconds = run.timings.seconds.reshape(n_steps, len(PHASES))
    driving = np.array([np.count_nonzero(run.plans.time_step == t) for t in np.unique(run.plans.time_step)])
    full = driving >= 0.9 * driving.max()
    result = {
        "agents": float(driving.max()),
        "participants": float(len(run.states.participant_id)),
        "steps": float(n_steps),
        "first_step": first_step,
        "python": python,
        "step": float(np.median(seconds.sum(axis=1))),
        "full_step": float(np.median(seconds[full].sum(axis=1))),
        "full_steps": float(full.sum()),
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024.0,
    }
    for name, share in zip(PHASES, seconds[full].sum(axis=0) / seconds[full].sum(), strict=True):
        result[f"share_{name}"] = float(share)
    return result


class KeepsSpeed:
    """A trivial planner in Python that knows how long it took itself."""

    seconds, calls = 0.0, 0

    def plan(self, view: Any, _predictions: Any) -> Any:  # noqa: ANN401, D102
        import numpy as np

        from interdrive import Trajectory

        start, ego, same = time.perf_counter(), view.ego, np.ones(31)
        along = ego.velocity * view.dt * np.arange(31)
        cos, sin = np.cos(ego.orientation), np.sin(ego.orientation)
        plan = Trajectory(ego.x + along * cos, ego.y + along * sin, ego.orientation * same, ego.velocity * same)
        KeepsSpeed.seconds += time.perf_counter() - start
        KeepsSpeed.calls += 1
        return plan


def measure_kind(scenario: str, kind: str) -> dict[str, float]:
    """24 agents with a recording, all of one planner kind, two threads: seconds per step while nearly all drive."""
    import numpy as np

    from interdrive.run import PHASES
    from interdrive.simulation import Simulation

    all_agents = Simulation(scenario, agents="all", threads=2)
    recorded = [agent.id for agent in all_agents.agents if agent.origin == "recorded"][:24]
    planner = KeepsSpeed if kind == "python" else kind
    run = Simulation(scenario, agents=recorded, planner=planner, threads=2).run()
    seconds = run.timings.seconds.reshape(-1, len(PHASES))
    driving = np.array([np.count_nonzero(run.plans.time_step == t) for t in np.unique(run.plans.time_step)])
    result = {"step": float(np.median(seconds[driving >= 0.9 * driving.max()].sum(axis=1)))}
    if KeepsSpeed.calls:
        outside = float(seconds[:, PHASES.index("plan_python")].sum()) - KeepsSpeed.seconds
        result["overhead"] = outside / KeepsSpeed.calls
    return result


def print_kinds(scenario: str, repeat: int) -> None:
    """One row per planner kind, and what a planner in Python costs beyond its own work."""
    print("\n| planner of 24 agents, 2 threads | ms per step | µs per plan beyond the planner's own work |")
    print("|---|--:|--:|")
    for kind in ("recorded", "velocity_adjusting", "idm", "idm_mobil", "frenet", "rollout", "python"):
        runs = []
        for _ in range(repeat):
            command = [sys.executable, __file__, "--kind", scenario, kind]
            runs.append(json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout))
        middle = {key: statistics.median(run[key] for run in runs) for key in runs[0]}
        overhead = f"{1e6 * middle['overhead']:.1f}" if "overhead" in middle else ""
        print(f"| {kind} | {1e3 * middle['step']:.2f} | {overhead} |")


def keep(found: dict[tuple[str, str, int, str], dict[str, float]]) -> None:
    """Notes what belongs to a target."""
    name, usual = Path(HIGHWAY).stem, "lane_following"
    both, alone = found.get((name, "24", 2, usual)), found.get((name, "24", 1, usual))
    if both and alone:
        note("step_highway", both["full_step"])
        note("python_share", both["python"])
        note("second_thread", alone["full_step"] / both["full_step"])
        note("step_24_neural", found[name, "24", 2, "neural"]["full_step"])
    few, many = found["town", "24", 2, usual], found["town", "1000", 2, usual]
    note("step_1000", many["full_step"])
    note("growth", many["full_step"] / few["full_step"] / (1000 / 24))


def command_start(scenario: str, agents: str) -> float:
    """Seconds from the start of the command line to the first step."""
    code = (
        "import sys, time; from interdrive import simulation as s; original = s.Simulation.step\n"
        "def step(self):\n    original(self); print(time.time()); sys.stdout.flush(); import os; os._exit(0)\n"
        "s.Simulation.step = step\n"
        "from interdrive.cli import main\n"
        f"sys.argv = ['interdrive', 'run', {scenario!r}, '--agents', {agents!r}]; main()"
    )
    start = time.time()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return float(done.stdout.strip().splitlines()[-1]) - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument(
        "--one", nargs=5, metavar=("SCENARIO", "AGENTS", "THREADS", "PREDICTOR", "STEPS"), help=argparse.SUPPRESS
    )
    parser.add_argument("--kind", nargs=2, metavar=("SCENARIO", "PLANNER"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.kind:
        print(json.dumps(measure_kind(*arguments.kind)))
        return
    if arguments.one:
        scenario, agents, threads, predictor, steps = arguments.one
        print(json.dumps(measure(scenario, agents, int(threads), predictor, int(steps))))
        return
    folder = Path(os.environ.get("INTERDRIVE_SCENARIOS", "../shared/scenarios"))
    usual = "lane_following"
    cases = [("t_junction", "all", 2, usual), ("intersection", "all", 2, usual), ("highway", "24", 2, usual)]
    cases += [("town", "24", 2, usual), ("town", "1000", 2, usual)]
    if (folder / HIGHWAY).exists():
        highway = str(folder / HIGHWAY)
        cases = [
            (highway, "24", 2, usual),
            (highway, "24", 1, usual),
            (highway, "all", 2, usual),
            (highway, "24", 2, "neural"),
            *cases,
        ]
    else:
        print(f"{folder / HIGHWAY} is not there: only the shipped scenarios are measured")
    print(
        "| scenario | agents | participants | threads | predictor | ms per step (all agents) | ms per step (whole run) "
        "| plan | predict | collision | advance | observe | Python | start to first step | memory |"
    )
    print("|---|--:|--:|--:|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|")
    found: dict[tuple[str, str, int, str], dict[str, float]] = {}
    for scenario, agents, threads, predictor in cases:
        runs = []
        steps = "30" if scenario == "town" else "100000"
        for _ in range(arguments.repeat):
            command = [sys.executable, __file__, "--one", scenario, agents, str(threads), predictor, steps]
            done = subprocess.run(command, capture_output=True, text=True, check=True)
            runs.append(json.loads(done.stdout))
        middle = {key: statistics.median(run[key] for run in runs) for key in runs[0]}
        found[Path(scenario).stem, agents, threads, predictor] = middle
        start = statistics.median(command_start(scenario, agents) for _ in range(arguments.repeat))
        shares = " | ".join(
            f"{100 * middle['share_' + phase]:.0f} %"
            for phase in ("plan", "predict", "collision", "advance", "observe")
        )
        print(
            f"| {Path(scenario).stem} | {middle['agents']:.0f} | {middle['participants']:.0f} | {threads} "
            f"| {predictor} | {1e3 * middle['full_step']:.2f} | {1e3 * middle['step']:.2f} | {shares} "
            f"| {100 * middle['python']:.1f} % | {start:.2f} s | {middle['memory'] / 2**20:.0f} MiB |"
        )
    keep(found)
    if (folder / HIGHWAY).exists():
        print_kinds(str(folder / HIGHWAY), arguments.repeat)


if __name__ == "__main__":
    main()
