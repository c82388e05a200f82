"""Recordings that are cut into windows of time, as data sets publish them."""

from dataclasses import replace

import numpy as np


def window(scenario, first, last, name=None, offset=0.0):
    """The time steps `first` to `last` of a scenario, counted from 0, with headings that are off by `offset` [rad]."""
    obstacles = scenario.obstacles
    part = slice(first, last + 1)
    rows = np.flatnonzero(obstacles.valid[:, part].any(axis=1))
    obstacles = obstacles.only(rows, part)
    return replace(
        scenario,
        name=f"REC_Road-1_{first}_T-{last}" if name is None else name,
        obstacles=replace(obstacles, orientation=obstacles.orientation - offset),
    )


def windows(scenario, length, offset=0.0):
    """All windows of a length."""
    n_steps = scenario.obstacles.n_steps
    return [
        window(scenario, first, min(first + length, n_steps) - 1, offset=offset) for first in range(0, n_steps, length)
    ]
