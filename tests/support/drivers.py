"""Simple planners in Python that drive what a test needs."""

from __future__ import annotations

import numpy as np

from interdrive import Trajectory


class Straight:
    """Keeps speed and heading."""

    def plan(self, view, predictions):
        ego, time = view.ego, np.arange(31) * view.dt
        same = np.ones_like(time)
        return Trajectory(
            ego.x + ego.velocity * np.cos(ego.orientation) * time,
            ego.y + ego.velocity * np.sin(ego.orientation) * time,
            ego.orientation * same,
            ego.velocity * same,
        )


class Turning(Straight):
    """Steers to the left at constant speed."""

    def plan(self, view, predictions):
        ego, time = view.ego, np.arange(31) * view.dt
        heading = ego.orientation + 0.3 * time
        step = ego.velocity * view.dt
        x = ego.x + step * np.concatenate([[0.0], np.cumsum(np.cos(heading[:-1]))])
        y = ego.y + step * np.concatenate([[0.0], np.cumsum(np.sin(heading[:-1]))])
        return Trajectory(x, y, heading, np.full_like(time, ego.velocity))
