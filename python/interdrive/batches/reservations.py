"""What the numbers of a comparison do not prove: some of it always, some of it seen in the data."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

#: Fewer scenarios than this make intervals that are too narrow.
_SCENARIOS_MIN = 20

#: A metric with fewer events than this in a planner says little about it.
_EVENTS_MIN = 10


def reservations(
    rows: Mapping[str, Any],
    variants: Sequence[str],
    table: Sequence[Mapping[str, Any]],
    differences: Sequence[Mapping[str, Any]],
    level: float,
) -> tuple[str, ...]:
    """One line each.

    Args:
        rows: Columns of the data set as arrays, with `variant`.
        variants: What is compared.
        table: Rows of the table.
        differences: Rows of the differences.
        level: Coverage of the intervals.
    """
    finished = rows["status"] == "finished"
    n_scenarios = len(set(rows["scenario_sha256"][finished]))
    said = [
        (
            f"The {n_scenarios} scenarios are those that were given, not a sample of traffic: nothing here is a rate "
            "per kilometre or hour on the road."
        )
    ]
    if len(variants) > 1:
        percent = f"{100 * level:g} %"
        said.append(
            f"Intervals ({percent}) say how far a difference depends on which of these scenarios were drawn; not how "
            "it depends on settings, predictor, vehicle model or goals that were derived from recordings."
        )
        whole = [row for row in differences if row["category"] == "all"]
        if whole:
            said.append(
                f"{len(whole)} differences over all categories are shown, and {len(differences) - len(whole)} within "
                f"categories: of {len(differences)} true zeros about {(1 - level) * len(differences):.0f} would have "
                "an interval without zero by chance."
            )
    if n_scenarios < _SCENARIOS_MIN:
        said.append(f"With fewer than {_SCENARIOS_MIN} scenarios the intervals are too narrow.")
    said += _of_failures(rows, variants)
    few = [
        f"{variant} {count}"
        for variant in variants
        if (count := int(((rows["variant"] == variant) & (rows["outcome"] == "collision")).sum())) < _EVENTS_MIN
    ]
    if few:
        said.append(
            f"Few collisions ({', '.join(few)}): a rate from so few events, and harm even more, hangs on single agents."
        )
    traffic = set(rows["traffic"])
    if "recorded" in traffic:
        said.append(
            "Recorded traffic does not react: it drives into an agent that is not where the recorded driver was, and "
            "such collisions are not all faults of the planner."
        )
    if "same" in traffic:
        said.append(
            "With traffic same, planners meet different traffic, namely themselves: a difference is one between "
            "worlds, not between drivers in the same world."
        )
    said += _of_measures(rows, table)
    return tuple(said)


def _of_failures(rows: Mapping[str, Any], variants: Sequence[str]) -> list[str]:
    lost = {}
    # What every planner was refused is no reservation about any of them.
    driven = set(rows["scenario_sha256"][rows["status"] == "finished"])
    possible = np.array([scenario in driven for scenario in rows["scenario_sha256"]], dtype=np.bool_)
    for variant in variants:
        mine = (rows["variant"] == variant) & (rows["status"] != "finished") & possible
        if mine.any():
            lost[variant] = len(set(rows["key"][mine]))
    if not lost:
        return []
    counts = ", ".join(f"{variant} {count}" for variant, count in lost.items())
    return [
        (
            f"Runs that did not finish are not in the rates ({counts}); differences leave the same agents out for "
            "both. Planners that fail on hard scenarios look better than they are."
        )
    ]


def _of_measures(rows: Mapping[str, Any], table: Sequence[Mapping[str, Any]]) -> list[str]:
    tested = rows["under_test"] == 1
    never = float(np.mean(np.isinf(rows["ttc_min"][tested]))) if tested.any() else 0.0
    said = [
        (
            f"The median of the smallest TTC counts agents without any conflict ({100 * never:.0f} %) as infinite. An "
            "agent that ends early, by a collision too, has less time for critical moments and jerk."
        ),
        (
            "Plan times are wall times on this machine with one thread per run; native planners share the time of a "
            "step equally."
        ),
    ]
    if any(row["planner_error"] > 0 for row in table):
        said.append("Agents whose planner broke (broken) are counted as agents; they may hide other outcomes.")
    return said
