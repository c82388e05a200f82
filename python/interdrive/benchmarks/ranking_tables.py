"""Rankings as tables for papers and pages: at most eight columns each."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from interdrive.benchmarks.sets import traffic_name
from interdrive.comparison.paper import PaperTable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.benchmarks.ranking import Rank, Ranking
    from interdrive.benchmarks.sets import BenchmarkSet

#: Columns of a table; more kinds of traffic are in further tables.
COLUMNS_MAX = 8

#: What marks a planner among its own copies, and what a number counts.
OWN = "*"


def cell(one: Rank, kind: str) -> str:
    """The score of a planner in a kind of traffic, marked where it meets its own copies."""
    value = one.columns[kind]
    if math.isnan(value):
        return ""
    return f"{value:.1f}" + (OWN if one.planner.partition(",")[0] == kind else "")


def rank_text(one: Rank) -> str:
    """The rank and its interval."""
    if not one.rank:
        return ""
    return str(one.rank) + (f" ({one.rank_low} to {one.rank_high})" if one.rank_high else "")


def ranking_tables(found: Ranking, chosen: BenchmarkSet, traffic: Sequence[str], about: str) -> list[PaperTable]:
    """The ranking, the scores by traffic, and how rankings agree; each with at most eight columns.

    Args:
        found: The ranking.
        chosen: The set.
        traffic: Kinds of traffic that were driven.
        about: What was driven, and the command, for captions.
    """
    counted = ", ".join(traffic_name(kind) for kind in chosen.counted)
    weights = ", ".join(f"{name} {weight:g}" for name, weight in chosen.weights.items())
    places = ", ".join(f"{name or 'all'} {n}" for name, n in found.n_places.items())
    head = ("planner", "number", "95 %", "rank (95 %)", "above next %", "separable")
    rows = [
        (
            one.planner,
            "" if math.isnan(one.number) else f"{one.number:.1f}",
            "" if math.isnan(one.low) else f"{one.low:.1f} to {one.high:.1f}",
            rank_text(one),
            "" if math.isnan(one.above_next) else f"{100.0 * one.above_next:.0f}",
            one.letters,
        )
        for one in found.ranks
    ]
    said = f"{about.rstrip('.')}. Number: mean among {counted}" + (f", classes weighted {weights}" if weights else "")
    said += f". Places: {places}. " + (
        "Planners that share a letter are not separable (all pairs, p adjusted after Holm, 0.05)."
        if found.is_sure
        else "Too few places for intervals of ranks, and nothing is claimed to be separable."
    )
    tables = [PaperTable(said, head, tuple(rows))]
    for first in range(0, len(traffic), COLUMNS_MAX - 1):
        part = traffic[first : first + COLUMNS_MAX - 1]
        body = tuple((one.planner, *(cell(one, kind) for kind in part)) for one in found.ranks)
        said = f" {found.sentence[:1].upper()}{found.sentence[1:]}." if found.sentence else ""
        caption = f"Score by traffic; {OWN} among its own copies.{said}"
        tables.append(PaperTable(caption, ("planner", *(traffic_name(kind) for kind in part)), body))
    if found.agreements:
        pairs = tuple(
            (
                f"{traffic_name(one.one)}, {traffic_name(one.other)}",
                "" if math.isnan(one.tau) else f"{one.tau:.2f}",
                "" if math.isnan(one.low) else f"{one.low:.2f} to {one.high:.2f}",
            )
            for one in found.agreements
        )
        caption = "Kendall's tau-b of the rankings in two kinds of traffic."
        tables.append(PaperTable(caption, ("traffic", "tau", "95 %"), pairs))
    return tables
