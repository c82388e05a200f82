"""The published planner (PyPI `frenetix`, a binary) as a black box: samples in, trajectories and costs out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import frenetix
import numpy as np
from frenetix.trajectory_functions import FillCoordinates, cost_functions, feasability_functions
from scipy.interpolate import CubicSpline

if TYPE_CHECKING:
    from collections.abc import Sequence

#: Ends of manoeuvres are passed a little late: the binary loses the last point where T / dt is rounded down.
LATE = 1e-9
N_POINTS = 31


@dataclass(frozen=True)
class Path:
    """A reference path as a curve of its own arc length, through the vertices that our route has."""

    curve: CubicSpline
    length: float

    @staticmethod
    def through(vertices: np.ndarray) -> Path:
        """A cubic spline, with arc length as its parameter to a fraction of a millimetre."""
        s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(vertices, axis=0).T))])
        for _ in range(3):
            curve = CubicSpline(s, vertices)
            middle = np.linspace(s[:-1], s[1:], 9, axis=1)
            chords = np.hypot(*np.diff(curve(middle), axis=1).transpose(2, 0, 1))
            s = np.concatenate([[0.0], np.cumsum(chords.sum(axis=1))])
        return Path(CubicSpline(s, vertices), float(s[-1]))

    def at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Position, heading, curvature and its derivative."""

        def curvature(where: np.ndarray) -> np.ndarray:
            (dx, dy), (ddx, ddy) = self.curve(where, 1).T, self.curve(where, 2).T
            return (dx * ddy - dy * ddx) / np.hypot(dx, dy) ** 3

        tangent = self.curve(s, 1)
        rate = (curvature(np.add(s, 0.5)) - curvature(np.subtract(s, 0.5))) / 1.0
        return self.curve(s), np.arctan2(tangent[..., 1], tangent[..., 0]), curvature(np.asarray(s)), rate


@dataclass(frozen=True)
class Start:
    """Rear axle in the frame of the path: arc length and derivatives by time, offset and derivatives by arc length."""

    s: float
    s_dot: float
    s_ddot: float
    d: float
    d_prime: float
    d_prime2: float

    def in_world(self, path: Path) -> tuple[np.ndarray, float, float, float, float]:
        """Position of the rear axle, heading, speed, acceleration and curvature (Werling's thesis, appendix A)."""
        position, theta, kappa, _ = (np.asarray(value) for value in path.at(np.array(self.s)))
        stretch, tan, cos, turn = self._beside(path)
        curvature = ((self.d_prime2 + turn * tan) * cos**2 / stretch + kappa) * cos / stretch
        acceleration = self.s_ddot * stretch / cos + self.s_dot**2 / cos * (
            stretch * tan * (curvature * stretch / cos - kappa) - turn
        )
        normal = np.array([-np.sin(theta), np.cos(theta)])
        where = position + self.d * normal
        angle = np.arctan(tan)
        return where, float(theta + angle), float(self.s_dot * stretch / cos), float(acceleration), float(curvature)

    def _beside(self, path: Path) -> tuple[float, float, float, float]:
        """1 - curvature d, tangent and cosine of the heading relative to the path, change of curvature d by s."""
        kappa, kappa_rate = (float(value) for value in path.at(np.array(self.s))[2:])
        stretch = 1.0 - kappa * self.d
        tan = self.d_prime / stretch
        return stretch, tan, float(np.cos(np.arctan(tan))), kappa_rate * self.d + kappa * self.d_prime

    def turning(self, path: Path, curvature: float) -> Start:
        """The same place, heading, speed and acceleration in the world with another curvature."""
        kappa, (stretch, tan, cos, turn) = float(path.at(np.array(self.s))[2]), self._beside(path)
        swing = curvature * stretch / cos - kappa
        inertia = self.s_dot**2 / cos * (stretch * tan * swing - turn)
        acceleration = self.in_world(path)[3]
        return replace(
            self, d_prime2=stretch / cos**2 * swing - turn * tan, s_ddot=(acceleration - inertia) * cos / stretch
        )

    def parallel(self, path: Path) -> Start:
        """The same with a steering that keeps the present direction relative to the path: d'' = 0 at constant speed."""
        return self.turning(path, replace(self, d_prime2=0.0).in_world(path)[4])

    def lateral(self, low_velocity: bool) -> list[float]:
        """As the binary wants it: derivatives by arc length in its low-velocity mode, else by time."""
        if low_velocity:
            return [self.d, self.d_prime, self.d_prime2]
        by_time = self.s_ddot * self.d_prime + self.s_dot**2 * self.d_prime2
        return [self.d, self.s_dot * self.d_prime, by_time]


