"""Measures over many agents, with intervals over places, of one build or of two builds on the same agents."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from comfort import COMFORTABLE
from drives import LONG, Drive
from pace import SLOW_SHARE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

#: Samples of the bootstrap, its seed, and the share of them inside an interval.
SAMPLES, SEED, INSIDE = 2000, 0, 0.95
#: Files are resampled where there are fewer places; where there are fewer files, there is no interval.
PLACES_MIN = 5
NAN = float("nan")


@dataclass(frozen=True)
class Measure:
    """One number over many agents.

    Attributes:
        title: Its heading.
        of: Its value for one agent; nan where it has none.
        recorded: The same of the agent's recording; nothing where that says nothing.
        quantile: The quantile of the values that it is; None for their mean.
        unit: "%" for shares, "" for counts per 100 agents.
    """

    title: str
    of: Callable[[Drive], float]
    recorded: Callable[[Drive], float] | None = None
    quantile: float | None = None
    unit: str = "%"

    def shown(self, value: float, sign: str = "") -> str:
        """A value as text."""
        if np.isnan(value):
            return ""
        if self.quantile is not None:
            return f"{value:{sign}.2f}"
        return f"{100 * value:{sign}.1f}{' %' if self.unit == '%' else ''}"


def is_lost(one: Drive) -> bool:
    """Reachable, and not in time."""
    return one.reachable and one.outcome != "goal_reached"


def stands_idle(one: Drive) -> bool:
    """Stands at its end, or stood for more than 10 s with a free way."""
    return one.stands_at_end or one.stood_free > LONG


def _compared(value: float, other: float) -> float:
    """A value of an agent that has the same of its recording."""
    return NAN if np.isnan(other) else value


def _above(value: float, bound: float) -> float:
    return NAN if np.isnan(value) else float(value > bound)


def is_slow(one: Drive) -> bool:
    """Slower than most of its recording, or of free flow if it has none."""
    return one.pace < SLOW_SHARE * one.recorded_pace


def _slow(one: Drive) -> float:
    """Of agents with a recording: free flow, all that a planning problem can be held against, knows no traffic."""
    return NAN if np.isnan(one.pace) or one.origin != "recorded" else float(is_slow(one))


IN_TIME = Measure("in time", lambda one: float(not is_lost(one)) if one.reachable else NAN)
COLLIDES = Measure("collides", lambda one: float(one.outcome == "collision"))
VIOLATIONS = Measure(
    "violations per 100", lambda one: float(one.violations), lambda one: float(one.recorded_violations), unit=""
)
MANNER = (
    Measure(f"slower than {SLOW_SHARE} of its recording", _slow),
    Measure(
        "brakes > 3 m/s²",
        lambda one: _above(_compared(one.brake, one.recorded_brake), COMFORTABLE),
        lambda one: _above(_compared(one.recorded_brake, one.brake), COMFORTABLE),
    ),
    Measure(
        "across > 3 m/s²",
        lambda one: _above(_compared(one.across, one.recorded_across), COMFORTABLE),
        lambda one: _above(_compared(one.recorded_across, one.across), COMFORTABLE),
    ),
    Measure(
        "across, 90 % [m/s²]",
        lambda one: _compared(one.across, one.recorded_across),
        lambda one: _compared(one.recorded_across, one.across),
        quantile=0.9,
    ),
    Measure(
        "jerk, 90 % [m/s³]",
        lambda one: _compared(one.jerk, one.recorded_jerk),
        lambda one: _compared(one.recorded_jerk, one.jerk),
        quantile=0.9,
    ),
    Measure("stands idle", lambda one: float(stands_idle(one))),
)
ALL = (IN_TIME, COLLIDES, VIOLATIONS, *MANNER)


def units(drives: Sequence[Drive]) -> tuple[str, NDArray[np.int64]]:
    """What is resampled, "places" or "files", and the number of the one that each agent belongs to."""
    named = [one.place for one in drives]
    what = "places"
    if len(set(named)) < PLACES_MIN:
        what, named = "files", [f"{one.category}/{one.scenario}" for one in drives]
    return what, np.unique(named, return_inverse=True)[1].astype(np.int64)


def statistic(values: Floats, weights: Floats, quantile: float | None) -> Floats:
    """Mean or quantile of values, for every row of weights, shape (rows, values); nan where all weights are 0."""
    total = weights.sum(axis=1)
    if quantile is None:
        return np.divide(weights @ values, total, out=np.full(len(total), NAN), where=total > 0)
    order = np.argsort(values, kind="stable")
    below = np.cumsum(weights[:, order], axis=1)
    place = np.minimum((below < quantile * total[:, None]).sum(axis=1), len(values) - 1)
    found: Floats = np.where(total > 0, values[order][place], NAN)
    return found


def value(values: Iterable[float], quantile: float | None) -> float:
    """Mean or quantile of the values that there are; nan where there are none."""
    there = np.array([one for one in values if not np.isnan(one)])
    if not len(there):
        return NAN
    return float(there.mean() if quantile is None else np.quantile(there, quantile))


def interval(values: Sequence[Floats], of: NDArray[np.int64], quantile: float | None) -> tuple[float, float]:
    """Percentile bootstrap over what `of` numbers, of a measure or (two sets of values) of the change between two.

    Nan for few places, and where all agents have the same value, of which resampling can say nothing.
    """
    n = int(of.max(initial=-1)) + 1
    if n < PLACES_MIN:
        return NAN, NAN
    drawn = np.random.default_rng(SEED).integers(n, size=(SAMPLES, n))
    times = np.stack([np.bincount(row, minlength=n) for row in drawn]).astype(np.float64)
    sets = []
    for one in values:
        there = ~np.isnan(one)
        if not there.any():
            return NAN, NAN
        sets.append(statistic(one[there], times[:, of[there]], quantile))
    found = sets[0] if len(sets) == 1 else sets[1] - sets[0]
    if np.nanmin(found) == np.nanmax(found):
        return NAN, NAN
    low, high = np.nanquantile(found, [0.5 - 0.5 * INSIDE, 0.5 + 0.5 * INSIDE])
    return float(low), float(high)


def of_agents(measure: Measure, drives: Sequence[Drive]) -> Floats:
    """Values of a measure for all agents."""
    return np.array([measure.of(one) for one in drives], dtype=np.float64)


def count_events(drives: Iterable[Drive]) -> int:
    """How many events agents were lost in."""
    return len({(one.category, one.scenario, one.event) for one in drives if one.event >= 0})
