"""Steps per second of highway-env with many learners, in its own environment; prints them as JSON.

python highway_inside.py SECONDS RUNS

All 24 vehicles learn, act ten times per second with continuous actions, and observe 13 vehicles each, as ours do; there
are no others and no pictures. An episode ends with the first contact, as highway-env has it, and because with random
actions most of the time would be spent on resets, these do not count. Observations are tables of pandas, which take
most of the time of a step, so the same is measured with one vehicle that observes.
"""

import json
import statistics
import sys
import time

import gymnasium
import highway_env  # noqa: F401 - registers the ids
import numpy as np

LEARNERS = 24
OBSERVED = {"type": "Kinematics", "vehicles_count": 13}
CONFIG = {
    "controlled_vehicles": LEARNERS,
    "vehicles_count": 0,
    "action": {"type": "MultiAgentAction", "action_config": {"type": "ContinuousAction"}},
    "simulation_frequency": 10,
    "policy_frequency": 10,
    "duration": 10,
}


def steps_per_second(observation: dict, seconds: float, runs: int) -> float:
    """Median of some runs."""
    env = gymnasium.make("highway-v0", config=CONFIG | {"observation": observation}, disable_env_checker=True)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    actions = [tuple(rng.uniform(-1, 1, (LEARNERS, 2)).astype(np.float32)) for _ in range(16)]
    assert len(env.unwrapped.controlled_vehicles) == LEARNERS == len(env.unwrapped.road.vehicles)
    found = []
    for run in range(runs + 1):
        end, passed, steps = time.perf_counter() + seconds, 0.0, 0
        while time.perf_counter() < end:
            begin = time.perf_counter()
            _, _, terminated, truncated, _ = env.step(actions[steps % 16])
            passed += time.perf_counter() - begin
            steps += 1
            if terminated or truncated:
                env.reset()
        # The first one warms up.
        if run:
            found.append(steps / passed)
    return statistics.median(found)


def main() -> None:
    seconds, runs = float(sys.argv[1]), int(sys.argv[2])
    all_observe = {"type": "MultiAgentObservation", "observation_config": OBSERVED}
    found = {name: steps_per_second(one, seconds, runs) for name, one in (("all", all_observe), ("one", OBSERVED))}
    print(json.dumps({name: LEARNERS * steps for name, steps in found.items()}))


if __name__ == "__main__":
    main()
