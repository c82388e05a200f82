"""Recordings of cars that follow given ways."""

from dataclasses import replace

import numpy as np

from interdrive.testing import Car, world


def driving(way, start, speeds):
    """Positions and headings along a way from an arc length on, one per speed [m/s], 0.1 s apart."""
    steps = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
    s = start + np.concatenate([[0.0], 0.1 * np.cumsum(speeds[:-1])])
    x, y = (np.interp(s, steps, way[:, i]) for i in (0, 1))
    ahead = (np.interp(s + 0.5, steps, way[:, i]) - np.interp(s - 0.5, steps, way[:, i]) for i in (0, 1))
    return {"x": x, "y": y, "velocity": speeds, "orientation": np.arctan2(*reversed(list(ahead)))}


def recorded(lanelets, drives):
    """A recording of drives by ids."""
    (first, *_) = drives.values()
    scenario = world(lanelets, cars=[Car(number, 0.0) for number in drives], steps=len(first["x"]) - 1)
    rows = [drives[number] for number in sorted(drives)]
    tables = {name: np.array([row[name] for row in rows]) for name in first}
    return replace(scenario, obstacles=replace(scenario.obstacles, **tables))


def steady(velocity, steps=80):
    return np.full(steps + 1, velocity)
