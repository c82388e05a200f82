"""Which failures belong together: one lorry that brakes can cost eight agents their time, and is one event.

Two participants belong together if they collide with each other, or if one falls further behind its recording while it
follows the other. Everything that is linked in this way, also by agents that do not fail, is one event.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from causes import CORRIDOR, GROWTH_MIN, LEADER_GAP, LEADER_TIME, SPACING, Delay

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from interdrive import _core
    from interdrive.runs import Run


def events(
    run: Run, routes: Sequence[_core.Route], delays: dict[int, Delay], failing: Collection[int]
) -> dict[int, int]:
    """The event of every failing agent: the smallest id of the failing agents in it."""
    if not failing:
        return {}
    ended = run.outcomes
    links = [
        (agent, partner)
        for agent, partner, outcome in zip(
            ended.agent_id.tolist(), ended.partner_id.tolist(), ended.outcome, strict=True
        )
        if outcome == "collision" and partner >= 0
    ]
    for i, route in enumerate(routes):
        links += [(run.agents[i].id, leader) for leader in _followed(run, i, route, delays[run.agents[i].id])]
    return joined(links, failing)


def joined(links: Iterable[tuple[int, int]], failing: Collection[int]) -> dict[int, int]:
    """For every failing participant the smallest one that is linked to it, over any number of links."""
    group: dict[int, set[int]] = {one: {one} for one in failing}
    for pair in links:
        together = group.get(pair[0], {pair[0]}) | group.get(pair[1], {pair[1]})
        group.update(dict.fromkeys(together, together))
    return {one: min(group[one].intersection(failing)) for one in failing}


def _followed(run: Run, i: int, route: _core.Route, delay: Delay) -> set[int]:
    """The participants that an agent follows while it falls behind, looked at every second until its deadline."""
    states, dt, agent = run.states, run.scenario.dt, run.agents[i]
    row, spacing = int(np.searchsorted(states.participant_id, agent.id)), max(1, round(SPACING / dt))
    found = set()
    for column in np.flatnonzero(states.valid[row])[::spacing].tolist():
        now = states.first_time_step + column
        if now >= agent.goal_time_step[1] or delay.growth(now, spacing) < GROWTH_MIN:
            continue
        others = np.flatnonzero(states.valid[:, column] & (np.arange(len(states.valid)) != row))
        station, offset = route.project(states.x[others, column], states.y[others, column])
        own, _ = route.project(states.x[row, [column]], states.y[row, [column]])
        gap = station - own - 0.5 * (states.length[others] + states.length[row])
        leads = (gap > -1.0) & (gap < LEADER_GAP + LEADER_TIME * states.velocity[row, column])
        leads &= np.abs(offset) < 0.5 * (states.width[others] + states.width[row]) + CORRIDOR
        if leads.any():
            found.add(int(states.participant_id[others[np.where(leads, gap, np.inf).argmin()]]))
    return found
