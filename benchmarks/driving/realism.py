"""How much agents drive like the recordings of the same vehicles: distances between distributions."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from interdrive.run import States
    from interdrive.runs import Run
    from interdrive.scenario import Obstacles

    Floats = NDArray[np.float64]

#: Time between samples [s].
SPACING = 0.5
#: What is compared, and its unit.
QUANTITIES = {"speed": "m/s", "acceleration": "m/s²", "headway": "s", "lateral offset": "m", "standing time": "s"}
#: Gaps are looked at this far ahead [m], headways from this speed on [m/s]; below the last speed a vehicle stands.
HEADWAY_REACH, HEADWAY_SPEED, STANDING = 60.0, 1.0, _core.STANDSTILL_SPEED


@dataclass(frozen=True)
class Samples:
    """Values of one agent, twice a second (the standing time once), driven and recorded."""

    category: str
    driven: dict[str, Floats]
    recorded: dict[str, Floats]


def samples_of(run: Run, i: int, route: _core.Route, category: str) -> Samples | None:
    """Of one agent of a run; None for a planning problem, which has no recording."""
    agent, states, obstacles = run.agents[i], run.states, run.scenario.obstacles
    recorded = np.flatnonzero(obstacles.ids == agent.id)
    if not len(recorded):
        return None
    every = max(1, round(SPACING / run.scenario.dt))
    extent = {
        int(one): (states.length[row], states.width[row]) for row, one in enumerate(states.participant_id.tolist())
    }
    row = int(np.searchsorted(states.participant_id, agent.id))
    driven = _values(run, states, states.participant_id, row, route, extent, every)
    return Samples(category, driven, _values(run, obstacles, obstacles.ids, int(recorded[0]), route, extent, every))


def _values(
    run: Run,
    table: States | Obstacles,
    ids: NDArray[np.int64],
    row: int,
    route: _core.Route,
    extent: dict[int, tuple[float, float]],
    every: int,
) -> dict[str, Floats]:
    steps = np.flatnonzero(table.valid[row])
    standing = float((np.abs(table.velocity[row, steps]) < STANDING).sum() * run.scenario.dt)
    steps = steps[::every]
    offset = route.project(table.x[row, steps], table.y[row, steps])[1]
    return {
        "speed": table.velocity[row, steps],
        "acceleration": table.acceleration[row, steps],
        "headway": _headways(table, ids, row, steps, extent),
        "lateral offset": offset[~np.isnan(offset)],
        "standing time": np.array([standing]),
    }


def _headways(
    table: States | Obstacles,
    ids: NDArray[np.int64],
    row: int,
    steps: NDArray[np.int64],
    extent: dict[int, tuple[float, float]],
) -> Floats:
    """Time to the rear of the nearest participant straight ahead [s], where there is one."""
    known = [extent.get(int(one), (np.nan, np.nan)) for one in ids.tolist()]
    length, width = np.array(known).T[:, :, None]
    x, y = table.x[:, steps] - table.x[row, steps], table.y[:, steps] - table.y[row, steps]
    cos, sin = np.cos(table.orientation[row, steps]), np.sin(table.orientation[row, steps])
    ahead, beside = cos * x + sin * y, cos * y - sin * x
    turned = np.abs((table.orientation[:, steps] - table.orientation[row, steps] + np.pi) % (2 * np.pi) - np.pi)
    gap = ahead - 0.5 * (length + length[row])
    leads = (
        (ahead > 0) & (gap < HEADWAY_REACH) & (np.abs(beside) < 0.5 * (width + width[row])) & (turned < 0.25 * np.pi)
    )
    nearest = np.where(leads, np.maximum(gap, 0.0), np.inf).min(axis=0)
    speed = table.velocity[row, steps]
    there = np.isfinite(nearest) & (speed > HEADWAY_SPEED)
    headways: Floats = nearest[there] / speed[there]
    return headways


def wasserstein(one: Floats, other: Floats) -> float:
    """Distance of two samples: the area between their distribution functions; nan if one is empty."""
    if not len(one) or not len(other):
        return float("nan")
    every = np.sort(np.concatenate([one, other]))
    between = np.diff(every)
    shares = (np.searchsorted(np.sort(values), every[:-1], side="right") / len(values) for values in (one, other))
    first, second = shares
    return float((np.abs(first - second) * between).sum())


def distances(samples: Iterable[Samples]) -> dict[str, dict[str, float]]:
    """Distance of each quantity by category, and over all of them as "all"."""
    grouped = defaultdict(list)
    for one in samples:
        for category in (one.category, "all"):
            grouped[category].append(one)
    return {
        category: {
            quantity: wasserstein(
                np.concatenate([one.driven[quantity] for one in part]),
                np.concatenate([one.recorded[quantity] for one in part]),
            )
            for quantity in QUANTITIES
        }
        for category, part in sorted(grouped.items(), key=lambda item: (item[0] == "all", item[0]))
    }
