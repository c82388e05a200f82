"""Roads and starts on which frenet and the published planner's binary are compared."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cache

import numpy as np
from published_planner import N_POINTS, Path, PublishedPlanner, Start

from interdrive import Simulation
from interdrive.planners import Frenet
from interdrive.scenario import InitialState, Lanelets, PlanningProblem
from interdrive.testing import Car, problem, straight_road, world

LENGTH = 190.0
#: Step for numeric derivatives of what the binary returns [s].
FINE = 0.001
AGENT = 100
#: Distance of vertices where more of them would say no more [m].
STRAIGHT = 0.5


def bending_road(curvature) -> Lanelets:
    """One lane, 14 m wide, 190 m long, with a curvature [1/m] that depends on the arc length."""
    s = np.arange(0.0, LENGTH + 1e-9, 0.5)
    kappa = curvature(s)
    theta = 0.3 + np.concatenate([[0.0], np.cumsum(0.25 * (kappa[1:] + kappa[:-1]))])
    middle = 0.5 * (theta[1:] + theta[:-1])
    steps = 0.5 * np.column_stack([np.cos(middle), np.sin(middle)])
    center = np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)])
    normal = np.column_stack([-np.sin(theta), np.cos(theta)])
    return dataclasses.replace(straight_road(LENGTH), left=(center + 7.0 * normal,), right=(center - 7.0 * normal,))


ROADS = {
    "straight": lambda s: 0.0 * s,
    "left bend, R = 60 m": lambda s: 0.0 * s + 1 / 60,
    "right bend, R = 35 m": lambda s: 0.0 * s - 1 / 35,
    "S bend": lambda s: 0.02 * np.sin(2 * np.pi * s / 120.0),
}


STARTS = [
    Start(60.0, speed, acceleration, d, d_prime, d_prime2)
    for speed in (3.0, 8.0, 15.0, 25.0)
    for acceleration, d, d_prime, d_prime2 in (
        (0.0, 0.0, 0.0, 0.0),
        (0.7, -0.8, 0.06, -0.004),
        (-1.1, 0.6, -0.08, 0.005),
    )
]


#: An agent is not taken to start with more lateral acceleration: half of what the vehicle's tyres hold [m/s²].
START_LATERAL_ACCELERATION_MAX = 0.5 * 8.0
#: Nor with more acceleration along its heading, which no start here has [m/s²].
START_ACCELERATION_MAX = 3.0
#: Every speed and every kind, for comparisons that take long.
SOME_STARTS = STARTS[::2]
SLOW_STARTS = [Start(60.0, speed, 0.4, 0.5, 0.03, 0.004) for speed in (1.0, 1.5, 1.9)]


@dataclass(frozen=True)
class Case:
    """One agent at one start state, as our planner takes it, with everything that both planners say about it."""

    simulation: Simulation
    path: Path
    start: Start
    found: dict
    n_lanes: int

    @property
    def desired(self) -> float:
        return self.found["desired_velocity"]

    @property
    def grid(self) -> np.ndarray:
        """The samples of the grid: all but braking and those steered, which the published planner does not have."""
        return np.arange(len(self.found["cost"]) - 2 * self.n_lanes)

    @property
    def center(self) -> float:
        return self.simulation.agents[0].vehicle.rear_axle_to_center

    def term(self, name: str) -> np.ndarray:
        return self.found["terms"][:, self.found["term_names"].index(name)]

    def matrix(self, rows: np.ndarray, low: bool, planner: PublishedPlanner) -> np.ndarray:
        columns = (self.found[name][rows] for name in ("end_time", "end_velocity", "end_offset"))
        return planner.matrix(*columns, low)


@cache
def path_of(road: str) -> tuple[Lanelets, Path]:
    """The reference path that our route has on a road."""
    lanelets = bending_road(ROADS[road])
    (center,) = (0.5 * (left + right) for left, right in zip(lanelets.left, lanelets.right, strict=True))
    there, ahead = center[120], center[-30]
    scenario = world(lanelets, problems=[_problem(there, _heading(center, 120), 10.0, ahead)])
    return lanelets, Path.through(Simulation(scenario, threads=1).agents[0].route.reference_path)


def _heading(center: np.ndarray, k: int) -> float:
    return float(np.arctan2(*(center[k + 1] - center[k - 1])[::-1]))


def _problem(center: np.ndarray, heading: float, velocity: float, goal: np.ndarray) -> PlanningProblem:
    return problem(AGENT, *center.tolist(), velocity, heading, goal=tuple(goal.tolist()), time_step=(0, 600))


def taken(road: str, start: Start) -> Start:
    """What an agent's first plan begins with: recorded turns are noisy, so they are limited, and none below 2 m/s."""
    _, path = path_of(road)
    _, _, velocity, acceleration, curvature = start.in_world(path)
    if velocity < 2.0:
        return start.parallel(path)
    assert abs(acceleration) < START_ACCELERATION_MAX
    limit = START_LATERAL_ACCELERATION_MAX / velocity**2
    return start if abs(curvature) <= limit else start.turning(path, float(np.clip(curvature, -limit, limit)))


