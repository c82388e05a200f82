"""Flow, speed and queues of generated traffic by lane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.run.arrays import Demand

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.array_types import Bools, Floats
    from interdrive.run.arrays import Outcomes
    from interdrive.run.record import RunRecord, RunSettings
    from interdrive.scenario.agents import Agent


@dataclass(frozen=True)
class LaneFlow:
    """Traffic of one lane between two times.

    Attributes:
        lane_id: The lanelet.
        side: "in": vehicles enter by it; "out": they leave by it.
        vehicles: Number of vehicles.
        due: Number of vehicles that wanted to enter; -1 for exits.
        flow: Vehicles per hour.
        speed: Mean speed of its vehicles on the map, their way over their time [m/s]; nan without vehicles.
        wait: Mean time that vehicles waited before the map [s], until the end of the time if they had not entered by
            then: at least so long; nan for exits and without vehicles.
        queue: Largest number of vehicles that waited at the same time; -1 for exits.
        left_out: Number of vehicles that wanted to enter and had not at the end; -1 for exits.
    """

    lane_id: int
    side: str
    vehicles: int
    due: int
    flow: float
    speed: float
    wait: float
    queue: int
    left_out: int


@dataclass(frozen=True)
class WholeFlow:
    """Generated traffic of all lanes together.

    Attributes:
        flow: Vehicles that leave the map per hour.
        speed: Mean speed of vehicles on the map, each one's own mean [m/s]; nan without vehicles.
        wait: Mean time that vehicles waited before the map [s], as in `LaneFlow`; nan without vehicles.
        queue: Largest number of vehicles that waited before one lane at the same time.
        left_out: Number of vehicles that wanted to enter and had not at the end.
    """

    flow: float
    speed: float
    wait: float
    queue: int
    left_out: int


def demand_of(
    agents: Sequence[Agent],
    lanes: tuple[Sequence[int], Sequence[float], Sequence[int], Sequence[float]],
    firsts: Mapping[int, int],
    outcomes: Outcomes,
    dt: float,
) -> Demand:
    """What became of generated vehicles.

    Args:
        agents: The vehicles.
        lanes: Lane, time that each is due [s], exit and length of the way [m], by vehicle.
        firsts: Time step at which each is there for the first time, by id.
        outcomes: Of the run until now.
        dt: Time between steps [s].
    """
    entered, left = np.full(len(agents), np.nan), np.full(len(agents), np.nan)
    ended = dict(
        zip(outcomes.agent_id.tolist(), zip(outcomes.outcome, outcomes.time_step.tolist(), strict=True), strict=True)
    )
    for place, agent in enumerate(agents):
        if agent.id in firsts:
            entered[place] = firsts[agent.id] * dt
        outcome, time_step = ended[agent.id]
        if outcome in ("goal_reached", "goal_reached_late"):
            left[place] = time_step * dt
    lane_ids, due, exit_ids, lengths = lanes
    return Demand(
        agent_id=np.array([agent.id for agent in agents], dtype=np.int64),
        lane_id=np.array(lane_ids, dtype=np.int64),
        kind=tuple(agent.kind for agent in agents),
        due=np.array(due, dtype=np.float64),
        entered=np.round(entered, 9),
        left=np.round(left, 9),
        exit_id=np.array(exit_ids, dtype=np.int64),
        route_length=np.array(lengths, dtype=np.float64),
    )


def lane_flows(run: RunRecord, first: float | None = None, last: float | None = None) -> tuple[LaneFlow, ...]:
    """Flow, speed and queues of a run with generated traffic: entries, then exits, by lanelet id.

    Args:
        run: The run; without generated traffic there are no rows.
        first: Begin of the time that counts [s]; None: as `counted_time` has it.
        last: Its end [s], which does not count; None: as `counted_time` has it.
    """
    if run.demand is None:
        return ()
    begin, end = counted_time_of(run)
    begin, end = begin if first is None else first, end if last is None else last
    return flows_of(run.demand, _speeds(run, run.demand, begin, end), begin, end, run.scenario.dt)


def whole_flow(run: RunRecord) -> WholeFlow | None:
    """Flow, speed and queues of all lanes together; None without generated traffic."""
    rows = lane_flows(run)
    if run.demand is None or not rows:
        return None
    speeds = _speeds(run, run.demand, *counted_time_of(run))
    entries = [row for row in rows if row.side == "in"]
    waiting = [(row.wait, row.vehicles + row.left_out) for row in entries if row.vehicles + row.left_out]
    return WholeFlow(
        flow=float(sum(row.flow for row in rows if row.side == "out")),
        speed=float(np.nanmean(speeds)) if np.isfinite(speeds).any() else float("nan"),
        wait=sum(wait * n for wait, n in waiting) / sum(n for _, n in waiting) if waiting else float("nan"),
        queue=max((row.queue for row in entries), default=0),
        left_out=sum(row.left_out for row in entries),
    )


def counted_time(settings: RunSettings, outcomes: Outcomes, steps: tuple[int, int], dt: float) -> tuple[float, float]:
    """Begin and end of the time in which generated traffic counts [s]; the end does not count.

    It is that between `traffic.warm_up` and `traffic.duration` after the first time step of the run. Of a run that was
    stopped it is no longer than the run; one in which everybody has left goes on, with an empty road.

    Args:
        settings: Of the run.
        outcomes: Of the run.
        steps: First and last time step of the run.
        dt: Time between steps [s].
    """
    said = settings.get("settings", {})
    first, last = steps
    begin = first * dt + float(said.get("traffic.warm_up", 0.0))  # type: ignore[arg-type]
    end = first * dt + float(said.get("traffic.duration", np.inf))  # type: ignore[arg-type]
    stopped = (last + 1) * dt
    return begin, min(end, stopped) if "running" in outcomes.outcome or np.isinf(end) else end


def counted_time_of(run: RunRecord) -> tuple[float, float]:
    """The same of a run."""
    first = run.states.first_time_step
    return counted_time(run.settings, run.outcomes, (first, first + run.states.n_steps - 1), run.scenario.dt)


def flows_of(demand: Demand, speeds: Floats, begin: float, end: float, dt: float) -> tuple[LaneFlow, ...]:
    """The same from the vehicles.

    Args:
        demand: The vehicles.
        speeds: Mean speed of each between the two times [m/s]; nan where it was not there.
        begin: Begin of the time that counts [s].
        end: Its end [s], which does not count.
        dt: Time between steps [s].
    """
    hours = max(end - begin, dt) / 3600.0

    def mean(values: Floats) -> float:
        return float(values.mean()) if len(values) else float("nan")

    found = []
    queued = ~np.isnan(demand.due)
    for lane in np.unique(demand.lane_id[queued]).tolist():
        own = queued & (demand.lane_id == lane)
        wanted = own & (demand.due >= begin) & (demand.due < end)
        came = own & (demand.entered >= begin) & (demand.entered < end)
        left_out = own & (demand.due < end) & ~(demand.entered < end)
        waited = np.fmin(demand.entered, end) - demand.due
        known = own & ~np.isnan(speeds)
        row = LaneFlow(
            lane, "in", int(came.sum()), int(wanted.sum()), came.sum() / hours, mean(speeds[known]),
            mean(waited[came | left_out]), _queue(demand, own, begin, end, dt), int(left_out.sum()),
        )  # fmt: skip
        found.append(row)
    for lane in np.unique(demand.exit_id).tolist():
        own = demand.exit_id == lane
        went = own & (demand.left >= begin) & (demand.left < end)
        known = own & ~np.isnan(speeds)
        found.append(
            LaneFlow(lane, "out", int(went.sum()), -1, went.sum() / hours, mean(speeds[known]), float("nan"), -1, -1)
        )
    return tuple(found)


def _speeds(run: RunRecord, demand: Demand, begin: float, end: float) -> Floats:
    """Mean speed of each vehicle between two times [m/s]; nan where it is not there."""
    states, dt = run.states, run.scenario.dt
    times = (states.first_time_step + np.arange(states.n_steps)) * dt
    counts = (times > begin - 0.5 * dt) & (times < end - 0.5 * dt)
    rows = np.searchsorted(states.participant_id, demand.agent_id)
    there = states.valid[rows] & counts
    total = np.where(there, states.velocity[rows], 0.0).sum(axis=1)
    number = there.sum(axis=1)
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)


def _queue(demand: Demand, own: Bools, begin: float, end: float, dt: float) -> int:
    """Largest number of vehicles that are due and have not entered at one time, those that need not wait left out."""
    due, entered = demand.due[own], demand.entered[own]
    waits = ~(entered - due < dt)
    due, entered = due[waits], np.nan_to_num(entered[waits], nan=np.inf)
    moments = np.append(begin, due[(due >= begin) & (due < end)])
    return max((int(((due <= moment) & (entered > moment)).sum()) for moment in moments.tolist()), default=0)
