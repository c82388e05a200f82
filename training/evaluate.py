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

#: Variance of the position of standing vehicles [m²], as in the predictor.
STAY_VARIANCE = 0.02
#: A standing vehicle that is expected to get less far than this in 3 s [m] is expected to stay.
STAY_DISTANCE = 1.0
#: No standard deviation is smaller [m].
SIGMA_MIN = 0.02
#: Shares of true positions that regions are to hold.
NOMINAL = (0.5, 0.9, 0.99)
#: Draws per row from which the size of a region is found.
DRAWS = 200
#: Farther off than this at the end is a miss [m].
MISS = 2.0


@dataclass(frozen=True)
class Merging:
    """When modes are one; the core reads it from the weights.

    Attributes:
        distance: Modes nearer to each other than this at every knot [m] ...
        share: ... or than this share of their standard deviations.
        moment: The spread is that of the second moments (1), the geometric mean (0), or between.
    """

    distance: float = 0.4
    share: float = 0.0
    moment: float = 1.0


#: How the predictor merges.
MERGING = Merging()


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


@dataclass
class _Drives:
    """Modes in path coordinates while they are merged; n rows, m modes, the last one stands exactly."""

    p: Floats
    slot: NDArray[np.int64]
    s: Floats
    d: Floats
    sigma: Floats
    xy: Floats
    axis: Floats


def modes_of(answer: Answer, rows: Rows, modes_max: int, merging: Merging | None = None) -> Modes:
    """Modes in the world as in the predictor: standing vehicles stay exactly, the most probable modes are kept."""
    n, n_slots, n_modes = answer.log_probability.shape
    p = np.exp(np.asarray(answer.log_probability, np.float64)).reshape(n, -1)
    s, d, sigma_s, sigma_d = (
        np.asarray(getattr(answer, name), np.float64).reshape(n, -1, len(KNOTS))
        for name in ("s", "d", "sigma_s", "sigma_d")
    )
    slot = np.broadcast_to(np.repeat(np.arange(n_slots), n_modes), p.shape)
    stays = rows["standing"][:, None] & (s[..., -1] < STAY_DISTANCE)
    p = np.concatenate([np.where(stays, 0.0, p), np.where(stays, p, 0.0).sum(axis=1, keepdims=True)], axis=1)
    slot = np.concatenate([slot, np.full((n, 1), -1)], axis=1)
    s, d = (np.concatenate([values, np.zeros((n, 1, len(KNOTS)))], axis=1) for values in (s, d))
    sigma = np.concatenate(
        [np.stack([sigma_s, sigma_d], axis=-1), np.full((n, 1, len(KNOTS), 2), np.sqrt(STAY_VARIANCE))], axis=1
    )
    xy, axis = _placed(rows, np.arange(n)[:, None], slot, s, d)
    drives = _Drives(p, slot, s, d, np.maximum(sigma, SIGMA_MIN), xy, axis)
    order = np.argsort(-p, axis=1, kind="stable")
    _merge(drives, order, rows, merging or MERGING)
    order = np.argsort(-drives.p, axis=1, kind="stable")[:, :modes_max]
    p = np.take_along_axis(drives.p, order, axis=1)
    axis, sigma, xy = (
        np.take_along_axis(values, order[:, :, None, None], axis=1) for values in (drives.axis, drives.sigma, drives.xy)
    )
    left = np.stack([-axis[..., 1], axis[..., 0]], axis=-1)
    covariance = (
        axis[..., :, None] * axis[..., None, :] * (sigma[..., 0] ** 2)[..., None, None]
        + left[..., :, None] * left[..., None, :] * (sigma[..., 1] ** 2)[..., None, None]
    )
    return Modes(p / p.sum(axis=1, keepdims=True), xy, covariance)


