"""Runs in the peer's environment and in a copy of its checkout: drives a scenario for some steps and takes times.

Prints one line of JSON. Nothing of interdrive is imported here.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any


def prepared(arguments: argparse.Namespace) -> Any:  # noqa: ANN401 - the peer's
    """The peer's simulation, without plots and logs."""
    sys.path.insert(0, str(Path.cwd()))
    kept = sys.argv
    sys.argv = kept[:1]  # its configuration reads the command line
    from cr_scenario_handler.simulation.simulation import Simulation
    from cr_scenario_handler.utils.configuration_builder import ConfigurationBuilder

    here, path = str(Path.cwd()), Path(arguments.scenario)
    (Path.cwd() / "logs").mkdir(exist_ok=True)
    build = ConfigurationBuilder
    simulation = build.build_sim_configuration(path.stem, str(path.parent), here)
    planner = build.build_frenetplanner_configuration(path.stem)
    sys.argv = kept
    choices = simulation.simulation
    choices.use_multiagent, choices.use_specific_agents = True, False
    choices.number_of_agents, choices.select_agents_randomly = arguments.agents - 1, False
    choices.multiprocessing, choices.num_procs = arguments.processes > 1, arguments.processes
    choices.msg_log_mode = planner.debug.msg_log_mode = "ERROR"
    shown = simulation.visualization
    shown.save_plots = shown.show_plots = shown.draw_calc_traj = False
    planner.debug.draw_traj_set = planner.debug.collision_report = planner.debug.activate_logging = False
    planner.debug.kinematic_debug = False
    planner.debug.use_cpp, planner.debug.multiproc = True, arguments.processes > 1
    planner.debug.num_workers = os.cpu_count()
    planner.planning.replanning_frequency = arguments.replan_every
    return Simulation(simulation, planner)


def main() -> None:
    """Steps until the number of steps or the time is used up."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenario")
    parser.add_argument("--agents", type=int, required=True)
    parser.add_argument("--steps", type=int, required=True)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--processes", type=int, required=True)
    parser.add_argument("--replan-every", type=int, required=True)
    parser.add_argument("--started", type=float, required=True)
    arguments = parser.parse_args()
    simulation = prepared(arguments)
    parallel = len(simulation.batch_list) > 1
    if parallel:
        for batch in simulation.batch_list:
            batch.start()
    step = simulation._step_parallel_simulation if parallel else simulation.step_sequential_simulation
    seconds: list[float] = []
    first_step = 0.0
    running = True
    while running and len(seconds) < arguments.steps and sum(seconds) < arguments.seconds:
        simulation.global_timestep += 1
        begin = time.perf_counter()
        running = step()
        seconds.append(time.perf_counter() - begin)
        first_step = first_step or time.time() - arguments.started
    # Memory of children is known once they have ended.
    for batch in simulation.batch_list if parallel else []:
        batch.terminate()
        batch.join()
    usage = [resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    outcomes = Counter(agent.status.name.lower() for agent in simulation.agents)
    print(
        json.dumps(
            {
                "agents": [int(agent.id) for agent in simulation.agents],
                "seconds": seconds,
                "first_step": first_step,
                "memory": 1024.0 * (usage[0] + arguments.processes * usage[1] if parallel else usage[0]),
                "outcomes": outcomes,
            }
        ),
        flush=True,
    )
    os._exit(0)


if __name__ == "__main__":
    main()
