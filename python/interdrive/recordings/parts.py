"""Parts of recordings: some of their time steps, with those who are there then."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from interdrive.recordings.repair import OVERLAP, with_overlaps

if TYPE_CHECKING:
    from interdrive.scenario import Scenario


def part_of(scenario: Scenario, first: int, end: int) -> Scenario:
    """The recording between two time steps, with those who are there; the new time steps begin at 0.

    Args:
        scenario: The recording; its planning problems are left out.
        first: First time step.
        end: One more than the last one.
    """
    obstacles = scenario.obstacles
    rows = np.flatnonzero(obstacles.valid[:, first:end].any(axis=1))
    return replace(
        scenario,
        planning_problems=(),
        obstacles=obstacles.only(rows, slice(first, end)),
        traffic_lights=tuple(replace(light, offset=light.offset - first) for light in scenario.traffic_lights),
    )


def with_own_overlaps(part: Scenario) -> Scenario:
    """A part with the pairs that overlap in it, in place of those of the whole; unchanged if recordings are raw."""
    if part.raw:
        return part
    notes = tuple(note for note in part.notes if not note.startswith(OVERLAP))
    return with_overlaps(replace(part, overlaps=(), notes=notes))