def case(road: str, start: Start, cars: tuple[Car, ...] = (), predictions=None, **settings) -> Case:
    """Samples of our planner; the start state is given in the world, so the way into the frame is compared as well."""
    lanelets, path = path_of(road)
    rear, heading, velocity, acceleration, curvature = start.in_world(path)
    forward = 1.4227170936
    place = rear + forward * np.array([np.cos(heading), np.sin(heading)])
    goal = 0.5 * (lanelets.left[0][-30] + lanelets.right[0][-30])
    asked = _problem(place, heading, velocity, goal)
    state = InitialState(0, *place.tolist(), heading, velocity, acceleration, curvature * velocity)
    scenario = world(lanelets, cars=cars, problems=[dataclasses.replace(asked, initial_state=state)])
    planner = Frenet(stop_targets=False, **settings)
    simulation = Simulation(scenario, agents=[AGENT], planner=planner, predictor="constant_velocity", threads=1)
    ours = Path.through(simulation.agents[0].route.reference_path)
    assert np.allclose(ours.curve(ours.curve.x), path.curve(path.curve.x)), "the reference path depends on the start"
    step = simulation.world.observe()
    simulation.world.plan(step, (predictions or simulation.progress.predict)(step.scene))
    found = simulation.world.candidates(AGENT, step)
    n_lanes = len(np.unique(found["end_offset"]))
    return Case(simulation, path, taken(road, start), found, n_lanes)


def turning_length(one: Case) -> float:
    """Least arc length of a lateral quintic of ours [m], see docs/reference/planner_frenet.md.

    It is 5 m; for an agent below 2 m/s so much longer (in steps of 10 %, up to 60 m) that the wheels turn fast enough
    at 80 % of its present or desired speed.
    """
    powers = np.arange(6.0)

    def row(at: float, order: int) -> np.ndarray:
        factors = np.prod([np.maximum(powers - k, 0.0) for k in range(order)], axis=0) if order else 1.0
        return factors * at ** np.maximum(powers - order, 0.0)

    vehicle, start = one.simulation.agents[0].vehicle, one.start
    velocity = start.in_world(one.path)[2]
    if velocity >= 2.0:
        return 5.0
    most = vehicle.steering_rate_max / vehicle.wheelbase / (0.8 * max(velocity, one.desired))
    length = 5.0
    while length < 60.0:
        # The quintic from (d, d', d'') to rest at 0: its third derivative at both ends.
        ends = np.array([row(at, order) for at in (0.0, length) for order in range(3)])
        quintic = np.linalg.solve(ends, [start.d, start.d_prime, start.d_prime2, 0.0, 0.0, 0.0])
        if max(abs(row(at, 3) @ quintic) for at in (0.0, length)) <= most:
            break
        length *= 1.1
    return length


def split(one: Case) -> tuple[np.ndarray, np.ndarray]:
    """Rows that both planners describe over time, and rows that both describe over arc length.

    Ours chooses by the slowest speed of the row and stretches manoeuvres over arc length to at least `turning_length`;
    the published one chooses by the start speed and stretches nothing. Rows with negative speeds are infeasible for
    both and left out.
    """
    rows, start = one.grid, one.start
    end, velocity = one.found["end_time"][rows, None], one.found["end_velocity"][rows, None]
    # The quartic with these ends: speeds at all points, and its length.
    gain, bend = velocity - start.s_dot - start.s_ddot * end, -start.s_ddot
    cubic, quartic = (3 * gain - bend * end) / (3 * end**2), (bend * end - 2 * gain) / (4 * end**3)
    t = np.minimum(np.arange(N_POINTS) * 0.1, end)
    s_dot = start.s_dot + start.s_ddot * t + 3 * cubic * t**2 + 4 * quartic * t**3
    slowest = np.minimum(s_dot.min(axis=1), start.in_world(one.path)[2])
    length = (0.5 * (start.s_dot + velocity) * end + start.s_ddot * end**2 / 12.0)[:, 0]
    over_time = rows[slowest >= 2.0]
    over_arc = rows[(slowest >= 0.0) & (slowest < 2.0) & (length >= turning_length(one))]
    return over_time, over_arc
