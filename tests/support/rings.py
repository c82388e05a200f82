"""Rings of lanelets: circles around the origin, driven counter-clockwise from (radius, 0)."""

import math

import numpy as np

from interdrive.scenario import Lanelets, Obstacles
from interdrive.testing import problem, world
from interdrive.testing.worlds import CAR

WIDTH = 3.5


def ring(n, radius, lanes=1):
    """`n` lanelets in a ring for each lane; lane 1 has the ids from 1 on and the radius, lane 2 lies inside."""
    ids, left, right, after, before = [], [], [], [], []
    for lane in range(lanes):
        middle = radius - lane * WIDTH
        for i in range(n):
            angles = np.linspace(i, i + 1, max(7, math.ceil(2 * math.pi * radius / n)) + 1) * 2 * math.pi / n
            circle = np.column_stack([np.cos(angles), np.sin(angles)])
            left.append((middle - 0.5 * WIDTH) * circle)
            right.append((middle + 0.5 * WIDTH) * circle)
            ids.append(lane * n + i + 1)
            after.append((lane * n + (i + 1) % n + 1,))
            before.append((lane * n + (i - 1) % n + 1,))
    inner = [number + n if number + n <= n * lanes else -1 for number in ids]
    outer = [number - n if number > n else -1 for number in ids]
    return Lanelets(
        ids=np.array(ids, dtype=np.int64),
        left=tuple(left),
        right=tuple(right),
        predecessors=tuple(before),
        successors=tuple(after),
        adjacent_left=np.array(inner, dtype=np.int64),
        adjacent_left_same_direction=np.array([number >= 0 for number in inner]),
        adjacent_right=np.array(outer, dtype=np.int64),
        adjacent_right_same_direction=np.array([number >= 0 for number in outer]),
        speed_limit=np.full(n * lanes, np.nan),
        types=((),) * (n * lanes),
    )


def circling(cars, radius, steps=40, dt=0.1):
    """Cars by id that drive around at (arc length at the start [m], speed [m/s])."""
    time = np.arange(steps + 1) * dt
    arc = np.array([start + velocity * time for start, velocity in cars.values()])
    speed = np.array([np.full_like(time, velocity) for _, velocity in cars.values()])
    angle = arc / radius
    return Obstacles(
        ids=np.array(list(cars), dtype=np.int64),
        kinds=("car",) * len(cars),
        shapes=(CAR,) * len(cars),
        is_static=np.zeros(len(cars), dtype=np.bool_),
        x=radius * np.cos(angle),
        y=radius * np.sin(angle),
        orientation=np.arctan2(np.cos(angle), -np.sin(angle)),
        velocity=speed,
        acceleration=np.zeros_like(speed),
        yaw_rate=speed / radius,
        valid=np.ones(speed.shape, dtype=np.bool_),
    )


def trip(number, radius, start, goal, *, velocity=6.0, steps=600):
    """A planning problem from one arc length of the ring to another [m]."""
    at, to = start / radius, goal / radius
    return problem(
        number,
        radius * math.cos(at),
        radius * math.sin(at),
        velocity,
        math.remainder(at + math.pi / 2, 2 * math.pi),
        goal=(radius * math.cos(to), radius * math.sin(to)),
        goal_size=(6.0, 3.5),
        goal_orientation=math.remainder(to + math.pi / 2, 2 * math.pi),
        time_step=(0, steps),
    )


__all__ = ["circling", "ring", "trip", "world"]
