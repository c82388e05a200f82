"""What costs time in a run: phases of steps, planners, agents. Needs `Run.timings` and `Run.profile`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.run import PHASES, PLAN_PARTS

if TYPE_CHECKING:
    from interdrive.array_types import Floats
    from interdrive.run import Profile, RunRecord


@dataclass(frozen=True)
class Cost:
    """The time that something took, over all calls or steps.

    Attributes:
        name: What took it: a phase, the name of a planner, or the id of an agent.
        part: One of `interdrive.run.PLAN_PARTS`; of a phase: "".
        agents: Number of agents.
        calls: Number of calls or steps.
        total: Sum [s].
        median: Of one call or step [s].
        high: 95th percentile of one [s].
        most: The longest one [s].
        most_at: Agent and time step of the longest one; of a phase: -1 and the time step.
    """

    name: str
    part: str
    agents: int
    calls: int
    total: float
    median: float
    high: float
    most: float
    most_at: tuple[int, int]


def phase_costs(run: RunRecord) -> list[Cost]:
    """One entry per phase of a step that took time, in the order of `PHASES`."""
    phases = np.array(run.timings.phase, dtype=np.str_)
    found = []
    for name in PHASES:
        mine = phases == name
        seconds, steps = run.timings.seconds[mine], run.timings.time_step[mine]
        if seconds.sum() > 0.0:
            found.append(_cost((name, ""), 0, seconds, [(-1, int(step)) for step in steps]))
    return found


def planner_costs(run: RunRecord) -> list[Cost]:
    """One entry per planner and part, the planner that took most time first; empty without `Run.profile`."""
    if run.profile is None:
        return []
    planners = {agent.id: agent.planner for agent in run.agents}
    return _by(run.profile, [planners[i] for i in run.profile.agent_id.tolist()])


def agent_costs(run: RunRecord) -> list[Cost]:
    """One entry per agent and part, the agent that took most time first; empty without `Run.profile`."""
    if run.profile is None:
        return []
    return _by(run.profile, list(map(str, run.profile.agent_id.tolist())))


def _by(profile: Profile, names: list[str]) -> list[Cost]:
    rows: dict[tuple[str, str], list[int]] = {}
    for row, key in enumerate(zip(names, profile.part, strict=True)):
        rows.setdefault(key, []).append(row)
    found = []
    for key, mine in rows.items():
        ids, steps = profile.agent_id[mine].tolist(), profile.time_step[mine].tolist()
        places = list(zip(ids, steps, strict=True))
        found.append(_cost(key, len(set(ids)), profile.seconds[mine], places))
    total = {name: sum(cost.total for cost in found if cost.name == name) for name in set(names)}
    return sorted(found, key=lambda cost: (-total[cost.name], cost.name, PLAN_PARTS.index(cost.part)))


def _cost(key: tuple[str, str], agents: int, seconds: Floats, places: list[tuple[int, int]]) -> Cost:
    most = int(np.argmax(seconds))
    return Cost(
        name=key[0],
        part=key[1],
        agents=agents,
        calls=len(seconds),
        total=float(seconds.sum()),
        median=float(np.median(seconds)),
        high=float(np.quantile(seconds, 0.95)),
        most=float(seconds[most]),
        most_at=places[most],
    )
