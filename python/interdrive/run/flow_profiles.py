"""Flow, speed and queue of each lane over the time of a run with generated traffic."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.run.flows import counted_time_of

if TYPE_CHECKING:
    from interdrive.array_types import Floats
    from interdrive.run.flows import LaneFlow
    from interdrive.run.record import RunRecord

#: A run is divided into so many windows, none shorter than this [s].
_WINDOWS, _WINDOW_MIN = 24, 5.0


@dataclass(frozen=True)
class FlowProfile:
    """A lane over time, one entry per window.

    Attributes:
        flow: Vehicles that enter or leave by the lane, per hour.
        speed: Mean speed of its vehicles on the map [m/s]; nan without any.
        queue: Vehicles that wait before the lane at the end of the window; nan for exits.
    """

    flow: Floats
    speed: Floats
    queue: Floats


def window_edges(run: RunRecord) -> Floats:
    """Begins and ends of the windows of a run [s], ascending; the last one may be shorter than the others."""
    begin = run.states.first_time_step * run.scenario.dt
    end = max(counted_time_of(run)[1], begin + run.scenario.dt)
    window = max(_WINDOW_MIN, (end - begin) / _WINDOWS)
    edges: Floats = np.append(np.arange(begin, end - 0.01 * window, window), end)
    return edges


def flow_profiles(run: RunRecord, rows: tuple[LaneFlow, ...], edges: Floats) -> tuple[FlowProfile, ...]:
    """What every lane was like over time, in the order of the rows.

    Args:
        run: With generated traffic.
        rows: Its lanes, see `interdrive.run.flows.lane_flows`.
        edges: Of the windows [s].
    """
    demand, states = run.demand, run.states
    if demand is None:
        return ()
    found = []
    hours = np.diff(edges) / 3600.0
    times = (states.first_time_step + np.arange(states.n_steps)) * run.scenario.dt
    window = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, len(hours) - 1)
    counts = times < edges[-1] - 0.5 * run.scenario.dt
    place = np.searchsorted(states.participant_id, demand.agent_id)
    for row in rows:
        is_entry = row.side == "in"
        own = (demand.lane_id if is_entry else demand.exit_id) == row.lane_id
        if is_entry:
            own &= ~np.isnan(demand.due)
        moments = (demand.entered if is_entry else demand.left)[own]
        valid = states.valid[place[own]] & counts
        speeds = np.where(valid, states.velocity[place[own]], 0.0).sum(axis=0)
        number = np.bincount(window, valid.sum(axis=0), len(hours))
        total = np.bincount(window, speeds, len(hours))
        speed = np.where(number > 0.0, total / np.maximum(number, 1.0), np.nan)
        queue = np.full(len(hours), np.nan)
        if is_entry:
            due, entered = demand.due[own], np.nan_to_num(demand.entered[own], nan=np.inf)
            due = due + run.scenario.dt  # who enters within a time step has not waited
            queue = np.array([float(((due <= end) & (entered > end)).sum()) for end in edges[1:].tolist()])
        flow = np.histogram(moments[moments < edges[-1]], edges)[0] / hours
        found.append(FlowProfile(flow, speed, queue))
    return tuple(found)
