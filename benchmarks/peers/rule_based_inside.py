"""Runs in the environment of highway-env: rule-based traffic without planning, and the time of its steps.

Prints one line of JSON. Nothing of interdrive is imported here.
"""

from __future__ import annotations

import argparse
import json
import resource
import time


def main() -> None:
    """Steps of 0.1 s with a number of vehicles that follow the IDM and change lane by MOBIL."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vehicles", type=int, required=True)
    parser.add_argument("--steps", type=int, required=True)
    parser.add_argument("--started", type=float, required=True)
    arguments = parser.parse_args()

    import gymnasium
    import highway_env

    gymnasium.register_envs(highway_env)
    configuration = {
        # The vehicle of the environment is one of them; it is rule-based, too, once it is replaced below.
        "vehicles_count": arguments.vehicles - 1,
        "lanes_count": 6,
        "duration": 10**6,
        "simulation_frequency": 10,
        "policy_frequency": 10,
        "observation": {"type": "Kinematics", "vehicles_count": 1},
        "offscreen_rendering": False,
    }
    environment = gymnasium.make("highway-v0", config=configuration).unwrapped
    environment.reset(seed=0)
    road = environment.road
    # All vehicles are driven by rules: the controlled vehicle is exchanged for one like the others.
    controlled = environment.vehicle
    rules = type(next(vehicle for vehicle in road.vehicles if vehicle is not controlled))
    road.vehicles[road.vehicles.index(controlled)] = rules.create_from(controlled)
    seconds, first_step = [], 0.0
    for _ in range(arguments.steps):
        begin = time.perf_counter()
        road.act()
        road.step(0.1)
        seconds.append(time.perf_counter() - begin)
        first_step = first_step or time.time() - arguments.started
    crashed = sum(bool(vehicle.crashed) for vehicle in road.vehicles)
    print(
        json.dumps(
            {
                "agents": len(road.vehicles),
                "seconds": seconds,
                "first_step": first_step,
                "memory": 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
                "outcomes": {"collision": crashed, "running": len(road.vehicles) - crashed},
            }
        )
    )


if __name__ == "__main__":
    main()
