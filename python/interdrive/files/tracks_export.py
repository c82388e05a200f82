"""Runs as neutral tracks: a table with one row for each participant and time, as `read_source` reads it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.storage.foreign_tables import csv_table

if TYPE_CHECKING:
    from interdrive.run import RunRecord


def run_tracks(run: RunRecord) -> bytes:
    """All participants of a run as CSV, rows by id and time, numbers with all their digits.

    Columns: `track_id`, `time_s`, centre `x` and `y` [m], `heading` [rad], `speed` along it [m/s], `length` and `width`
    of the footprint [m], `kind` as in `interdrive.scenario.KINDS`. Time 0 is time step 0 of the scenario.
    """
    states = run.states
    rows, steps = np.nonzero(states.valid)
    columns = {
        "track_id": states.participant_id[rows],
        "time_s": (steps + states.first_time_step) * run.scenario.dt,
        "x": states.x[rows, steps],
        "y": states.y[rows, steps],
        "heading": states.orientation[rows, steps],
        "speed": states.velocity[rows, steps],
        "length": states.length[rows],
        "width": states.width[rows],
        "kind": np.array(states.kinds, dtype=object)[rows],
    }
    return csv_table(columns)
