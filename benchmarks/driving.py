"""Drives every scenario of a folder with all agents and prints what came of it as Markdown.

Outcomes by category, refusals, the slowest scenarios, and one category agent by agent:

    python benchmarks/driving.py ../shared/scenarios --agents-of t_junction
"""

from __future__ import annotations

import argparse
import time
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

from interdrive.errors import InterdriveError
from interdrive.run import OUTCOMES, PHASES, Run
from interdrive.simulation import simulate


def agent_rows(run: Run) -> list[str]:
    """One row per agent: goal time, outcome, time, partner, impact speed."""
    rows = []
    ended = run.outcomes
    for i, agent in enumerate(run.agents):
        emergency = int((run.plans.status[run.plans.agent_id == agent.id] == 2).sum())
        partner = (
            "edge of the road" if ended.off_road[i] else (str(ended.partner_id[i]) if ended.partner_id[i] >= 0 else "")
        )
        impact = f"{ended.impact_speed[i]:.1f}" if np.isfinite(ended.impact_speed[i]) else ""
        first, last = (step * run.scenario.dt for step in agent.goal_time_step)
        rows.append(
            f"| {run.scenario.name} | {agent.id} | {agent.origin} | {first:.1f} to {last:.1f} | {ended.outcome[i]} "
            f"| {ended.time_step[i] * run.scenario.dt:.1f} | {partner} | {impact} | {emergency} |"
        )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--agents-of", metavar="CATEGORY", help="list the agents of this category one by one")
    parser.add_argument("--planner", default="frenet")
    parser.add_argument("--predictor", default="lane_following")
    parser.add_argument("--threads", type=int, default=2)
    arguments = parser.parse_args()
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    refused, detailed, ends, durations = [], [], [], []
    for path in sorted(arguments.folder.glob("*/*.xml")):
        start = time.perf_counter()
        try:
            run = simulate(path, planner=arguments.planner, predictor=arguments.predictor, threads=arguments.threads)
        except InterdriveError as error:
            refused.append(f"| {path.parent.name} | {path.stem} | {error} |")
            continue
        seconds = time.perf_counter() - start
        steps = run.timings.seconds.reshape(-1, len(PHASES)).sum(axis=1)
        durations.append((seconds, path.stem, len(run.agents), len(steps), 1e3 * float(np.median(steps))))
        counts[path.parent.name].update(run.outcomes.outcome)
        counts[path.parent.name]["scenarios"] += 1
        if path.parent.name == arguments.agents_of:
            detailed += agent_rows(run)
        bad = [
            i
            for i, outcome in enumerate(run.outcomes.outcome)
            if outcome in ("collision", "infeasible", "planner_error")
        ]
        rows = agent_rows(run)
        ends += [rows[i] for i in bad]
    columns = ["scenarios", *OUTCOMES]
    total: Counter[str] = sum(counts.values(), Counter())
    print("| category | agents | " + " | ".join(columns) + " | in time |")
    print("|---|" + "--:|" * (len(columns) + 2))
    for name, row in [*sorted(counts.items()), ("all", total)]:
        agents = sum(row[outcome] for outcome in OUTCOMES)
        cells = " | ".join(str(row[column]) for column in columns)
        print(f"| {name} | {agents} | {cells} | {100 * row['goal_reached'] / agents:.1f} % |")
    print(f"\nRefused: {len(refused)}\n\n| category | file | why |\n|---|---|---|")
    print("\n".join(refused))
    print("\nSlowest\n\n| file | agents | steps | ms per step (median) | seconds in all |\n|---|--:|--:|--:|--:|")
    for seconds, name, agents, n_steps, step in sorted(durations, reverse=True)[:5]:
        print(f"| {name} | {agents} | {n_steps} | {step:.1f} | {seconds:.1f} |")
    header = "| scenario | agent | origin | goal [s] | outcome | time [s] | with | impact [m/s] | emergency steps |"
    print(f"\nCollisions and infeasible agents\n\n{header}\n|---|--:|---|---|---|--:|---|--:|--:|")
    print("\n".join(ends))
    if detailed:
        print(f"\n{arguments.agents_of}, agent by agent\n\n{header}\n|---|--:|---|---|---|--:|---|--:|--:|")
        print("\n".join(detailed))


if __name__ == "__main__":
    main()
