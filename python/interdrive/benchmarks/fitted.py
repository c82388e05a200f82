"""Drivers of a benchmark that were fitted on places of its set: there they know what they are asked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from interdrive.batches.plan import choices
from interdrive.config.specs import read_planner
from interdrive.planners import PlannerSettings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.benchmarks.sets import SetFile
    from interdrive.config.specs import PlannerSpecs


def fitted_notes(planner: PlannerSpecs, files: Sequence[SetFile]) -> tuple[str, ...]:
    """One line per planner whose drivers were fitted on a place that is driven.

    Args:
        planner: Planners, as `interdrive.benchmark` takes them.
        files: What is driven.
    """
    notes = []
    for label, one in choices(planner, "planner").items():
        drivers = read_planner(one, PlannerSettings()).drivers
        known = () if drivers is None else drivers.fitted_on
        own = [file for file in files if _is_of(file, known)]
        if own:
            places = ", ".join(sorted({file.place for file in own}))
            notes.append(
                f"{label} was fitted on {places} ({len(own)} of {len(files)} files): scores there are no test of it"
            )
    return tuple(notes)


def _is_of(file: SetFile, maps: Sequence[str]) -> bool:
    """Whether a file is of one of the maps, which are named by country and place, such as USA_US101."""
    if file.passage is not None:
        return file.passage.recording in {name.partition("_")[2] for name in maps}
    return file.name.removeprefix("C-").partition("-")[0] in maps
