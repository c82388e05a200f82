"""Crossing ways: partner, time, and how far it still is: against the definitions written out."""

from __future__ import annotations

import numpy as np
import pytest
from conflict_definitions import Conflicts, crossing_connectors, stated_connectors
from definitions import Definitions

from interdrive.criticality import CriticalitySettings, evaluate


@pytest.mark.parametrize("areas", ["stated", "crossing"])
def test_conflict_areas_and_who_is_there_when_are_as_defined(recorded, measured, areas):
    settings = CriticalitySettings(conflict_areas=areas)
    n, n_vehicles, largest, wrong = dict.fromkeys(("et", "pet", "psd"), 0), 0, 0.0, []
    for scenario in recorded:
        found = evaluate(scenario, settings=settings)
        definitions = Definitions(scenario, oncoming_filter=False)
        if not all(outline.is_valid for outline in definitions.outlines):
            continue
        connectors = stated_connectors(scenario) if areas == "stated" else crossing_connectors(definitions)
        conflicts = Conflicts(definitions, connectors)
        for place, number in enumerate(found.participant_id.tolist() if connectors else []):
            n_vehicles += 1
            row = int(np.searchsorted(scenario.obstacles.ids, number))
            expected = conflicts.encroachment(row)
            for name in ("et", "pet"):
                ours, theirs = found.extremes[name].value[place], getattr(expected, name)
                n[name] += bool(np.isfinite(theirs))
                if not np.isclose(ours, theirs, rtol=0.0, atol=1e-9, equal_nan=True):
                    wrong.append((scenario.name, number, name, ours, theirs))
            present = found.present[place]
            remaining, stopping = expected.remaining[present], scenario.obstacles.velocity[row, present] ** 2 / 23.0
            with np.errstate(divide="ignore", invalid="ignore"):
                theirs = np.where(remaining == 0.0, 0.0, np.where(stopping == 0.0, np.inf, remaining / stopping))
            ours = found["psd"][place, present]
            both = np.isfinite(ours) & np.isfinite(theirs)
            n["psd"] += int(both.sum())
            if not np.array_equal(np.isfinite(ours), np.isfinite(theirs)):
                wrong.append((scenario.name, number, "psd", ours, theirs))
            if both.any():
                deviation = np.abs(ours[both] - theirs[both]) / np.maximum(1.0, theirs[both])
                largest = max(largest, float(deviation.max()))
    remark = f"{n_vehicles} vehicles, {n['et']} et, {n['pet']} pet"
    measured(
        f"{areas} conflict areas: definition, different verdicts", n["et"] + n["pet"], len(wrong), 0, "", remark, wrong
    )
    measured(f"psd, {areas} conflict areas: definition", n["psd"], largest, 1e-9, "", remark)
