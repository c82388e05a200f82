"""Scenarios with recordings made for a test."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from interdrive import Scenario
from interdrive.scenario import Lanelets, Obstacles, PlanningProblem
from interdrive.testing import CAR, world


def along_x(start: float, velocity: np.ndarray, dt: float = 0.1, y: float = 0.0) -> dict[str, np.ndarray]:
    """States of a car that drives towards +x with a speed per time step, constant acceleration in between."""
    acceleration = np.append(np.diff(velocity) / dt, 0.0)
    x = start + np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * dt)])
    zero = np.zeros_like(x)
    return {"x": x, "y": zero + y, "orientation": zero, "velocity": velocity, "acceleration": acceleration}


def braking(velocity: float, deceleration: float, first: int, steps: int, dt: float = 0.1) -> np.ndarray:
    """A constant speed, then braking to standstill from a time step on."""
    time = np.maximum(np.arange(steps + 1) - first, 0) * dt
    return np.maximum(velocity - deceleration * time, 0.0)


def with_recordings(
    lanelets: Lanelets,
    tracks: dict[int, dict[str, np.ndarray]],
    problems: tuple[PlanningProblem, ...] = (),
    dt: float = 0.1,
) -> Scenario:
    """A scenario in which the cars drive the given states from time step 0 on."""
    ids = sorted(tracks)
    n_steps = max(len(track["x"]) for track in tracks.values())
    tables = {
        name: np.full((len(ids), n_steps), np.nan)
        for name in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate")
    }
    valid = np.zeros((len(ids), n_steps), dtype=np.bool_)
    for row, car in enumerate(ids):
        n = len(tracks[car]["x"])
        valid[row, :n] = True
        for name, table in tables.items():
            table[row, :n] = tracks[car].get(name, np.zeros(n))
    obstacles = Obstacles(
        ids=np.array(ids, dtype=np.int64),
        kinds=("car",) * len(ids),
        shapes=(CAR,) * len(ids),
        is_static=np.zeros(len(ids), dtype=np.bool_),
        valid=valid,
        **tables,
    )
    return replace(world(lanelets, problems=problems, dt=dt), obstacles=obstacles)


def only(scenario: Scenario, obstacle_id: int) -> Scenario:
    """The scenario with one of its recorded participants and no planning problem."""
    obstacles = scenario.obstacles
    rows = np.flatnonzero(obstacles.ids == obstacle_id)
    kept = {
        name: getattr(obstacles, name)[rows]
        for name in (
            "ids", "is_static", "valid", "x", "y", "orientation", "velocity", "acceleration", "yaw_rate",
        )
    }  # fmt: skip
    named = {name: tuple(getattr(obstacles, name)[row] for row in rows) for name in ("kinds", "shapes")}
    return replace(scenario, obstacles=replace(obstacles, **kept, **named), planning_problems=())
