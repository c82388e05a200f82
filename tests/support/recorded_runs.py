"""Recorded traffic as runs, and runs as documents that are read again."""

import commonroad_documents as cr
import numpy as np

from interdrive.files import read_scenario, run_document
from interdrive.run import States
from interdrive.runs import Run


def run_of(scenario, *, first_time_step=0, participants=None):
    """A run in which all participants do what was recorded; `participants` replaces ids."""
    obstacles = scenario.obstacles
    steps = slice(first_time_step, None)
    ids = obstacles.ids if participants is None else np.array(participants)
    sizes = np.array([(shape.length or 1.0, shape.width or 1.0) for shape in obstacles.shapes]).reshape(-1, 2)
    names = ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate", "valid")
    states = States(
        participant_id=ids,
        kinds=obstacles.kinds,
        first_time_step=first_time_step,
        is_agent=~obstacles.is_static,
        is_static=obstacles.is_static,
        length=sizes[:, 0],
        width=sizes[:, 1],
        **{name: getattr(obstacles, name)[:, steps] for name in names},
    )
    return Run(scenario, {}, (), outcomes=None, states=states, plans=None, timings=None, notes=(), digest="")


def written(run, folder):
    """The run's document, read again."""
    return read_scenario(cr.saved(folder, run_document(run), "written.xml"))
