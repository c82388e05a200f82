"""What is measured of a row in a window: scores, samples for distributions, snippets for the classifier, counts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.traffic_realism.estimators import crps, energy_score
from interdrive.traffic_realism.tracks import GRID, kinematics

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive import _core
    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.traffic_realism.rollouts import Rollouts
    from interdrive.traffic_realism.tracks import Kinematics
    from interdrive.traffic_realism.windows import Window

#: Times after the start at which positions and speeds are scored [s].
HORIZONS = (1, 3, 5, 8)
#: Quantities whose distributions are compared, with their units.
QUANTITIES = {
    "speed": "m/s",
    "acceleration": "m/s²",
    "jerk": "m/s³",
    "headway": "s",
    "offset": "m",
    "lateral_speed": "m/s",
}
#: Samples lie between these times after the start [s].
_FROM, _UNTIL = 1.0, 5.0
#: Slower than this a vehicle stands [m/s].
_STANDS = 0.3
#: Snippets begin at these times after the start, and are this long [s].
_SNIPPETS, _SNIPPET = (1.0, 3.0), 2.0

#: Features of snippets by group.
LON, GAP, LAT = tuple(range(9)), tuple(range(9, 13)), tuple(range(13, 18))
#: Sets of features on which the classifier is trained.
FEATURE_SETS: Mapping[str, tuple[int, ...]] = {
    "lon_gap": LON + GAP,
    "coarse": (*LON[:4], *GAP),
    "lat": LAT,
    "all": LON + GAP + LAT,
}


@dataclass(frozen=True)
class WindowMeasures:
    """What is measured of a row in a window.

    Attributes:
        judged: Ids of the judged vehicles, shape (n,).
        energy: Energy scores of positions [m], shape (horizons, n); nan where the recording is over.
        crps: Scores of speeds [m/s], shape (horizons, n).
        distance: Distance of the first rollout's positions [m], shape (horizons, n).
        samples: Values of `QUANTITIES` at points where the recording goes on.
        lane_changes: At these points.
        lag_gaps: Gap of the follower in the new lane at lane changes that have one [m].
        way: Length of all steps to these points [m].
        standing: Number of these points at which a vehicle stands.
        points: Number of these points.
        snippets: Features, shape (snippets, 18).
        is_snippet: Which snippets exist, shape (all snippets,); rows have those in common that both have.
        n_agents: See `Rollouts`; so are the others.
        collisions: In all rollouts.
        departures: In all rollouts.
        not_admitted: In all rollouts.
        braked: In all rollouts.
        rollouts: Number of rollouts.
    """

    judged: Ints
    energy: Floats
    crps: Floats
    distance: Floats
    samples: Mapping[str, Floats]
    lane_changes: int
    lag_gaps: Floats
    way: float
    standing: int
    points: int
    snippets: Floats
    is_snippet: Bools
    n_agents: int
    collisions: int
    departures: int
    not_admitted: int
    braked: int
    rollouts: int


def measured(window: Window, truth: Rollouts, found: Rollouts, road: _core.RoadNetwork) -> WindowMeasures:
    """Measures rollouts against the recording.

    Args:
        window: Where they begin.
        truth: The recording.
        found: The rollouts.
        road: For lanes.
    """
    recorded = truth.states[0]
    known = np.logical_and.accumulate(np.isfinite(recorded[0]), axis=1)
    shape = (len(HORIZONS), len(found.judged))
    energy, speeds, distance = (np.full(shape, np.nan) for _ in range(3))
    for row, horizon in enumerate(HORIZONS):
        point = round(horizon / GRID)
        if point >= recorded.shape[2]:
            continue
        there = known[:, point]
        positions = np.moveaxis(found.states[:, :2, :, point], 1, 2)
        at = recorded[:2, :, point].T
        energy[row, there] = _scored(positions[:, there], at[there])
        speeds[row, there] = _scored(found.states[:, 3, :, point][:, there, None], recorded[3, there, point][:, None])
        distance[row, there] = np.hypot(*(positions[0] - at)[there].T)
    own, theirs = (kinematics(each.tracks, found.judged, road) for each in (found, truth))
    own, theirs = (_from_start(one, window.start_point) for one in (own, theirs))
    points = slice(round(_FROM / GRID), round(_UNTIL / GRID) + 1)
    compared = known[:, points]
    samples = {name: _values(own, theirs, name, points, compared) for name in QUANTITIES}
    raw_speed = found.states[0, 3][:, points]
    with np.errstate(invalid="ignore"):
        standing = int((compared & (np.abs(raw_speed) < _STANDS)).sum())
    snippets, is_snippet = snippets_of(own)
    _, is_recorded = snippets_of(theirs)
    goes_on = np.stack(
        [
            known[:, _last(begin)] if _last(begin) < known.shape[1] else np.zeros(len(known), dtype=np.bool_)
            for begin in _SNIPPETS
        ]
    )
    return WindowMeasures(
        judged=found.judged,
        energy=energy,
        crps=speeds,
        distance=distance,
        samples=samples,
        lane_changes=int((own.changes[:, points] & compared).sum()),
        lag_gaps=own.lag[:, points][compared & np.isfinite(own.lag[:, points])],
        way=float(np.nansum(np.where(compared, own.way[:, points], 0.0))),
        standing=standing,
        points=int(compared.sum()),
        snippets=snippets,
        is_snippet=is_snippet & (is_recorded & goes_on.ravel()),
        n_agents=found.n_agents,
        collisions=found.collisions,
        departures=found.departures,
        not_admitted=found.not_admitted,
        braked=found.braked,
        rollouts=len(found.states),
    )


def _scored(samples: Floats, truth: Floats) -> Floats:
    """Energy scores, or those of one dimension; samples that ended are left out."""
    ends = np.isfinite(samples[:, :, 0])
    if ends.all():
        return energy_score(samples, truth) if samples.shape[2] > 1 else crps(samples[..., 0], truth[:, 0])
    scores = np.full(len(truth), np.nan)
    for item in range(len(truth)):
        kept = samples[ends[:, item], item : item + 1]
        if len(kept):
            scores[item] = energy_score(kept, truth[item : item + 1])[0]
    return scores


def _from_start(found: Kinematics, start: int) -> Kinematics:
    return type(found)(**{name: getattr(found, name)[:, start:] for name in found.__dataclass_fields__})


def _values(own: Kinematics, theirs: Kinematics, name: str, points: slice, compared: Bools) -> Floats:
    values, recorded = getattr(own, name)[:, points], getattr(theirs, name)[:, points]
    there = compared if name in ("headway", "offset") else compared & np.isfinite(recorded)
    found: Floats = values[there & np.isfinite(values)]
    return found


def _last(begin: float) -> int:
    return round((begin + _SNIPPET) / GRID)


def snippets_of(found: Kinematics) -> tuple[Floats, Bools]:
    """Features of snippets from a start on, and which are complete.

    Args:
        found: Of vehicles, from the start on.

    Returns:
        Shape (snippets of each begin, one after the other, 18), and (snippets,).
    """
    parts = []
    for begin in _SNIPPETS:
        first, last = round(begin / GRID), _last(begin)
        if last >= found.speed.shape[1]:
            parts.append(np.full((len(found.speed), 18), np.nan))
            continue
        speed, acceleration = found.speed, found.acceleration
        later = [first + round(after / GRID) for after in (0.6, 1.2, 1.8)]
        span = slice(first, last + 1)
        with np.errstate(invalid="ignore"):
            columns = [
                speed[:, first],
                *(speed[:, point] - speed[:, first] for point in later),
                acceleration[:, first],
                *(acceleration[:, point] for point in later),
                np.sqrt(np.mean(found.jerk[:, span] ** 2, axis=1)),
                found.gap[:, first],
                found.gap[:, last] - found.gap[:, first],
                found.closing[:, first],
                found.headway[:, first],
                found.offset[:, first],
                found.offset[:, last] - found.offset[:, first],
                np.sqrt(np.mean(found.lateral_speed[:, span] ** 2, axis=1)),
                found.lateral_speed[:, first],
                np.sqrt(np.mean(found.yaw_rate[:, span] ** 2, axis=1)),
            ]
        parts.append(np.column_stack(columns))
    features = np.concatenate(parts)
    return features, np.isfinite(features[:, list(LON)]).all(axis=1)
