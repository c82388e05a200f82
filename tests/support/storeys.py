"""Roads on several storeys: ways by their points and heights, a bridge, a ramp that comes down from it."""

from dataclasses import replace

import numpy as np
from meetings import lane, lanelets
from recorded_drives import driving, recorded, steady

EAST, NORTH = np.array([1.0, 0.0]), np.array([0.0, 1.0])


def line(direction, start=-100.0, end=100.0):
    """Points along a direction through the origin, 2 m apart."""
    return np.linspace(start, end, round((end - start) / 2.0) + 1)[:, None] * direction


def road(*ways, after=None):
    """Lanelets from (points, heights) pairs, ids from 1 on; `after` links ids."""
    links = after or {}
    found = lanelets([lane(points) for points, _ in ways])
    ids = found.ids.tolist()
    heights = [np.empty(0) if z is None else np.broadcast_to(np.asarray(z, float), len(p)) for p, z in ways]
    return replace(
        found,
        heights=tuple(heights),
        successors=tuple(tuple(links.get(number, ())) for number in ids),
        predecessors=tuple(tuple(one for one in ids if number in links.get(one, ())) for number in ids),
    )


def drive(way, start, velocity=10.0, steps=80):
    return driving(way, start, steady(velocity, steps))


def crossed(height, below=0.0):
    ways = line(EAST), line(NORTH)
    return recorded(road((ways[0], below), (ways[1], height)), {7: drive(ways[0], 60.0), 8: drive(ways[1], 60.0)})


def ramp():
    """The ground (1, then 3), a bridge over it (2) and a ramp (4) that comes down to the ground's second half."""
    ground, bridge = line(EAST, -100.0, 60.0), line(NORTH, -100.0, 40.0)
    turn = np.linspace(np.pi, 0.0, 40)
    around = np.column_stack([60.0 + 60.0 * np.cos(turn), 40.0 + 60.0 * np.sin(turn)])
    back = np.linspace([120.0, 40.0], [120.0, 20.0], 11)[1:]
    bend = np.linspace(np.pi, 1.5 * np.pi, 12)[1:]
    join = np.column_stack([140.0 + 20.0 * np.cos(bend), 20.0 + 20.0 * np.sin(bend)])
    ramp = np.vstack([around, back, join])
    after, before = line(EAST, 140.0, 300.0), line(EAST, 60.0, 140.0)
    ways = [(ground, 0.0), (bridge, 7.0), (after, 0.0), (ramp, np.linspace(7.0, 0.0, len(ramp))), (before, 0.0)]
    lanes = road(*ways, after={1: (5,), 5: (3,), 2: (4,), 4: (3,)})
    return lanes, np.vstack([ground, before[1:], after[1:]]), np.vstack([bridge, ramp[1:], after[1:]])
