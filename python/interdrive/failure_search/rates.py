"""Rates of failures with exact intervals, and the yield of directed runs against uniform ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from interdrive.failure_search.allocation import SOURCES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

_TAIL = 0.025
#: Headings of `Yield.cells`.
YIELD_HEAD = ("runs", "driven", "fail", "different", "rate [%]", "95 %", "times uniform", "95 % of it")


@dataclass(frozen=True)
class Yield:
    """What the runs of one source brought.

    Attributes:
        source: One of `interdrive.failure_search.SOURCES`, or "directed": all but the uniform ones.
        runs: Runs that were driven.
        failures: Runs that failed.
        signatures: Different signatures among these.
        rate: Share of the runs that fail, with its 95 % interval (Clopper and Pearson).
        ratio: Its share as a multiple of that of the uniform runs, with the exact 95 % interval given the number of
            failures of both; nan and inf where there are none.
    """

    source: str
    runs: int
    failures: int
    signatures: int
    rate: tuple[float, float, float]
    ratio: tuple[float, float, float]

    def cells(self) -> tuple[str, ...]:
        """Its row of a table with the headings `YIELD_HEAD`."""
        at, least, most = self.ratio
        has_ratio = self.source != "uniform" and not math.isnan(at)
        return (
            self.source,
            *(str(number) for number in (self.runs, self.failures, self.signatures)),
            *said_rate(self.rate),
            *((f"{at:.1f}", f"{least:.1f} to {most:.1f}") if has_ratio else ("", "")),
        )


def said_rate(rate: tuple[float, float, float]) -> tuple[str, str]:
    """A share of runs and its interval [%]; empty without runs."""
    share, low, high = (100.0 * value for value in rate)
    return ("", "") if math.isnan(share) else (f"{share:.2f}", f"{low:.2f} to {high:.2f}")


def yields(rows: Sequence[Mapping[str, Any]]) -> tuple[Yield, ...]:
    """The yield of the uniform runs, of every other source that has runs, and of the directed ones together.

    Args:
        rows: Of the runs: `source`, `outcome` (None: not driven), `failure` and `signature`.
    """
    driven = [row for row in rows if row["outcome"] is not None]
    uniform = [row for row in driven if row["source"] == "uniform"]
    found = [_yield("uniform", uniform, uniform)]
    others = [name for name in SOURCES if name != "uniform" and any(row["source"] == name for row in driven)]
    found += [_yield(name, [row for row in driven if row["source"] == name], uniform) for name in others]
    if others:
        found.append(_yield("directed", [row for row in driven if row["source"] != "uniform"], uniform))
    return tuple(found)


def _yield(source: str, rows: Sequence[Mapping[str, Any]], uniform: Sequence[Mapping[str, Any]]) -> Yield:
    failed = [row["signature"] for row in rows if row["failure"]]
    ratio = (1.0, 1.0, 1.0)
    if rows is not uniform:
        ratio = rate_ratio(len(failed), len(rows), sum(bool(row["failure"]) for row in uniform), len(uniform))
    return Yield(source, len(rows), len(failed), len(set(failed)), interval(len(failed), len(rows)), ratio)


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
