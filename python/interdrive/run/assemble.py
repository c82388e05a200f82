"""Converts the tables of the core to the arrays of a `Run`."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.run.arrays import OUTCOMES, PHASES, Hits, Outcomes, Plans, States, SumoParticipants, Timings
from interdrive.run.record import AgentRecord, RunRecord
from interdrive.scenario import KINDS, STATE_FIELDS
from interdrive.scenario.native import core_shape

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

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
    ids, kinds = raw["agent_id"].tolist(), raw.pop("kind").tolist()
    return Outcomes(
        **raw,
        planner=tuple(planners[i] for i in ids),
        outcome=tuple(OUTCOME_NAMES[code] for code in kinds),
        reason=("",) * len(ids),
        traceback=tuple(tracebacks.get(i, "") for i in ids),
    )


def hits_of(hits: Sequence[tuple[int, int, int, float, str]]) -> Hits:
    """Contacts (agent, who hit it, time step, impact speed, type) as a record, by time step and agent."""
    rows = sorted(hits, key=lambda hit: (hit[2], hit[0]))
    return Hits(
        agent_id=np.array([row[0] for row in rows], dtype=np.int64),
        by_id=np.array([row[1] for row in rows], dtype=np.int64),
        time_step=np.array([row[2] for row in rows], dtype=np.int64),
        impact_speed=np.array([row[3] for row in rows], dtype=np.float64),
        collision_type=tuple(row[4] for row in rows),
    )


def named_by_sumo(names: Mapping[int, str]) -> SumoParticipants:
    """What SUMO calls its participants, by id."""
    return SumoParticipants(np.array(list(names), dtype=np.int64), tuple(names.values()))


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
    return RunRecord(scenario, {}, (), Outcomes.empty(), states, Plans.empty(), Timings.empty(), scenario.notes, "")
