"""Converts the tables of the core to the arrays of a `Run`."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from interdrive.run.arrays import OUTCOMES, PHASES, Hits, Outcomes, Plans, States, SumoParticipants, Timings
from interdrive.run.record import AgentRecord, RunRecord
from interdrive.scenario import KINDS, STATE_FIELDS
from interdrive.scenario.native import core_shape

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from interdrive.array_types import Floats
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


class FirstState(NamedTuple):
    """When and how a participant was there for the first time: time step, speed [m/s] and yaw rate [rad/s]."""

    time_step: int
    velocity: float
    yaw_rate: float


def first_states(states: States, ids: Iterable[int]) -> dict[int, FirstState]:
    """The first states of those of some participants that were there, by id."""
    found = {}
    for number in ids:
        row = int(np.searchsorted(states.participant_id, number))
        if row < len(states.participant_id) and states.participant_id[row] == number and states.valid[row].any():
            at = row, int(states.valid[row].argmax())
            motion = float(states.velocity[at]), float(states.yaw_rate[at])
            found[number] = FirstState(states.first_time_step + at[1], *motion)
    return found


def agent_records(agents: Iterable[Agent], planners: Mapping[int, str]) -> tuple[AgentRecord, ...]:
    """The constant properties of agents; those with one route share its path.

    Args:
        agents: The agents.
        planners: Names of their planners by id.
    """
    routes: dict[int, tuple[tuple[int, ...], Floats]] = {}
    found = []
    for agent in agents:
        route = agent.route
        if id(route) not in routes:
            routes[id(route)] = tuple(route.lanelet_ids), route.reference_path
        lanelet_ids, path = routes[id(route)]
        found.append(
            AgentRecord(
                id=agent.id,
                planner=planners[agent.id],
                origin=agent.origin,
                start_time_step=agent.initial_state.time_step,
                goal=agent.goal,
                route_lanelet_ids=lanelet_ids,
                reference_path=path,
            )
        )
    return tuple(found)


def timings_of(rows: Floats) -> Timings:
    """Wall times in long form, from rows of a time step and its phases, shape (time steps, 1 + phases)."""
    return Timings(
        time_step=np.repeat(rows[:, 0].astype(np.int64), len(PHASES)),
        phase=PHASES * len(rows),
        seconds=rows[:, 1:].ravel(),
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
