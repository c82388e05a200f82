"""How far agents drive from their plans, see docs/research/cooperation.md: the spread of plans that others receive.

    python benchmarks/plan_spread.py [FOLDER] [--planners rollout,idm] [--predictor neural]

Drives every scenario of a folder (that of INTERDRIVE_SCENARIOS) with all agents and prints Markdown, for ordinary plans
and for those of emergencies: root mean squares of driven - planned position along and across the planned heading, by
planner and time after the plan; the distance that 68 % of the plans keep (one standard deviation if they were normally
distributed); and the least rate with which `v2x.plan_sigma` and rate x time cover that.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from interdrive.errors import InterdriveError
from interdrive.files import FOLDER_VARIABLE
from interdrive.native_settings import V2xSettings
from interdrive.prediction_evaluation.recordings import found_files
from interdrive.run import PLAN_STATUS
from interdrive.simulation import simulate

#: Times after the plan [s].
LEADS = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
#: Share of normally distributed values that are within one standard deviation.
SHARE = 0.6827
#: Agents are not held at junctions, as in the study of cooperation.
SETTINGS = {"record.violations": False, "rules.precedence": False}
#: Status of a plan and its lead -> distances along and across [m], shape (2, plans).
Deviations = dict[tuple[str, float], np.ndarray]


def drive(path: Path, planner: str, predictor: str) -> Deviations:
    """Deviations of all agents of a scenario."""
    try:
        run = simulate(path, planner=planner, predictor=predictor, threads=1, settings=SETTINGS)
    except InterdriveError:
        return {}
    states, plans, dt = run.states, run.plans, run.scenario.dt
    row_of = {agent: row for row, agent in enumerate(states.participant_id.tolist())}
    rows = np.array([row_of[agent] for agent in plans.agent_id.tolist()], dtype=int)
    found: Deviations = {}
    for lead in LEADS:
        ahead = round(lead / dt)
        if ahead >= plans.x.shape[1]:
            continue
        then = plans.time_step - states.first_time_step + ahead
        inside = then < states.n_steps
        at = np.where(inside, then, 0)
        there = inside & states.valid[rows, at] & np.isfinite(plans.x[:, ahead])
        east, north = states.x[rows, at] - plans.x[:, ahead], states.y[rows, at] - plans.y[:, ahead]
        cos, sin = np.cos(plans.orientation[:, ahead]), np.sin(plans.orientation[:, ahead])
        along, across = east * cos + north * sin, north * cos - east * sin
        for code, status in enumerate(PLAN_STATUS):
            chosen = there & (plans.status == code)
            if chosen.any():
                found[status, lead] = np.array([along[chosen], across[chosen]], dtype=np.float32)
    return found


def growth(values: dict[float, float], sigma: float) -> float:
    """Least rate [m/s] with which sqrt(sigma² + (rate x time)²) is nowhere below the values [m]."""
    return max(np.sqrt(max(value**2 - sigma**2, 0.0)) / lead for lead, value in values.items())


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("folder", type=Path, nargs="?", default=os.environ.get(FOLDER_VARIABLE))
    arguments.add_argument("--planners", default="rollout,idm")
    arguments.add_argument("--predictor", default="neural")
    arguments.add_argument("--workers", type=int, default=os.cpu_count())
    given = arguments.parse_args()
    if given.folder is None:
        arguments.error(f"no folder is given, and {FOLDER_VARIABLE} names none")
    files = [path for path, _ in found_files([given.folder])]
    sigma = V2xSettings().plan_sigma
    print("| planner | plans | | measure | " + " | ".join(f"{lead:g} s" for lead in LEADS) + " | rate [m/s] |")
    print("|---|---|---|---|" + "--:|" * len(LEADS) + "--:|")
    with ProcessPoolExecutor(given.workers, multiprocessing.get_context("spawn")) as pool:
        for planner in given.planners.split(","):
            total: dict[tuple[str, float], list[np.ndarray]] = defaultdict(list)
            for found in pool.map(drive, files, [planner] * len(files), [given.predictor] * len(files)):
                for key, values in found.items():
                    total[key].append(values)
            for status in dict.fromkeys(status for status, _ in total):
                by_lead = {lead: np.concatenate(total[status, lead], axis=1) for lead in LEADS if total[status, lead]}
                number = max(values.shape[1] for values in by_lead.values())
                for place, name in enumerate(("along", "across")):
                    rms = {lead: float(np.sqrt(np.mean(values[place] ** 2))) for lead, values in by_lead.items()}
                    most = {lead: float(np.quantile(abs(values[place]), SHARE)) for lead, values in by_lead.items()}
                    for measure, found, rate in (("RMS", rms, ""), ("68 %", most, f"{growth(most, sigma):.2f}")):
                        cells = " | ".join(f"{found[lead]:.2f}" if lead in found else "" for lead in LEADS)
                        head = f"| {planner} | {number} {status} | {name} [m] | {measure}"
                        print(f"{head} | {cells} | {rate} |", flush=True)


if __name__ == "__main__":
    main()
