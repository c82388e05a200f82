"""Recordings of highways and junctions by drones: highD, inD, rounD, exiD, uniD; three tables each."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError
from interdrive.files.sources.model import Lane, Roads, Source, Tracks
from interdrive.files.sources.neutral import WORDS, tracks_of
from interdrive.files.sources.notes import Notes
from interdrive.files.sources.recorded import kinds_of
from interdrive.scenario.limits import LARGEST_COORDINATE
from interdrive.storage.foreign_tables import ForeignTable, foreign_table, header_of

if TYPE_CHECKING:
    from interdrive.array_types import Floats
    from interdrive.files.sources.opening import SourceFile
    from interdrive.scenario import SourceOptions

_FILE = re.compile(r"(\d+)_(tracks|tracksMeta|recordingMeta)\.csv")
#: Columns that tell the tables.
_COLUMNS = (
    {"frame", "id", "xVelocity", "laneId"},
    {"trackId", "frame", "xCenter", "yCenter"},
    {"initialFrame", "finalFrame", "numFrames", "class"},
    {"frameRate", "locationId", "speedLimit"},
)
_PARTS = ("tracks", "tracksMeta", "recordingMeta")
#: Sizes of what these projects state as 0 x 0 [m]; others have those of their kinds.
_SIZES = {"bicycle": (2.0, 0.7)}
#: The map that is made of the markings of highD ends this far [m] beyond the recorded vehicles.
_BEYOND = 50.0


def fits(file: SourceFile) -> bool:
    """Whether the table has columns of these projects, or the folder their files."""
    if file.is_folder:
        return bool(_recordings(file))
    header = set(header_of(file.data))
    return any(columns <= header for columns in _COLUMNS) or bool(_FILE.fullmatch(file.path.name) and header)


def read(file: SourceFile, _: SourceOptions) -> Source:
    """Reads the three tables of a recording."""
    found = _FILE.fullmatch(file.path.name)
    if found is None and not file.is_folder:
        raise InputError(f"{file.path}: call it NN_tracks.csv, beside NN_tracksMeta.csv and NN_recordingMeta.csv")
    recordings = _recordings(file) if found is None else [found[1]]
    if len(recordings) > 1:
        listed = ", ".join(recordings[:5])
        raise InputError(f"{file.path}: holds {len(recordings)} recordings ({listed}); give a file of one")
    folder = file.path if file.is_folder else file.path.parent
    tables = {}
    for part in _PARTS:
        name = f"{recordings[0]}_{part}.csv"
        if not file.names(name):
            raise InputError(f"{folder / name}: is not beside {file.path.name}; put it there")
        data = file.data if name == file.path.name else file.beside(name)
        tables[part] = foreign_table(data, str(folder / name))
    notes, meta = Notes(), tables["recordingMeta"]
    rate = _only_number(meta, "frameRate")
    if not 0.0 < rate <= 1000.0:
        raise InputError(f"{meta.file}: the frameRate is {rate:g}; it must be above 0 and at most 1000")
    is_highd = "upperLaneMarkings" in meta.names
    tracks = _tracks(tables["tracks"], tables["tracksMeta"], rate, notes, is_highd=is_highd)
    if is_highd:
        return Source(_carriageways(meta, tracks), tracks, notes)
    origin = (_only_number(meta, "xUtmOrigin"), _only_number(meta, "yUtmOrigin"))
    return Source(None, tracks, notes, map_options={"projection": "utm", "utm_origin": origin})


def _recordings(file: SourceFile) -> list[str]:
    return sorted({found[1] for name in file.names("*.csv") if (found := _FILE.fullmatch(name))})


def _only_number(table: ForeignTable, name: str) -> float:
    table.require((name,))
    values = table.numbers(name)
    if len(values) != 1 or not abs(values[0]) <= LARGEST_COORDINATE:
        raise InputError(f"{table.file}: the column {name} must have one number, at most {LARGEST_COORDINATE:g}")
    return float(values[0])


def _tracks(table: ForeignTable, meta: ForeignTable, rate: float, notes: Notes, *, is_highd: bool) -> Tracks:
    key, place = ("id", ("x", "y")) if is_highd else ("trackId", ("xCenter", "yCenter"))
    # In highD the box is called width x height, its first side along the road.
    sizes = ("width", "height") if is_highd else ("length", "width")
    table.require((key, "frame", *place, "xVelocity", "yVelocity", *(() if is_highd else ("heading",))))
    meta.require((key, "class", *sizes))
    names, track = table.words(key)
    known, of_row = meta.words(key)
    row_of = {known[index]: row for row, index in enumerate(of_row.tolist())}
    for name in names:
        if name not in row_of:
            raise InputError(f"{meta.file}: has no row for track {name[:20]}")
    rows = np.array([row_of[name] for name in names], dtype=np.int64)
    words, classes = meta.words("class")
    kinds = kinds_of([words[classes[row]] for row in rows.tolist()], WORDS, notes)
    lengths, widths = (meta.numbers(name)[rows] for name in sizes)
    x, y, vx, vy = (table.numbers(name) for name in (*place, "xVelocity", "yVelocity"))
    if is_highd:
        x, y, vy = x + 0.5 * lengths[track], -(y + 0.5 * widths[track]), -vy
        heading = np.where(vx >= 0.0, 0.0, np.pi)
    else:
        heading = np.radians(table.numbers("heading"))
        for row, kind in enumerate(kinds):
            if not (lengths[row] > 0.0 and widths[row] > 0.0):
                lengths[row], widths[row] = _SIZES.get(kind, (np.nan, np.nan))
    columns = {
        "time_s": (table.numbers("frame") - (1.0 if is_highd else 0.0)) / rate,
        "x": x,
        "y": y,
        "heading": heading,
        "speed": vx * np.cos(heading) + vy * np.sin(heading),
        "length": lengths[track],
        "width": widths[track],
    }
    return tracks_of(names, kinds, track, columns)


def _carriageways(meta: ForeignTable, tracks: Tracks) -> Roads:
    """Lanes between the markings of highD, whose y points down; those of the upper ones run towards smaller x."""
    limit = _only_number(meta, "speedLimit") if "speedLimit" in meta.names else -1.0
    x = tracks.x[np.isfinite(tracks.x)]
    low, high = (float(x.min()) - _BEYOND, float(x.max()) + _BEYOND) if len(x) else (0.0, 0.0)
    roads = Roads([], left_hand=False)
    for name, ends in (("upperLaneMarkings", (high, low)), ("lowerLaneMarkings", (low, high))):
        lines = _markings(meta, name)
        y = (-lines)[::-1] if ends[0] > ends[1] else -lines  # from left to right in driving direction
        first = len(roads.lanes)
        for index in range(len(y) - 1):
            left, right = (np.column_stack((ends, np.full(2, side))) for side in (y[index], y[index + 1]))
            lane = Lane(f"{name}/{index + 1}", left, right, kind="highway")
            lane.speed_limit = limit if limit > 0.0 else float("nan")
            lane.left_line = "dashed" if index else "solid"
            lane.right_line = "dashed" if index < len(y) - 2 else "solid"
            lane.left_neighbour = (first + index - 1, True) if index else None
            lane.right_neighbour = (first + index + 1, True) if index < len(y) - 2 else None
            roads.lanes.append(lane)
    return roads


def _markings(meta: ForeignTable, name: str) -> Floats:
    meta.require((name,))
    texts, rows = meta.words(name)
    try:
        lines = sorted(float(number) for number in texts[rows[0]].split(";") if number.strip())
    except ValueError:
        lines = [float("nan")]
    if not np.isfinite(lines).all():
        raise InputError(f"{meta.file}: the column {name} has a value that is no number; correct it")
    return np.array(lines, dtype=np.float64)
