"""The prediction cost of frenet is that of the published planner's binary and that of numeric integration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import published_planner as published
import pytest
from published_cases import SOME_STARTS, STRAIGHT, Case, case, path_of, split
from published_planner import N_POINTS, Path, PublishedPlanner, Start
from scipy.special import ndtr

from interdrive import _core
from interdrive.testing import Car


@dataclass(frozen=True)
class Traffic:
    """Cars around the agent's way and what is expected of them: one row per car and mode, shape (rows, steps, ...)."""

    cars: tuple[Car, ...]
    car_of_row: np.ndarray
    probability: np.ndarray
    mean: np.ndarray
    heading: np.ndarray
    covariance: np.ndarray

    def table(self, scene: _core.Scene) -> _core.Predictions:
        """For our planner."""
        n_modes = len(self.car_of_row) // len(self.cars)
        shape = (len(self.cars), n_modes, N_POINTS - 1)
        mean = self.mean.reshape(*shape, 2)
        ids = np.array([car.id for car in self.cars])
        columns = (np.ascontiguousarray(a) for a in (mean[..., 0], mean[..., 1], self.heading.reshape(shape)))
        return _core.Predictions(
            scene.time_step, ids, self.probability.reshape(shape[:2]), *columns,
            np.full(shape, 5.0), np.ascontiguousarray(self.covariance.reshape(*shape, 2, 2)), np.ones(shape, bool),
        )  # fmt: skip

    def counts(self, density_min: float = 0.02) -> np.ndarray:
        """Where a row counts, shape (rows, steps): everywhere if it must be missed, else where it is dense enough.

        Modes with a probability of 0.2 and more, and the most probable one of a car, must be missed; others count where
        the density of their positions in the middle is not below a bound [1/m²].
        """
        by_car = self.probability.reshape(len(self.cars), -1)
        must_be_missed = ((by_car >= 0.2) | (by_car == by_car.max(axis=1, keepdims=True))).ravel()
        density = self.probability[:, None] / (2.0 * np.pi * np.sqrt(np.linalg.det(self.covariance)))
        return must_be_missed[:, None] | (density >= density_min)

    def rounding(self, place: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """What single precision may change the cost of samples by, shape (samples,).

        The core states an error of at most 6e-7 for each probability. They count a thousand times: that of the centre
        once, those of four corners half. Beyond six standard deviations there is nothing that could be rounded.
        """
        pairs = np.zeros(len(place))
        for row in range(len(self.mean)):
            reach = 6.0 * np.sqrt(np.linalg.eigvalsh(self.covariance[row]).max(axis=1))
            gap = np.min([gap_to_box(place, theta, means[row]) for means in self.corners()], axis=0)
            pairs += self.probability[row] * (gap <= reach).sum(axis=1)
        return 1000.0 * (1.0 + 4 * 0.5) * 6e-7 * pairs

    def corners(self) -> list[np.ndarray]:
        """Mean positions of the centre and of the four corners of the footprint with margin: C, RL, RR, FL, FR."""
        ahead = np.stack([np.cos(self.heading), np.sin(self.heading)], axis=-1) * (0.5 * (4.5 + 0.5))
        left = np.stack([-np.sin(self.heading), np.cos(self.heading)], axis=-1) * (0.5 * (1.8 + 0.2))
        return [self.mean + a * ahead + b * left for a, b in ((0, 0), (-1, 1), (-1, -1), (1, 1), (1, -1))]


def traffic(
    rng: np.random.Generator, path: Path, start: Start, sigma: tuple[float, float], n_modes: int = 1
) -> Traffic:
    """Three cars ahead and beside; every mode drives straight on from where the car is, in a direction of its own."""
    cars, mean, heading, covariance = [], [], [], []
    times = np.arange(1, N_POINTS) * 0.1
    for k in range(3):
        position, theta, *_ = path.at(np.array(start.s + rng.uniform(6.0, 30.0)))
        normal = np.array([-np.sin(theta), np.cos(theta)])
        place = position + normal * rng.choice([-1.0, 1.0]) * rng.uniform(2.5, 5.5)
        speed = rng.uniform(0.0, 1.2) * start.s_dot
        cars.append(Car(k + 1, *place.tolist(), speed, float(theta)))
        for _ in range(n_modes):
            direction = theta + rng.normal(0.0, 0.3)
            mean.append(place + times[:, None] * speed * np.array([np.cos(direction), np.sin(direction)]))
            heading.append(np.full(N_POINTS - 1, direction))
            turned = direction + rng.uniform(-1.5, 1.5)
            axes = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
            spread = np.linspace(*rng.uniform(*sigma, (2, 2)), N_POINTS - 1)
            covariance.append(np.einsum("ij,tj,kj->tik", axes, spread**2, axes))
    probability = rng.dirichlet(np.ones(n_modes), 3).ravel()
    rows = np.repeat(np.arange(3), n_modes)
    return Traffic(tuple(cars), rows, probability, np.array(mean), np.array(heading), np.array(covariance))


REAR_RIGHT = 1
#: Sums of double precision, and tails beyond six standard deviations.
ROUNDING = 1e-6


def _binary_prediction(
    planner: PublishedPlanner, matrix: np.ndarray, expected: Traffic, means: np.ndarray, corners: float
) -> np.ndarray:
    """What the binary makes of the expectations, with the means given and this weight of the corners."""
    repeated = [*range(N_POINTS - 1), N_POINTS - 2]
    size = np.tile([4.5 + 0.5, 1.8 + 0.2], (len(means), 1))
    cost = published.prediction(
        1.0, means[:, repeated], expected.heading[:, repeated], expected.covariance[:, repeated], size, corners
    )
    return planner.costs(matrix, False, cost)


def test_prediction_costs_are_those_of_the_published_planner(measured):
    """The binary counts the rear right corner twice, so its corners are asked for one by one, as centres.

    Narrow distributions, for which it does not matter that centres farther than 7 m are left out. In multiples of what
    single precision may change; some samples of every start.
    """
    rng, worst, defect, n, n_positive = np.random.default_rng(23), 0.0, 0.0, 0, 0
    for start in SOME_STARTS:
        expected = traffic(rng, path_of("straight")[1], start, (0.1, 0.5))
        one = case("straight", start, expected.cars, expected.table)
        over_time, _ = split(one)
        rows = over_time[np.isfinite(one.term("prediction")[over_time])]
        rows = rng.choice(rows, min(150, len(rows)), replace=False)
        planner = PublishedPlanner(one.path, one.start, spacing=STRAIGHT)
        matrix = one.matrix(rows, False, planner)
        center, *corners = (_binary_prediction(planner, matrix, expected, means, 0.0) for means in expected.corners())
        theirs = center + 0.5 * np.sum(corners, axis=0)
        rounding = expected.rounding(*poses(one, rows, planner))
        ours = one.term("prediction")[rows]
        worst = max(worst, float((np.abs(ours - theirs) / (ROUNDING + rounding)).max()))
        whole = _binary_prediction(planner, matrix, expected, expected.mean, 0.5)
        defect = max(defect, float((np.abs(whole - theirs - 0.5 * corners[REAR_RIGHT]) / (1.0 + whole)).max()))
        n, n_positive = n + len(rows), n_positive + int((theirs > 1.0).sum())
    measured("prediction, straight: published planner", n, worst, 1.0, "", f"times rounding; {n_positive} above 1")
    measured("prediction, straight: binary's own sum has rear right twice", n, defect, 1e-6, "rel.")


def poses(one: Case, rows: np.ndarray, planner: PublishedPlanner) -> tuple[np.ndarray, np.ndarray]:
    """Places of samples by ours, shape (rows, steps, 2), and headings by the binary, from the first step on."""
    theta = planner.samples(one.matrix(rows, False, planner), False).corrected.theta[:, 1:]
    return np.stack([one.found["x"][rows, 1:], one.found["y"][rows, 1:]], axis=-1), theta


@pytest.mark.parametrize("road", ["straight", "S bend"])
def test_prediction_costs_are_those_of_numeric_integration(road, measured):
    """Wide distributions and two modes: Gauss-Legendre with 64 nodes over eight standard deviations.

    As set by default, and with vague modes counting as well. Headings are those of the binary's samples; on bends they
    are 0.5 mrad off (vertices 5 cm apart), so there deviations are relative to one plus the cost. Elsewhere they are in
    multiples of what single precision may change.
    """
    rng, n, n_vague = np.random.default_rng(29), 0, 0
    bounds, worst = {"dense": 0.02, "all": 0.0}, {"dense": 0.0, "all": 0.0}
    for start in SOME_STARTS:
        expected = traffic(rng, path_of(road)[1], start, (0.3, 3.0), n_modes=2)
        cases = {
            name: case(road, start, expected.cars, expected.table, expectation_density_min=bound)
            for name, bound in bounds.items()
        }
        one = cases["all"]
        over_time, _ = split(one)
        rows = over_time[np.isfinite(one.term("prediction")[over_time])]
        rows = rng.choice(rows, min(60, len(rows)), replace=False)
        planner = PublishedPlanner(one.path, one.start, spacing=STRAIGHT if road == "straight" else 0.05)
        place, theta = poses(one, rows, planner)
        costs = np.zeros((len(rows), *expected.mean.shape[:2]))
        for k in range(len(expected.car_of_row)):
            near = gap_to_box(place, theta, expected.mean[k]) <= np.sqrt(50.0)
            for means, weight in zip((c[k] for c in expected.corners()), (1.0, 0.5, 0.5, 0.5, 0.5), strict=True):
                inside = box_probability(place, theta, means, expected.covariance[k])
                costs[:, k] += 1000.0 * weight * expected.probability[k] * inside * near
        for name, bound in bounds.items():
            theirs = (costs * expected.counts(bound)).sum(axis=(1, 2))
            deviation = np.abs(cases[name].term("prediction")[rows] - theirs)
            scale = ROUNDING + expected.rounding(place, theta) if road == "straight" else 1.0 + theirs
            worst[name] = max(worst[name], float((deviation / scale).max()))
        n, n_vague = n + len(rows), n_vague + int(((costs * ~expected.counts()).sum(axis=(1, 2)) > 1.0).sum())
    assert n_vague > 0.05 * n, "the bound of the density makes no difference"
    allowed, unit = (1.0, "") if road == "straight" else (1e-2, "rel.")
    remark = f"vague modes would add more than 1 to {n_vague}"
    for name, largest in worst.items():
        measured(f"prediction, {road}, {name} modes: numeric integration", n, largest, allowed, unit, remark)


def in_box_frame(place: np.ndarray, theta: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Means along and beside the agent's axis, shape (samples, steps, 2)."""
    offset = mean[None] - place
    cos, sin = np.cos(theta), np.sin(theta)
    return np.stack([offset[..., 0] * cos + offset[..., 1] * sin, offset[..., 1] * cos - offset[..., 0] * sin], axis=-1)


def gap_to_box(place: np.ndarray, theta: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Distance of the means from the agent's footprint [m]."""
    local = np.abs(in_box_frame(place, theta, mean)) - [0.5 * 4.508, 0.5 * 1.610]
    return np.hypot(*np.maximum(local, 0.0).transpose(2, 0, 1))


def box_probability(place: np.ndarray, theta: np.ndarray, mean: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Probability that a normally distributed point lies in the agent's footprint, shape (samples, steps)."""
    local = in_box_frame(place, theta, mean)
    cos, sin = np.cos(theta), np.sin(theta)
    xx, xy, yy = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    a = cos**2 * xx + 2 * cos * sin * xy + sin**2 * yy
    b = cos * sin * (yy - xx) + (cos**2 - sin**2) * xy
    c = sin**2 * xx - 2 * cos * sin * xy + cos**2 * yy
    sigma = np.sqrt(c)
    low = np.clip((-0.805 - local[..., 1]) / sigma, -8.0, 8.0)
    high = np.clip((0.805 - local[..., 1]) / sigma, -8.0, 8.0)
    nodes, weights = np.polynomial.legendre.leggauss(64)
    total = np.zeros_like(a)
    rest = np.sqrt(a - b**2 / c)
    for node, weight in zip(nodes, weights, strict=True):
        z = 0.5 * (low + high) + 0.5 * (high - low) * node
        middle = local[..., 0] + b / sigma * z
        inner = ndtr((2.254 - middle) / rest) - ndtr((-2.254 - middle) / rest)
        total += weight * np.exp(-0.5 * z**2) * inner
    return total * 0.5 * (high - low) / np.sqrt(2 * np.pi)
