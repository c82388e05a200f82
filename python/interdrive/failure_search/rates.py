"""Rates of failures with exact intervals, and the yield of directed runs against uniform ones."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from interdrive.failure_search.allocation import SOURCES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

_TAIL = 0.025
#: Headings of `Yield.cells`.
YIELD_HEAD = (
    *("runs", "driven", "lost", "fail", "rate [%]", "95 %", "times uniform", "95 % of it"),
    *("different", "at equal runs", "uniform then"),
)


@dataclass(frozen=True)
class Yield:
    """What the runs of one source brought.

    Attributes:
        source: One of `interdrive.failure_search.SOURCES`, or "directed": all but the uniform ones.
        runs: Runs that were driven.
        lost: Runs besides whose process was lost, so that it is unknown whether they fail.
        failures: Runs that failed.
        signatures: Different signatures among these.
        rate: Share of the driven runs that fail, with its 95 % interval (Clopper and Pearson), whose upper end counts
            lost runs as failures and whose lower end does not.
        alike: Different signatures expected in as many runs of this source, and in as many uniform ones, as the source
            with fewer runs has; each the mean over all choices of so many of its runs.
        ratio: Its share as a multiple of that of the uniform runs, with the exact 95 % interval given the number of
            failures of both; nan and inf where there are none.
    """

    source: str
    runs: int
    lost: int
    failures: int
    signatures: int
    rate: tuple[float, float, float]
    alike: tuple[float, float]
    ratio: tuple[float, float, float]

    def cells(self) -> tuple[str, ...]:
        """Its row of a table with the headings `YIELD_HEAD`."""
        is_uniform = self.source == "uniform"
        return (
            self.source,
            *(str(number) for number in (self.runs, self.lost, self.failures)),
            *said_rate(self.rate),
            *(("", "") if is_uniform else said_ratio(self.ratio)),
            str(self.signatures),
            *(("", "") if is_uniform else (f"{number:.1f}" for number in self.alike)),
        )


def said_rate(rate: tuple[float, float, float]) -> tuple[str, str]:
    """A share of runs and its interval [%]; empty without runs."""
    share, low, high = (100.0 * value for value in rate)
    return ("", "") if math.isnan(share) else (f"{share:.2f}", f"{low:.2f} to {high:.2f}")


def said_ratio(ratio: tuple[float, float, float]) -> tuple[str, str]:
    """A ratio of two shares and its interval; empty without failures."""
    at, least, most = ratio
    return ("", "") if math.isnan(at) else (f"{at:.1f}", f"{least:.1f} to {most:.1f}")


def yields(rows: Sequence[Mapping[str, Any]]) -> tuple[Yield, ...]:
    """The yield of the uniform runs, of every other source that has runs, and of the directed ones together.

    Args:
        rows: Of the runs: `source`, `draws` (0: lost), `outcome` (None: not driven), `failure` and `signature`.
    """
    parts = {name: [row for row in rows if row["source"] == name] for name in SOURCES}
    uniform = parts.pop("uniform")
    found = [_yield("uniform", uniform, uniform)]
    found += [_yield(name, own, uniform) for name, own in parts.items() if own]
    if len(found) > 1:
        found.append(_yield("directed", [row for own in parts.values() for row in own], uniform))
    return tuple(found)


def _yield(source: str, rows: Sequence[Mapping[str, Any]], uniform: Sequence[Mapping[str, Any]]) -> Yield:
    driven, others = (tuple(row for row in some if row["outcome"] is not None) for some in (rows, uniform))
    failed = Counter(row["signature"] for row in driven if row["failure"])
    failed_of_others = Counter(row["signature"] for row in others if row["failure"])
    n_lost = sum(is_lost(row) for row in rows)
    n_failed, n_of_others = failed.total(), failed_of_others.total()
    share, low, high = interval(n_failed, len(driven))
    if n_lost:
        low, high = (interval(n, len(driven) + n_lost)[side] for side, n in ((1, n_failed), (2, n_failed + n_lost)))
    ratio = (1.0, 1.0, 1.0)
    if rows is not uniform:
        ratio = rate_ratio(n_failed, len(driven), n_of_others, len(others))
    fewest = min(len(driven), len(others))
    alike = different(failed, len(driven), fewest), different(failed_of_others, len(others), fewest)
    return Yield(source, len(driven), n_lost, n_failed, len(failed), (share, low, high), alike, ratio)


def is_lost(row: Mapping[str, Any]) -> bool:
    """Whether the process of a run was lost."""
    return row["outcome"] is None and row["draws"] == 0


def different(failed: Mapping[str, int], runs: int, chosen: int) -> float:
    """Number of different signatures expected among some of the runs, chosen without replacement.

    Args:
        failed: Number of failures by signature.
        runs: Number of runs.
        chosen: Of these are chosen.
    """
    ways = math.comb(runs, chosen)
    return math.fsum(1.0 - math.comb(runs - n, chosen) / ways for n in failed.values())


def rate_ratio(failed: int, runs: int, other_failed: int, other_runs: int) -> tuple[float, float, float]:
    """A share as a multiple of another one, with the exact 95 % interval given both numbers of failures together.

    Of all failures each falls to the first kind of runs with the probability r n / (r n + m), where r is the ratio and
    n, m are the numbers of runs; so the interval of that probability gives the one of the ratio.
    """
    if not (failed + other_failed and runs and other_runs):
        return math.nan, 0.0, math.inf
    _, low, high = interval(failed, failed + other_failed)
    at = math.inf if other_failed == 0 else failed / runs / (other_failed / other_runs)
    share = other_runs / runs
    return at, share * low / (1.0 - low), math.inf if high == 1.0 else share * high / (1.0 - high)


def interval(failed: int, runs: int) -> tuple[float, float, float]:
    """Share of failures, and its 95 % interval (Clopper and Pearson)."""
    if not runs:
        return math.nan, 0.0, 1.0
    low = 0.0 if failed == 0 else _solved(lambda p: 1.0 - _at_most(failed - 1, runs, p) < _TAIL)
    high = 1.0 if failed == runs else _solved(lambda p: _at_most(failed, runs, p) > _TAIL)
    return failed / runs, low, high


def _at_most(k: int, n: int, p: float) -> float:
    """Probability of at most k of n."""
    terms = [math.lgamma(n + 1) - math.lgamma(i + 1) - math.lgamma(n - i + 1) for i in range(k + 1)]
    logs = [term + i * math.log(p) + (n - i) * math.log1p(-p) for i, term in enumerate(terms)]
    return math.fsum(map(math.exp, logs))


def _solved(is_below: Callable[[float], bool]) -> float:
    """Where a probability stops being too low."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_below(middle) else (low, middle)
    return low