@dataclass(frozen=True)
class Samples:
    """Trajectories of the rear axle, shape (samples, points); costs without weights by name, shape (samples,)."""

    x: np.ndarray
    y: np.ndarray
    theta: np.ndarray
    velocity: np.ndarray
    s_dot: np.ndarray
    d: np.ndarray
    d_prime: np.ndarray
    curvature_of_path: np.ndarray
    reported_acceleration: np.ndarray
    valid: np.ndarray
    costs: dict[str, np.ndarray]

    @property
    def corrected(self) -> Samples:
        """With tan D = d' / (1 - curvature d) where the binary takes d' for it."""
        stretch = 1.0 - self.curvature_of_path * self.d
        theta = self.theta - np.arctan(self.d_prime) + np.arctan(self.d_prime / stretch)
        velocity = self.s_dot * np.hypot(stretch, self.d_prime)
        return Samples(**{**self.__dict__, "theta": theta, "velocity": velocity})


class PublishedPlanner:
    """One path and one start state; `spacing` of the vertices given to the binary [m]."""

    def __init__(self, path: Path, start: Start, dt: float = 0.1, spacing: float = 0.1) -> None:
        self.path, self.start, self.dt = path, start, dt
        # Only what can be reached: the binary's preparation takes time with the square of the number of vertices.
        self.s = np.arange(max(0.0, start.s - 10.0), min(path.length, start.s + 115.0), spacing)
        vertices = path.at(self.s)[0]
        self.frame = frenetix.CoordinateSystemWrapper(np.array(vertices, order="C"))
        # Its arc length is that of the polyline, and starts three extra points before the first vertex.
        self.s_of_binary = np.asarray(self.frame.ref_pos)[3 : 3 + len(self.s)]

    def matrix(self, end_time: np.ndarray, end_velocity: np.ndarray, end_offset: np.ndarray, low: bool) -> np.ndarray:
        """One row per sample: times, start and end of the longitudinal and of the lateral motion."""
        s0 = np.interp(self.start.s, self.s, self.s_of_binary)
        rows = np.zeros((len(end_time), 13))
        rows[:, 1] = end_time + LATE
        rows[:, 2:5] = [s0, self.start.s_dot, self.start.s_ddot]
        rows[:, 5] = end_velocity
        rows[:, 7:10] = self.start.lateral(low)
        rows[:, 10] = end_offset
        return rows

    def handler(
        self, low: bool, costs: Sequence[object] = (), checks: Sequence[object] = ()
    ) -> frenetix.TrajectoryHandler:
        """Everything that is evaluated for a sample."""
        handler = frenetix.TrajectoryHandler(dt=self.dt)
        heading = self.start.in_world(self.path)[1]
        handler.add_function(FillCoordinates(low, heading, self.frame, 3.0))
        for check in checks:
            handler.add_feasability_function(check)
        for cost in costs:
            handler.add_cost_function(cost)
        return handler

    def evaluated(self, rows: np.ndarray, low: bool, costs: Sequence[object] = ()) -> list[frenetix.TrajectorySample]:
        """The binary's samples in the order of the rows of a matrix."""
        handler = self.handler(low, costs)
        handler.generate_trajectories(rows, low)
        handler.evaluate_all_current_functions(True)
        found = {np.asarray(s.sampling_parameters).tobytes(): s for s in handler.get_sorted_trajectories()}
        return [found[np.ascontiguousarray(row).tobytes()] for row in rows]

    def costs(self, rows: np.ndarray, low: bool, cost: object) -> np.ndarray:
        """One term of the cost, without its weight, for every row."""
        samples = self.evaluated(rows, low, [cost])
        assert all(sample.valid for sample in samples)
        return np.array([sample.costMap[cost.name][0] for sample in samples])

    def samples(self, rows: np.ndarray, low: bool, costs: Sequence[object] = ()) -> Samples:
        """Trajectories and costs for every row."""
        ordered = self.evaluated(rows, low, costs)
        n_points = round(3.0 / self.dt) + 1

        def table(part: str, name: str) -> np.ndarray:
            out = np.full((len(rows), n_points), np.nan)
            for k, sample in enumerate(ordered):
                if sample.valid:
                    out[k] = getattr(getattr(sample, part), name)
            return out

        names = [cost.name for cost in costs]
        values = [[s.costMap[name][0] if s.valid else np.nan for s in ordered] for name in names]
        s_dot, s = table("curvilinear", "s_dot"), table("curvilinear", "s")
        d_dot = table("curvilinear", "d_dot")
        with np.errstate(invalid="ignore", divide="ignore"):
            d_prime = d_dot if low else np.where(s_dot > 1e-3, d_dot / s_dot, 0.0)
        curvature = np.interp(s, self.s_of_binary, self.path.at(self.s)[2])
        return Samples(
            x=table("cartesian", "x"),
            y=table("cartesian", "y"),
            theta=table("cartesian", "theta"),
            velocity=table("cartesian", "v"),
            s_dot=s_dot,
            d=table("curvilinear", "d"),
            d_prime=d_prime,
            curvature_of_path=curvature,
            reported_acceleration=table("cartesian", "a"),
            valid=np.array([s.valid for s in ordered]),
            costs=dict(zip(names, map(np.array, values), strict=True)),
        )


