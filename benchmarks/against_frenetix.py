"""Our `frenet` and the published FRENETIX in one run: time per plan on the same scenes, and outcomes.

Needs the extra `frenetix` and the recorded scenarios (INTERDRIVE_SCENARIOS, default ../shared/scenarios); in the
environment of `make third_party`:

    .venv-third/bin/python benchmarks/against_frenetix.py    # times; outcomes of the two small scenarios
    .venv-third/bin/python benchmarks/against_frenetix.py --all  # outcomes of the highway, too (minutes)

Times: one thread; both planners are asked in the same scenes, those of a run that `frenet` drives, with the same
predictions, 800 samples, weights and margins; `frenetix` computes its start from the agent's state, as `frenet` does.
"""

from __future__ import annotations

import argparse
import os
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
from targets import note

from interdrive.planners import Frenet
from interdrive.planners.frenetix import Frenetix
from interdrive.run import OUTCOMES
from interdrive.simulation import Simulation, simulate

HIGHWAY = "highway/USA_US101-23_1_T-1.xml"
SCENARIOS = {HIGHWAY: 24, "t_junction/ZAM_Tjunction-1_42_T-1.xml": "all", "merge/ZAM_Zip-1_56_T-1.xml": "all"}
#: The same samples for both: those of the grid.
GRID = Frenet(stop_targets=False)
DRIVERS = {
    "frenet": "frenet",
    "frenetix, as published": "frenetix",
    "frenetix, planned every step from the true state": "frenetix,replan_every=1,carry_state=false",
}


def times_per_plan(scenario: Path, agents: str | int, steps: int, every: int) -> dict[str, np.ndarray]:
    """Seconds per plan of each planner, in every so many of the first steps."""
    records = {"frenet": GRID, "frenet, all samples evaluated": replace(GRID, lazy=False)}
    runs = {
        name: Simulation(scenario, agents=agents, planner=record, predictor="lane_following", threads=1)
        for name, record in records.items()
    }
    others = {agent.id: Frenetix(replan_every=1, carry_state=False) for agent in runs["frenet"].agents}
    seconds: dict[str, list[float]] = {name: [] for name in (*runs, "frenetix")}
    for step in range(steps):
        if runs["frenet"].is_done:
            break
        if step % every == 0:
            for name, simulation in runs.items():
                _observe, _predict, plan = simulation.progress.begin_step().seconds
                seconds[name].append(plan / max(1, len(simulation.driving)))
            world = runs["frenet"].world
            scene = world.scene()
            predictions = runs["frenet"].progress.predict(scene)
            for agent in runs["frenet"].driving:
                view = world.view(scene, agent)
                seen = predictions.seen_by(view)
                start = time.perf_counter()
                others[agent].plan(view, seen)
                seconds["frenetix"].append(time.perf_counter() - start)
        for simulation in runs.values():
            simulation.step()
    return {name: np.array(values) for name, values in seconds.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=60, help="time steps in which times are taken")
    parser.add_argument("--every", type=int, default=15, help="times are taken in every so many of them")
    parser.add_argument("--all", action="store_true", help="outcomes of the highway with 24 agents, too")
    parser.add_argument("--times-only", action="store_true", help="no outcomes")
    arguments = parser.parse_args()
    folder = Path(os.environ.get("INTERDRIVE_SCENARIOS", "../shared/scenarios"))
    print("| ms per plan, median (90 %) | agents | frenet | frenet, all samples evaluated | frenetix | ratio |")
    print("|---|--:|--:|--:|--:|--:|")
    for scenario, agents in SCENARIOS.items():
        found = times_per_plan(folder / scenario, agents, arguments.steps, arguments.every)
        cells = [f"{1e3 * np.median(t):.2f} ({1e3 * np.quantile(t, 0.9):.2f})" for t in found.values()]
        ratio = np.median(found["frenetix"]) / np.median(found["frenet"])
        print(f"| {Path(scenario).stem} | {agents} | {' | '.join(cells)} | {ratio:.0f} |", flush=True)
        if scenario == HIGHWAY:
            note("plan_ratio", float(ratio))
    if arguments.times_only:
        return
    print("\n| outcomes | planner | agents | " + " | ".join(OUTCOMES) + " | s of computing per s |")
    print("|---|---|" + "--:|" * (len(OUTCOMES) + 2))
    for scenario, agents in SCENARIOS.items():
        if scenario == HIGHWAY and not arguments.all:
            continue
        for name, planner in list(DRIVERS.items())[: 2 if scenario == HIGHWAY else None]:
            start = time.perf_counter()
            run = simulate(folder / scenario, agents=agents, planner=planner, predictor="lane_following", threads=1)
            share = (time.perf_counter() - start) / (run.states.x.shape[1] * run.scenario.dt)
            counts = Counter(run.outcomes.outcome)
            row = " | ".join(str(counts[outcome]) for outcome in OUTCOMES)
            print(f"| {Path(scenario).stem} | {name} | {len(run.agents)} | {row} | {share:.2f} |", flush=True)


if __name__ == "__main__":
    main()
