"""What is repaired, or noted, whenever a file is read."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from interdrive.recordings.headings import heading_offset, turned
from interdrive.recordings.overlaps import overlapping
from interdrive.scenario.native import storeys

if TYPE_CHECKING:
    from interdrive.scenario import Scenario

#: How the note about overlapping recordings begins.
OVERLAP = "recordings overlap; "

#: Pairs that a note names.
_PAIRS_NAMED = 5


def repaired(scenario: Scenario) -> Scenario:
    """A scenario whose headings are turned if they are off by one angle, and whose overlapping recordings are listed.

    Args:
        scenario: As the file has it.

    Returns:
        The scenario; `notes` has a line for each finding, `overlaps` the pairs.
    """
    offset = heading_offset([scenario.obstacles])
    return with_overlaps(turned(scenario, offset) if offset.is_constant else scenario)


def with_overlaps(scenario: Scenario) -> Scenario:
    """The scenario with the pairs of recorded participants that are in each other."""
    pairs = overlapping(scenario.obstacles, scenario.dt)
    if pairs and (road := storeys(scenario)) is not None:
        pairs = overlapping(scenario.obstacles, scenario.dt, road)
    if not pairs:
        return scenario
    named = ", ".join(f"{first} and {second}" for first, second in pairs[:_PAIRS_NAMED])
    more = f" and {len(pairs) - _PAIRS_NAMED} more" if len(pairs) > _PAIRS_NAMED else ""
    note = f"{OVERLAP}they take part, but their contacts are no collisions: {named}{more}"
    return replace(scenario, overlaps=pairs, notes=(*scenario.notes, note))
