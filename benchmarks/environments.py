"""Speed of environments with random actions and autoreset: agent-steps and world-steps per second.

python benchmarks/environments.py [SCENARIOS] [--threads 1,2] [--seconds 2] [--runs 5]

Prints the median of some runs after 100 steps. SCENARIOS is a folder with USA_US101-23_1_T-1.xml; without one only the
shipped scenario is measured. `--clock cpu` counts the time of the processor, for a machine that does other things as
well; it says nothing about more than one thread.
"""

from __future__ import annotations

import argparse
import statistics
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from interdrive import envs

if TYPE_CHECKING:
    from collections.abc import Callable

#: Steps before the clock starts.
WARM_UP = 100


def rates(rows: envs.Rows, seconds: float, runs: int, clock: Callable[[], float]) -> tuple[float, float]:
    """Agent-steps and world-steps per second, medians."""
    rows.reset(0)
    rng = np.random.default_rng(0)
    actions = [rng.uniform(-1, 1, rows.actions.shape).astype(np.float32) for _ in range(16)]
    for step in range(WARM_UP):
        rows.step(actions[step % 16])
    found = []
    for _ in range(runs):
        begin, agents, steps = clock(), 0, 0
        while (passed := clock() - begin) < seconds:
            agents += int(np.count_nonzero(rows.masks))
            rows.step(actions[steps % 16])
            steps += 1
        found.append((agents / passed, steps * rows.num_worlds / passed))
    return statistics.median(one[0] for one in found), statistics.median(one[1] for one in found)


def single(seconds: float, runs: int, clock: Callable[[], float]) -> float:
    """Steps per second of one environment made by gymnasium."""
    import gymnasium

    env = gymnasium.make("interdrive/TJunction-v0", traffic="recorded", disable_env_checker=True)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, (64, 2)).astype(np.float32)
    found = []
    for _ in range(runs):
        begin, steps = clock(), 0
        while (passed := clock() - begin) < seconds:
            *_, terminated, truncated, _ = env.step(actions[steps % 64])
            steps += 1
            if terminated or truncated:
                env.reset()
        found.append(steps / passed)
    return statistics.median(found)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("scenarios", type=Path, nargs="?")
    arguments.add_argument("--threads", default="1,2")
    arguments.add_argument("--seconds", type=float, default=2.0)
    arguments.add_argument("--runs", type=int, default=5)
    arguments.add_argument("--clock", choices=("wall", "cpu"), default="wall")
    given = arguments.parse_args()
    clock = time.perf_counter if given.clock == "wall" else time.process_time
    cases: list[tuple[str, dict[str, object]]] = [
        ("T3: t_junction, 1 learner, 64 worlds", {"scenarios": "t_junction", "learners": [2001]})
    ]
    if given.scenarios is not None:
        us101 = next(given.scenarios.rglob("USA_US101-23_1_T-1.xml"))
        cases = [
            ("T1: USA_US101-23, 24 learners, 64 worlds", {"scenarios": us101, "slots": 24}),
            ("T2: USA_US101-23, 1 learner, 64 worlds", {"scenarios": us101, "learners": 1}),
            *cases,
        ]
    print("| case | threads | agent-steps/s | world-steps/s |\n|---|---|---|---|")
    for name, settings in cases:
        for threads in map(int, given.threads.split(",")):
            agents, worlds = rates(envs.Rows(64, threads=threads, **settings), given.seconds, given.runs, clock)
            print(f"| {name} | {threads} | {agents:,.0f} | {worlds:,.0f} |", flush=True)
    print(f"| T7: t_junction by gymnasium.make | 1 | {single(given.seconds, given.runs, clock):,.0f} | |")


if __name__ == "__main__":
    main()
