"""Rows of the tables: what all windows of a place, or of all places, say about a planner."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from interdrive.traffic_realism.estimators import intervals, wasserstein
from interdrive.traffic_realism.measures import FEATURE_SETS, HORIZONS, QUANTITIES
from interdrive.traffic_realism.persistence import Persistence, Thirds, persistence
from interdrive.traffic_realism.trees import two_sample_auc

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.traffic_realism.measures import WindowMeasures

#: Splits of the recording into halves for the floor of distances.
_SPLITS = 20
#: A claim needs so many windows or vehicles of a place.
_WINDOWS_MIN, _VEHICLES_MIN = 20, 300


@dataclass(frozen=True)
class LongMeasures:
    """What is measured of a row in a long rollout.

    Attributes:
        thirds: Headways of its vehicles.
        n_agents: Vehicles that planned or wanted to.
        collisions: Of them those that hit others.
        departures: Those that left the road.
        not_admitted: Those that found no room to enter.
    """

    thirds: Thirds
    n_agents: int = 0
    collisions: int = 0
    departures: int = 0
    not_admitted: int = 0


@dataclass(frozen=True)
class Row:
    """A planner, or one of the rows beside it, at a place.

    Attributes:
        planner: As it was given; or recorded, constant_velocity, analog.
        place: Name of the place; or "all".
        windows: Number of windows.
        vehicles: Number of judged vehicles in all windows.
        is_claim: Whether windows or vehicles suffice to say something about a place.
        energy: Mean energy score of positions by horizon [s], in m.
        energy_interval: 95 % interval of each, over windows.
        distance: Mean distance of the first rollout by horizon [s], in m.
        crps: Mean score of speeds by horizon [s], in m/s.
        wasserstein: Distance of distributions from the recording's by quantity, in its unit.
        auc: How well a classifier tells the row from the recording, by set of features.
        lane_changes: Per kilometre.
        lag_gap: Median gap to whoever is behind in the new lane, at lane changes [m].
        lag_gaps: Number of lane changes with a follower; below 100 they decide nothing.
        standing: Share of points at which a vehicle stands.
        braked: Judged vehicles of 100 that braked harder than 4 m/s² in the first 3 s.
        collisions: Vehicles of 100 that hit another participant.
        departures: Vehicles of 100 that left the road.
        not_admitted: Share of the vehicles that found no room to enter, in short and long rollouts.
        long_collisions: As `collisions`, in long rollouts.
        long_departures: As `departures`, in long rollouts.
        long_vehicles: Vehicles of the long rollouts.
        persistence: How drivers differ, in long rollouts.
        is_fitted: Its drivers were fitted on this place, so that it says nothing about realism.
    """

    planner: str
    place: str
    windows: int
    vehicles: int
    is_claim: bool
    energy: Mapping[int, float]
    energy_interval: Mapping[int, tuple[float, float]]
    distance: Mapping[int, float]
    crps: Mapping[int, float]
    wasserstein: Mapping[str, float]
    auc: Mapping[str, float]
    lane_changes: float
    lag_gap: float
    lag_gaps: int
    standing: float
    braked: float
    collisions: float
    departures: float
    not_admitted: float
    long_collisions: float
    long_departures: float
    long_vehicles: int
    persistence: Persistence
    is_fitted: bool = False


@dataclass(frozen=True)
class Floor:
    """What separates one half of a place's windows from the other.

    Attributes:
        place: Its name; or "all".
        wasserstein: By quantity the median and the 90 % quantile over random halves, in its unit.
        auc: By set of features, for one pair of halves.
    """

    place: str
    wasserstein: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    auc: Mapping[str, float] = field(default_factory=dict)


def row_of(
    planner: str,
    place: str,
    parts: Sequence[WindowMeasures],
    recorded: Sequence[WindowMeasures],
    long: Sequence[LongMeasures],
    *,
    seed: int,
    is_fitted: bool = False,
) -> Row:
    """Sums up windows.

    Args:
        planner: Name of the row.
        place: Name of the place.
        parts: What the row has in each window.
        recorded: What the recording has there.
        long: What the row has in long rollouts.
        seed: Of bootstrap and classifier.
        is_fitted: Its drivers were fitted on this place.
    """
    counts = [len(part.judged) for part in parts]
    groups = np.repeat(np.arange(len(parts)), counts).astype(np.float64)

    def means(name: str) -> dict[int, float]:
        return {h: _mean(np.concatenate([getattr(part, name)[i] for part in parts])) for i, h in enumerate(HORIZONS)}

    agents, judged = sum(part.n_agents for part in parts), sum(len(part.judged) * part.rollouts for part in parts)
    long_agents = sum(part.n_agents for part in long)
    points, way = sum(part.points for part in parts), sum(part.way for part in parts)
    lags = np.concatenate([part.lag_gaps for part in parts]) if parts else np.empty(0)
    outside = sum(part.not_admitted for part in parts) + sum(part.not_admitted for part in long)
    return Row(
        planner=planner,
        place=place,
        windows=len(parts),
        vehicles=sum(counts),
        is_claim=len(parts) >= _WINDOWS_MIN or sum(counts) >= _VEHICLES_MIN,
        energy=means("energy"),
        energy_interval={
            h: intervals(np.concatenate([part.energy[i] for part in parts]), groups, seed=seed)
            for i, h in enumerate(HORIZONS)
        },
        distance=means("distance"),
        crps=means("crps"),
        wasserstein={name: wasserstein(_samples(parts, name), _samples(recorded, name)) for name in QUANTITIES},
        auc=_aucs(parts, recorded, seed),
        lane_changes=1000.0 * sum(part.lane_changes for part in parts) / way if way > 0.0 else float("nan"),
        lag_gap=float(np.median(lags)) if lags.size else float("nan"),
        lag_gaps=len(lags),
        standing=sum(part.standing for part in parts) / points if points else float("nan"),
        braked=_per_100(sum(part.braked for part in parts), judged if agents else 0),
        collisions=_per_100(sum(part.collisions for part in parts), agents),
        departures=_per_100(sum(part.departures for part in parts), agents),
        not_admitted=_per_100(outside, agents + long_agents) / 100.0,
        long_collisions=_per_100(sum(part.collisions for part in long), long_agents),
        long_departures=_per_100(sum(part.departures for part in long), long_agents),
        long_vehicles=long_agents,
        persistence=persistence([part.thirds for part in long]),
        is_fitted=is_fitted,
    )


def floor_of(place: str, recorded: Sequence[WindowMeasures], *, seed: int) -> Floor:
    """Compares the recording with itself, half of its windows with the other half."""
    if len(recorded) < 2:
        return Floor(place)
    splits = halves(len(recorded), seed)
    distances = {}
    for name in QUANTITIES:
        found = [
            wasserstein(
                *(
                    _samples([one for one, own in zip(recorded, half == side, strict=True) if own], name)
                    for side in (True, False)
                )
            )
            for half in splits
        ]
        median, high = np.nanpercentile(found, (50.0, 90.0)).tolist() if np.isfinite(found).any() else (np.nan, np.nan)
        distances[name] = (median, high)
    snippets, groups = _snippets(recorded, [part.is_snippet for part in recorded])
    labels = splits[0][groups]
    return Floor(
        place,
        distances,
        {
            name: two_sample_auc(snippets[:, list(columns)], labels, groups, seed)
            for name, columns in FEATURE_SETS.items()
        },
    )


def halves(windows: int, seed: int) -> list[Bools]:
    """Random halves of windows: which of them are in the first one.

    Args:
        windows: Their number.
        seed: Of the draws.
    """
    random = np.random.default_rng(seed)
    return [random.permutation(windows) < windows // 2 for _ in range(_SPLITS)]


def _mean(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else float("nan")


def _per_100(count: int, total: int) -> float:
    return 100.0 * count / total if total else float("nan")


def _samples(parts: Sequence[WindowMeasures], name: str) -> Floats:
    return np.concatenate([part.samples[name] for part in parts]) if parts else np.empty(0)


def _snippets(parts: Sequence[WindowMeasures], kept: Sequence[Bools]) -> tuple[Floats, Ints]:
    """Snippets of windows, and the window of each."""
    features = [part.snippets[own] for part, own in zip(parts, kept, strict=True)]
    groups = np.repeat(np.arange(len(parts)), [len(one) for one in features])
    return np.concatenate(features), groups


def _aucs(parts: Sequence[WindowMeasures], recorded: Sequence[WindowMeasures], seed: int) -> dict[str, float]:
    """Of snippets that both have; without any, nan."""
    both = [one.is_snippet & other.is_snippet for one, other in zip(parts, recorded, strict=True)]
    own, groups = _snippets(parts, both)
    theirs, _ = _snippets(recorded, both)
    features, labels = np.concatenate((own, theirs)), np.arange(2 * len(own)) < len(own)
    return {
        name: two_sample_auc(features[:, list(columns)], labels, np.tile(groups, 2), seed)
        for name, columns in FEATURE_SETS.items()
    }
