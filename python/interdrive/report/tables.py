"""The tables of a run as packed arrays: participants by row, time steps by column, positions from an origin."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.plots.road import road_lines
from interdrive.plots.view import View
from interdrive.report.measured import columns_of, rows_of
from interdrive.report.planning import made_at
from interdrive.run import PLAN_STATUS
from interdrive.scenario.control import shown_at_lines
from interdrive.storage.arrow_arrays import values_of

if TYPE_CHECKING:
    from interdrive.array_types import Floats
    from interdrive.report.packing import Packer
    from interdrive.run import RunRecord
    from interdrive.storage import ArrowTable

#: Resolutions: positions [m], headings [rad], speeds [m/s] and accelerations [m/s²].
_METRE, _RADIAN, _SPEED = 0.01, 0.001, 0.01

#: Distance around all participants within which road is shown [m]; spacing of the points of plans [s].
_AROUND, _PLAN_SPACING = 150.0, 0.3


def pack_states(packer: Packer, run: RunRecord, origin: Floats) -> None:
    """Positions, headings, speeds and accelerations of all participants, shape (participants, time_steps)."""
    states = run.states
    packer.add("valid", states.valid)
    packer.add("x", states.x - origin[0], unit=_METRE, steps=True)
    packer.add("y", states.y - origin[1], unit=_METRE, steps=True)
    packer.add("orientation", _unwrapped(states.orientation), unit=_RADIAN, steps=True)
    packer.add("velocity", states.velocity, unit=_SPEED, steps=True)
    packer.add("acceleration", states.acceleration, unit=_SPEED, steps=True)
    packer.add("yaw_rate", states.yaw_rate, unit=_RADIAN, steps=True)


def _unwrapped(orientation: Floats) -> Floats:
    """Headings without jumps by a turn between time steps; nan where absent."""
    made = np.full(orientation.shape, np.nan)
    for row, headings in enumerate(orientation):
        there = np.isfinite(headings)
        made[row, there] = np.unwrap(headings[there])
    return made


def pack_road(packer: Packer, run: RunRecord, origin: Floats) -> None:
    """Surfaces and lines near the traffic, in the world's frame."""
    states = run.states
    x, y = (table[states.valid] for table in (states.x, states.y))
    low = np.array([x.min(), y.min()]) if len(x) else origin
    high = np.array([x.max(), y.max()]) if len(x) else origin
    center, size = 0.5 * (low + high), high - low + 2.0 * _AROUND
    view = View(0.0, (float(center[0]), float(center[1])), float(size[0]), float(size[1]))
    road = road_lines(run.scenario.lanelets, view)
    for name in ("surfaces", "arrows", "dashed", "solid", "edges"):
        lines = [line - origin for line in getattr(road, name)]
        packer.add(f"{name}_n", np.array([len(line) for line in lines], dtype=np.int64))
        points = np.concatenate([np.empty((0, 2)), *lines])
        packer.add(f"{name}_xy", points.T, unit=_METRE, steps=True)


def pack_stop_lines(packer: Packer, run: RunRecord, origin: Floats) -> None:
    """Ends of stop lines, shape (pieces, 4), and what their lights show, shape (pieces, time_steps)."""
    scenario, states = run.scenario, run.states
    if not scenario.stop_lines:
        return
    ends, shown = shown_at_lines(scenario.traffic_lights, scenario.stop_lines, states.first_time_step, states.n_steps)
    packer.add("stop_line_xy", (ends - origin).reshape(-1, 4), unit=_METRE)
    packer.add("stop_line_signal", shown)


