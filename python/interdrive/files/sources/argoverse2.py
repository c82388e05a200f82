"""Scenarios of the Argoverse 2 motion forecasting data set: a folder with tracks and a map, or the map alone."""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import InputError
from interdrive.files.sources.json_documents import json_object, points_of
from interdrive.files.sources.model import Lane, Roads, Source, Tracks
from interdrive.files.sources.notes import Notes
from interdrive.files.sources.pairing import paired
from interdrive.storage.foreign_tables import foreign_table

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.array_types import Floats
    from interdrive.files.sources.opening import SourceFile
    from interdrive.scenario import SourceOptions

_TRACKS, _MAP = "scenario_*.parquet", "log_map_archive_*.json"
_KINDS = {
    **{"vehicle": "car", "bus": "bus", "motorcyclist": "motorcycle", "pedestrian": "pedestrian"},
    **{"cyclist": "bicycle", "riderless_bicycle": "bicycle"},
}
_LINES = {
    **{"NONE": "no_marking", "SOLID": "solid", "DASHED": "dashed", "SOLID_DASH": "solid_dashed"},
    **{"DASH_SOLID": "dashed_solid", "DOUBLE_SOLID": "solid_solid", "DOUBLE_DASH": "dashed_dashed"},
}
_LANES = {"VEHICLE": "urban", "BUS": "busLane"}
_COLUMNS = (
    *("track_id", "object_type", "timestep", "position_x", "position_y", "heading", "velocity_x", "velocity_y"),
    "focal_track_id",
)
#: Time between steps [s].
_DT = 0.1
#: Tracks are numbered from here on.
_FIRST_ID = 10_001
_AV = "AV"


def read(file: SourceFile, options: SourceOptions) -> Source:
    """Reads the map and, in a folder, the tracks."""
    notes = Notes()
    if not file.is_folder:
        return Source(_roads(json_object(file.data, str(file.path)), options, notes, str(file.path)), notes=notes)
    names = {pattern: file.names(pattern) for pattern in (_TRACKS, _MAP)}
    for pattern, found in names.items():
        if len(found) > 1:
            raise InputError(f"{file.path}: holds {len(found)} files {pattern}; give a folder with one scenario")
    map_file, table_file = (str(file.path / names[pattern][0]) for pattern in (_MAP, _TRACKS))
    roads = _roads(json_object(file.beside(names[_MAP][0]), map_file), options, notes, map_file)
    return Source(roads, _tracks(file.beside(names[_TRACKS][0]), table_file, notes), notes)


# The map


def _roads(document: Mapping[str, Any], options: SourceOptions, notes: Notes, file: str) -> Roads:
    segments = document.get("lane_segments")
    if not isinstance(segments, dict):
        raise InputError(f"{file}: has no lane_segments; give the map of a scenario")
    kept: dict[int, dict[str, Any]] = {}
    for key, segment in segments.items():
        number = segment.get("id") if isinstance(segment, dict) else None
        kind = str(segment.get("lane_type"))[:30] if isinstance(segment, dict) else "broken"
        if isinstance(number, bool) or not isinstance(number, int):
            notes.name("lane segments without an id left out", str(key)[:30])
        elif kind in _LANES or (kind == "BIKE" and "bike" in options.keep):
            kept[number] = segment
        else:
            notes.leave_out("lanes", kind)
    borders = {}
    for number in sorted(kept):
        sides = [points_of(kept[number].get(f"{side}_lane_boundary")) for side in ("left", "right")]
        if min(map(len, sides)) < 2:
            notes.name("lane segments without two borders left out", number)
        else:
            borders[number] = (sides[0], sides[1])
    position = {number: index for index, number in enumerate(borders)}
    roads = Roads([], left_hand=False, location=str(document.get("city_name") or ""))
    for number, (left, right) in borders.items():
        segment = kept[number]
        lane = Lane(
            str(number),
            *paired(left, right),
            left_line=_line(segment.get("left_lane_mark_type")),
            right_line=_line(segment.get("right_lane_mark_type")),
            kind=_LANES.get(segment["lane_type"], "bicycleLane"),
        )
        for side in ("left", "right"):
            other = segment.get(f"{side}_neighbor_id")
            if other in position and other != number:
                same = float((left[-1] - left[0]) @ (borders[other][0][-1] - borders[other][0][0])) > 0.0
                setattr(lane, f"{side}_neighbour", (position[other], same))
        roads.lanes.append(lane)
    roads.links = _links({number: kept[number] for number in borders}, position)
    roads.lanes += _crosswalks(document.get("pedestrian_crossings"), notes)
    return roads


