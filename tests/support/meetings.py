"""Small worlds in which agents meet without any rule that says which goes first."""

from __future__ import annotations

import numpy as np

from interdrive.scenario import Lanelets
from interdrive.testing import problem, world

#: Half the side of the square that crossing streets share [m].
HALF = 3.5


def lane(points, width=3.5):
    """Left and right bound of a lane along a polyline."""
    points = np.asarray(points, dtype=float)
    along = np.gradient(points, axis=0)
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    return points + 0.5 * width * normal, points - 0.5 * width * normal


def lanelets(lanes):
    """Lanelets that have nothing to do with each other but their place; ids from 1 on."""
    n = len(lanes)
    none = np.full(n, -1, dtype=np.int64)
    return Lanelets(
        ids=np.arange(1, n + 1),
        left=tuple(left for left, _ in lanes),
        right=tuple(right for _, right in lanes),
        predecessors=((),) * n,
        successors=((),) * n,
        adjacent_left=none,
        adjacent_left_same_direction=np.zeros(n, dtype=bool),
        adjacent_right=none,
        adjacent_right_same_direction=np.zeros(n, dtype=bool),
        speed_limit=np.full(n, np.nan),
        types=((),) * n,
    )


def turned(points, angle):
    """Points, turned around the origin."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.asarray(points) @ np.array([[cos, sin], [-sin, cos]])


def straight(from_x, to_x, y):
    x = np.linspace(from_x, to_x, round(abs(to_x - from_x)) + 1)
    return np.column_stack([x, np.full_like(x, y)])


def four_arms(way=40.0, velocity=8.0):
    """Four agents at the same distance, speed and hour, each straight on; right lanes of two crossing streets."""
    angles = [0.3 + 0.5 * np.pi * i for i in range(4)]
    lanes = [lane(turned(straight(-100.0, 100.0, -0.5 * HALF), angle)) for angle in angles]
    problems = []
    for i, angle in enumerate(angles):
        (x, y), (gx, gy) = turned([[-way, -0.5 * HALF], [40.0, -0.5 * HALF]], angle)
        problems.append(
            problem(
                i + 1,
                x,
                y,
                velocity,
                angle,
                goal=(gx, gy),
                goal_size=(10.0, 3.5),
                goal_orientation=angle,
                time_step=(0, 400),
            )
        )
    return world(lanelets(lanes), cars=[], problems=problems)


def two_roads(ways=(30.0, 36.0), speeds=(7.0, 7.0), cars=()):
    """Two one-way roads that cross; agent 1 drives on lanelet 1 towards +x, agent 2 on lanelet 2 from its right."""
    lanes = [lane(turned(straight(-100.0, 100.0, 0.0), angle)) for angle in (0.0, 0.5 * np.pi)]
    problems = []
    for i, angle in enumerate((0.0, 0.5 * np.pi)):
        (x, y), (gx, gy) = turned([[-ways[i], 0.0], [40.0, 0.0]], angle)
        area = {"goal": (gx, gy), "goal_size": (10.0, 3.5), "goal_orientation": angle, "time_step": (0, 400)}
        problems.append(problem(i + 1, x, y, speeds[i], angle, **area))
    return world(lanelets(lanes), cars=cars, problems=problems, steps=250)


def queue_at_a_crossing():
    """Two crossing one-way roads: agents 2 and, 12 m behind it, 3 drive towards +x, agent 4 comes from the side."""
    lanes = [lane(turned(straight(-100.0, 100.0, 0.0), angle)) for angle in (0.0, 0.5 * np.pi)]
    problems = []
    for agent, way, angle in ((2, 30.0, 0.0), (3, 42.0, 0.0), (4, 40.0, 0.5 * np.pi)):
        (x, y), (gx, gy) = turned([[-way, 0.0], [40.0, 0.0]], angle)
        area = {"goal": (gx, gy), "goal_size": (10.0, 3.5), "goal_orientation": angle, "time_step": (0, 400)}
        problems.append(problem(agent, x, y, 7.0, angle, **area))
    return world(lanelets(lanes), problems=problems, steps=250)


def three_left_turns(way=25.0, velocity=6.0):
    """Three agents at a T-junction, each of which crosses the ways of the two others."""

    def left(radius=9.0):
        turn = np.linspace(0.0, 0.5 * np.pi, 12)
        arc = np.column_stack([radius * np.sin(turn), radius * (1.0 - np.cos(turn))])
        before = straight(-60.0, -1.0, 0.0)
        after = np.column_stack([np.full(60, radius), radius + np.arange(1.0, 61.0)])
        return np.concatenate([before, arc, after]) + np.array([-5.0, -1.75])

    angles = [0.0, 0.5 * np.pi, np.pi]
    ways = [turned(left(), angle) for angle in angles]
    problems = []
    for i, (points, angle) in enumerate(zip(ways, angles, strict=True)):
        start, goal = points[np.argmin(np.abs(np.arange(len(points)) - (60 - round(way))))], points[-20]
        problems.append(
            problem(
                i + 1,
                *start,
                velocity,
                angle,
                goal=tuple(goal),
                goal_size=(10.0, 3.5),
                goal_orientation=angle + 0.5 * np.pi,
                time_step=(0, 400),
            )
        )
    return world(lanelets([lane(points) for points in ways]), cars=[], problems=problems)


def narrow_street(velocity=6.0):
    """A street of 3 m by 40 m with room for two at both ends; one agent from each end."""

    def way():
        x = np.linspace(-70.0, 70.0, 141)
        aside = np.clip((np.abs(x) - 20.0) / 15.0, 0.0, 1.0)
        return np.column_stack([x, -2.0 * aside**2 * (3.0 - 2.0 * aside)])

    there = way()
    back = turned(way(), np.pi)
    (x, y), (gx, gy) = there[10], there[-15]
    problems = [
        problem(1, x, y, velocity, 0.0, goal=(gx, gy), goal_size=(10.0, 3.5), time_step=(0, 500)),
        problem(
            2,
            -x,
            -y,
            velocity,
            np.pi,
            goal=(-gx, -gy),
            goal_size=(10.0, 3.5),
            goal_orientation=np.pi,
            time_step=(0, 500),
        ),
    ]
    return world(lanelets([lane(there, 3.0), lane(back, 3.0)]), cars=[], problems=problems)


def passing_place(ahead=0, velocity=6.0):
    """A street of 3 m by 100 m with room for two at both ends and in a bay in its middle; one agent from each end.

    The bay, 20 m long, is on the right of agent 2, whose lane leads through it. Agent 2 (agent 1, if it is negative)
    starts `ahead` metres farther on.
    """

    def eased(values):
        """From 0 to 1 without a kink."""
        values = np.clip(values, 0.0, 1.0)
        return values**2 * (3.0 - 2.0 * values)

    x = np.linspace(-110.0, 110.0, 221)
    ends = -2.0 * eased((np.abs(x) - 50.0) / 15.0)
    there = np.column_stack([x, ends])
    back = turned(np.column_stack([x, ends - 4.0 * eased((22.0 - np.abs(x)) / 12.0)]), np.pi)
    problems = []
    for agent, points, angle, start in ((1, there, 0.0, 10 - min(ahead, 0)), (2, back, np.pi, 10 + max(ahead, 0))):
        area = {"goal": tuple(points[-15]), "goal_size": (10.0, 3.5), "goal_orientation": angle}
        problems.append(problem(agent, *points[start], velocity, angle, **area, time_step=(0, 450)))
    return world(lanelets([lane(there, 3.0), lane(back, 3.0)]), cars=[], problems=problems)


def zip_merge(n=5, velocity=15.0):
    """Two lanes of `n` agents each become one."""
    x = np.linspace(0.0, 600.0, 301)
    aside = 3.5 * (1.0 - np.clip((x - 200.0) / 100.0, 0.0, 1.0))
    right, left = np.column_stack([x, np.zeros_like(x)]), np.column_stack([x, aside])
    problems = [
        problem(
            10 * lane + i + 1,
            15.0 + 35.0 * (n - 1 - i),
            3.5 * lane,
            velocity,
            goal=(420.0, 0.0),
            goal_size=(20.0, 3.5),
            time_step=(0, 600),
        )
        for lane in (0, 1)
        for i in range(n)
    ]
    return world(lanelets([lane(right), lane(left)]), cars=[], problems=problems)
