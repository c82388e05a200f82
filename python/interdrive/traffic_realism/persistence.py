"""Whether drivers differ, and stay themselves: time headways of vehicles over long rollouts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.traffic_realism.tracks import GRID, leaders

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Floats, Ints
    from interdrive.traffic_realism.tracks import Tracks

#: Seconds count with a headway below this [s] and a speed above this [m/s], from this time after start or entry on [s].
_HEADWAY_MAX, _SPEED_MIN, _AFTER = 4.0, 3.0, 1.0
#: A vehicle has at least so many of them.
_SECONDS_MIN = 8
#: The first and the last third of them are this far apart [s].
_APART = 8.0


@dataclass(frozen=True)
class Thirds:
    """The mean logarithm of the headway of each vehicle in the first and in the last third of its seconds.

    Attributes:
        first: Shape (vehicles,).
        last: The same.
        apart: Between the middles of both thirds [s].
    """

    first: Floats
    last: Floats
    apart: Floats


@dataclass(frozen=True)
class Persistence:
    """How drivers differ.

    Attributes:
        spread: Standard deviation over vehicles of the logarithm of the headway.
        persistence: Correlation between the first and the last third.
        n_vehicles: Vehicles of the correlation.
    """

    spread: float
    persistence: float
    n_vehicles: int


def thirds(tracks: Tracks, ids: Ints, start: int) -> Thirds:
    """Headways of vehicles.

    Args:
        tracks: All participants.
        ids: Of the vehicles.
        start: Point of the grid from which on they count.
    """
    rows = tracks.rows(ids)
    gap, _ = leaders(tracks, rows)
    speed = tracks.speed[rows]
    with np.errstate(divide="ignore", invalid="ignore"):
        headway = gap / speed
        counts = (headway < _HEADWAY_MAX) & (speed > _SPEED_MIN) & (gap > 0.0)
    found: list[tuple[float, float, float]] = []
    every, after = round(1.0 / GRID), round(_AFTER / GRID)
    for row in range(len(rows)):
        there = np.flatnonzero(np.isfinite(speed[row]))
        there = there[there >= start]
        if not there.size:
            continue
        seconds = np.arange(there[0] + after, there[-1] + 1, every)
        seconds = seconds[counts[row, seconds]]
        if len(seconds) < _SECONDS_MIN:
            continue
        third = len(seconds) // 3
        values = np.log(headway[row, seconds])
        apart = GRID * (seconds[-third:].mean() - seconds[:third].mean())
        found.append((float(values[:third].mean()), float(values[-third:].mean()), float(apart)))
    table = np.array(found).reshape(-1, 3)
    return Thirds(table[:, 0], table[:, 1], table[:, 2])


def persistence(parts: Sequence[Thirds]) -> Persistence:
    """Spread and persistence over all vehicles of several rollouts; nan below three vehicles."""
    first, last, apart = (
        np.concatenate([getattr(part, name) for part in parts]) if parts else np.empty(0)
        for name in ("first", "last", "apart")
    )
    far = apart >= _APART
    spread = float(last.std(ddof=1)) if len(last) > 2 else float("nan")
    enough = int(far.sum()) > 2 and first[far].std() > 0.0 and last[far].std() > 0.0
    correlation = float(np.corrcoef(first[far], last[far])[0, 1]) if enough else float("nan")
    return Persistence(spread, correlation, int(far.sum()))
