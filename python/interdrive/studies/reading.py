"""A study in words: what happened, without why."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.run.goals import said_time
from interdrive.studies.lateral import lateral_offsets
from interdrive.studies.measures import collided, footprint_distances

if TYPE_CHECKING:
    from interdrive.runs import Run
    from interdrive.studies.result import CaseStudy

#: Sideways deviations below this are not worth a word [m].
_WORTH_TELLING = 0.1
#: If lowest speeds differ by less than this, neither is called slow [m/s].
_WORTH_TELLING_SPEED = 0.5


def reading(study: CaseStudy) -> str:
    """One paragraph of facts about the encounter of a `study` in every degree."""
    sentences = [
        f"{degree.replace('_', '-').capitalize()}: {_encounter(study, run)}{_reaction(study, run)}."
        for degree, run in study.runs.items()
    ]
    return f"{study.scenario.name}, agent {study.agent} and vehicle {study.other}. " + " ".join(sentences)


def _encounter(study: CaseStudy, run: Run) -> str:
    """How near they came to each other, when, and which was ahead on the way there."""
    if collided(run, study.agent, study.other):
        row = run.outcomes.agent_id.tolist().index(study.agent)
        at = said_time(run, int(run.outcomes.time_step[row]))
        return f"they collide at {at} s with {run.outcomes.impact_speed[row]:.1f} m/s"
    distances = footprint_distances(run, study.agent, study.other)
    if not np.isfinite(distances).any():
        return "they are never there at the same time"
    nearest = int(np.nanargmin(distances))
    when = said_time(run, run.states.first_time_step + nearest)
    return f"they come to {distances[nearest]:.2f} m of each other, at {when} s"


def _reaction(study: CaseStudy, run: Run) -> str:
    """What the other vehicle does compared with its recording."""
    states, obstacles = run.states, run.scenario.obstacles
    row = int(np.searchsorted(states.participant_id, study.other))
    if not states.is_agent[row]:
        return ""
    recorded = int(np.searchsorted(obstacles.ids, study.other))
    path = np.stack([obstacles.x[recorded], obstacles.y[recorded]], axis=1)[obstacles.valid[recorded]]
    driven = np.stack([states.x[row], states.y[row]], axis=1)[states.valid[row]]
    aside = np.abs(lateral_offsets(path, driven))
    slowest, recorded_slowest = (
        float(np.nanmin(np.abs(speed))) for speed in (states.velocity[row], obstacles.velocity[recorded])
    )
    text = f"; vehicle {study.other} {_slowness(slowest, recorded_slowest)}"
    if np.nanmax(aside, initial=0.0) > _WORTH_TELLING:
        text += f" and drives up to {np.nanmax(aside):.1f} m beside its recorded path"
    return text


def _slowness(slowest: float, recorded: float) -> str:
    """The lowest speed beside the recorded one [m/s]: only a lower one says that the vehicle reacts by slowing."""
    stops = slowest < _core.JUDGED_STANDSTILL_SPEED
    if f"{slowest:.1f}" == f"{recorded:.1f}" or (stops and recorded < _core.JUDGED_STANDSTILL_SPEED):
        return "stops, as in its recording" if stops else f"drives at least {slowest:.1f} m/s, as in its recording"
    if slowest - recorded > _WORTH_TELLING_SPEED:
        text = f"does not slow below {slowest:.1f} m/s"
    elif recorded - slowest > _WORTH_TELLING_SPEED:
        text = "stops" if stops else f"slows to {slowest:.1f} m/s"
    else:
        text = f"drives at least {slowest:.1f} m/s"
    return f"{text} (recorded: {recorded:.1f} m/s)"
