"""Batches with invented runs, and what is found in comparisons of them."""

import hashlib

from interdrive.batches import BatchFolder
from interdrive.batches.columns import AGENT_COLUMNS, COLUMNS
from interdrive.batches.dataset import encoded, joined
from interdrive.batches.job import Finished
from interdrive.storage import arrow_table, labels

#: A file for each of so many runs takes long to write and to read.
MANY = 20


def invented(folder, runs):
    """A batch folder with invented runs.

    Args:
        folder: Where.
        runs: (scenario, planner, agents) each, or with what differs in the run as a fourth; agents is a status, or a
            mapping from ids to what differs from an agent that has reached its goal.
    """
    batch, tables = BatchFolder.create(folder), []
    for scenario, planner, agents, *other in runs:
        key = hashlib.sha256(f"{scenario} {planner} {other}".encode()).hexdigest()[:32]
        sha = hashlib.sha256(scenario.encode()).hexdigest()
        run = {
            "key": key, "scenario": scenario, "category": scenario.partition("/")[0], "planner": planner,
            "predictor": "lane_following", "settings": "", "traffic": "same", "agents": "all", "seed": 0,
            "status": "finished", "error": "", "attempts": 1, "digest": key, "dt": 0.1, "n_steps": 100,
            "read_seconds": 0.1, "run_seconds": 1.0, "kept": False, "path": f"/{scenario}.xml",
            "scenario_sha256": sha, "version": "0",
            **(other[0] if other else {}),
        }  # fmt: skip
        if isinstance(agents, str):
            rows = [{**run, "status": agents, **dict.fromkeys(column.name for column in AGENT_COLUMNS)}]
        else:
            usual = {
                column.name: 1.0 if column.kind == "number" else 0 if column.kind == "integer" else ""
                for column in AGENT_COLUMNS
            }
            usual |= {"under_test": True, "off_road": False, "outcome": "goal_reached", "agent_planner": planner}
            usual |= {"harm": None, "partner_id": None, "impact_area": None, "fault": False, "fault_nuplan": False}
            usual |= dict.fromkeys(column.name for column in AGENT_COLUMNS if column.name.startswith("preventable_"))
            usual |= {"in_time": True, "arrived": True, "forced": False}
            rows = [{**run, **usual, "agent_id": agent, **own} for agent, own in agents.items()]
        values = {column.name: [row[column.name] for row in rows] for column in COLUMNS}
        for column in COLUMNS:
            if column.kind == "label" and values[column.name][0] is not None:
                values[column.name] = labels(tuple(values[column.name]))
        tables.append(arrow_table(COLUMNS, values))
        if len(runs) < MANY:
            batch.store(key, Finished("finished", "", encoded(tables[-1])))
    if len(runs) >= MANY:  # merged, as a batch leaves them behind
        batch.results.write_bytes(encoded(joined(tables)))
    return folder


def crash(harm=0.5):
    return {"outcome": "collision", "harm": harm}


def row(found, category, variant):
    return next(r for r in found.table.to_pylist() if (r["category"], r["variant"]) == (category, variant))


def difference(found, metric, category="all"):
    rows = found.differences.to_pylist()
    return next(r for r in rows if (r["category"], r["metric"]) == (category, metric))
