"""How stable a ranking of planners is: over places, which are drawn together, and over kinds of traffic.

All planners and all traffic see the same draws of places. Kendall, "Rank Correlation Methods", 1970, chapter 3 (tau-b).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.benchmarks.sets import traffic_name
from interdrive.comparison.intervals import LEVEL, PLACES_SURE, SAMPLES, SEED, chance, draws, holm, interval, letters

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.array_types import Floats

#: With fewer places in a class there are no intervals and no letters.
CLASS_PLACES_MIN = 3

#: Share of samples in which a difference is found that `places_needed` asks for.
POWER = 0.8


@dataclass(frozen=True)
class Standings:
    """Scores by planner, traffic and unit; a unit is a file, or a place where classes have weights.

    Attributes:
        planners: Names. traffic: Kinds of traffic.
        values: From 0 to 100, shape (planners, traffic, units); nan: the planner has no score there.
        places: The place of each unit. classes: The class of each unit.
        weights: Of each class; they need not add up to 1.
        counted: Kinds of traffic whose mean is the number.
    """

    planners: tuple[str, ...]
    traffic: tuple[str, ...]
    values: Floats = field(repr=False)
    places: tuple[str, ...]
    classes: tuple[str, ...]
    weights: Mapping[str, float]
    counted: tuple[str, ...]

    def totals(self, drawn: Mapping[str, int] | None = None) -> Floats:
        """Total of each planner in each traffic, shape (planners, traffic); `drawn`: how often each place counts."""
        counts = [1 if drawn is None else drawn[place] for place in self.places]
        found: Floats = self._totals(np.array([counts], dtype=np.float64))[0]
        return found

    def numbers(self) -> Floats:
        """The number of each planner, shape (planners,); nan where it has none in traffic that counts."""
        found: Floats = self.numbers_of(self.totals()[None])[0]
        return found

    def samples(self) -> Floats:
        """Totals of every sample of places within classes, shape (samples, planners, traffic)."""
        counts = np.zeros((SAMPLES, len(self.places)))
        for k, name in enumerate(sorted(set(self.classes))):
            units = [u for u, own in enumerate(self.classes) if own == name]
            own = sorted({self.places[u] for u in units})
            drawn = draws(len(own), SAMPLES, SEED + k)
            for u in units:
                counts[:, u] = drawn[:, own.index(self.places[u])]
        return self._totals(counts)

    def _totals(self, counts: Floats) -> Floats:
        known = np.isfinite(self.values)
        values = np.where(known, self.values, 0.0)
        names = sorted(set(self.classes))
        sum_of_weights = sum(self.weights[name] for name in names)
        found = np.zeros((len(counts), *self.values.shape[:2]))
        for name in names:
            here = np.array([own == name for own in self.classes], dtype=np.float64)
            weighed = counts * here
            total = np.einsum("su,pcu->spc", weighed, values)
            count = np.einsum("su,pcu->spc", weighed, known.astype(np.float64))
            with np.errstate(invalid="ignore"):
                found += self.weights[name] / sum_of_weights * np.where(count > 0.0, total / count, np.nan)
        return found

    def numbers_of(self, totals: Floats) -> Floats:
        """Numbers of samples of totals, shape (samples, planners); nan if no traffic counts."""
        if not self.counted:
            return np.full(totals.shape[:2], np.nan)
        columns = [self.traffic.index(name) for name in self.counted]
        found: Floats = totals[:, :, columns].mean(axis=2)
        return found


@dataclass(frozen=True)
class Rank:
    """One planner.

    Attributes:
        planner: Label.
        number: Mean over the traffic that counts; nan if it does not drive in all of it. low, high: Its interval.
        columns: Its total by traffic; nan where it has none.
        rank: By number, 1 is best; 0 without a number. rank_low, rank_high: 95 % of the samples; 0 without them.
        above_next: Share of samples in which it is above the next one; nan for the last, and without samples.
        letters: Planners that share one are not separable; "" where nothing is claimed.
        rank_by_traffic: Its rank in each kind of traffic in which it drives.
    """

    planner: str
    number: float
    low: float
    high: float
    columns: Mapping[str, float]
    rank: int
    rank_low: int
    rank_high: int
    above_next: float
    letters: str
    rank_by_traffic: Mapping[str, int]


@dataclass(frozen=True)
class Agreement:
    """Kendall's tau-b of the rankings in two kinds of traffic, with its interval; nan where there is none."""

    one: str
    other: str
    tau: float
    low: float
    high: float


