"""Rollouts from a window: simulated ones, and those of the reference rows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError
from interdrive.run.reasons import NO_ROOM
from interdrive.scenario.agents import possible_agents
from interdrive.scenario.native import core_road
from interdrive.simulation import Simulation
from interdrive.traffic_realism.tracks import GRID, Tracks
from interdrive.traffic_realism.windows import JUDGED_KINDS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Floats, Ints
    from interdrive.config.schema import SimulationSettings
    from interdrive.config.specs import PlannerSpec
    from interdrive.runs import Run
    from interdrive.traffic_realism.windows import Window

#: Braking harder than this [m/s²] within this time of the start [s] is hard.
_HARD, _HARD_WITHIN = 4.0, 3.0


@dataclass(frozen=True)
class Rollouts:
    """What a row of the tables has for a window.

    Attributes:
        judged: Ids of the judged vehicles that plan, ascending, shape (n,).
        states: x, y, heading, speed of each from the start on, shape (rollouts, 4, n, points).
        tracks: All participants of the first rollout, from the beginning of the window on.
        n_agents: Vehicles that planned or wanted to, in all rollouts.
        collisions: Of them those that hit others, in all rollouts.
        departures: Those that left the road.
        not_admitted: Those that found no room to enter.
        braked: Judged vehicles that braked harder than 4 m/s² in the first 3 s.
    """

    judged: Ints
    states: Floats
    tracks: Tracks
    n_agents: int = 0
    collisions: int = 0
    departures: int = 0
    not_admitted: int = 0
    braked: int = 0


def planning(window: Window, settings: SimulationSettings) -> list[int]:
    """Ids of the vehicles of a window that plan: those of judged kinds that have a route."""
    road = core_road(window.scenario, settings.road)
    kinds = dict(zip(window.scenario.obstacles.ids.tolist(), window.scenario.obstacles.kinds, strict=True))
    able, _ = possible_agents(
        window.scenario,
        road,
        agent_settings=settings.agents,
        goal_settings=settings.goal,
        max_steps=settings.step.steps_at_most(window.scenario),
    )
    return [number for number in able if kinds.get(number) in JUDGED_KINDS]


def simulated(
    window: Window, planner: PlannerSpec, settings: SimulationSettings, seeds: Sequence[int], agents: Sequence[int]
) -> Rollouts:
    """Rollouts of a planner.

    Args:
        window: Where they begin.
        planner: See `interdrive.PlannerSpec`.
        settings: Of the runs.
        seeds: One per rollout.
        agents: Ids of the vehicles that plan.
    """
    judged = np.intersect1d(window.judged, np.array(agents, dtype=np.int64))
    states, counts, first = [], np.zeros(5, dtype=np.int64), None
    for seed in seeds:
        simulation = Simulation(
            window.scenario, agents=list(agents), planner=planner, settings=settings, seed=seed, threads=1
        )
        run = simulation.run()
        whole = _on_grid(run, window)
        own = _going_on(whole.stacked(whole.rows(judged)), window.start_point)
        states.append(own[:, :, window.start_point :])
        counts += _counted(run, window, judged)
        if first is None:
            first = whole.replaced(whole.rows(judged), own)
    if first is None:
        raise InputError("realism: at least one rollout is needed")
    return Rollouts(judged, np.stack(states), first, *counts.tolist())


def _on_grid(run: Run, window: Window) -> Tracks:
    found = run.states
    columns = slice(window.start % window.stride, None, window.stride)
    n = window.start_point + window.n_points + 1
    tables = []
    for table in (found.x, found.y, found.orientation, found.velocity):
        values = table[:, columns][:, :n]
        tables.append(np.pad(values, ((0, 0), (0, n - values.shape[1])), constant_values=np.nan))
    return Tracks(found.participant_id, found.length, found.width, *tables)


def _going_on(states: Floats, start: int) -> Floats:
    """The states, in which agents that have ended go on at their last speed and heading."""
    x, y, heading, speed = (table.copy() for table in states)
    for point in range(start + 1, x.shape[1]):
        ended = np.flatnonzero(~np.isfinite(x[:, point]) & np.isfinite(x[:, point - 1]))
        heading[ended, point], speed[ended, point] = heading[ended, point - 1], speed[ended, point - 1]
        way = GRID * speed[ended, point]
        x[ended, point] = x[ended, point - 1] + way * np.cos(heading[ended, point])
        y[ended, point] = y[ended, point - 1] + way * np.sin(heading[ended, point])
    return np.stack((x, y, heading, speed))


def _counted(run: Run, window: Window, judged: Ints) -> Ints:
    """Agents, collisions, departures, vehicles that did not enter, judged vehicles that braked hard."""
    ended = run.outcomes
    hit = np.array([outcome == "collision" for outcome in ended.outcome], dtype=np.bool_)
    # Who overlaps others in the recording takes part, but its contacts say nothing about the planner.
    unsure = np.array(sorted(window.scenario.overlapping), dtype=np.int64)
    hit &= ended.off_road | ~(np.isin(ended.agent_id, unsure) | np.isin(ended.partner_id, unsure))
    outside = np.array([message.startswith(NO_ROOM) for message in ended.message], dtype=np.bool_)
    columns = slice(window.start + 1, window.start + 1 + round(_HARD_WITHIN / window.scenario.dt))
    acceleration = run.states.acceleration[np.searchsorted(run.states.participant_id, judged), columns]
    braked = np.nanmin(np.where(np.isfinite(acceleration), acceleration, 0.0), axis=1, initial=0.0) < -_HARD
    return np.array(
        [len(hit), (hit & ~ended.off_road).sum(), (hit & ended.off_road).sum(), outside.sum(), braked.sum()]
    )


def replayed(window: Window, settings: SimulationSettings, agents: Sequence[int]) -> Rollouts:
    """The recording, with what is judged of it as of any planner: contacts, and whether vehicles leave the road.

    Args:
        window: Where the vehicles start.
        settings: Of the runs.
        agents: Ids of the vehicles that plan in other rows.
    """
    # Who replays is done where its recording ends.
    until_end = replace(settings.goal, information="timed")
    own = replace(settings, goal=until_end, step=replace(settings.step, entry_wait=0.0))
    # Whose recorded way is none of the map's has no goal with a time: its recording counts, but nobody judges it.
    able = np.intersect1d(planning(window, own), np.array(agents, dtype=np.int64))
    truth = recorded(window, np.intersect1d(window.judged, np.array(agents, dtype=np.int64)))
    if not len(able):
        return truth
    found = simulated(window, "recorded", own, (0,), able.tolist())
    counts = {name: getattr(found, name) for name in ("n_agents", "collisions", "departures", "braked")}
    return replace(truth, **counts)


def recorded(window: Window, judged: Ints) -> Rollouts:
    """The recording itself."""
    tracks = _padded(window)
    states = tracks.stacked(tracks.rows(judged))[:, :, window.start_point :]
    return Rollouts(judged, states[None], tracks)


def constant_velocity(window: Window, judged: Ints) -> Rollouts:
    """Everybody goes on straight at the speed of the start."""
    tracks = _padded(window)
    rows = tracks.rows(judged)
    states = tracks.stacked(rows)
    states[:, :, window.start_point + 1 :] = np.nan
    own = _going_on(states, window.start_point)
    return Rollouts(judged, own[None, :, :, window.start_point :], tracks.replaced(rows, own))


def moved(window: Window, judged: Ints, states: Floats) -> Rollouts:
    """Given motions of the judged vehicles from the start on, shape (rollouts, 4, n, points); others as recorded."""
    tracks = _padded(window)
    rows = tracks.rows(judged)
    own = tracks.stacked(rows)
    own[:, :, window.start_point :] = states[0]
    return Rollouts(judged, states, tracks.replaced(rows, own))


def _padded(window: Window) -> Tracks:
    """As recorded, with as many points as a rollout has."""
    tracks = window.recorded()
    n = window.start_point + window.n_points + 1
    tables = [
        np.pad(table[:, :n], ((0, 0), (0, max(0, n - table.shape[1]))), constant_values=np.nan)
        for table in (tracks.x, tracks.y, tracks.heading, tracks.speed)
    ]
    return Tracks(tracks.ids, tracks.length, tracks.width, *tables)
