"""What a prediction is worth, sample by sample: displacements, log-likelihood, region levels, points off the road.

A sample is one vehicle at one time step. Shapes: n samples, m modes, k time steps; step j is (j + 1) * dt from now.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.prediction_evaluation.mixtures import (
    ellipse_level,
    log_densities,
    log_sum,
    region_levels,
    squared_distances,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive._core import RoadNetwork
    from interdrive.array_types import Bools, Floats, Ints

#: Times from now at which predictions are judged [s].
HORIZONS = (1, 2, 3)
#: Times of the error curve, and of the points that are looked for on the road [s].
TIMES = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
#: A vehicle whose end is predicted further away than this is missed [m].
MISS = 2.0


@dataclass(frozen=True)
class Predicted:
    """Predictions for the samples.

    Attributes:
        probability: Of the modes, shape (n, m).
        mean: Positions [m], shape (n, m, k, 2).
        covariance: Of the positions [m²], shape (n, m, k, 2, 2).
        valid: Shape (n, m, k).
    """

    probability: Floats
    mean: Floats
    covariance: Floats
    valid: Bools


def joined(parts: Sequence[Predicted]) -> Predicted:
    """One after the other; modes and steps that only some have are not valid in the others."""
    n_modes = max(part.valid.shape[1] for part in parts)
    n_steps = max(part.valid.shape[2] for part in parts)

    def grown(values: Any) -> Any:  # noqa: ANN401 - array
        shape = (n_modes, n_steps)[: 1 if values.ndim == 2 else 2]
        missing = [(0, 0), *((0, wanted - given) for wanted, given in zip(shape, values.shape[1:], strict=False))]
        return np.pad(values, missing + [(0, 0)] * (values.ndim - len(missing)))

    names = ("probability", "mean", "covariance", "valid")
    return Predicted(*(np.concatenate([grown(getattr(part, name)) for part in parts]) for name in names))


def step_of(time: float, dt: float) -> int:
    """Index of the time step nearest to a time from now [s]."""
    return max(1, round(time / dt)) - 1


def judged(predicted: Predicted, truth: Floats, now: Floats, dt: float, road: RoadNetwork) -> dict[str, Any]:
    """Every measure of every sample, by name; nan where it is not defined.

    With h in `HORIZONS`: a mode counts at h if it has a probability and all its steps until then are valid; the
    probabilities of the counted modes add up to 1. The measures at h are nan if the recording ends before h, or if no
    mode counts (`answered_h` is 0 then).

    Args:
        predicted: What was predicted.
        truth: Recorded positions [m], shape (n, k, 2) with k steps until 3 s; nan where there is none.
        now: Positions now [m], shape (n, 2).
        dt: Time between steps [s].
        road: Where the road is.

    Returns:
        Arrays of shape (n,): ade_h, fde_h [m] of the most probable mode; ade_best_h, fde_best_h [m]: the smallest of
        any mode; nll_h [nats] of the mixture, nll its mean over all steps until 3 s; region_h, ellipse_h: levels, see
        `mixtures.region_levels`; answered_h; displacement [m] from now to 3 s of the most probable mode. Shape
        (n, times): off_road, the probability of being off the road, nan unless the vehicle is on the road now and
        then; error, error_best [m].
    """
    n, k = truth.shape[:2]
    padded = _until(predicted, k)
    distance = np.linalg.norm(padded.mean - truth[:, None], axis=3)
    # Absent steps stand at the truth with unit covariance; they are masked below.
    logarithms = log_densities(truth[:, None], padded.mean, padded.covariance)
    known: Bools = np.isfinite(truth[:, :, 0] + truth[:, :, 1])
    found: dict[str, Any] = {}
    for h in HORIZONS:
        last = step_of(h, dt)
        weights, main, counts = _modes(padded, last)
        exists, answered = np.all(known[:, : last + 1], axis=1), np.any(counts, axis=1)
        use: Bools = np.logical_and(exists, answered)

        def only(values: Floats, use: Bools = use) -> Floats:
            return np.where(use, values, np.nan)

        rows = np.arange(n)
        mean_distance = distance[:, :, : last + 1].mean(axis=2)
        found[f"answered_{h}"] = np.where(exists, answered.astype(np.float64), np.nan)
        found[f"ade_{h}"] = only(mean_distance[rows, main])
        found[f"fde_{h}"] = only(distance[rows, main, last])
        found[f"ade_best_{h}"] = only(np.where(counts, mean_distance, np.inf).min(axis=1))
        found[f"fde_best_{h}"] = only(np.where(counts, distance[:, :, last], np.inf).min(axis=1))
        found[f"nll_{h}"] = only(-log_sum(logarithms[:, :, last], weights, axis=1))
        mean, covariance = padded.mean[:, :, last], padded.covariance[:, :, last]
        squared = squared_distances(truth[:, last], mean[rows, main], covariance[rows, main])
        found[f"ellipse_{h}"] = only(ellipse_level(squared))
        level = np.full(n, np.nan)
        level[use] = region_levels(truth[use, last], weights[use], mean[use], covariance[use])
        found[f"region_{h}"] = level
        if h == HORIZONS[-1]:
            found["nll"] = only(-log_sum(logarithms, weights[:, :, None], axis=1)[:, : last + 1].mean(axis=1))
            moved = np.linalg.norm(mean[rows, main] - now, axis=1)
            found["displacement"] = np.where(answered, moved, np.nan)
    _over_time(found, padded, distance, (truth, known), now, dt, road)
    return found


def _over_time(
    found: dict[str, Any],
    predicted: Predicted,
    distance: Floats,
    recorded: tuple[Floats, Bools],
    now: Floats,
    dt: float,
    road: RoadNetwork,
) -> None:
    """Adds what is judged at `TIMES`."""
    truth, known = recorded
    n, rows = len(now), np.arange(len(now))
    error, best, off_road = (np.full((n, len(TIMES)), np.nan) for _ in range(3))
    on_road_now = road.on_road(now) if n else np.zeros(0, dtype=np.bool_)
    for column, time in enumerate(TIMES):
        last = step_of(time, dt)
        weights, main, counts = _modes(predicted, last)
        use = known[:, : last + 1].all(axis=1) & counts.any(axis=1)
        error[use, column] = distance[rows, main, last][use]
        best[use, column] = np.where(counts, distance[:, :, last], np.inf).min(axis=1)[use]
        there = use & on_road_now
        there[there] = road.on_road(np.ascontiguousarray(truth[there, last]))
        points = np.ascontiguousarray(predicted.mean[there, :, last])
        off = ~road.on_road(points.reshape(-1, 2)).reshape(points.shape[:2])
        off_road[there, column] = (off * weights[there]).sum(axis=1)
    found |= {"error": error, "error_best": best, "off_road": off_road}


def _modes(predicted: Predicted, last: int) -> tuple[Floats, Ints, Bools]:
    """Probabilities of the modes that count until a step, the first most probable one, and which modes count."""
    counts = (predicted.probability > 0) & predicted.valid[:, :, : last + 1].all(axis=2)
    weights = np.where(counts, predicted.probability, 0.0)
    total = weights.sum(axis=1, keepdims=True)
    weights = np.divide(weights, total, out=np.zeros_like(weights), where=total > 0)
    return weights, weights.argmax(axis=1), counts


def _until(predicted: Predicted, k: int) -> Predicted:
    """The first k steps; what is not valid gets numbers that do no harm."""
    n, m, given = predicted.valid.shape
    valid = np.zeros((n, m, k), dtype=np.bool_)
    mean, covariance = np.zeros((n, m, k, 2)), np.broadcast_to(np.eye(2), (n, m, k, 2, 2)).copy()
    steps = min(k, given)
    valid[:, :, :steps] = predicted.valid[:, :, :steps]
    mean[valid] = predicted.mean[:, :, :steps][valid[:, :, :steps]]
    covariance[valid] = predicted.covariance[:, :, :steps][valid[:, :, :steps]]
    return Predicted(predicted.probability, mean, covariance, valid)
