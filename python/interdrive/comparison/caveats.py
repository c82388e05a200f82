"""Caveats of a comparison: some always apply, others depend on the data."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.comparison.intervals import LEVEL, PLACES_MIN, PLACES_SURE
from interdrive.comparison.metrics import METRICS
from interdrive.comparison.places import largest_share, place_of
from interdrive.comparison.variants import ALL, NOT_JUDGED, REPLAYED
from interdrive.run.reasons import said_count

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.comparison.variants import ComparedSet

_DIGITS = {metric.name: metric.digits for metric in METRICS}

#: A metric with fewer events than this in a planner says little about it.
_EVENTS_MIN = 10


def is_certain(row: Mapping[str, Any], level: float = LEVEL) -> bool:
    """A difference may be called one: it is of enough places, and its interval has a width and does not contain zero.

    Adjusted for all pairs of planners, it must be no chance either. Ends that tables print as zero are zero.

    Args:
        row: Of the differences, with `interdrive.comparison.compare.DIFFERENCE_COLUMNS`.
        level: Coverage of the intervals.
    """
    if not _is_enough(row) or not _has_width(row) or row["p"] is None or row["p"] >= 1.0 - level:
        return False
    low, high = (round(row[name], _DIGITS[row["metric"]]) for name in ("low", "high"))
    return bool(low > 0 or high < 0)


def _is_enough(row: Mapping[str, Any]) -> bool:
    return bool(row["n_places"] >= PLACES_SURE)


def _has_width(row: Mapping[str, Any]) -> bool:
    return row["low"] is not None and bool(row["low"] < row["high"])


def caveats(
    rows: Mapping[str, Any],
    sets: Sequence[ComparedSet],
    counted: Sequence[Mapping[str, Any]],
    differences: Sequence[Mapping[str, Any]],
    level: float,
    *,
    group: str = "place",
    no_humans: bool = False,
) -> tuple[str, ...]:
    """One line each.

    Args:
        rows: Columns of the data set as arrays, with `variant`.
        sets: What is compared.
        counted: Per set its rows, with `counts`.
        differences: Rows of the differences.
        level: Coverage of the intervals.
        group: What intervals draw together.
        no_humans: Rows of the planner `recorded` among reacting traffic were left out.
    """
    n_scenarios = len(set(rows["scenario_sha256"][rows["status"] == "finished"]))
    said = [
        (
            f"The scenarios ({n_scenarios}) were chosen, not sampled from traffic: no number here is a rate per "
            "kilometre or hour on the road."
        ),
        *_of_the_choice(rows, sets),
    ]
    said += _of_panels(rows)
    said += _of_groups(counted, group)
    said += _of_intervals([row for row in differences if row["n_scenarios"]], level, group)
    for one, here in zip(sets, counted, strict=True):
        said += _of_collisions(one, here, several=len(sets) > 1)
    if no_humans:
        said.append(f"{NOT_JUDGED[0].upper()}{NOT_JUDGED[1:]} and has no row there: {REPLAYED}.")
    traffic = {one.traffic for one in sets}
    if "recorded" in traffic:
        said.append(
            "Recorded traffic does not react: it drives into agents that are not where the recorded driver was, so not "
            "every collision is the planner's fault."
        )
    if "same" in traffic:
        said.append(
            "Where all vehicles have the planner under test, planners meet different traffic, namely themselves: "
            "differences are between worlds, not between drivers in the same world."
        )
    return (*said, *_of_measures(counted))


def _of_the_choice(rows: Mapping[str, Any], sets: Sequence[ComparedSet]) -> list[str]:
    """Which scenarios and agents are not in the numbers."""
    said = []
    driven = set(rows["scenario_sha256"][rows["status"] == "finished"])
    refused = set(rows["scenario_sha256"][rows["status"] == "refused"]) - driven
    if refused:
        scenarios = f"{len(refused)} scenario{'s' * (len(refused) != 1)}"
        said.append(f"Not among them: {scenarios} in which no vehicle could be under test.")
    # What every planner was refused is no caveat about any of them.
    possible = np.array([scenario in driven for scenario in rows["scenario_sha256"]], dtype=np.bool_)
    lost = {
        variant: len(set(rows["key"][mine]))
        for variant in sorted(set(rows["variant"]))
        if (mine := (rows["variant"] == variant) & (rows["status"] != "finished") & possible).any()
    }
    if lost:
        counts = ", ".join(f"{variant} {count}" for variant, count in lost.items())
        said.append(
            f"Runs that did not finish are not in the numbers ({counts}), and the same agents are left out for all "
            "planners. Planners that fail on hard scenarios look better than they are."
        )
    if any(any(one.left_out.values()) for one in sets):
        said.append(
            "Only agents that all planners drove are compared: if a planner lacks scenarios, all numbers cover just "
            "the scenarios that it has, which may not be typical. `--planner` leaves it out."
        )
    return said


def _of_panels(rows: Mapping[str, Any]) -> list[str]:
    """Against what agents were scored."""
    panels = sorted({str(name) for name in rows["panel"].tolist() if isinstance(name, str)})
    if panels == [""]:
        return ["Scores are absolute: no panel drove in the agents' places, so congestion and obedience cost pace."]
    if len(panels) > 1:
        told = " and ".join(name or "none" for name in panels)
        return [f"Scores are against different panels ({told}) and do not compare."]
    return []


def _of_groups(counted: Sequence[Mapping[str, Any]], group: str) -> list[str]:
    """What intervals draw together, and whether one of it decides."""
    found = np.concatenate([here["group"][here["counts"]] for here in counted])
    names = np.concatenate([here["scenario"][here["counts"]] for here in counted])
    roads = Counter(place for name in {*names.tolist()} if (place := place_of(str(name))))
    several = [place for place, count in roads.items() if count > 1]
    said = []
    if group != "place" and several:
        said.append(
            f"Of {len(several)} places there are several files, so intervals over {group}s are too narrow; "
            "`--group place` draws these files together."
        )
    name, share = largest_share(found)
    if share > 0.5 and len({*found.tolist()}) > 1:
        # A file whose name tells no place is known by its hash.
        which = names[found == name][0] if group != "agent" else name
        said.append(
            f"{100 * share:.0f} % of the compared agents are of one {group} ({which}), which decides the means."
        )
    return said


def _of_intervals(known: Sequence[Mapping[str, Any]], level: float, group: str) -> list[str]:
    """What intervals mean, of which differences they mean nothing, and how many are wrong by chance."""
    if not known:
        return []
    said = [
        (
            f"Intervals ({100 * level:g} %) show how much a difference depends on the drawn {group}s, not how it "
            "depends on settings, predictor, vehicle model or goals derived from recordings."
        )
    ]
    enough = [row for row in known if _is_enough(row)]
    if len(enough) < len(known):
        few = len(known) - len(enough)
        which = f"{few} of {len(known)} differences are" if enough else "All differences are"
        said.append(
            f"{which} over fewer than {PLACES_SURE} {group}s: their intervals are rough, with fewer than {PLACES_MIN} "
            "there is none, and none of these differences is called certain."
        )
    tested = [row for row in enough if _has_width(row)]
    if tested:
        n, whole = len(tested), sum(row["category"] == ALL for row in tested)
        wrong = f"{(1 - level) * n:.{0 if n >= 10 else 1}f}"
        said.append(
            f"{n} differences have an interval over {PLACES_SURE} or more {group}s ({whole} over all categories, "
            f"{n - whole} within categories): if all were truly zero, about {wrong} intervals or more would still "
            f"exclude zero by chance. Bold also asks for p < {1 - level:.2g} after Holm's adjustment for the "
            f"{said_count(len(_pairs(tested)), 'pair')} of planners; metrics are not adjusted for each other."
        )
    return said


def _pairs(rows: Sequence[Mapping[str, Any]]) -> set[tuple[str, str]]:
    return {(row["variant"], row["other"]) for row in rows}


def _of_collisions(one: ComparedSet, here: Mapping[str, Any], *, several: bool) -> list[str]:
    collided = here["counts"] & (here["outcome"] == "collision")
    few = [
        f"{variant} {count}"
        for variant in one.drivers
        if (count := int((collided & (here["variant"] == variant)).sum())) < _EVENTS_MIN
    ]
    if not few:
        return []
    where = f" with traffic {one.traffic}, agents {one.agents}" if several else ""
    return [
        (
            f"Few collisions{where} ({', '.join(few)}): a rate from few events, and harm even more, depends on "
            "single agents."
        )
    ]


def _of_measures(counted: Sequence[Mapping[str, Any]]) -> list[str]:
    ttc = np.concatenate([here["ttc_min"][here["counts"]] for here in counted])
    never = float(np.mean(np.isinf(ttc))) if len(ttc) else 0.0
    said = [
        (
            f"The median of the smallest TTC counts agents without any conflict ({100 * never:.0f} %) as infinite. An "
            "agent that ends early, by a collision too, has less time for critical moments and jerk."
        ),
        (
            "Plan times are wall times on this machine with one thread per run, at whatever load; native planners "
            "share the time of a step equally."
        ),
    ]
    if any((here["counts"] & (here["outcome"] == "planner_error")).any() for here in counted):
        said.append("Agents whose planner failed (broken) count as agents; they may hide other outcomes.")
    return said
