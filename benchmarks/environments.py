"""Speed of environments with random actions and autoreset, one thread and more; see docs/reference/environments.md.

python benchmarks/environments.py [SCENARIOS] [--threads 1,2] [--seconds 2] [--runs 5] [--peers]

Prints medians of some runs after 100 steps. SCENARIOS is a folder with USA_US101-23_1_T-1.xml; without one only the
shipped scenario is measured. `--clock cpu` counts the time of the processor, for a machine that does other things as
well; it says nothing about more than one thread.
"""

from __future__ import annotations

import argparse
import statistics
import time
from pathlib import Path
from typing import TYPE_CHECKING

import gymnasium
import numpy as np
from peers.environment import environment, measured
from targets import note

from interdrive import envs, simulate

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.random import Generator

    Clock = Callable[[], float]

#: Steps before the clock starts.
WARM_UP = 100
#: The planning problem that learns, and those that plan beside it in T4.
PROBLEM, TRAFFIC = 2001, ("idm", "frenet")


class Counting(envs.Uniform):
    """Counts the episodes that are drawn."""

    drawn = 0

    def draw(self, rng: Generator) -> int:
        """Position of the next scenario."""
        self.drawn += 1
        return super().draw(rng)


def rates(rows: envs.Rows, seconds: float, runs: int, clock: Clock) -> tuple[float, float]:
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


def reset_share(settings: dict[str, object], world_steps: float, clock: Clock) -> float:
    """Share of the time that beginning episodes takes, at that many world-steps per second on one thread."""
    sampler = Counting()
    rows = envs.Rows(64, sampler=sampler, **settings)
    rows.reset(0)
    rng = np.random.default_rng(0)
    sampler.drawn, steps = 0, 400
    for _ in range(steps):
        rows.step(rng.uniform(-1, 1, rows.actions.shape).astype(np.float32))
    episodes = sampler.drawn / (64 * steps)
    begin, resets = clock(), 50
    for _ in range(resets):
        rows._engine.reset()  # without new generators, as when a world begins anew
    return episodes * (clock() - begin) / (64 * resets) * world_steps


def single(seconds: float, runs: int, clock: Clock) -> float:
    """Steps per second of one environment made by gymnasium."""
    env = gymnasium.make("interdrive/TJunction-v1", traffic="recorded", disable_env_checker=True)
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


def several(seconds: float, runs: int, clock: Clock) -> float:
    """Steps per second of 64 environments in gymnasium's own vector environment."""
    settings = {"scenarios": "t_junction", "learners": [PROBLEM]}
    env = gymnasium.vector.SyncVectorEnv([lambda: envs.DriveEnv(**settings)] * 64)
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (16, 64, 2)).astype(np.float32)
    found = []
    for _ in range(runs):
        begin, steps = clock(), 0
        while (passed := clock() - begin) < seconds:
            env.step(actions[steps % 16])
            steps += 1
        found.append(64 * steps / passed)
    return statistics.median(found)


def costs(settings: dict[str, object], seconds: float, runs: int, clock: Clock) -> dict[str, float]:
    """What each of the observations that are off by default adds to the time per agent-step [s], one thread.

    All take turns, so that a machine that becomes slower does so for all of them.
    """
    extra: dict[str, object] = {"nothing": {}, "edges": 32, "predictions": True, "raster": True}
    found: dict[str, list[float]] = {name: [] for name in extra}
    for _ in range(runs):
        for name, value in extra.items():
            asked = {} if name == "nothing" else {f"observation.{name}": value}
            agents, _ = rates(envs.Rows(8, **settings, **asked), seconds, 1, clock)
            found[name].append(1 / agents)
    least = {name: min(one) for name, one in found.items()}
    return {name: least[name] - least["nothing"] for name in extra if name != "nothing"}


def highway(seconds: float, runs: int) -> dict[str, float]:
    """Agent-steps per second of highway-env with 24 learners, if all observe and if one does."""
    python = environment("highway", ["highway-env==1.12.1"])
    script = Path(__file__).parent / "peers" / "highway_inside.py"
    return measured([str(python), str(script), str(seconds), str(runs)], timeout=600.0)


