"""Checks the contract of planners: `check_planner(MyPlanner)`."""

from __future__ import annotations

import time
import warnings
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from interdrive.config.plugins import DEFAULT_PLANNER, Choice
from interdrive.errors import InputError
from interdrive.foreign import failure
from interdrive.planners.contract import stated
from interdrive.planners.workers import can_be_sent
from interdrive.scenario import STATE_FIELDS, StopLine, TrafficLight
from interdrive.scenario.control import Priorities
from interdrive.simulation import simulate
from interdrive.testing.worlds import Car, crossing, problem, straight_road, world

if TYPE_CHECKING:
    from collections.abc import Callable

    from interdrive._core import Predictions, View
    from interdrive.config.specs import PlannerSpec
    from interdrive.planners import Planner, Trajectory
    from interdrive.scenario import Scenario


#: Smaller changes of heading per time do not count as turning [rad/s].
_YAW_NOISE = 0.1
#: A vehicle that moves less than this per step turns on the spot [m].
_SPOT = 1e-3


#: Others that drive beside the planner under test, and settings, in the worlds with V2X.
_V2X: dict[str, tuple[list[int], dict[str, float | bool]]] = {
    "an agreement to wait": ([1], {"v2x.penetration": 1.0, "v2x.negotiate": True}),
    "a car that only another agent sees": ([1], {"v2x.penetration": 1.0, "v2x.cpm": True, "view.occlusion": True}),
}


#: The world in which the driver of the planner under test has drawn something, and from what.
_DRIVEN, _DRIVERS = "a driver of its own", "house"


def _worlds() -> dict[str, Scenario]:
    road = straight_road(300.0, lanes=2)
    limits = (0, 200)
    return {
        "an empty road": world(road, problems=[problem(100, 20.0, goal=(150.0, 0.0), time_step=limits)]),
        _DRIVEN: world(road, problems=[problem(100, 20.0, goal=(150.0, 0.0), time_step=limits)]),
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
        "an agreement to wait": world(
            crossing(),
            problems=[
                problem(1, 0.0, -30.0, 8.0, 0.5 * np.pi, goal=(0.0, 40.0), goal_size=(3.5, 10.0), time_step=limits),
                problem(100, -36.0, velocity=8.0, goal=(40.0, 0.0), time_step=limits),
            ],
        ),
        # The car ahead hides the one before it, which the agent in the other lane sees.
        "a car that only another agent sees": world(
            road,
            cars=[Car(2, 45.0, 0.0, 10.0), Car(3, 60.0, 0.0, 10.0)],
            problems=[
                problem(1, 50.0, 3.5, goal=(200.0, 3.5), time_step=limits),
                problem(100, 20.0, goal=(200.0, 0.0), time_step=limits),
            ],
        ),
    }


def _worlds_with_rules() -> dict[str, Scenario]:
    limits = (0, 200)
    goal = problem(100, 20.0, goal=(150.0, 0.0), time_step=limits)
    line = StopLine(1, np.array([[80.0, 1.75], [80.0, -1.75]]), ((1, (7,)),))
    road = straight_road(300.0)
    met = problem(1, 0.0, -45.0, 8.0, 0.5 * np.pi, goal=(0.0, 60.0), goal_size=(3.5, 10.0), time_step=limits)
    change = problem(100, 10.0, goal=(150.0, 3.5), time_step=limits)
    lines = tuple(
        StopLine(k + 1, np.array([[80.0, 3.5 * k + 1.75], [80.0, 3.5 * k - 1.75]]), ((k + 1, (7,)),)) for k in range(2)
    )
    red = (TrafficLight(7, (("red", 100), ("green", 900))),)
    cross = world(crossing(), problems=[met, problem(100, -45.0, velocity=8.0, goal=(60.0, 0.0), time_step=limits)])
    return {
        "a red light": replace(world(road, problems=[goal]), traffic_lights=red, stop_lines=(line,)),
        "a red light behind a lane change": replace(
            world(straight_road(300.0, lanes=2), problems=[change]), traffic_lights=red, stop_lines=lines
        ),
        "a sign to give way": replace(cross, priorities=Priorities(ranks=((1, (2, 2, 2)),))),
    }


class PlannerContractError(AssertionError):
    """A planner breaks the contract; the text names the broken part, the world and the time step."""


