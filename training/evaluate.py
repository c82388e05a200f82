"""Errors and calibration of modes against true positions, in the world frame, per category."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from training.dataset import KNOTS, PATH_POINTS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from training.dataset import Rows
    from training.network import Answer

    Floats = NDArray[np.float64]

#: Variance of the position of who stands [m²], as the predictor has it.
STAY_VARIANCE = 0.02
#: A standing vehicle that is expected to get less far than this in 3 s [m] is expected to stay.
STAY_DISTANCE = 1.0
#: Modes whose positions at all knots are nearer than this [m] are one.
SAME = 0.4
#: Shares of true positions that regions are to hold.
NOMINAL = (0.5, 0.9, 0.99)
#: Draws per row from which the size of a region is found.
DRAWS = 200
#: Farther off than this at the end is a miss [m].
MISS = 2.0


@dataclass(frozen=True)
class Modes:
    """Positions relative to the vehicle in axes of the world; n rows, m modes, most probable first.

    Attributes:
        probability: Shape (n, m); 0 where there is no mode.
        xy: Shape (n, m, knots, 2) [m].
        covariance: Shape (n, m, knots, 2, 2) [m²]; None for predictors whose spreads are not looked at.
    """

    probability: Floats
    xy: Floats
    covariance: Floats | None = None


def modes_of(answer: Answer, rows: Rows, modes_max: int) -> Modes:
    """Modes in the world as the predictor makes them: who stands stays exactly, the most probable modes are kept."""
    n = len(rows["velocity"])
    p = answer.log_probability.double().exp().numpy()
    s, d, sigma_s, sigma_d = (getattr(answer, name).double().numpy() for name in ("s", "d", "sigma_s", "sigma_d"))
    shape = np.nan_to_num(rows["path_shape"].astype(np.float64))
    reach = rows["reach"].astype(np.float64)[:, None, None, None]
    at = np.clip(s / reach * (PATH_POINTS - 1), 0.0, PATH_POINTS - 1 - 1e-9)
    i = at.astype(int)
    flat = i.reshape(n, s.shape[1], -1)
    low = np.take_along_axis(shape, flat[..., None], axis=2).reshape(*s.shape, 3)
    high = np.take_along_axis(shape, flat[..., None] + 1, axis=2).reshape(*s.shape, 3)
    place = low + (at - i)[..., None] * (high - low)
    axis = np.stack([np.cos(place[..., 2]), np.sin(place[..., 2])], axis=-1)
    left = np.stack([-axis[..., 1], axis[..., 0]], axis=-1)
    xy = place[..., :2] + axis * np.maximum(s - reach, 0.0)[..., None] + left * d[..., None]
    covariance = (
        axis[..., :, None] * axis[..., None, :] * (sigma_s**2)[..., None, None]
        + left[..., :, None] * left[..., None, :] * (sigma_d**2)[..., None, None]
    )
    p, xy, covariance = p.reshape(n, -1), xy.reshape(n, -1, len(KNOTS), 2), covariance.reshape(n, -1, len(KNOTS), 2, 2)
    stays = rows["standing"][:, None] & (s[..., -1].reshape(n, -1) < STAY_DISTANCE)
    stay = np.where(stays, p, 0.0).sum(axis=1)
    p = np.concatenate([np.where(stays, 0.0, p), stay[:, None]], axis=1)
    xy = np.concatenate([xy, np.zeros((n, 1, len(KNOTS), 2))], axis=1)
    still = np.broadcast_to(np.eye(2) * STAY_VARIANCE, (n, 1, len(KNOTS), 2, 2))
    covariance = np.concatenate([covariance, still], axis=1)
    p, covariance = _merged(p, xy, covariance)
    order = np.argsort(-p, axis=1, kind="stable")[:, :modes_max]
    p = np.take_along_axis(p, order, axis=1)
    xy = np.take_along_axis(xy, order[:, :, None, None], axis=1)
    covariance = np.take_along_axis(covariance, order[:, :, None, None, None], axis=1)
    return Modes(p / p.sum(axis=1, keepdims=True), xy, covariance)


def _merged(p: Floats, xy: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """Modes that are the same drive become one, as in the core: the most probable of them takes over the others."""
    n, m = p.shape
    order, pick = np.argsort(-p, axis=1, kind="stable"), np.arange(n)
    p, covariance = p.copy(), covariance.copy()
    for b in range(1, m):
        later = order[:, b]
        for a in range(b):
            into = order[:, a]
            apart = xy[pick, later] - xy[pick, into]
            same = (np.linalg.norm(apart, axis=-1) < SAME).all(axis=1) & (p[pick, into] > 0) & (p[pick, later] > 0)
            if not same.any():
                continue
            rows, i, j = pick[same], into[same], later[same]
            share = (p[rows, j] / (p[rows, i] + p[rows, j]))[:, None, None, None]
            beside = apart[same][..., :, None] * apart[same][..., None, :]
            mixed = (1 - share) * covariance[rows, i] + share * (covariance[rows, j] + beside)
            is_stay = ((i == m - 1) | (j == m - 1))[:, None, None, None]
            covariance[rows, i] = np.where(is_stay, covariance[rows, i], mixed)
            p[rows, i] += p[rows, j]
            p[rows, j] = 0.0
    return p, covariance


def rival_modes(rows: Rows, name: str) -> Modes:
    """What another predictor said, without spreads."""
    p, xy = rows[f"{name}_probability"].astype(np.float64), rows[f"{name}_xy"].astype(np.float64)
    order = np.argsort(-p, axis=1, kind="stable")
    p, xy = np.take_along_axis(p, order, axis=1), np.take_along_axis(xy, order[:, :, None, None], axis=1)
    return Modes(p, np.where(np.isfinite(xy), xy, 1e3))


def errors(modes: Modes, rows: Rows) -> dict[str, Floats]:
    """Per row: distances [m] of the most probable and of the nearest mode, on average and at the last knot.

    Where the recording ends before 3 s they are nan.
    """
    future = rows["future"].astype(np.float64)
    distance = np.linalg.norm(modes.xy - future[:, None], axis=-1)
    distance = np.where((modes.probability > 0)[..., None], distance, np.inf)
    ade = distance.mean(axis=2)
    best = np.argmin(np.nan_to_num(distance[..., -1], nan=0.0), axis=1)
    pick = np.arange(len(best))
    return {
        "fde": distance[:, 0, -1],
        "ade": ade[:, 0],
        "min_fde": distance[pick, best, -1],
        "min_ade": ade.min(axis=1),
        "miss": np.where(np.isnan(future[:, -1, 0]), np.nan, distance[pick, best, -1] > MISS),
        "moves": np.linalg.norm(modes.xy[:, 0, -1], axis=-1),
    }


def density(modes: Modes, knot: int, points: Floats) -> Floats:
    """Density of the mixture at points relative to the vehicle, shape (n, points, 2) -> (n, points)."""
    covariance = modes.covariance
    assert covariance is not None, "spreads are needed"
    c = covariance[:, :, knot]
    det = c[..., 0, 0] * c[..., 1, 1] - c[..., 0, 1] ** 2
    delta = points[:, None] - modes.xy[:, :, None, knot]
    x, y = delta[..., 0], delta[..., 1]
    a, b, e = (c[..., i, j][:, :, None] for i, j in ((0, 0), (0, 1), (1, 1)))
    energy = (e * x * x - 2 * b * x * y + a * y * y) / det[:, :, None]
    return (modes.probability[:, :, None] * np.exp(-0.5 * energy) / (2 * np.pi * np.sqrt(det))[:, :, None]).sum(axis=1)


def levels(modes: Modes, rows: Rows, knot: int, seed: int = 0) -> Floats:
    """Per row the share of the mixture's mass that lies where it is denser than at the true position; nan if unknown.

    The smallest region that holds a share q of the mass contains the true position if its level is at most q.
    """
    n = len(rows["velocity"])
    generator = np.random.default_rng(seed)
    chosen = (generator.random((n, DRAWS))[..., None] > np.cumsum(modes.probability, axis=1)[:, None]).sum(axis=-1)
    chosen = np.minimum(chosen, modes.probability.shape[1] - 1)
    assert modes.covariance is not None, "spreads are needed"
    root = np.linalg.cholesky(modes.covariance[:, :, knot])
    pick = np.arange(n)[:, None]
    noise = generator.standard_normal((n, DRAWS, 2, 1))
    points = modes.xy[pick, chosen, knot] + (root[pick, chosen] @ noise)[..., 0]
    truth = rows["future"][:, None, knot].astype(np.float64)
    level = (density(modes, knot, points) > density(modes, knot, truth)).mean(axis=1)
    return np.where(np.isfinite(truth[:, 0, 0]), level, np.nan)


def groups(rows: Rows, categories: Mapping[str, str]) -> dict[str, NDArray[np.bool_]]:
    """Rows of every category and of all, those whose recording lasts 3 s."""
    whole = np.isfinite(rows["future"][:, -1, 0])
    category = np.array([categories[place] for place in rows["place"]])
    found = {name: whole & (category == name) for name in sorted(set(category))}
    return {**{name: rows_in for name, rows_in in found.items() if rows_in.any()}, "all": whole}


def table(named: Mapping[str, Modes], rows: Rows, categories: Mapping[str, str]) -> list[dict[str, str | float]]:
    """One line per category and predictor: errors, and for predictors with spreads the calibration."""
    lines: list[dict[str, str | float]] = []
    true_move = np.linalg.norm(rows["future"][:, -1], axis=-1)
    for name, modes in named.items():
        found = errors(modes, rows)
        level = {knot: levels(modes, rows, knot) for knot in (1, 3, 5)} if modes.covariance is not None else {}
        for group, chosen in groups(rows, categories).items():
            stands = chosen & rows["standing"] & (true_move < 0.2)
            line: dict[str, str | float] = {"category": group, "predictor": name, "rows": int(chosen.sum())}
            line |= {key: round(float(np.nanmean(found[key][chosen])), 3) for key in found if key != "moves"}
            moves = found["moves"][stands]
            line["standing"] = int(stands.sum())
            line["standing_median"] = round(float(np.median(moves)), 3) if len(moves) else float("nan")
            line["standing_p95"] = round(float(np.quantile(moves, 0.95)), 3) if len(moves) else float("nan")
            for knot, values in level.items():
                inside = values[chosen & ~rows["standing"]]
                for q in NOMINAL:
                    line[f"inside_{round(100 * q)}_at_{KNOTS[knot]:.0f}s"] = round(float(np.nanmean(inside <= q)), 3)
            lines.append(line)
    return lines
