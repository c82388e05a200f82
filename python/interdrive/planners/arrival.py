"""Additions to third-party planners: the speed for arrival at the goal in time, and braking to a stop."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.planners.contract import Trajectory

if TYPE_CHECKING:
    from interdrive._core import View

#: The desired speed differs from the present one by at most this, and never exceeds the maximum [m/s].
_VELOCITY_STEP, _VELOCITY_MAX = 5.0, 50.0
#: Below this speed the steering cannot be derived from the yaw rate [m/s].
_SLOW = 1.0


def arrival_velocity(view: View, reserve: float) -> float:
    """The constant speed that brings the rear axle to the middle of the goal area in time [m/s].

    The aim is the middle of the goal's time interval, but no earlier than `reserve` [s] before its end. Within the
    area, too late, or without a goal area it is the middle of the goal's speed interval, else the present speed. The
    planner around FRENETIX (release 2024.4) does the same, but always aims for the middle of the time interval.
    """
    ego = view.ego
    first, last = ego.goal_time_step
    _, _, interval, _ = max(ego.goal.states, key=lambda state: state[1][1])
    at_goal = ego.velocity if interval is None else 0.5 * (max(interval[0], 0.01) + max(interval[1], 0.01))
    entry, leave = ego.route.goal_entry_s, ego.route.goal_exit_s
    left = (max(0.5 * (first + last), last - reserve / view.dt) - view.time_step) * view.dt
    if not np.isfinite(entry):
        wanted = ego.velocity
    elif entry <= ego.s <= leave or left <= 0.0:
        wanted = at_goal
    else:
        wanted = (0.5 * (entry + leave) - ego.s) / left
    return float(
        np.clip(wanted, max(ego.velocity - _VELOCITY_STEP, 0.0), min(ego.velocity + _VELOCITY_STEP, _VELOCITY_MAX))
    )


def braking_along_arc(view: View, n_points: int, deceleration: float) -> Trajectory:
    """Trajectory that brakes [m/s²] with the present steering until the agent stands, also from rolling backwards."""
    ego, t = view.ego, view.dt * np.arange(n_points)
    velocity = np.copysign(np.maximum(abs(ego.velocity) - abs(deceleration) * t, 0.0), ego.velocity)
    travelled = np.append(0.0, np.cumsum(0.5 * view.dt * (velocity[1:] + velocity[:-1])))
    curvature = ego.yaw_rate / ego.velocity if abs(ego.velocity) > _SLOW else 0.0
    limit = ego.vehicle.curvature_max
    theta = ego.orientation + min(max(curvature, -limit), limit) * travelled
    middle, steps = 0.5 * (theta[1:] + theta[:-1]), np.diff(travelled)
    x = ego.x + np.append(0.0, np.cumsum(steps * np.cos(middle)))
    y = ego.y + np.append(0.0, np.cumsum(steps * np.sin(middle)))
    return Trajectory(x, y, theta, velocity)