def pack_plans(packer: Packer, run: RunRecord, origin: Floats, table: ArrowTable, replan_every: int) -> None:
    """Every plan, thinned, sorted by agent and time step; when it was made, if not always at that time step."""
    column = columns_of(table, ("time_step", "agent_id", "point", "cost", "turn", "x", "y", "velocity"))
    stride = max(1, round(_PLAN_SPACING / run.scenario.dt))
    starts = np.flatnonzero(column["point"] == 0)
    row = np.cumsum(column["point"] == 0) - 1
    point = column["point"].astype(np.int64)
    kept = point % stride == 0
    points = int(point[kept].max(initial=0)) // stride + 1
    order = np.lexsort((column["time_step"][starts], column["agent_id"][starts]))
    names = values_of(table["status"])[starts].tolist()
    status = np.array([PLAN_STATUS.index(name) for name in names], dtype=np.int64)
    packer.add("plan_participant", rows_of(run, column["agent_id"][starts][order]), steps=True)
    packer.add("plan_step", column["time_step"][starts][order] - run.states.first_time_step, steps=True)
    if replan_every > 1:
        agent, step = column["agent_id"][starts][order], column["time_step"][starts][order]
        length, made = np.diff(np.append(starts, table.num_rows))[order], step.copy()
        for number in np.unique(agent):
            mine = agent == number
            made[mine] = made_at(step[mine], length[mine], replan_every)
        packer.add("plan_made", made - run.states.first_time_step, steps=True)
    packer.add("plan_status", status[order])
    packer.add("plan_cost", column["cost"][starts][order].astype(np.float64))
    packer.add("plan_turn", column["turn"][starts][order].astype(np.float64))
    packer.header["plan_step"]["spacing"] = stride
    for name, shift, unit in (("x", origin[0], _METRE), ("y", origin[1], _METRE), ("velocity", 0.0, _SPEED)):
        values = np.full((len(starts), points), np.nan)
        values[row[kept], point[kept] // stride] = column[name][kept] - shift
        packer.add(f"plan_{name}", values[order], unit=unit, steps=True)


def pack_views(packer: Packer, run: RunRecord, table: ArrowTable | None) -> None:
    """Visibility intervals per observer and participant."""
    if table is None:
        return
    column = columns_of(table, ("observer_id", "seen_id", "first_time_step", "last_time_step"))
    first = run.states.first_time_step
    packer.add("view_observer", rows_of(run, column["observer_id"]), steps=True)
    packer.add("view_seen", rows_of(run, column["seen_id"]))
    packer.add("view_first", column["first_time_step"] - first)
    packer.add("view_last", column["last_time_step"] - first)


def pack_candidates(packer: Packer, run: RunRecord, origin: Floats, table: ArrowTable | None) -> list[str]:
    """Kept candidates, sorted by agent and time step; returns why candidates were rejected, "" first."""
    if table is None or not table.num_rows:
        return []
    points = np.unique(values_of(table["point"]))
    column = {
        name: values.reshape(-1, len(points))
        for name, values in columns_of(table, ("time_step", "agent_id", "cost", "chosen", "x", "y")).items()
    }
    order = np.lexsort((column["time_step"][:, 0], column["agent_id"][:, 0]))
    texts = values_of(table["rejection"])[:: len(points)]
    reasons = ["", *sorted(set(texts.tolist()) - {""})]
    packer.add("candidate_participant", rows_of(run, column["agent_id"][order, 0]), steps=True)
    packer.add("candidate_step", column["time_step"][order, 0] - run.states.first_time_step, steps=True)
    packer.header["candidate_step"]["point"] = points.tolist()
    packer.add("candidate_cost", column["cost"][order, 0].astype(np.float64))
    packer.add("candidate_chosen", column["chosen"][order, 0].astype(np.bool_))
    numbers = {text: number for number, text in enumerate(reasons)}
    packer.add("candidate_reason", np.array([numbers[text] for text in texts[order].tolist()], dtype=np.int64))
    # All candidates of a plan start in one place; less that, and less what the one before does, little is left.
    for name, shift in (("x", origin[0]), ("y", origin[1])):
        packer.add(f"candidate_{name}", column[name][order] - shift, unit=5.0 * _METRE, steps=True)
    return reasons


def pack_predictions(packer: Packer, run: RunRecord, origin: Floats, table: ArrowTable | None) -> None:
    """Modes of all participants by the predictor, sorted by time step, participant and mode, as they are stored."""
    if table is None:
        return
    table = table.filter(table["sender_id"].is_null())
    if not table.num_rows:
        return
    points = np.unique(values_of(table["point"]))
    names = ("time_step", "participant_id", "probability", "x", "y", "variance_x", "covariance_xy", "variance_y")
    column = {name: values.reshape(-1, len(points)) for name, values in columns_of(table, names).items()}
    packer.add("prediction_step", column["time_step"][:, 0] - run.states.first_time_step, steps=True)
    packer.header["prediction_step"]["point"] = points.tolist()
    packer.add("prediction_participant", rows_of(run, column["participant_id"][:, 0]))
    packer.add("prediction_probability", column["probability"][:, 0].astype(np.float64), unit=1.0 / 250.0)
    packer.add("prediction_x", column["x"] - origin[0], unit=5.0 * _METRE, steps=True)
    packer.add("prediction_y", column["y"] - origin[1], unit=5.0 * _METRE, steps=True)
    deviation = {axis: np.sqrt(np.maximum(column[f"variance_{axis}"], 0.0)) for axis in "xy"}
    product = deviation["x"] * deviation["y"]
    correlation = np.where(product > 0.0, column["covariance_xy"] / np.where(product > 0.0, product, 1.0), 0.0)
    packer.add("prediction_sx", deviation["x"], unit=5.0 * _METRE, steps=True)
    packer.add("prediction_sy", deviation["y"], unit=5.0 * _METRE, steps=True)
    packer.add("prediction_correlation", np.where(np.isnan(product), np.nan, correlation).clip(-1.0, 1.0), unit=0.01)