def _placed(rows: Rows, row: NDArray[np.int64], slot: NDArray[np.int64], s: Floats, d: Floats) -> tuple[Floats, Floats]:
    """Positions relative to the vehicle, and directions of the path, at path coordinates; slot -1 is where it is now.

    Args:
        rows: For `path_shape` and `reach`.
        row: Row of each mode, shape (n, 1) or (n,).
        slot: Its path, shape (n, m) or (n,).
        s: Arc length [m], the shape of `slot` and knots.
        d: Offset [m], the same shape.
    """
    reach = rows["reach"].astype(np.float64)[row][..., None]
    at = np.clip(s / reach * (PATH_POINTS - 1), 0.0, PATH_POINTS - 1 - 1e-9)
    i = at.astype(int)
    shape = rows["path_shape"]
    low = np.nan_to_num(shape[row[..., None], slot[..., None], i].astype(np.float64))
    high = np.nan_to_num(shape[row[..., None], slot[..., None], i + 1].astype(np.float64))
    place = low + (at - i)[..., None] * (high - low)
    axis = np.stack([np.cos(place[..., 2]), np.sin(place[..., 2])], axis=-1)
    left = np.stack([-axis[..., 1], axis[..., 0]], axis=-1)
    xy = place[..., :2] + axis * np.maximum(s - reach, 0.0)[..., None] + left * d[..., None]
    return np.where(slot[..., None, None] < 0, 0.0, xy), axis


def _merge(drives: _Drives, order: NDArray[np.int64], rows: Rows, merging: Merging) -> None:
    """Modes that are the same drive become one, as in the core: the most probable of them takes over the others."""
    n, m = drives.p.shape
    pick = np.arange(n)
    for b in range(1, m):
        later = order[:, b]
        for a in range(b):
            into = order[:, a]
            both = np.flatnonzero((drives.p[pick, into] > 0) & (drives.p[pick, later] > 0))
            i, j = into[both], later[both]
            apart = drives.xy[both, j] - drives.xy[both, i]
            axis = drives.axis[both, i]
            along = (apart * axis).sum(axis=-1)
            across = axis[..., 0] * apart[..., 1] - axis[..., 1] * apart[..., 0]
            offset = np.stack([along, across], axis=-1)
            middle = np.sqrt(drives.sigma[both, i] * drives.sigma[both, j])
            is_stay = (i == m - 1) | (j == m - 1)
            near = (np.abs(offset) < np.maximum(merging.distance, merging.share * middle)).all(axis=(1, 2))
            still = (np.linalg.norm(apart, axis=-1) < merging.distance).all(axis=1)
            same = np.where(is_stay, still, near)
            if same.any():
                _absorb(drives, both[same], i[same], j[same], offset[same], is_stay[same], rows, merging)


def _absorb(
    drives: _Drives,
    row: NDArray[np.int64],
    i: NDArray[np.int64],
    j: NDArray[np.int64],
    offset: Floats,
    is_stay: NDArray[np.bool_],
    rows: Rows,
    merging: Merging,
) -> None:
    """Modes i of rows take over modes j, which are `offset` along and across the path away."""
    share = (drives.p[row, j] / (drives.p[row, i] + drives.p[row, j]))[:, None, None]
    mine, theirs = drives.sigma[row, i], drives.sigma[row, j]
    on_one = (drives.slot[row, i] == drives.slot[row, j])[:, None, None]
    weight = np.where(on_one, share / theirs / (share / theirs + (1 - share) / mine), 0.0)
    beside = (share * (1 - weight) ** 2 + (1 - share) * weight**2) * offset**2
    moment = (1 - share) * mine**2 + share * theirs**2 + beside
    geometric = mine ** (2 - 2 * share) * theirs ** (2 * share) + beside
    sigma = np.sqrt(moment**merging.moment * geometric ** (1 - merging.moment))
    moves = ~is_stay[:, None]
    s = drives.s[row, i] + weight[..., 0] * (drives.s[row, j] - drives.s[row, i])
    d = drives.d[row, i] + weight[..., 1] * (drives.d[row, j] - drives.d[row, i])
    drives.s[row, i] = np.where(moves, np.maximum.accumulate(s, axis=1), drives.s[row, i])
    drives.d[row, i] = np.where(moves, d, drives.d[row, i])
    drives.sigma[row, i] = np.where(moves[..., None], sigma, mine)
    drives.p[row, i] += drives.p[row, j]
    drives.p[row, j] = 0.0
    drives.xy[row, i], drives.axis[row, i] = _placed(rows, row, drives.slot[row, i], drives.s[row, i], drives.d[row, i])


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


def share_inside(level: Floats, q: float) -> float:
    """Share of the known true positions that are in the region that holds a share q; nan if none is known."""
    known = level[np.isfinite(level)]
    return float((known <= q).mean()) if len(known) else float("nan")


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
                    line[f"inside_{round(100 * q)}_at_{KNOTS[knot]:.0f}s"] = round(share_inside(inside, q), 3)
            lines.append(line)
    return lines
