"""A run as Arrow tables, one per file of its folder. What the columns are, the records of `interdrive.run` declare."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.criticality import agent_harm
from interdrive.results.columns import COLUMNS
from interdrive.storage.tables import arrow_table

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import pyarrow as pa
    from numpy.typing import NDArray

    from interdrive.array_types import Ints
    from interdrive.criticality import AgentHarm
    from interdrive.run import AgentRecord, Plans, RunRecord, States
    from interdrive.run.arrays import Tabular


def outcome_table(run: RunRecord, harm: AgentHarm | None = None) -> pa.Table:
    """Outcomes of a `run`, one row per agent, as an Arrow table (`to_pandas()`, `polars.from_arrow`).

    Args:
        run: The run.
        harm: Of its agents; None: from its states.
    """
    ended = run.outcomes
    found = agent_harm(run) if harm is None else harm
    values = {**ended.arrays, **found.arrays, "time_s": _seconds(ended.time_step, run.scenario.dt)}
    return arrow_table(COLUMNS["outcomes"], values)


def states_table(run: RunRecord) -> pa.Table:
    """One row of a `run` per time step and participant that is present then, in that order, as an Arrow table."""
    return table_of_states(run.states, run.scenario.dt)


def table_of_states(states: States, dt: float) -> pa.Table:
    """The same of states, `dt` [s] apart."""
    step, row = np.nonzero(states.valid.T)
    time_step = states.first_time_step + step
    times = {"time_step": time_step, "time_s": _seconds(time_step, dt)}
    return arrow_table(COLUMNS["states"], {**states.spread(row, step), **times})


def _seconds(time_step: Ints, dt: float) -> NDArray[np.float64]:
    """Time steps in seconds, without the last bits of the multiplication."""
    return np.round(time_step * dt, 9)


def plans_table(run: RunRecord) -> pa.Table:
    """One row of a `run` per plan and point, sorted by time step, agent and point, as an Arrow table."""
    return table_of_plans(run.plans)


def table_of_plans(plans: Plans) -> pa.Table:
    """The same of plans."""
    if not plans.x.shape[1]:
        grids = [name for name, column in plans.stored.items() if column.axes == "row and point"]
        nothing: dict[str, Any] = dict.fromkeys(grids, np.full((len(plans.time_step), 1), np.nan))
        plans = replace(plans, **nothing)
    present = np.isfinite(plans.x)
    present[:, 0] = True
    row, point = np.nonzero(present)
    return arrow_table(COLUMNS["plans"], {**plans.spread(row, point), "point": point})


def timing_table(run: RunRecord) -> pa.Table:
    """Wall time of a `run` per time step and phase [s], as an Arrow table."""
    return arrow_table(COLUMNS["timing"], run.timings.arrays)


def routes_table(run: RunRecord) -> pa.Table:
    """The reference paths of all agents of a `run`, one row per point, as an Arrow table."""
    return table_of_routes(run.agents)


def table_of_routes(agents: Sequence[AgentRecord]) -> pa.Table:
    """The same of some agents."""
    counts = [len(agent.reference_path) for agent in agents]
    points = np.concatenate([np.empty((0, 2)), *(agent.reference_path for agent in agents)])
    values = {
        "agent_id": np.repeat(np.array([agent.id for agent in agents], dtype=np.int64), counts),
        "point": np.concatenate([np.empty(0, dtype=np.int64), *map(np.arange, counts)]),
        "x": points[:, 0],
        "y": points[:, 1],
    }
    return arrow_table(COLUMNS["routes"], values)


def predictions_table(run: RunRecord) -> pa.Table | None:
    """Predictions of a `run`, one row per point of a mode, as an Arrow table; None if they were not recorded."""
    found = run.predictions
    if found is None:
        return None
    row, point = _all_points(found.time_step, found.point)
    spread = found.covariance[row, point]
    axes = {"variance_x": spread[:, 0, 0], "covariance_xy": spread[:, 0, 1], "variance_y": spread[:, 1, 1]}
    return arrow_table(COLUMNS["predictions"], {**found.spread(row, point), **axes})


def candidates_table(run: RunRecord) -> pa.Table | None:
    """Kept candidates of a `run`, one row per point, as an Arrow table; None if they were not recorded."""
    found = run.candidates
    if found is None:
        return None
    change = np.flatnonzero((np.diff(found.time_step) != 0) | (np.diff(found.agent_id) != 0)) + 1
    first = np.repeat(np.append(0, change), np.diff(np.concatenate([[0], change, [len(found.time_step)]])))
    row, point = _all_points(found.time_step, found.point)
    number = np.arange(len(first)) - first
    return arrow_table(COLUMNS["candidates"], {**found.spread(row, point), "candidate": number[row]})


def _all_points(rows: Ints, points: Ints) -> tuple[Ints, Ints]:
    """Positions of rows and points of a table with a row for each point of each row."""
    return np.repeat(np.arange(len(rows)), len(points)), np.tile(np.arange(len(points)), len(rows))


def _recorded(name: str, run: RunRecord) -> pa.Table | None:
    """The table of a record whose rows are those of the table; None if it was not recorded."""
    found: Tabular | None = getattr(run, name)
    return None if found is None else arrow_table(COLUMNS[name], found.arrays)


#: What makes the table of each file.
TABLES: Mapping[str, Callable[[RunRecord], pa.Table | None]] = {
    "outcomes": outcome_table,
    "states": states_table,
    "plans": plans_table,
    "timing": timing_table,
    "routes": routes_table,
    "predictions": predictions_table,
    "candidates": candidates_table,
    **{
        name: partial(_recorded, name)
        for name in ("views", "violations", "orders", "messages", "agreements", "hits", "profile", "demand", "sumo")
    },
}