def _crosswalks(crossings: object, notes: Notes) -> list[Lane]:
    """Crosswalks between their two edges."""
    found = []
    for key, one in crossings.items() if isinstance(crossings, dict) else ():
        edges = [points_of(one.get(name) if isinstance(one, dict) else None) for name in ("edge1", "edge2")]
        if min(map(len, edges)) < 2:
            notes.name("crosswalks without two edges left out", str(key)[:30])
            continue
        left, right = edges
        if float((left[-1] - left[0]) @ (right[-1] - right[0])) < 0.0:
            right = right[::-1]
        ahead, across = left[-1] - left[0], right[0] - left[0]
        if float(ahead[0] * across[1] - ahead[1] * across[0]) > 0.0:
            left, right = right, left
        found.append(Lane(f"crosswalk {str(key)[:30]}", *paired(left, right), kind="crosswalk"))
    return found


def _links(segments: Mapping[int, Mapping[str, Any]], position: Mapping[int, int]) -> list[tuple[int, int]]:
    """Links that either of both lanes states."""
    found: dict[tuple[int, int], None] = {}
    for number, segment in segments.items():
        for name in ("predecessors", "successors"):
            others = segment.get(name)
            for other in others if isinstance(others, list) else ():
                if isinstance(other, int) and other in position:
                    pair = (number, other) if name == "successors" else (other, number)
                    found[position[pair[0]], position[pair[1]]] = None
    return list(found)


def _line(mark: object) -> str:
    """CommonRoad's name of a line; colours are not kept."""
    return _LINES.get(str(mark).removesuffix("_WHITE").removesuffix("_YELLOW").removesuffix("_BLUE"), "unknown")


# Tracks


def _tracks(data: bytes, file: str, notes: Notes) -> Tracks:
    table = foreign_table(data, file, _COLUMNS)
    table.require(_COLUMNS[:-1])
    names, track = table.words("track_id")
    words, kind_of_row = table.words("object_type")
    # A track has the kind of its first row, and those without one that takes part in traffic are left out.
    first = np.full(len(names), -1)
    first[track[::-1]] = kind_of_row[::-1]
    kinds = [_KINDS.get(words[index], "") for index in first.tolist()]
    left_out = Counter(words[index] for index, kind in zip(first.tolist(), kinds, strict=True) if not kind)
    for word, count in left_out.items():
        notes.leave_out("tracks", word[:30] or "without a kind", count)
    order = sorted((row for row, kind in enumerate(kinds) if kind), key=lambda row: (names[row] != _AV, names[row]))
    number = np.full(len(names), -1)
    number[order] = np.arange(len(order))
    ids = {names[row]: _FIRST_ID + index for index, row in enumerate(order)}
    _say_who(ids, table.words("focal_track_id")[0] if "focal_track_id" in table.names else (), notes)
    kept = number[track] >= 0
    x, y, heading, vx, vy, step = (
        table.numbers(name)[kept]
        for name in ("position_x", "position_y", "heading", "velocity_x", "velocity_y", "timestep")
    )
    unknown: Floats = np.full(len(order), math.nan)
    return Tracks(
        names=tuple(str(ids[names[row]]) for row in order),
        kinds=tuple(kinds[row] for row in order),
        length=unknown,
        width=unknown,
        is_round=tuple(kinds[row] == "pedestrian" for row in order),
        is_static=(False,) * len(order),
        track=number[track][kept],
        time=step * _DT,
        x=x,
        y=y,
        heading=heading,
        speed=vx * np.cos(heading) + vy * np.sin(heading),
        dt=_DT,
    )


def _say_who(ids: Mapping[str, int], focal: tuple[str, ...], notes: Notes) -> None:
    """Says which ids the recording vehicle and the vehicle to be predicted have."""
    named = [("AV", _AV), *(("focal track", name) for name in focal[:1])]
    known = [f"{word} is {ids[name]}" for word, name in named if name in ids]
    if known:
        notes.say(", ".join(known))
