"""Recordings of INTERACTION and SinD: a row for each participant and time, vehicles and pedestrians apart."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import InputError
from interdrive.files.sources.model import Source, Tracks
from interdrive.files.sources.neutral import WORDS, first_rows, tracks_of
from interdrive.files.sources.notes import Notes
from interdrive.files.sources.recorded import kinds_of
from interdrive.files.sources.sind_lights import light_states
from interdrive.storage.foreign_tables import ForeignTable, foreign_table, header_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Floats, Ints
    from interdrive.files.sources.opening import SourceFile
    from interdrive.scenario import SourceOptions

_COLUMNS = ("track_id", "timestamp_ms", "agent_type", "x", "y")
_FILE = re.compile(r"(vehicle|pedestrian)_tracks_(\w+)\.csv", re.IGNORECASE)
#: Tables of vehicles and of pedestrians of SinD.
_SIND = ("Veh_smoothed_tracks.csv", "Ped_smoothed_tracks.csv")
#: What INTERACTION calls pedestrians and cyclists alike; those faster than this on average [m/s] are cyclists.
_WALKS_OR_RIDES, _RIDES = "pedestrian/bicycle", 2.5
#: Headings of bodies come before those of the motion.
_HEADINGS = ("psi_rad", "yaw_rad", "heading_rad")


def fits(file: SourceFile) -> bool:
    """Whether the table has the columns of these projects, or the folder has their files."""
    if file.is_folder:
        return bool(_recordings(file))
    return set(_COLUMNS) <= set(header_of(file.data))


def read(file: SourceFile, options: SourceOptions) -> Source:
    """Reads the table and, where there is one, that of the other participants of the same recording."""
    notes = Notes()
    if file.is_folder:
        recordings = _recordings(file)
        if len(recordings) > 1:
            listed = ", ".join(list(recordings)[:5])
            raise InputError(f"{file.path}: holds {len(recordings)} recordings ({listed}); give a file of one")
        names = next(iter(recordings.values()))
        parts = [(name, file.beside(name)) for name in names]
        folder = file.path
    else:
        folder = file.path.parent
        parts = [(file.path.name, file.data), *((name, file.beside(name)) for name in _others(file))]
    tracks = [_tracks(foreign_table(data, str(folder / name)), options.case, notes) for name, data in parts]
    found = tracks[0] if len(tracks) == 1 else _together(tracks)
    states = light_states(file, notes) if any(name in _SIND for name, _ in parts) else {}
    at_zero = {"projection": "utm", "origin": (0.0, 0.0)}
    return Source(None, found, notes, map_options=at_zero, light_states=states)


def _recordings(file: SourceFile) -> dict[str, list[str]]:
    """Names of files by recording; vehicles come first."""
    found: dict[str, list[str]] = {}
    for name in sorted(file.names("*.csv"), reverse=True):
        match = _FILE.fullmatch(name)
        if match or name in _SIND:
            found.setdefault(match[2] if match else "SinD", []).append(name)
    return found


def _others(file: SourceFile) -> list[str]:
    """Tables of the other participants of the same recording."""
    return [
        name
        for names in _recordings(file).values()
        if file.path.name in names
        for name in names
        if name != file.path.name
    ]


def _tracks(table: ForeignTable, case: int | None, notes: Notes) -> Tracks:
    table.require(_COLUMNS)
    names, track = table.words("track_id")
    words, kind = table.words("agent_type")
    columns = {name: table.numbers(name) for name in ("x", "y", "vx", "vy", "length", "width")}
    columns["time_s"] = 1e-3 * table.numbers("timestamp_ms")
    stated = [name for name in _HEADINGS if name in table.names]
    columns["heading"] = table.numbers(stated[0]) if stated else np.full(len(table), np.nan)
    if "case_id" in table.names and len(table):
        rows = _rows_of_case(table, case)
        kept, track = np.unique(track[rows], return_inverse=True)
        names = tuple(names[index] for index in kept.tolist())
        columns, kind = {name: column[rows] for name, column in columns.items()}, kind[rows]
    vx, vy, heading = columns.pop("vx"), columns.pop("vy"), columns["heading"]
    columns["speed"] = np.where(np.isnan(heading), np.hypot(vx, vy), vx * np.cos(heading) + vy * np.sin(heading))
    called = [words[kind[row]] for row in first_rows(track, len(names)).tolist()]
    kinds = kinds_of(_walking_or_riding(called, track, np.hypot(vx, vy)), WORDS, notes)
    return tracks_of(names, kinds, track, columns)


def _rows_of_case(table: ForeignTable, case: int | None) -> Ints:
    cases = table.numbers("case_id")
    known = np.unique(cases[np.isfinite(cases)])
    chosen = float(known[0]) if case is None and len(known) else float("nan") if case is None else float(case)
    rows = np.flatnonzero(cases == chosen)
    if not len(rows):
        listed = ", ".join(f"{one:g}" for one in known[:5])
        raise InputError(f"{table.file}: has no case {chosen:g} (found: {listed}); choose another with --case")
    return rows


def _walking_or_riding(words: Sequence[str], track: Ints, speed: Floats) -> list[str]:
    """Words of kinds, where the one for pedestrians and cyclists is decided by the mean speed."""
    counts = np.bincount(track, minlength=len(words))
    means = np.bincount(track, weights=np.nan_to_num(speed), minlength=len(words)) / np.maximum(counts, 1)
    return [
        word if word.strip().lower() != _WALKS_OR_RIDES else "bicycle" if mean > _RIDES else "pedestrian"
        for word, mean in zip(words, means.tolist(), strict=True)
    ]


def _together(parts: Sequence[Tracks]) -> Tracks:
    """Tracks of vehicles and pedestrians; a pedestrian's name that is a vehicle's, too, gets a word before it."""
    first, second = parts
    taken = set(first.names)
    columns: dict[str, Any] = {
        name: np.concatenate((getattr(first, name), getattr(second, name)))
        for name in ("length", "width", "time", "x", "y", "heading", "speed")
    }
    return replace(
        first,
        names=(*first.names, *(f"pedestrian {name}" if name in taken else name for name in second.names)),
        kinds=first.kinds + second.kinds,
        is_round=first.is_round + second.is_round,
        is_static=first.is_static + second.is_static,
        track=np.concatenate((first.track, second.track + len(first.names))),
        **columns,
    )
