"""Tiny worlds, and checks that authors of planners run on their own: `check_planner(MyPlanner)`."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import InputError
from interdrive.planners import Trajectory
from interdrive.planners.calls import failure
from interdrive.planners.contract import stated
from interdrive.planners.workers import can_be_sent
from interdrive.scenario import GoalState, InitialState, Lanelets, Obstacles, PlanningProblem, Scenario, Shape
from interdrive.simulation import simulate

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from interdrive._core import Predictions, View

CAR = Shape("rectangle", length=4.5, width=1.8)


@dataclass(frozen=True)
class Car:
    """A recorded car of a tiny world that keeps its speed and heading.

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
    """Parallel lanes towards +x, starting at x = 0; lane `i` (lanelet id `i + 1`) has its centre at y = i * width."""
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
    """Two one-way lanes that cross at the origin: lanelet 1 towards +x, lanelet 2 towards +y."""
    along = np.linspace(-arm, arm, int(arm / 2.5) + 1)
    half = np.full_like(along, 0.5 * lane_width)
    return _lanelets(
        ids=[1, 2],
        left=[np.column_stack([along, half]), np.column_stack([-half, along])],
        right=[np.column_stack([along, -half]), np.column_stack([half, along])],
        adjacent_left=[-1, -1],
        adjacent_right=[-1, -1],
    )


def _lanelets(
    ids: list[int],
    left: list[np.ndarray],
    right: list[np.ndarray],
    adjacent_left: list[int],
    adjacent_right: list[int],
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
    """A planning problem that starts at a pose and wants to be in a rectangle around `goal` within `time_step`."""
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
    """A scenario from lanes, recorded cars that keep their speed, and planning problems."""
    ordered = sorted(cars, key=lambda car: car.id)
    shape = (len(ordered), steps + 1)
    tables = {
        field: np.full(shape, np.nan) for field in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate")
    }
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
        valid=valid,
        **tables,
    )
    return Scenario(name, name, dt, lanelets, obstacles, tuple(sorted(problems, key=lambda p: p.id)))


def _worlds() -> dict[str, Scenario]:
    road = straight_road(300.0, lanes=2)
    limits = (0, 200)
    return {
        "an empty road": world(road, problems=[problem(100, 20.0, goal=(150.0, 0.0), time_step=limits)]),
        "a standing car ahead": world(
            road, cars=[Car(1, 110.0)], problems=[problem(100, 20.0, goal=(200.0, 0.0), time_step=limits)]
        ),
        "a start from standstill": world(
            road, problems=[problem(100, 20.0, velocity=0.0, goal=(80.0, 0.0), time_step=limits)]
        ),
        "crossing traffic": world(
            crossing(),
            cars=[Car(1, 0.0, -50.0, 10.0, np.pi / 2)],
            problems=[problem(100, -50.0, goal=(50.0, 0.0), time_step=limits)],
        ),
    }


class PlannerContractError(AssertionError):
    """A planner breaks the contract; the text says which part of it, in which world, at which time step."""


class _Watched:
    """Calls a planner twice per step and compares, times it, and checks what it returns."""

    def __init__(self, factory: Callable[[], Any], seconds_max: float, findings: list[str]) -> None:
        self._first, self._second = factory(), factory()
        self._seconds_max, self._findings = seconds_max, findings

    def plan(self, view: View, predictions: Predictions) -> Trajectory:
        def fail(text: str) -> None:
            self._findings.append(f"time step {view.time_step}: {text}")
            raise PlannerContractError(text)

        before = _seen(view)
        start = time.perf_counter()
        try:
            plan: Trajectory = self._first.plan(view, predictions)
        except Exception as error:  # noqa: BLE001 - whatever it raises is the finding
            fail(f"plan: {failure(error)}")
        seconds = time.perf_counter() - start
        try:
            view.check_plan(*stated(plan))
        except InputError as error:
            fail(str(error))
        if not np.array_equal(before, _seen(view), equal_nan=True):
            fail("plan changed its view")
        again = self._second.plan(view, predictions)
        if not all(np.array_equal(getattr(plan, f), getattr(again, f)) for f in ("x", "y", "orientation", "velocity")):
            fail("two planners that saw the same did not plan the same (randomness without a seed?)")
        if seconds > self._seconds_max:
            fail(f"plan took {seconds:.3f} s, allowed are {self._seconds_max} s")
        self._check_motion(plan, view, fail)
        return plan

    @staticmethod
    def _check_motion(plan: Trajectory, view: View, fail: Callable[[str], None]) -> None:
        vehicle, dt = view.ego.vehicle, view.dt
        moved = np.hypot(np.diff(plan.x), np.diff(plan.y)) / dt
        if (moved > vehicle.velocity_max + 1e-6).any():
            fail(f"the plan moves at {moved.max():.1f} m/s, the vehicle reaches {vehicle.velocity_max:.1f} m/s")
        change = np.abs(np.diff(plan.velocity)) / dt
        if (change > vehicle.acceleration_max * 1.05 + 1e-6).any():
            fail(f"the plan accelerates by {change.max():.1f} m/s², the vehicle by {vehicle.acceleration_max:.1f} m/s²")


def _seen(view: View) -> np.ndarray:
    return np.concatenate([np.ravel(a) for a in (view.x, view.y, view.orientation, view.velocity, view.ego.state)])


def check_planner(factory: Callable[[], Any], *, seconds_max: float = 1.0) -> dict[str, str]:
    """Drives a planner through small worlds and checks the contract at every step.

    Checked are: shape and finiteness of the trajectory, its start at the present state, jumps, the vehicle's limits of
    speed and acceleration, the same plan for the same view, an unchanged view, and the time per call. A planner that
    says `parallel = True` must be one that can be sent to another process.

    Args:
        factory: Makes a planner; called without arguments, once or more per world.
        seconds_max: Longest time that one call may take [s].

    Returns:
        How the agent ended in each world.

    Raises:
        PlannerContractError: The first part of the contract that is broken, with world and time step.
    """
    if getattr(factory, "parallel", False) and not can_be_sent(factory):
        raise PlannerContractError("it says `parallel = True`, but cannot be pickled and sent to another process")
    ends = {}
    for name, scenario in _worlds().items():
        findings: list[str] = []
        watched = partial(_Watched, factory, seconds_max, findings)
        run = simulate(scenario, agents=[100], planner={100: watched}, threads=1)
        if findings:
            raise PlannerContractError(f"{name}, {findings[0]}")
        if run.outcomes.outcome[0] == "planner_error":
            raise PlannerContractError(f"{name}: {run.outcomes.message[0]}")
        ends[name] = run.outcomes.outcome[0]
    return ends
