"""A run as Arrow tables, one per file of its folder."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.criticality import IMPACT_AREAS, agent_harm
from interdrive.results.columns import COLUMNS
from interdrive.run import PHASES, PLAN_STATUS, SERVICES
from interdrive.scenario import STATE_FIELDS
from interdrive.storage.tables import arrow_table, labels

if TYPE_CHECKING:
    import pyarrow as pa
    from numpy.typing import NDArray

    from interdrive.run import RunRecord


def outcome_table(run: RunRecord) -> pa.Table:
    """Outcomes of a `run`, one row per agent, as an Arrow table (`to_pandas()`, `polars.from_arrow`)."""
    ended, harm = run.outcomes, agent_harm(run)
    return _table(
        "outcomes",
        agent_id=ended.agent_id,
        planner=labels(ended.planner),
        outcome=labels(ended.outcome),
        time_step=ended.time_step,
        time_s=_seconds(run, ended.time_step),
        partner_id=np.ma.masked_equal(ended.partner_id, -1),
        off_road=ended.off_road,
        impact_speed=ended.impact_speed,
        off_lanelets=ended.off_lanelets,
        off_lanelets_s=ended.off_lanelets_s,
        harm=harm.harm,
        partner_harm=harm.partner_harm,
        impact_angle=harm.impact_angle,
        impact_area=labels(
            IMPACT_AREAS, np.array([IMPACT_AREAS.index(a) if a else -1 for a in harm.impact_area], dtype=np.int64)
        ),
        message=ended.message,
        reason=ended.reason,
        traceback=ended.traceback,
    )


def states_table(run: RunRecord) -> pa.Table:
    """One row of a `run` per time step and participant that is present then, in that order, as an Arrow table."""
    states = run.states
    step, row = np.nonzero(states.valid.T)
    time_step = states.first_time_step + step
    return _table(
        "states",
        time_step=time_step,
        time_s=_seconds(run, time_step),
        participant_id=states.participant_id[row],
        kind=labels(states.kinds, row),
        is_agent=states.is_agent[row],
        length=states.length[row],
        width=states.width[row],
        **{name: getattr(states, name)[row, step] for name in STATE_FIELDS},
    )


def _seconds(run: RunRecord, time_step: NDArray[np.int64]) -> NDArray[np.float64]:
    """Time steps in seconds, without the last bits of the multiplication."""
    return np.round(time_step * run.scenario.dt, 9)


def plans_table(run: RunRecord) -> pa.Table:
    """One row of a `run` per plan and point, sorted by time step, agent and point, as an Arrow table."""
    plans = run.plans
    reasons, reason = np.unique(np.array(plans.rejection, dtype=np.str_), return_inverse=True)
    present = np.isfinite(plans.x)
    if present.shape[1]:
        present[:, 0] = True
        row, point = np.nonzero(present)
        along = {name: getattr(plans, name)[row, point] for name in STATE_FIELDS[:5]}
    else:
        row, point = np.arange(len(plans.time_step)), np.zeros(len(plans.time_step), dtype=np.int64)
        along = dict.fromkeys(STATE_FIELDS[:5], np.full(len(row), np.nan))
    return _table(
        "plans",
        time_step=plans.time_step[row],
        agent_id=plans.agent_id[row],
        status=labels(PLAN_STATUS, plans.status[row]),
        cost=plans.cost[row],
        point=point,
        **along,
        rejection=labels(tuple(reasons.tolist()), reason[row]),
        **{name: getattr(plans, name)[row] for name in ("rejection_x", "rejection_y", "rejection_overhang")},
    )


def timing_table(run: RunRecord) -> pa.Table:
    """Wall time of a `run` per time step and phase [s], as an Arrow table."""
    names = (*PHASES, *sorted(set(run.timings.phase) - set(PHASES)))
    order = {phase: index for index, phase in enumerate(names)}
    index = np.array([order[phase] for phase in run.timings.phase], dtype=np.int64)
    return _table("timing", time_step=run.timings.time_step, phase=labels(names, index), seconds=run.timings.seconds)


def routes_table(run: RunRecord) -> pa.Table:
    """The reference paths of all agents of a `run`, one row per point, as an Arrow table."""
    counts = [len(agent.reference_path) for agent in run.agents]
    points = np.concatenate([np.empty((0, 2)), *(agent.reference_path for agent in run.agents)])
    return _table(
        "routes",
        agent_id=np.repeat(np.array([agent.id for agent in run.agents], dtype=np.int64), counts),
        point=np.concatenate([np.empty(0, dtype=np.int64), *map(np.arange, counts)]),
        x=points[:, 0],
        y=points[:, 1],
    )


def views_table(run: RunRecord) -> pa.Table | None:
    """Visibility intervals of a `run`, one row each, as an Arrow table; None if they were not recorded."""
    seen = run.views
    if seen is None:
        return None
    names = [column.name for column in COLUMNS["views"]]
    return _table("views", **{name: getattr(seen, name) for name in names})


def predictions_table(run: RunRecord) -> pa.Table | None:
    """Predictions of a `run`, one row per point of a mode, as an Arrow table; None if they were not recorded."""
    found = run.predictions
    if found is None:
        return None
    points = len(found.point)
    names = ("time_step", "participant_id", "age", "mode", "probability")
    return _table(
        "predictions",
        **{name: np.repeat(getattr(found, name), points) for name in names},
        sender_id=np.ma.masked_equal(np.repeat(found.sender_id, points), -1),
        point=np.tile(found.point, len(found.time_step)),
        x=found.x.ravel(),
        y=found.y.ravel(),
        variance_x=found.covariance[..., 0, 0].ravel(),
        covariance_xy=found.covariance[..., 0, 1].ravel(),
        variance_y=found.covariance[..., 1, 1].ravel(),
    )


def candidates_table(run: RunRecord) -> pa.Table | None:
    """Kept candidates of a `run`, one row per point, as an Arrow table; None if they were not recorded."""
    found = run.candidates
    if found is None:
        return None
    points, reasons = len(found.point), tuple(sorted(set(found.rejection)))
    change = np.flatnonzero((np.diff(found.time_step) != 0) | (np.diff(found.agent_id) != 0)) + 1
    first = np.repeat(np.append(0, change), np.diff(np.concatenate([[0], change, [len(found.time_step)]])))
    reason = np.array([reasons.index(text) for text in found.rejection], dtype=np.int64)
    return _table(
        "candidates",
        **{name: np.repeat(getattr(found, name), points) for name in ("time_step", "agent_id", "cost", "chosen")},
        candidate=np.repeat(np.arange(len(first)) - first, points),
        rejection=labels(reasons, np.repeat(reason, points)),
        point=np.tile(found.point, len(found.time_step)),
        x=found.x.ravel(),
        y=found.y.ravel(),
    )


def violations_table(run: RunRecord) -> pa.Table | None:
    """Violations of rules of the road, one row each, as an Arrow table; None if they were not recorded."""
    found = run.violations
    if found is None:
        return None
    columns = {column.name: getattr(found, column.name) for column in COLUMNS["violations"]}
    texts = {name: labels(getattr(found, name)) for name in ("source", "rule")}
    ids = {name: np.ma.masked_equal(getattr(found, name), -1) for name in ("lanelet_id", "partner_id")}
    return _table("violations", **columns | texts | ids)


def orders_table(run: RunRecord) -> pa.Table | None:
    """Orders to wait before junctions, one row each, as an Arrow table; None if they were not recorded."""
    found = run.orders
    if found is None:
        return None
    columns = {column.name: getattr(found, column.name) for column in COLUMNS["orders"]}
    return _table("orders", **columns | {"kind": labels(found.kind), "by_id": np.ma.masked_equal(found.by_id, -1)})


def messages_table(run: RunRecord) -> pa.Table | None:
    """V2X messages and their links, one row each, as an Arrow table; None if they were not recorded."""
    found = run.messages
    if found is None:
        return None
    columns = {column.name: getattr(found, column.name) for column in COLUMNS["messages"]}
    nulls = {name: np.ma.masked_equal(columns[name], -1) for name in ("receiver_id", "arrived")}
    return _table("messages", **columns | nulls | {"service": labels(SERVICES, found.service)})


def agreements_table(run: RunRecord) -> pa.Table | None:
    """Agreements about shared road, one row each, as an Arrow table; None if no agents negotiate."""
    found = run.agreements
    if found is None:
        return None
    columns = {column.name: getattr(found, column.name) for column in COLUMNS["agreements"]}
    return _table("agreements", **columns | {"going_id": np.ma.masked_equal(found.going_id, -1)})


def _table(name: str, **columns: Any) -> pa.Table:  # noqa: ANN401 - arrays, tuples and Arrow arrays alike
    return arrow_table(COLUMNS[name], columns)
