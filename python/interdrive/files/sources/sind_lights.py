"""Traffic lights of SinD: a table with a row for each change and a column for each light, named as the map names it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from interdrive.files.sources.model import LightStates
from interdrive.storage.foreign_tables import foreign_table

if TYPE_CHECKING:
    from interdrive.array_types import Floats
    from interdrive.files.sources.notes import Notes
    from interdrive.files.sources.opening import SourceFile
    from interdrive.scenario import Signal

#: Names of the tables, and of their columns for times and for the lights of vehicles.
_FILES, _TIME = "Traffic*Light*.csv", "timestamp(ms)"
_COLUMN = re.compile(r"(?:vehicle )?(traffic light \w+)", re.IGNORECASE)
_SIGNALS: dict[float, Signal] = {0.0: "red", 1.0: "green", 3.0: "yellow"}


def light_states(file: SourceFile, notes: Notes) -> dict[str, LightStates]:
    """What the lights beside a recording show, by their labels on the map ("Traffic light 4").

    In the cities of SinD drivers may turn right on red (Format.md of the data set).

    Args:
        file: The recording, or its folder.
        notes: Lights for pedestrians, and tables of which there are several, are named.

    Raises:
        InputError: The table lacks the times, or has a cell that is no number; one line.
    """
    names = file.names(_FILES)
    if len(names) != 1:
        for name in names:
            notes.name("several tables of traffic lights beside the recording, of which none is read", name)
        return {}
    folder = file.path if file.is_folder else file.path.parent
    table = foreign_table(file.beside(names[0]), str(folder / names[0]))
    table.require((_TIME,))
    time = 1e-3 * table.numbers(_TIME)
    order = np.argsort(time, kind="stable")
    found: dict[str, LightStates] = {}
    for column in table.names:
        match = _COLUMN.fullmatch(column.strip())
        if match is None:
            if "light" in column.lower():
                notes.leave_out("traffic lights", "pedestrian" if "pedestrian" in column.lower() else "unknown")
            continue
        states = _states(time[order], table.numbers(column)[order])
        if states is not None:
            found[match[1].capitalize()] = states
    return found


def _states(time: Floats, codes: Floats) -> LightStates | None:
    """Phases from the first known state on, which holds before it, too; None: none is known."""
    known = [
        (at, signal)
        for at, code in zip(time.tolist(), codes.tolist(), strict=True)
        if np.isfinite(at) and (signal := _SIGNALS.get(code)) is not None
    ]
    changes = [pair for place, pair in enumerate(known) if not place or pair[1] != known[place - 1][1]]
    if not changes:
        return None
    times = [at for at, _ in changes]
    # The last state lasts, however long it is said to be.
    lengths = [*np.diff(times).tolist(), 1.0]
    phases = tuple((signal, length) for (_, signal), length in zip(changes, lengths, strict=True))
    return LightStates(times[0], phases, turns_on_red=True)
