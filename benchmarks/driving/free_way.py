"""Agents that stand although they could drive on.

The way of an agent is free while no body is on the next 20 m of its reference path, as wide as the agent, and no light
is red or yellow there. Whatever else it waits for - a gap, an order, a doubt - does not excuse it for more than 10 s.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.scenario.control import GOING_SIGNALS, shown_together

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive import _core
    from interdrive.runs import Run

    Bools = NDArray[np.bool_]

#: A way is free if nothing is on it this far ahead of the front [m]: across most junctions.
REACH = 20.0
#: Bodies are looked at along their axis, in steps of this [m].
SPACING = 1.0


def free(run: Run, row: int, route: _core.Route, steps: NDArray[np.int64]) -> Bools:
    """Whether the way of the agent in a row of the states is free at some of the columns in which it is present."""
    states = run.states
    station, _ = route.project(states.x[row, steps], states.y[row, steps])
    front = station + 0.5 * states.length[row]
    is_free = np.ones(len(steps), dtype=np.bool_)
    for other in range(len(states.participant_id)):
        present = np.flatnonzero(states.valid[other, steps])
        if other == row or not len(present):
            continue
        half = 0.5 * states.length[other]
        along = np.linspace(-half, half, int(np.ceil(2.0 * half / SPACING)) + 1)
        heading = states.orientation[other, steps[present]][:, None]
        x = states.x[other, steps[present]][:, None] + along * np.cos(heading)
        y = states.y[other, steps[present]][:, None] + along * np.sin(heading)
        s, d = (values.reshape(x.shape) for values in route.project(x.ravel(), y.ravel()))
        ahead = s - front[present, None]
        beside = np.abs(d) < 0.5 * (states.width[row] + states.width[other])
        is_free[present] &= ~((ahead > 0.0) & (ahead < REACH) & beside).any(axis=1)
    return is_free & ~_held_by_light(run, route, front, steps)


def _held_by_light(run: Run, route: _core.Route, front: NDArray[np.float64], steps: NDArray[np.int64]) -> Bools:
    """Whether a light that is yellow or red counts within `REACH` of a front."""
    scenario, held = run.scenario, np.zeros(len(steps), dtype=np.bool_)
    lights = {light.id: light for light in scenario.traffic_lights}
    ways = set(route.lanelet_ids)
    for line in scenario.stop_lines:
        counting = sorted({i for following, ids in line.light_ids if following in ways for i in ids})
        if line.lanelet_id not in ways or not counting:
            continue
        middle = line.ends.mean(axis=0)
        station = route.project(middle[:1], middle[1:])[0][0]
        time_steps = run.states.first_time_step + steps
        shown = shown_together([lights[i] for i in counting], int(time_steps.max(initial=0)) + 1)[time_steps]
        held |= (station > front) & (station < front + REACH) & ~np.isin(shown, GOING_SIGNALS)
    return held
