"""Neutral tracks and lanes: tables of Parquet or CSV with a few named columns, which any script can write."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError
from interdrive.files.sources.model import Lane, Roads, Source, Tracks
from interdrive.files.sources.notes import Notes
from interdrive.files.sources.recorded import kinds_of
from interdrive.storage.foreign_tables import ForeignTable, foreign_table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.array_types import Floats, Ints
    from interdrive.files.sources.opening import SourceFile
    from interdrive.scenario import SourceOptions

#: Words of recordings for kinds; those of `KINDS` mean themselves.
WORDS = {
    **{"vehicle": "car", "van": "car", "truck_bus": "truck", "trailer": "truck", "tricycle": "motorcycle"},
    **{"cyclist": "bicycle", "motorcyclist": "motorcycle", "person": "pedestrian"},
}
_TRACKS = ("track_id", "time_s", "x", "y")
_LANES, _LINKS = ("lane_id", "side", "point", "x", "y"), ("lane_id", "relation", "other_id")
#: Table of links beside one of lanes.
LANES, LINKS = "lanes", "links"


def read(file: SourceFile, _: SourceOptions) -> Source:
    """Reads tracks, or lanes with their links."""
    table = foreign_table(file.data, str(file.path))
    notes = Notes()
    if "side" in table.names:
        return Source(roads_of(table, links_beside(file, file.path.name)), notes=notes)
    table.require(_TRACKS)
    if not len(table):
        raise InputError(f"{file.path}: has no rows")
    names, track = table.words("track_id")
    kinds: tuple[str, ...] = ("car",) * len(names)
    if "kind" in table.names:
        words, of_row = table.words("kind")
        kinds = kinds_of([words[of_row[row]] for row in first_rows(track, len(names)).tolist()], WORDS, notes)
    columns = {name: table.numbers(name) for name in ("time_s", "x", "y", "heading", "speed", "length", "width")}
    return Source(None, tracks_of(names, kinds, track, columns), notes)


def tracks_of(
    names: Sequence[str], kinds: Sequence[str], track: Ints, columns: Mapping[str, Floats], dt: float = 0.1
) -> Tracks:
    """Tracks of columns by row: time_s, x, y, heading, speed, length, width; sizes are those of the first rows."""
    first = first_rows(track, len(names))
    return Tracks(
        names=tuple(names),
        kinds=tuple(kinds),
        length=columns["length"][first],
        width=columns["width"][first],
        is_round=tuple(kind == "pedestrian" for kind in kinds),
        is_static=(False,) * len(names),
        track=track,
        time=columns["time_s"],
        x=columns["x"],
        y=columns["y"],
        heading=columns["heading"],
        speed=columns["speed"],
        dt=dt,
    )


def first_rows(track: Ints, n: int) -> Ints:
    """First row of each of n tracks, which all have one."""
    found = np.zeros(n, dtype=np.int64)
    found[track[::-1]] = np.arange(len(track))[::-1]
    return found


# Lanes


def links_beside(file: SourceFile, name: str) -> ForeignTable | None:
    """The table of links beside one of lanes, with the same ending; None where there is none."""
    other = name.replace(LANES, LINKS)
    if other == name or not file.names(other):
        return None
    return foreign_table(file.beside(other), str(file.path.with_name(other)))


def roads_of(lanes: ForeignTable, links: ForeignTable | None) -> Roads:
    """Roads of a table of border points and one of links.

    Args:
        lanes: Columns `lane_id`, `side` (left or right, in driving direction), `point` (order), `x`, `y` [m].
        links: Columns `lane_id`, `relation` (successor, left, right, left_opposite, right_opposite), `other_id`.

    Raises:
        InputError: A column is missing, a lane lacks a side, or a link leads nowhere; one line.
    """
    lanes.require(_LANES)
    names, lane = lanes.words("lane_id")
    sides, side = lanes.words("side")
    wrong = [one for one in sides if one not in ("left", "right")]
    if wrong:
        raise InputError(f"{lanes.file}: the side {wrong[0][:20]!r} is neither left nor right; correct it")
    is_left = np.array([one == "left" for one in sides], dtype=np.bool_)[side]
    point, x, y = (lanes.numbers(name) for name in ("point", "x", "y"))
    if not (np.isfinite(point) & np.isfinite(x) & np.isfinite(y)).all():
        raise InputError(f"{lanes.file}: a point, x or y is not a finite number; correct it")
    order = np.lexsort((point, is_left, lane))
    places = np.column_stack((x, y))[order]
    counts = np.bincount(2 * lane + is_left, minlength=2 * len(names))
    ends = np.cumsum(counts)
    found = []
    for index, name in enumerate(names):
        right, left = (places[ends[k] - counts[k] : ends[k]] for k in (2 * index, 2 * index + 1))
        if len(left) != len(right) or len(left) < 2:
            raise InputError(
                f"{lanes.file}: lane {name[:20]} has {len(left)} left and {len(right)} right points;"
                " give both sides equally many, at least 2"
            )
        found.append(Lane(name, left, right))
    roads = Roads(found)
    if links is not None:
        _add_links(roads, links)
    return roads


def _add_links(roads: Roads, links: ForeignTable) -> None:
    links.require(_LINKS)
    position = {lane.key: index for index, lane in enumerate(roads.lanes)}
    columns = [(words, rows.tolist()) for words, rows in (links.words(name) for name in _LINKS)]
    for row in range(len(links)):
        one, relation, other = (words[rows[row]] for words, rows in columns)
        for name in (one, other):
            if name not in position:
                raise InputError(f"{links.file}: has the lane {name[:20]}, which is not among the lanes; correct it")
        here, there = position[one], position[other]
        same = not relation.endswith("_opposite")
        if relation == "successor":
            roads.links.append((here, there))
        elif relation in ("left", "left_opposite"):
            roads.lanes[here].left_neighbour = (there, same)
        elif relation in ("right", "right_opposite"):
            roads.lanes[here].right_neighbour = (there, same)
        else:
            known = "successor, left, right, left_opposite, right_opposite"
            raise InputError(f"{links.file}: the relation {relation[:20]!r} is none of {known}; correct it")
