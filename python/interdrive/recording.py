"""From the tables of the core to the arrays of a `Run`."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.run import PHASES, AgentRecord, Outcomes, Snapshot, States, Timings
from interdrive.scenario import KINDS

if TYPE_CHECKING:
    from interdrive import _core
    from interdrive.agents import Agent

#: Names of the core's outcome codes.
OUTCOME_NAMES = (
    "running",
    "goal_reached",
    "goal_reached_late",
    "time_limit",
    "goal_missed",
    "infeasible",
    "collision",
    "planner_error",
)


def digest(states: States) -> str:
    """SHA-256 over ids, masks and the bits of all states; equal digests mean equal runs."""
    total = hashlib.sha256()
    for array in (
        states.ids,
        states.valid,
        *(getattr(states, name) for name in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate")),
    ):
        # Absent states are nan; one bit pattern for all of them.
        clean = np.where(np.isnan(array), 0.0, array) if array.dtype == np.float64 else array
        total.update(np.ascontiguousarray(clean).tobytes())
    return total.hexdigest()


def outcomes_of(raw: dict[str, Any], planners: dict[int, str]) -> Outcomes:
    """How every agent ended, from the core's table; `planners` are their names."""
    return Outcomes(
        agent_id=raw["agent_id"],
        planner=tuple(planners[i] for i in raw["agent_id"].tolist()),
        outcome=tuple(OUTCOME_NAMES[code] for code in raw["kind"].tolist()),
        time_step=raw["time_step"],
        partner_id=raw["partner_id"],
        off_road=raw["off_road"],
        impact_speed=raw["impact_speed"],
        message=tuple(raw["message"]),
    )


def states_of(raw: dict[str, Any]) -> States:
    """States of all participants, from the core's table."""
    return States(kinds=tuple(KINDS[code] for code in raw.pop("kind").tolist()), **raw)


def agent_record(agent: Agent, planner: str) -> AgentRecord:
    """What does not change about an agent."""
    return AgentRecord(
        id=agent.id,
        planner=planner,
        origin=agent.origin,
        start_time_step=agent.initial_state.time_step,
        goal_time_step=(min(g.time_step[0] for g in agent.goal), max(g.time_step[1] for g in agent.goal)),
        goal_areas=tuple(area for alternative in agent.goal for area in alternative.areas),
        route_lanelet_ids=tuple(agent.route.lanelet_ids),
        reference_path=agent.route.reference_path,
    )


def timings_of(rows: list[tuple[int, tuple[float, ...]]]) -> Timings:
    """Wall times in long form, from one row of phases per time step."""
    return Timings(
        time_step=np.repeat(np.array([time_step for time_step, _ in rows], dtype=np.int64), len(PHASES)),
        phase=PHASES * len(rows),
        seconds=np.array([seconds for _, phases in rows for seconds in phases], dtype=np.float64),
    )


def snapshot(world: _core.World, scene: _core.Scene, predictions: _core.Predictions, agent_id: int) -> Snapshot:
    """What an agent considers now: its samples and the predictions that it sees."""
    view = world.view(scene, agent_id)
    found = world.candidates(agent_id, scene, predictions)
    seen = np.isin(predictions.ids, view.ids)
    used = seen[:, None] & (predictions.probability > 0)
    rows, modes = np.nonzero(used)
    empty = np.empty((0, 0))
    return Snapshot(
        time_step=world.time_step,
        agent_id=agent_id,
        candidate_x=found["x"] if found else empty,
        candidate_y=found["y"] if found else empty,
        cost=found["cost"] if found else np.empty(0),
        rejection=tuple(found["rejection"]) if found else (),
        chosen=int(found["chosen"]) if found else -1,
        prediction_id=predictions.ids[rows],
        prediction_probability=predictions.probability[rows, modes],
        prediction_x=predictions.x[rows, modes],
        prediction_y=predictions.y[rows, modes],
        prediction_covariance=predictions.covariance[rows, modes],
    )
