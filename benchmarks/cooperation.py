"""What V2X costs: CPU time per step with and without it, see docs/research/cooperation.md.

python benchmarks/cooperation.py [--scenario NAME|FILE] [--predictor NAME] [--cpm] [--agents 24,1000] [--steps 25]
    [--repetitions 3]

Drives the shipped town, or another scenario, with all agents equipped (states, plans, negotiation; with --cpm also what
they see, and with occlusion) and with none, in turn, on one thread. Prints medians, and the quartiles of the ratio of
each pair, which say how much the machine disturbs.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from interdrive.simulation import Simulation

V2X = {"v2x.penetration": 1.0, "v2x.negotiate": True}
#: Agents that enter junctions on orders have nothing to negotiate there.
SETTINGS = {"rules.precedence": False}


def step_time(given: argparse.Namespace, agents: int, settings: dict[str, float | bool]) -> float:
    """CPU time per step [s]."""
    simulation = Simulation(
        given.scenario,
        agents=agents,
        planner="frenet",
        predictor=given.predictor,
        settings={**SETTINGS, "step.max_steps": given.steps, "view.occlusion": given.cpm, **settings},
        threads=1,
    )
    begin = time.process_time()
    simulation.run()
    return (time.process_time() - begin) / given.steps


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--scenario", default="town")
    arguments.add_argument("--predictor", default="lane_following")
    arguments.add_argument("--cpm", action="store_true")
    arguments.add_argument("--agents", default="24,1000")
    arguments.add_argument("--steps", type=int, default=25)
    arguments.add_argument("--repetitions", type=int, default=3)
    given = arguments.parse_args()
    print("| agents | without V2X [ms] | with V2X [ms] | ratio of pairs: median (quartiles) |\n|--:|--:|--:|--:|")
    cooperating = {**V2X, "v2x.cpm": given.cpm}
    for agents in map(int, given.agents.split(",")):
        pairs = [tuple(step_time(given, agents, v2x) for v2x in ({}, cooperating)) for _ in range(given.repetitions)]
        low, ratio, high = np.quantile([after / before for before, after in pairs], [0.25, 0.5, 0.75])
        without, told = 1e3 * np.median(pairs, axis=0)
        print(f"| {agents} | {without:.1f} | {told:.1f} | {ratio:.2f} ({low:.2f}..{high:.2f}) |", flush=True)


if __name__ == "__main__":
    main()
