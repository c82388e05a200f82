"""Small worlds: a straight road, a crossing, cars that keep their speed, planning problems."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.scenario import (
    STATE_FIELDS,
    GoalState,
    InitialState,
    Lanelets,
    Obstacles,
    PlanningProblem,
    Scenario,
    Shape,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

#: Footprint of the recorded cars.
CAR = Shape("rectangle", length=4.5, width=1.8)


@dataclass(frozen=True)
class Car:
    """A recorded car of a small world that keeps its speed and heading.

    Attributes:
        id: Obstacle id.
        x: Centre at the first step [m]. y: Centre [m].
        velocity: Speed [m/s]; 0: it stands.
        orientation: Heading [rad].
        first: First time step. last: Last time step (None: the world's).
    """

    id: int
    x: float
    y: float = 0.0
    velocity: float = 0.0
    orientation: float = 0.0
    first: int = 0
    last: int | None = None


def straight_road(length: float = 200.0, lanes: int = 1, lane_width: float = 3.5) -> Lanelets:
    """Parallel lanes towards +x, starting at x = 0; lane `i` (lanelet id `i + 1`) has its centre at y = i * lane_width.

    Args:
        length: Of the road [m].
        lanes: Number of lanes.
        lane_width: Width of a lane [m].
    """
    x = np.linspace(0.0, length, max(2, int(length / 5) + 1))
    offsets = [(i - 0.5) * lane_width for i in range(lanes + 1)]

    def bound(y: float) -> np.ndarray:
        return np.column_stack([x, np.full_like(x, y)])

    return _lanelets(
        ids=[i + 1 for i in range(lanes)],
        left=[bound(offsets[i + 1]) for i in range(lanes)],
        right=[bound(offsets[i]) for i in range(lanes)],
        adjacent_left=[i + 2 if i + 1 < lanes else -1 for i in range(lanes)],
        adjacent_right=[i if i > 0 else -1 for i in range(lanes)],
    )


def crossing(arm: float = 100.0, lane_width: float = 3.5) -> Lanelets:
    """Two one-way lanes that cross at the origin: lanelet 1 towards +x, lanelet 2 towards +y.

    Args:
        arm: From the origin to each end [m].
        lane_width: Width of a lane [m].
    """
    along = np.linspace(-arm, arm, int(arm / 2.5) + 1)
    half = np.full_like(along, 0.5 * lane_width)
    return _lanelets(
        ids=[1, 2],
        left=[np.column_stack([along, half]), np.column_stack([-half, along])],
        right=[np.column_stack([along, -half]), np.column_stack([half, along])],
        adjacent_left=[-1, -1],
        adjacent_right=[-1, -1],
    )


def bend(radius: float = 30.0, arm: float = 50.0, lane_width: float = 3.5) -> Lanelets:
    """One lane that turns left by 90 degrees: towards +x up to the origin, an arc, then towards +y; lanelet id 1.

    Args:
        radius: Of the centre line in the arc [m].
        arm: Length of the straight before and behind the arc [m].
        lane_width: Width of the lane [m].
    """
    turned = np.linspace(0.0, 0.5 * np.pi, max(4, int(radius) + 1))
    straight = np.linspace(0.0, arm, max(2, int(arm / 5) + 1))

    def bound(offset: float) -> np.ndarray:
        own = radius - offset
        arc = np.column_stack([own * np.sin(turned), radius - own * np.cos(turned)])
        before = np.column_stack([straight[:-1] - arm, np.full(len(straight) - 1, offset)])
        after = np.column_stack([np.full(len(straight) - 1, own), radius + straight[1:]])
        return np.vstack([before, arc, after])

    return _lanelets(
        ids=[1],
        left=[bound(0.5 * lane_width)],
        right=[bound(-0.5 * lane_width)],
        adjacent_left=[-1],
        adjacent_right=[-1],
    )


def _lanelets(
    ids: list[int], left: list[np.ndarray], right: list[np.ndarray], adjacent_left: list[int], adjacent_right: list[int]
) -> Lanelets:
    n = len(ids)
    return Lanelets(
        ids=np.array(ids, dtype=np.int64),
        left=tuple(left),
        right=tuple(right),
        predecessors=((),) * n,
        successors=((),) * n,
        adjacent_left=np.array(adjacent_left, dtype=np.int64),
        adjacent_left_same_direction=np.array([i >= 0 for i in adjacent_left]),
        adjacent_right=np.array(adjacent_right, dtype=np.int64),
        adjacent_right_same_direction=np.array([i >= 0 for i in adjacent_right]),
        speed_limit=np.full(n, np.nan),
        types=((),) * n,
    )


def problem(
    agent_id: int,
    x: float,
    y: float = 0.0,
    velocity: float = 10.0,
    orientation: float = 0.0,
    *,
    goal: tuple[float, float],
    goal_size: tuple[float, float] = (10.0, 3.5),
    goal_orientation: float = 0.0,
    time_step: tuple[int, int],
    start: int = 0,
) -> PlanningProblem:
    """A planning problem that starts at a pose and has to reach a rectangle around `goal` within `time_step`.

    Args:
        agent_id: Id of the problem and its agent.
        x: Centre of the footprint at the start [m], world frame.
        y: The same [m].
        velocity: Speed at the start [m/s].
        orientation: Heading at the start [rad].
        goal: Centre of the goal area (x, y) [m].
        goal_size: Length and width of the goal area [m].
        goal_orientation: Direction of its length [rad].
        time_step: First and last time step at which the goal counts, both included.
        start: Time step of the start.
    """
    area = Shape("rectangle", goal_size[0], goal_size[1], center=goal, orientation=goal_orientation)
    return PlanningProblem(
        id=agent_id,
        initial_state=InitialState(start, x, y, orientation, velocity, 0.0, 0.0),
        goal=(GoalState(areas=(area,), lanelet_ids=(), time_step=time_step),),
    )


def world(
    lanelets: Lanelets,
    *,
    cars: Sequence[Car] = (),
    problems: Sequence[PlanningProblem] = (),
    steps: int = 100,
    dt: float = 0.1,
    name: str = "tiny",
) -> Scenario:
    """A scenario from lanes, recorded cars that keep their speed, and planning problems.

    Args:
        lanelets: The roads, for instance `straight_road()`.
        cars: Recorded traffic.
        problems: Agents with a goal of their own.
        steps: Number of recorded time steps after the first.
        dt: Time between steps [s].
        name: Name and benchmark id of the scenario.
    """
    ordered = sorted(cars, key=lambda car: car.id)
    shape = (len(ordered), steps + 1)
    tables = {field: np.full(shape, np.nan) for field in STATE_FIELDS}
    valid = np.zeros(shape, dtype=np.bool_)
    for row, car in enumerate(ordered):
        present = np.arange(car.first, (steps if car.last is None else car.last) + 1)
        time_since = (present - car.first) * dt
        tables["x"][row, present] = car.x + car.velocity * np.cos(car.orientation) * time_since
        tables["y"][row, present] = car.y + car.velocity * np.sin(car.orientation) * time_since
        tables["orientation"][row, present] = car.orientation
        tables["velocity"][row, present] = car.velocity
        tables["acceleration"][row, present] = 0.0
        tables["yaw_rate"][row, present] = 0.0
        valid[row, present] = True
    obstacles = Obstacles(
        ids=np.array([car.id for car in ordered], dtype=np.int64),
        kinds=("car",) * len(ordered),
        shapes=(CAR,) * len(ordered),
        is_static=np.zeros(len(ordered), dtype=np.bool_),
        x=tables["x"],
        y=tables["y"],
        orientation=tables["orientation"],
        velocity=tables["velocity"],
        acceleration=tables["acceleration"],
        yaw_rate=tables["yaw_rate"],
        valid=valid,
    )
    return Scenario(name, name, dt, lanelets, obstacles, tuple(sorted(problems, key=lambda p: p.id)))
