"""Which contacts were not the fault of the agent that they ended: it was hit, and may drive on."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from interdrive.scenario.inspection import DRIVABLE_KINDS
from interdrive.scoring.drives import site_of, traffic
from interdrive.scoring.faults import verdicts
from interdrive.scoring.settings import ScoringSettings

if TYPE_CHECKING:
    from collections.abc import Iterable

    from interdrive.run import RunRecord


class Hit(NamedTuple):
    """An agent that was hit by another vehicle without its fault.

    Attributes:
        agent_id: The agent. by_id: Who hit it.
        time_step: First time step after the contact.
        impact_speed: Size of the relative velocity at the contact [m/s].
        collision_type: nuPlan's type of the collision.
    """

    agent_id: int
    by_id: int
    time_step: int
    impact_speed: float
    collision_type: str


def hits_among(run: RunRecord, ended: Iterable[int]) -> list[Hit]:
    """Agents of a run, of these that have just ended, that another vehicle hit without their fault.

    They are judged in the order of their ids, from what has happened until now. Who hits one of them is not among
    them, even if another vehicle hit it at the same time: it ends. One vehicle may hit several of them.
    """
    outcomes, states = run.outcomes, run.states
    rows = {number: row for row, number in enumerate(states.participant_id.tolist())}
    wanted = sorted(ended)
    simulated = traffic(site_of(run, run.settings.get("settings") or {}), run)
    judged = verdicts(run, simulated, wanted, ScoringSettings())
    found: list[Hit] = []
    for number in wanted:
        verdict = judged.get(number)
        if verdict is None or verdict.kind or any(hit.by_id == number for hit in found):
            continue
        place = int(np.searchsorted(outcomes.agent_id, number))
        by = int(outcomes.partner_id[place])
        if states.is_static[rows[by]] or states.kinds[rows[by]] not in DRIVABLE_KINDS:
            continue
        found = [hit for hit in found if hit.agent_id != by]
        impact = float(outcomes.impact_speed[place])
        found.append(Hit(number, by, int(outcomes.time_step[place]), impact, verdict.collision_type))
    return found