class _Watched:
    """Calls a planner twice per step and compares, times it, and checks what it returns."""

    def __init__(
        self, factory: Callable[[], Planner], seconds_max: float, findings: list[PlannerContractError]
    ) -> None:
        self._first, self._second = factory(), factory()
        self._seconds_max, self._findings = seconds_max, findings

    def plan(self, view: View, predictions: Predictions) -> Trajectory:
        def fail(text: str, cause: Exception | None = None) -> None:
            finding = PlannerContractError(f"time step {view.time_step}: {text}")
            finding.__cause__ = cause
            self._findings.append(finding)
            raise finding

        before = _seen(view)
        start = time.perf_counter()
        try:
            plan: Trajectory = self._first.plan(view, predictions)
        except Exception as error:  # noqa: BLE001 - whatever it raises is the finding
            fail(f"plan: {failure(error, 'view', placed=True)}", error)
        seconds = time.perf_counter() - start
        try:
            view.check_plan(*stated(plan))
        except InputError as error:
            fail(str(error))
        if not np.array_equal(before, _seen(view), equal_nan=True):
            fail("plan changed its view")
        again = self._second.plan(view, predictions)
        if not all(np.array_equal(getattr(plan, f), getattr(again, f)) for f in STATE_FIELDS[:4]):
            fail("two planners made different plans for the same view (randomness without a seed?)")
        if seconds > self._seconds_max:
            fail(f"plan took {seconds:.3f} s, at most {self._seconds_max} s are allowed")
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
        # The rear axle moves along its heading, so the change of heading per distance is the curvature.
        back = vehicle.rear_axle_to_center
        rear = np.array([plan.x - back * np.cos(plan.orientation), plan.y - back * np.sin(plan.orientation)])
        way, turned = np.hypot(*np.diff(rear)), np.abs(np.diff(np.unwrap(plan.orientation)))
        too_sharp = turned > 1.1 * vehicle.curvature_max * way + _YAW_NOISE * dt
        if too_sharp.any():
            way, turned = way[too_sharp], turned[too_sharp]
            if way.min() < _SPOT:
                fail(f"the plan turns by {turned[way < _SPOT].max() / dt:.2f} rad/s on the spot")
            curvature = (turned / way).max()
            fail(f"the plan turns by {curvature:.2f} rad per metre, the vehicle by {vehicle.curvature_max:.2f} at most")


def _seen(view: View) -> np.ndarray:
    driver = list(view.ego.driver.values())
    seen = (view.x, view.y, view.orientation, view.velocity, view.ego.state, driver)
    return np.concatenate([np.ravel(a) for a in seen])


def check_planner(factory: Callable[[], Planner], *, seconds_max: float = 1.0) -> dict[str, str]:
    """Drives a planner through small worlds and checks the contract at every step.

    Two of the worlds have V2X: in one the agent is told of a bar before which it has agreed to wait (id -1), in the
    other of a car that it cannot see itself. In one world the agent draws a driver (`view.ego.driver`); in all others
    it has none.

    The checks cover shape and finiteness of the trajectory, its start at the present state, jumps, the vehicle's limits
    of speed, acceleration and curvature, the same plan for the same view, an unchanged view, and the time per call. A
    planner with `parallel = True` must be picklable. One with `obeys_rules = True` also drives to a red light, to one
    behind a lane change, and to a sign to give way; a rule that it breaks there is a warning.

    Args:
        factory: Makes a planner; called without arguments, once or more per world.
        seconds_max: Time limit of a call [s].

    Returns:
        Outcome of the agent in each world.

    Raises:
        PlannerContractError: A part of the contract is broken; the text names it with world and time step. If the
            planner raised an exception, that is its cause.
    """
    if getattr(factory, "parallel", False) and not can_be_sent(factory):
        raise PlannerContractError("it has `parallel = True`, but cannot be pickled for another process")
    ends = {}
    for name, scenario in _worlds().items():
        findings: list[PlannerContractError] = []
        watched = partial(_Watched, factory, seconds_max, findings)
        others, settings = _V2X.get(name, ([], {}))
        own: PlannerSpec = Choice(watched, {"drivers": _DRIVERS}) if name == _DRIVEN else watched
        planners: dict[int, PlannerSpec] = {100: own, **dict.fromkeys(others, DEFAULT_PLANNER)}
        run = simulate(scenario, agents=[*others, 100], planner=planners, settings=settings, threads=1)
        if findings:
            raise PlannerContractError(f"{name}, {findings[0]}") from findings[0].__cause__
        # 100 is the largest id.
        if run.outcomes.outcome[-1] == "planner_error":
            raise PlannerContractError(f"{name}: {run.outcomes.message[-1]}")
        ends[name] = run.outcomes.outcome[-1]
    # A factory need not be the class itself.
    if getattr(factory(), "obeys_rules", False):
        _warn_of_violations(factory)
    return ends


def _warn_of_violations(factory: Callable[[], Planner]) -> None:
    for name, scenario in _worlds_with_rules().items():
        others = [problem.id for problem in scenario.planning_problems if problem.id != 100]
        planners: dict[int, PlannerSpec] = {100: factory, **dict.fromkeys(others, DEFAULT_PLANNER)}
        run = simulate(
            scenario, agents=[*others, 100], planner=planners, settings={"rules.precedence": True}, threads=1
        )
        found = run.violations
        if found is None:
            continue
        rows = zip(found.source, found.participant_id.tolist(), found.rule, strict=True)
        broken = sorted({rule for source, who, rule in rows if source == "agent" and who == 100})
        if broken:
            warnings.warn(f"{name}: the planner has `obeys_rules = True`, but breaks {', '.join(broken)}", stacklevel=3)