def velocity_offset(desired: float, weight: float = 1.0) -> object:
    return cost_functions.CalculateVelocityOffsetCost("velocity_offset", weight, desired, 0.1, 1.1, False, 2)


def distance_to_reference(weight: float = 1.0) -> object:
    return cost_functions.CalculateDistanceToReferencePathCost("distance_to_reference", weight)


def prediction(
    weight: float, means: np.ndarray, headings: np.ndarray, covariances: np.ndarray, size: np.ndarray, corners: float
) -> object:
    """Collision probability: arrays of shape (obstacles, steps, ...), sizes (obstacles, 2), weight of the corners."""
    objects = {}
    for k in range(len(means)):
        poses = []
        for mean, heading, covariance in zip(means[k], headings[k], covariances[k], strict=True):
            whole = np.zeros((6, 6), order="F")
            whole[:2, :2] = covariance
            turn = np.array([0.0, 0.0, np.sin(0.5 * heading), np.cos(0.5 * heading)])
            poses.append(frenetix.PoseWithCovariance(np.array([*mean, 0.0]), turn, whole))
        objects[k + 1] = frenetix.PredictedObject(k + 1, poses, *size[k].tolist())
    vehicle = 4.508, 1.610, 1.4227170936
    return cost_functions.CalculateCollisionProbabilityFast("prediction", weight, objects, *vehicle, corners)


def default_costs(desired: float, prediction_cost: object) -> list[object]:
    """The five terms that count in the published benchmark, with its weights."""
    return [
        velocity_offset(desired, 1.0),
        distance_to_reference(5.0),
        cost_functions.CalculateLateralJerkCost("lateral_jerk", 0.2),
        cost_functions.CalculateLongitudinalJerkCost("longitudinal_jerk", 0.2),
        prediction_cost,
    ]


def default_checks() -> list[object]:
    """The limits of the published benchmark."""
    wheelbase, steering, rate = 2.5789128, 1.066, 0.4
    return [
        feasability_functions.CheckAccelerationConstraint(7.319, 11.5, False),
        feasability_functions.CheckCurvatureConstraint(steering, wheelbase, False),
        feasability_functions.CheckCurvatureRateConstraint(wheelbase, rate, False),
        feasability_functions.CheckYawRateConstraint(steering, wheelbase, False),
    ]


def squared_jerk(start: list[float], end: list[float], time: float, until: float) -> float:
    """Its own integral of the squared third derivative, over any time: the costs use only the first 0.1 s of it."""
    if len(end) == 2:
        curve = frenetix.QuarticTrajectory(
            0.0, time, np.array(start), np.array(end), np.arange(3, dtype=np.int32), np.array([1, 2], dtype=np.int32)
        )
    else:
        curve = frenetix.QuinticTrajectory(
            0.0, time, np.array(start), np.array(end), np.arange(3, dtype=np.int32), np.arange(3, dtype=np.int32)
        )
    return curve.squared_jerk_integral(until)
