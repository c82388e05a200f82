"""Counts how all agents of some scenarios end if a learned policy drives them, and if simpler drivers or planners do.

    python examples/rl/compare.py out/ppo/policy.safetensors --unseen FOLDER > table.md

Sets: A, the shipped scenarios without the highway; B, with it; C, the files ZAM_Tjunction-* of a folder, which were not
trained on; D, junctions that scenarios/varied.py has made of seeds that were not trained on. All agents drive alike
from the first time step on, and expect others to follow their lanes.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from interdrive import envs, simulate

if TYPE_CHECKING:
    from collections.abc import Callable

    Drive = Callable[[np.ndarray], np.ndarray]

A = ["t_junction", "intersection", "lane_merge"]
SETS: dict[str, list[str | Path]] = {"A": [*A], "B": [*A, "highway"]}
OUTCOMES = ("goal_reached", "goal_reached_late", "goal_missed", "collision", "off_road", "time_limit")
PLANNERS = ("idm", "frenet")
#: Full stick: of the curvature, and of the lateral acceleration.
CURVATURE_MAX, LATERAL_MAX = 0.2, 4.0
#: Where the ego and the route are among the observations, and rows of the route: metres ahead.
ROUTE, AHEAD = slice(28, 156), np.array([2, 4, 6, 9, 12, 16, 20, 25, 30, 36, 42, 50, 60, 72, 86, 100])


def nothing(observations: np.ndarray) -> np.ndarray:
    """Keeps speed and steering wheel straight."""
    return np.zeros((len(observations), 2), np.float32)


def hold_speed(observations: np.ndarray) -> np.ndarray:
    """Keeps its speed and pursues the point of its path that lies 0.8 s ahead, at least 6 m; minds no other vehicle."""
    actions = nothing(observations)
    for action, observation in zip(actions, observations, strict=True):
        velocity, route = 40 * observation[0], observation[ROUTE].reshape(16, 8)
        reach = max(6.0, 0.8 * velocity)
        x, y = (np.interp(reach, AHEAD, 100 * route[:, column]) for column in (1, 2))
        curvature = 2 * y / (x**2 + y**2)
        action[1] = np.clip(curvature / min(CURVATURE_MAX, LATERAL_MAX / max(velocity, 1.0) ** 2), -1, 1)
    return actions


def at_random(seed: int) -> Drive:
    """Any action is equally likely."""
    rng = np.random.default_rng(seed)
    return lambda observations: rng.uniform(-1, 1, (len(observations), 2)).astype(np.float32)


def driven(scenario: str | Path, drive: Drive) -> Counter[str]:
    """Outcomes of the agents of a scenario, by what their observations become."""
    env, found = envs.parallel_env(scenarios=scenario), Counter[str]()
    observations, _ = env.reset(seed=0)
    while env.agents:
        names = env.agents
        actions = drive(np.stack([observations[name] for name in names]))
        observations, _, _, _, infos = env.step(dict(zip(names, actions, strict=True)))
        found.update("off_road" if info["off_road"] else info["outcome"] for info in infos.values() if info)
    return found


def planned(scenario: str | Path, planner: str) -> Counter[str]:
    """Outcomes of the agents of a scenario with a planner."""
    run = simulate(scenario, agents="all", planner=planner, predictor="lane_following")
    return Counter(
        "off_road" if off_road else outcome
        for outcome, off_road in zip(run.outcomes.outcome, run.outcomes.off_road, strict=True)
    )


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("policy", type=Path, help="file of a policy, or several", nargs="*")
    arguments.add_argument("--unseen", type=Path, help="folder with ZAM_Tjunction-*")
    arguments.add_argument("--yielding", type=Path, help="folder that scenarios/varied.py has made, of other seeds")
    given = arguments.parse_args()
    sets = dict(SETS)
    if given.unseen is not None:
        sets["C"] = sorted(given.unseen.rglob("ZAM_Tjunction-*.xml"))
    if given.yielding is not None:
        sets["D"] = sorted(given.yielding.glob("*.xml"))
    columns: dict[str, Callable[[str | Path], Counter[str]]] = {
        "random": lambda scenario: driven(scenario, at_random(0)),
        "nothing": lambda scenario: driven(scenario, nothing),
        "hold speed": lambda scenario: driven(scenario, hold_speed),
        **{name: lambda scenario, name=name: planned(scenario, name) for name in PLANNERS},
        **{file.stem: lambda scenario, file=file: planned(scenario, f"policy,file={file}") for file in given.policy},
    }
    counted = {
        name: {scenario: count(scenario) for scenario in {one: None for several in sets.values() for one in several}}
        for name, count in columns.items()
    }
    print("| set | agents | driver |", " | ".join(OUTCOMES), "|")
    print("|---|---|---|" + "---|" * len(OUTCOMES))
    for name, scenarios in sets.items():
        for driver, by_scenario in counted.items():
            total = sum((by_scenario[scenario] for scenario in scenarios), Counter[str]())
            n = total.total()
            print(f"| {name} | {n} | {driver} |", " | ".join(f"{total[one] / n:.0%}" for one in OUTCOMES), "|")


if __name__ == "__main__":
    main()