def planning(traffic: str, runs: int) -> float:
    """Seconds per step that predictions and plans of the traffic take in a run, on one thread, as long as all drive."""
    found = []
    for _ in range(runs):
        run = simulate("t_junction", planner=traffic, threads=1, settings={"step.max_steps": 30})
        n = len(run.agents)
        seconds = [
            taken
            for phase, taken in zip(run.timings.phase, run.timings.seconds, strict=True)
            if phase in ("predict", "plan")
        ]
        found.append(sum(seconds) / len(set(run.timings.time_step.tolist())) * (n - 1) / n)
    return statistics.median(found)


def keep(case: str, agents: float, *, is_wanted: bool) -> None:
    """Notes agent-steps per second for the targets, which are meant for two threads."""
    if is_wanted:
        note(case.partition(":")[0], agents)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("scenarios", type=Path, nargs="?")
    arguments.add_argument("--threads", default="1,2")
    arguments.add_argument("--seconds", type=float, default=2.0)
    arguments.add_argument("--runs", type=int, default=5)
    arguments.add_argument("--clock", choices=("wall", "cpu"), default="wall")
    arguments.add_argument(
        "--peers", action="store_true", help="measures highway-env beside it, in an environment of its own"
    )
    given = arguments.parse_args()
    clock = time.perf_counter if given.clock == "wall" else time.process_time
    threads = [int(one) for one in given.threads.split(",")]
    junction: dict[str, object] = {"scenarios": "t_junction", "learners": [PROBLEM]}
    cases = [("T3: t_junction, 1 learner, 64 worlds", junction)]
    if given.scenarios is not None:
        us101 = next(given.scenarios.rglob("USA_US101-23_1_T-1.xml"))
        cases = [
            ("T1: USA_US101-23, 24 learners, 64 worlds", {"scenarios": us101, "slots": 24}),
            ("T2: USA_US101-23, 1 learner, 64 worlds", {"scenarios": us101, "learners": 1}),
            *cases,
            ("T5: T1 with FrenetTarget", {"scenarios": us101, "slots": 24, "actions": envs.FrenetTarget()}),
            ("T6: T1 with FrenetWeights", {"scenarios": us101, "slots": 24, "actions": envs.FrenetWeights()}),
        ]
    cases += [(f"T4: T3 with {traffic}", {**junction, "traffic": traffic}) for traffic in TRAFFIC]
    alone: dict[str, float] = {}
    print("| case | threads | agent-steps/s | world-steps/s |\n|---|---|---|---|")
    for name, settings in cases:
        for n in threads:
            agents, worlds = rates(envs.Rows(64, threads=n, **settings), given.seconds, given.runs, clock)
            if n == 1:
                alone[name] = worlds
            keep(name, agents, is_wanted=n == 2 and given.clock == "wall")
            print(f"| {name} | {n} | {agents:,.0f} | {worlds:,.0f} |", flush=True)
    print(f"| T7: T3 by gymnasium.make, one world | 1 | {single(given.seconds, given.runs, clock):,.0f} | |")
    print(f"| T3 by gymnasium's SyncVectorEnv | 1 | {several(given.seconds, given.runs, clock):,.0f} | |")
    if given.peers:
        found = highway(given.seconds, given.runs)
        for name in ("all", "one"):
            n = f"{found[name]:,.0f} | {found[name] / 24:,.0f}"
            print(f"| highway-env, 24 learners, {name} of them observe{'s' * (name == 'one')} | 1 | {n} |")
    print()
    if given.scenarios is not None:
        for name, added in costs({"scenarios": us101, "slots": 24}, given.seconds, given.runs, clock).items():
            case = "T1 (T9)" if name == "raster" else "T1"
            print(f"- observation.{name} in {case}: {1e6 * added:.1f} us more per agent-step")
    for name, settings in cases:
        if name not in alone or name.startswith(("T5", "T6")):
            continue
        if name.startswith("T4"):
            traffic = str(settings["traffic"])
            native, whole = 1e6 * planning(traffic, given.runs), 1e6 / alone[name]
            print(f"- {name}: {whole:.0f} us per step, of which planning takes {native:.0f} us in a run")
        else:
            print(f"- T8 of {name}: {reset_share(settings, alone[name], clock):.1%} of the time begins episodes")


if __name__ == "__main__":
    main()
