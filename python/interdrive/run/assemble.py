"""Converts the tables of the core to the arrays of a `Run`."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.run.record import OUTCOMES, PHASES, AgentRecord, Outcomes, Plans, RunRecord, States, Timings
from interdrive.scenario import KINDS, STATE_FIELDS
from interdrive.scenario.native import core_shape

if TYPE_CHECKING:
    from interdrive.scenario import Scenario
    from interdrive.scenario.agents import Agent

#: Names of the core's outcome codes.
OUTCOME_NAMES = ("running", *OUTCOMES)


def digest(states: States) -> str:
    """SHA-256 over ids, masks and the bits of all states; equal digests mean equal runs."""
    total = hashlib.sha256()
    for array in (states.participant_id, states.valid, *(getattr(states, name) for name in STATE_FIELDS)):
        # Absent states are nan, all with the same bit pattern.
        clean = np.where(np.isnan(array), 0.0, array) if array.dtype == np.float64 else array
        total.update(np.ascontiguousarray(clean).tobytes())
    return total.hexdigest()


def outcomes_of(raw: dict[str, Any], planners: dict[int, str], tracebacks: dict[int, str]) -> Outcomes:
    """Outcomes of all agents, from the core's table, with the names of planners and the tracebacks of failed ones."""
    return Outcomes(
        agent_id=raw["agent_id"],
        planner=tuple(planners[i] for i in raw["agent_id"].tolist()),
        outcome=tuple(OUTCOME_NAMES[code] for code in raw["kind"].tolist()),
        time_step=raw["time_step"],
        partner_id=raw["partner_id"],
        off_road=raw["off_road"],
        impact_speed=raw["impact_speed"],
        off_lanelets=raw["off_lanelets"],
        off_lanelets_s=raw["off_lanelets_s"],
        message=tuple(raw["message"]),
        reason=("",) * len(raw["agent_id"]),
        traceback=tuple(tracebacks.get(i, "") for i in raw["agent_id"].tolist()),
    )


def states_of(raw: dict[str, Any]) -> States:
    """States of all participants, from the core's table."""
    ids, kinds = raw.pop("ids"), tuple(KINDS[code] for code in raw.pop("kind").tolist())
    return States(participant_id=ids, kinds=kinds, **raw)


def agent_record(agent: Agent, planner: str) -> AgentRecord:
    """The constant properties of an agent."""
    return AgentRecord(
        id=agent.id,
        planner=planner,
        origin=agent.origin,
        start_time_step=agent.initial_state.time_step,
        goal=agent.goal,
        route_lanelet_ids=tuple(agent.route.lanelet_ids),
        reference_path=agent.route.reference_path,
    )


def timings_of(rows: list[tuple[int, list[float]]]) -> Timings:
    """Wall times in long form, from one row of phases per time step."""
    return Timings(
        time_step=np.repeat(np.array([time_step for time_step, _ in rows], dtype=np.int64), len(PHASES)),
        phase=PHASES * len(rows),
        seconds=np.array([seconds for _, phases in rows for seconds in phases], dtype=np.float64),
    )


def no_plans() -> Plans:
    """The table of plans of a run without plans."""
    none, numbers, points = np.empty(0, dtype=np.int64), np.empty(0), np.empty((0, 0))
    return Plans(none, none, none, numbers, points, points, points, points, points, (), numbers, numbers, numbers)


def no_timings() -> Timings:
    """The table of timings of a run without timings."""
    return Timings(np.empty(0, dtype=np.int64), (), np.empty(0))


def recorded_traffic(scenario: Scenario) -> RunRecord:
    """The recorded traffic of a scenario as a run without agents."""
    obstacles = scenario.obstacles
    sizes = np.array([core_shape(shape).extent for shape in obstacles.shapes]).reshape(-1, 2)
    states = States(
        participant_id=obstacles.ids,
        kinds=obstacles.kinds,
        first_time_step=0,
        is_agent=np.zeros(len(obstacles.ids), dtype=np.bool_),
        is_static=obstacles.is_static,
        length=sizes[:, 0],
        width=sizes[:, 1],
        **{name: getattr(obstacles, name) for name in STATE_FIELDS},
        valid=obstacles.valid,
    )
    none = np.empty(0, dtype=np.int64)
    numbers = none.astype(np.float64)
    no_outcomes = Outcomes(none, (), (), none, none, none.astype(np.bool_), numbers, numbers, numbers, (), (), ())
    return RunRecord(scenario, {}, (), no_outcomes, states, no_plans(), no_timings(), scenario.notes, "")
