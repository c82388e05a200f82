"""Participants ahead, those that count, and what follows, on real roads: against the definitions written out."""

from __future__ import annotations

import numpy as np
import pytest
from definitions import Definitions

from interdrive.criticality import CriticalitySettings, evaluate

#: So many moments of each scenario are compared.
MOMENTS = 16
#: Allowed relative to the value where that is above 1.
RELATIVE = 1e-8
#: Of distances [m], also where coordinates have seven digits.
DISTANCE = 2e-8
#: Beyond this it is a matter of rounding whether two vehicles of the same speed ever meet [s].
NEVER = 1e6
NAMES = ("hw", "thw", "ttc", "a_long_req", "a_lat_req")


def ever(name: str, value: float) -> float:
    return np.inf if name == "ttc" and value > NEVER else value


@pytest.mark.parametrize("oncoming_filter", [True, False])
def test_who_is_ahead_and_who_counts_is_as_defined(recorded, measured, oncoming_filter):
    rng = np.random.default_rng(8)
    settings = CriticalitySettings(oncoming_filter=oncoming_filter)
    largest, finite, wrong = dict.fromkeys(NAMES, 0.0), dict.fromkeys(NAMES, 0), []
    n_distances, largest_distance, n_scenarios, n_skipped = 0, 0.0, 0, 0
    for scenario in recorded:
        found = evaluate(scenario, settings=settings)
        rows, columns = np.nonzero(found.present)
        picked = rng.choice(len(rows), min(MOMENTS, len(rows)), replace=False)
        definitions = Definitions(scenario, oncoming_filter=oncoming_filter)
        n_scenarios += bool(len(picked))
        for row, k in zip(rows[picked].tolist(), columns[picked].tolist(), strict=True):
            expected = definitions.moment(int(np.searchsorted(scenario.obstacles.ids, found.participant_id[row])), k)
            if expected is None:
                n_skipped += 1
                continue
            case = (scenario.name, int(found.participant_id[row]), k)
            for name in NAMES:
                ours, theirs = (ever(name, value) for value in (found[name][row, k], getattr(expected, name)))
                if not np.isfinite([ours, theirs]).all():
                    if not np.array_equal(ours, theirs, equal_nan=True):
                        wrong.append((*case, name, ours, theirs))
                    continue
                finite[name] += 1
                deviation = abs(ours - theirs) / max(1.0, abs(theirs))
                largest[name] = max(largest[name], deviation)
                if deviation > RELATIVE:
                    wrong.append((*case, name, ours, theirs))
            # The distance of the closest encounter is at most that of now, and equal at the encounter.
            if found["ttce"][row, k] == 0.0 or found["dce"][row, k] > expected.distance:
                n_distances += 1
                deviation = abs(found["dce"][row, k] - expected.distance)
                largest_distance = max(largest_distance, deviation)
                if deviation > DISTANCE:
                    wrong.append((*case, "dce", found["dce"][row, k], expected.distance))
    assert n_scenarios >= 0.3 * len(recorded)
    rule = "with" if oncoming_filter else "without"
    remark = f"{n_scenarios} scenarios, {n_skipped} moments left out"
    for name in NAMES:
        measured(f"{name}: definition, {rule} oncoming rule", finite[name], largest[name], RELATIVE, "", remark, wrong)
    what = f"dce at the encounter: definition, {rule} oncoming rule"
    measured(what, n_distances, largest_distance, DISTANCE, "m", remark, wrong)
    measured(
        f"definition, {rule} oncoming rule: different verdicts", sum(finite.values()), len(wrong), 0, "", "", wrong
    )