@dataclass(frozen=True)
class Ranking:
    """Planners in order, and how far that order can be trusted.

    Attributes:
        ranks: The best first; planners without a number last.
        agreements: For each pair of kinds of traffic.
        n_places: Places by class.
        is_sure: There are places enough for intervals of ranks and for letters.
        sentence: Whether the ranking depends on the traffic, in words.
    """

    ranks: tuple[Rank, ...]
    agreements: tuple[Agreement, ...]
    n_places: Mapping[str, int]
    is_sure: bool
    sentence: str

    def plain(self) -> dict[str, Any]:
        """For JSON; numbers that are absent are null."""
        return {
            "ranks": [{name: _plain(value) for name, value in vars(one).items()} for one in self.ranks],
            "agreements": [{name: _plain(value) for name, value in vars(one).items()} for one in self.agreements],
            "places": dict(self.n_places),
            "sentence": self.sentence,
        }


def ranked(found: Standings) -> Ranking:
    """The ranking of planners by their number.

    Args:
        found: Scores of at least one planner.
    """
    totals, numbers, samples = found.totals(), found.numbers(), found.samples()
    drawn = found.numbers_of(samples)
    n_places = {
        name: len({place for place, own in zip(found.places, found.classes, strict=True) if own == name})
        for name in sorted(set(found.classes))
    }
    n = sum(n_places.values())
    # A class of one or two places hardly varies in samples: what is drawn from it says nothing.
    varies = len(n_places) == 1 or min(n_places.values()) >= CLASS_PLACES_MIN
    is_sure = n >= PLACES_SURE and varies
    order = sorted(range(len(numbers)), key=lambda p: -math.inf if math.isnan(numbers[p]) else numbers[p], reverse=True)
    numbered = [p for p in order if not math.isnan(numbers[p])]
    places = _places(numbers)
    drawn_places = _places(drawn)
    marks = _letters(found.planners, numbers, drawn, numbered, n) if is_sure and len(numbered) > 1 else {}
    by_traffic = {name: _places(totals[:, c]) for c, name in enumerate(found.traffic)}
    ranks = []
    for p in order:
        name, has_number = found.planners[p], p in numbered
        low, high = interval(float(numbers[p]), drawn[:, p], n) if has_number and varies else (math.nan, math.nan)
        ends = np.quantile(drawn_places[:, p], [0.025, 0.975], method="nearest") if is_sure and has_number else (0, 0)
        later = numbered.index(p) + 1 if has_number else len(numbered)
        above = math.nan
        if is_sure and later < len(numbered):
            above = float((drawn[:, p] > drawn[:, numbered[later]]).mean())
        columns = {name: float(totals[p, c]) for c, name in enumerate(found.traffic)}
        ranks.append(
            Rank(
                planner=name,
                number=float(numbers[p]),
                low=low,
                high=high,
                columns=columns,
                rank=int(places[p]) if has_number else 0,
                rank_low=int(ends[0]),
                rank_high=int(ends[1]),
                above_next=above,
                letters=marks.get(name, ""),
                rank_by_traffic={
                    traffic: int(own[p]) for traffic, own in by_traffic.items() if not math.isnan(columns[traffic])
                },
            )
        )
    agreements = tuple(_agreements(found, totals, samples, is_sure=is_sure))
    return Ranking(tuple(ranks), agreements, n_places, is_sure, _sentence(ranks, agreements))


