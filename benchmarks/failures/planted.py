"""Planners with planted faults: car followers that obey the rules of the road, and what is wrong with each."""

from __future__ import annotations

from collections import deque

import numpy as np

import interdrive as idr

HORIZON = 31


class Sound:
    """Follows its path by the Intelligent Driver Model; barriers are standing vehicles. Nothing is planted."""

    obeys_rules = True
    #: Time between what it sees and what it does [s].
    delay = 0.0
    #: Acceleration and comfortable deceleration [m/s²], gap at rest [m], time gap [s].
    limits = (1.5, 3.0)
    gap, headway = 2.0, 1.0

    def __init__(self, cruise: float = 12.0) -> None:
        """With a cruising speed [m/s]."""
        self.cruise = cruise
        self.wanted: deque[float] = deque()

    def plan(self, view: idr.View, predictions: idr.Predictions) -> idr.Trajectory:
        """A trajectory of 3 s with one acceleration."""
        self.wanted.append(self.acceleration(view))
        while len(self.wanted) > round(self.delay / view.dt) + 1:
            self.wanted.popleft()
        a, v = self.wanted[0], view.ego.velocity
        time = np.arange(HORIZON) * view.dt
        moving = np.where(v + a * time > 0.0, time, -v / min(a, -1e-9))
        return along(view, v * moving + 0.5 * a * moving**2, v + a * moving)

    def acceleration(self, view: idr.View) -> float:
        """What it wants to do now [m/s²]."""
        ego = view.ego
        front = ego.s + ego.vehicle.rear_axle_to_center + 0.5 * ego.vehicle.length
        s, d = ego.route.project(view.x[:, -1], view.y[:, -1])
        leads = self.seen(view) & (s > front) & (np.abs(d) < 2.0)
        gaps = np.append(s[leads] - 0.5 * view.length[leads] - front, ego.stop_s - front + 1.0)
        speeds = np.append(view.velocity[leads, -1], 0.0)
        first, v = int(np.argmin(gaps)), ego.velocity
        most, comfortable = self.limits
        closing = v * (v - float(speeds[first])) / (2.0 * np.sqrt(most * comfortable))
        wanted = self.gap + max(0.0, v * self.headway + closing)
        free = 1.0 - (v / self.cruise) ** 4
        return float(np.clip(most * (free - (wanted / max(float(gaps[first]), 0.1)) ** 2), -8.0, most))

    def seen(self, view: idr.View) -> np.ndarray:
        """Which participants it heeds."""
        return np.ones(len(view.ids), dtype=bool)


class Late(Sound):
    """Follows closely, and brakes 0.5 s late."""

    delay = 0.5
    limits = (2.0, 6.0)
    gap, headway = 1.0, 0.6


class BlindRight(Sound):
    """Sees nobody on its right within 12 m."""

    def seen(self, view: idr.View) -> np.ndarray:
        """Which participants it heeds."""
        ego = view.ego
        dx, dy = view.x[:, -1] - ego.x, view.y[:, -1] - ego.y
        is_right = dx * np.sin(ego.orientation) - dy * np.cos(ego.orientation) > 0.0
        return ~(is_right & (np.hypot(dx, dy) < 12.0))


class Standing(Sound):
    """Brakes to a standstill and stays there; it harms nobody who looks ahead."""

    def acceleration(self, view: idr.View) -> float:
        """What it wants to do now [m/s²]."""
        return -4.0


def along(view: idr.View, way: np.ndarray, velocity: np.ndarray) -> idr.Trajectory:
    """A trajectory along the reference path that starts where the agent is."""
    ego, route = view.ego, view.ego.route
    path, heading = route.reference_path, np.unwrap(route.reference_orientation)
    knots = np.linspace(0.0, route.length, len(path))
    at = ego.s + ego.vehicle.rear_axle_to_center + way
    x, y, theta = (np.interp(at, knots, values) for values in (path[:, 0], path[:, 1], heading))
    fade = np.exp(-way / 10.0)
    turn = np.angle(np.exp(1j * (ego.orientation - theta[0])))
    return idr.Trajectory(x + fade * (ego.x - x[0]), y + fade * (ego.y - y[0]), theta + fade * turn, velocity)
