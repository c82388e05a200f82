"""Agents that stand because of each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from drives import LONG, STANDING, longest

from interdrive.scenario.native import core_scenario

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive.runs import Run
    from interdrive.simulation import Simulation

    Floats = NDArray[np.float64]
    Bools = NDArray[np.bool_]

#: An agent waits for a leader that is nearer than this [m].
LEADER = 3.0
#: Two wait for each other before or in a common area if its middle is at most so far ahead of both fronts [m].
AREA = 15.0
#: A leader is beside the path by at most this [m].
ASIDE = 1.5


def mutual_waits(simulation: Simulation, run: Run) -> tuple[int, ...]:
    """Ids of the agents that stand for more than 10 s in a circle of waits.

    An agent that stands waits for the one that its order names, for a leader, and, if it is the first of its lane, for
    the first ones of other lanes that stand before or in an area that both ways share.
    """
    states = run.states
    still = states.valid & (np.abs(states.velocity) < STANDING)
    agents = [
        (i, int(np.searchsorted(states.participant_id, agent.id)))
        for i, agent in enumerate(simulation.agents)
        if agent.id in states.participant_id
    ]
    agents = [(i, row) for i, row in agents if longest(still[row], run.scenario.dt) > LONG]
    if len(agents) < 2:
        return ()
    ids = [simulation.agents[i].id for i, _ in agents]
    n, n_steps = len(agents), states.n_steps
    waits = np.zeros((n_steps, n, n), dtype=np.bool_)
    told = simulation.world.waits()
    for agent, by, first, last in zip(
        *(told[name].tolist() for name in ("agent_id", "by_id", "first_time_step", "last_time_step")), strict=True
    ):
        if agent in ids and by in ids:
            begin, end = first - states.first_time_step, last - states.first_time_step + 1
            waits[begin:end, ids.index(agent), ids.index(by)] = True
    ahead = _areas_ahead(simulation, run, agents)
    gaps = [_gaps(simulation, run, i, row, [other for _, other in agents]) for i, row in agents]
    is_first = [~(gap < LEADER).any(axis=0) for gap in gaps]
    for a in range(n):
        waits[:, a, :] |= (gaps[a] < LEADER).T
        for b in range(n):
            if a != b:
                shared = [(area, side) for area, side in ahead[a] if (area, 1 - side) in ahead[b]]
                for area, side in shared:
                    waits[:, a, b] |= ahead[a][area, side] & ahead[b][area, 1 - side] & is_first[a] & is_first[b]
    stands = np.stack([still[row] for _, row in agents], axis=1)
    waits &= stands[:, :, None] & stands[:, None, :]
    circles = zip(ids, _in_circles(waits).T, strict=True)
    return tuple(agent for agent, in_circle in circles if longest(in_circle, run.scenario.dt) > LONG)


def _in_circles(waits: Bools) -> Bools:
    """Which agents wait for themselves by way of others, shape (steps, agents)."""
    reach = waits.copy()
    for k in range(waits.shape[1]):
        reach |= reach[:, :, k, None] & reach[:, None, k, :]
    circles: Bools = reach.diagonal(axis1=1, axis2=2)
    return circles


def _gaps(simulation: Simulation, run: Run, i: int, row: int, others: list[int]) -> Floats:
    """Distance from the front of an agent to the rears of others on its path [m], shape (others, steps); else inf."""
    states, route = run.states, simulation.agents[i].route
    own = _along(route, states.x[row], states.y[row])[0] + 0.5 * states.length[row]
    gaps = np.full((len(others), states.n_steps), np.inf)
    for place, other in enumerate(others):
        s, d = _along(route, states.x[other], states.y[other])
        is_ahead = (s > own) & (np.abs(d) < ASIDE) & (other != row)
        gaps[place, is_ahead] = (s - 0.5 * states.length[other] - own)[is_ahead]
    return gaps


def _areas_ahead(simulation: Simulation, run: Run, agents: list[tuple[int, int]]) -> list[dict[tuple[int, int], Bools]]:
    """For each agent the areas on its way, with its side, and when the agent is before or in them."""
    areas = core_scenario(run.scenario, simulation.road).junctions()
    states, found = run.states, []
    for i, row in agents:
        agent = simulation.agents[i]
        front = _along(agent.route, states.x[row], states.y[row])[0] + 0.5 * states.length[row]
        near = {}
        for area, side in np.argwhere(np.isin(areas["lanelet"], run.agents[i].route_lanelet_ids)).tolist():
            middle = _along(agent.route, areas["x"][area : area + 1], areas["y"][area : area + 1])[0][0]
            near[area, side] = (middle - front <= AREA) & (middle - front >= -states.length[row])
        found.append(near)
    return found


def _along(route: object, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Arc lengths and offsets on a route [m]; nan where a place is not a number."""
    known = np.isfinite(x)
    s, d = np.full(len(x), np.nan), np.full(len(x), np.nan)
    s[known], d[known] = route.project(np.ascontiguousarray(x[known]), np.ascontiguousarray(y[known]))  # type: ignore[attr-defined]
    return s, d