def places_needed(found: Standings, points: float) -> dict[tuple[str, str], int]:
    """Places that are needed to separate neighbours that are some points apart, in 80 % of all sets (`POWER`).

    From the spread of the paired differences over places, by the normal approximation, at least the places below which
    nothing is claimed.

    Args:
        found: Scores.
        points: The difference.
    """
    numbers = found.numbers()
    order = [p for p in np.argsort(-np.nan_to_num(numbers, nan=-1.0)).tolist() if not math.isnan(numbers[p])]
    if not order:
        return {}
    columns = [found.traffic.index(name) for name in found.counted]
    by_unit = found.values[:, columns].mean(axis=1)
    names, place = np.unique(np.array(found.places, dtype=str), return_inverse=True)
    quantiles = NormalDist().inv_cdf(0.5 + 0.5 * LEVEL) + NormalDist().inv_cdf(POWER)
    needed = {}
    for one, other in itertools.pairwise(order):
        apart = by_unit[one] - by_unit[other]
        known = np.isfinite(apart)
        count = np.bincount(place[known], minlength=len(names))
        means = np.bincount(place[known], weights=apart[known], minlength=len(names))[count > 0] / count[count > 0]
        if len(means) < 2:
            continue
        spread = float(np.std(means, ddof=1))
        n = math.ceil((quantiles * spread / points) ** 2)
        needed[found.planners[one], found.planners[other]] = max(n, PLACES_SURE)
    return needed


def _places(numbers: Floats) -> Floats:
    """Rank of each number along the last axis: one more than the larger ones."""
    found: Floats = 1 + (numbers[..., None, :] > numbers[..., :, None]).sum(axis=-1)
    return found


def _letters(
    planners: Sequence[str], numbers: Floats, drawn: Floats, numbered: Sequence[int], n: int
) -> dict[str, str]:
    pairs = list(itertools.combinations(numbered, 2))
    chances = [chance(float(numbers[a] - numbers[b]), drawn[:, a] - drawn[:, b], n) for a, b in pairs]
    differ = {
        frozenset((planners[a], planners[b])): p < 1.0 - LEVEL for (a, b), p in zip(pairs, holm(chances), strict=True)
    }
    return letters([planners[p] for p in numbered], differ)


def kendall(one: Floats, other: Floats) -> Floats:
    """Kendall's tau-b along the last axis; nan where one of both is the same for all."""
    a, b = np.triu_indices(one.shape[-1], k=1)
    first, second = np.sign(one[..., a] - one[..., b]), np.sign(other[..., a] - other[..., b])
    untied = np.sqrt(np.abs(first).sum(axis=-1) * np.abs(second).sum(axis=-1))
    with np.errstate(invalid="ignore", divide="ignore"):
        found: Floats = (first * second).sum(axis=-1) / untied
    return found


def _agreements(found: Standings, totals: Floats, samples: Floats, *, is_sure: bool) -> list[Agreement]:
    made = []
    for a, b in itertools.combinations(range(len(found.traffic)), 2):
        both = np.flatnonzero(np.isfinite(totals[:, a]) & np.isfinite(totals[:, b]))
        if len(both) < 2:
            continue
        tau = float(kendall(totals[both, a], totals[both, b]))
        low = high = math.nan
        if is_sure:
            drawn = kendall(samples[:, both, a], samples[:, both, b])
            drawn = drawn[np.isfinite(drawn)]
            if len(drawn):
                low, high = np.quantile(drawn, [0.025, 0.975], method="nearest").tolist()
        made.append(Agreement(found.traffic[a], found.traffic[b], tau, low, high))
    return made


def _sentence(ranks: Sequence[Rank], agreements: Sequence[Agreement]) -> str:
    if not agreements:
        return ""
    if all(one.tau == 1.0 for one in agreements):
        return "the ranking is the same in all traffic"
    least = min((one for one in agreements if not math.isnan(one.tau)), key=lambda one: one.tau, default=None)
    if least is None:
        return ""
    span = "" if math.isnan(least.low) else f" ({least.low:.1f} to {least.high:.1f})"
    pair = f"{traffic_name(least.one)}, {traffic_name(least.other)}"
    said = f"the ranking depends on the traffic: tau({pair}) {least.tau:.1f}{span}"
    moved = max(
        (one for one in ranks if {least.one, least.other} <= one.rank_by_traffic.keys()),
        key=lambda one: abs(one.rank_by_traffic[least.one] - one.rank_by_traffic[least.other]),
    )
    before, after = moved.rank_by_traffic[least.one], moved.rank_by_traffic[least.other]
    return said if before == after else f"{said}; {moved.planner} moves from {before} to {after}"


def _plain(value: object) -> object:
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    return None if isinstance(value, float) and math.isnan(value) else value
