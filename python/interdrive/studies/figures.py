"""The figures of a case study: profiles over time and scenes with time stamps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.plots.profiles import Profile, draw_profiles
from interdrive.plots.scenes import Scene, draw_scenes
from interdrive.plots.style import pair_colors
from interdrive.studies.lateral import lateral_offsets
from interdrive.studies.measures import collided, distance_of_closest_encounter, footprint_distances

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from interdrive.runs import Run
    from interdrive.studies.result import CaseStudy


def profile_figure(study: CaseStudy) -> Figure:
    """Lateral position and velocity of both vehicles of a `study` over time, the degrees overlaid.

    Lateral positions are those in the frame of the lane that the other vehicle is to follow: signed distances to the
    reference path of its route in the interactive run, positive to the left. They are nan beyond the ends of that path.
    """
    profiles = {
        degree.replace("_", "-"): [_profile(study, run, number) for number in (study.agent, study.other)]
        for degree, run in study.runs.items()
    }
    colors = pair_colors(list(study.runs.values()), (study.agent, study.other))
    titles = dict(zip((f"agent {study.agent}", f"other vehicle {study.other}"), colors, strict=True))
    return draw_profiles(profiles, titles, f"lateral position\nin lane of {study.other} [m]")


def nearest_step(study: CaseStudy, run: Run) -> int | None:
    """Column of the run's states at which the two are nearest to each other; the first one of several."""
    distances = footprint_distances(run, study.agent, study.other)
    return int(np.nanargmin(distances)) if np.isfinite(distances).any() else None


def _profile(study: CaseStudy, run: Run, number: int) -> Profile:
    states = run.states
    row = int(np.searchsorted(states.participant_id, number))
    path = next(agent.reference_path for agent in study.runs["interactive"].agents if agent.id == study.other)
    position = np.stack([states.x[row], states.y[row]], axis=1)
    ended = dict(zip(run.outcomes.agent_id.tolist(), run.outcomes.outcome, strict=True))
    return Profile(
        time=np.arange(states.first_time_step, states.first_time_step + states.n_steps, dtype=np.float64)
        * run.scenario.dt,
        lateral=lateral_offsets(path, position),
        velocity=np.where(states.valid[row], states.velocity[row], np.nan),
        nearest=nearest_step(study, run),
        outcome=ended.get(number, ""),
    )


def scene_figure(study: CaseStudy) -> Figure:
    """Footprints of both vehicles of a `study` with time stamps over the road, one panel per degree."""
    scenes = [Scene(run, _title(study, degree, run), nearest_step(study, run)) for degree, run in study.runs.items()]
    names = (f"agent {study.agent}", f"other vehicle {study.other}")
    return draw_scenes(scenes, (study.agent, study.other), names)


def _title(study: CaseStudy, degree: str, run: Run) -> str:
    name, nearest = degree.replace("_", "-"), nearest_step(study, run)
    if nearest is None:
        return name
    if collided(run, study.agent, study.other):
        return f"{name}: collision"
    return f"{name}: min. DCE {distance_of_closest_encounter(run, study.agent, study.other):.2f} m"
