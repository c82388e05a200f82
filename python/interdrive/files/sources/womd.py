"""Scenes of the Waymo Open Motion Dataset in JSON, as GPUDrive and PufferDrive have them: centre lines and tracks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import InputError
from interdrive.files.sources.centre_lines import CentreLine, lanes_of
from interdrive.files.sources.json_documents import json_object, numbers_of, points_of
from interdrive.files.sources.model import Source, Tracks
from interdrive.files.sources.notes import Notes
from interdrive.files.sources.womd_control import DT, crosswalks_of, lights_of, signs_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.array_types import Floats
    from interdrive.files.sources.model import Roads
    from interdrive.files.sources.opening import SourceFile
    from interdrive.scenario import SourceOptions

#: Types of lanes by `map_element_id`: undefined, freeway, surface street; bicycle lanes on demand.
_LANES, _BIKE = {0: "urban", 1: "highway", 2: "urban"}, 3
_KINDS = {"vehicle": "car", "pedestrian": "pedestrian", "cyclist": "bicycle"}
#: Vehicles from this length [m] on are lorries.
_LORRY = 7.0
#: The id of an object is this plus its position in the file.
_FIRST_ID = 100_000


def read(file: SourceFile, options: SourceOptions) -> Source:
    """Reads map and tracks of a scene."""
    name, notes = str(file.path), Notes()
    document = json_object(file.data, name)
    parts = _objects(document, "roads", name)
    roads = _roads(parts, options, notes, name)
    roads.signs = signs_of(roads, parts, notes)
    roads.lights = lights_of(roads, document.get("tl_states"), notes)
    roads.lanes += crosswalks_of(parts, notes)
    tracks = _tracks(_objects(document, "objects", name), notes)
    _say_who(document.get("metadata"), len(document["objects"]), notes)
    return Source(roads, tracks, notes)


def _objects(document: Mapping[str, Any], name: str, file: str) -> list[dict[str, Any]]:
    found = document.get(name)
    if not isinstance(found, list) or not all(isinstance(one, dict) for one in found):
        raise InputError(f"{file}: {name} is no list of objects; give a scene of the Waymo Open Motion Dataset")
    return found


def _roads(roads: Sequence[Mapping[str, Any]], options: SourceOptions, notes: Notes, file: str) -> Roads:
    lines, edges = [], []
    for position, road in enumerate(roads):
        kind = road.get("type")
        if kind in ("crosswalk", "stop_sign"):
            continue
        if kind not in ("lane", "road_edge"):
            notes.leave_out("parts of the map", str(kind)[:30].replace("_", " "))
            continue
        points = points_of(road.get("geometry"))
        if kind == "road_edge":
            edges.append(points)
            continue
        element = road.get("map_element_id")
        element = element if isinstance(element, int) else 0
        if element not in _LANES and not (element == _BIKE and "bike" in options.keep):
            notes.leave_out("lanes", "bike" if element == _BIKE else f"type {element}"[:30])
        elif len(points) < 2:
            notes.name("lanes with fewer than two points left out", road.get("id", position))
        else:
            key = str(road.get("id", position))[:50]
            lines.append(CentreLine(key, points, _LANES.get(element, "bicycleLane")))
    return lanes_of(lines, edges, file, notes)


def _tracks(objects: Sequence[Mapping[str, Any]], notes: Notes) -> Tracks:
    kinds, sizes, numbers = [], [], []
    parts: list[Floats] = []
    for position, one in enumerate(objects):
        table = _states(one)
        if not len(table):
            notes.leave_out("objects", "never valid")
            continue
        length, width = (_first(one.get(name)) for name in ("length", "width"))
        kind = _KINDS.get(str(one.get("type")), "unknown")
        kinds.append("truck" if kind == "car" and length >= _LORRY else kind)
        sizes.append((length, length if kind == "pedestrian" else width))
        parts.append(np.column_stack((np.full(len(table), len(parts)), table)))
        numbers.append(str(_FIRST_ID + position))
    table = np.concatenate(parts) if parts else np.zeros((0, 6))
    lengths, widths = np.array(sizes, dtype=np.float64).reshape(-1, 2).T
    track, step, x, y, heading, speed = table.T
    return Tracks(
        names=tuple(numbers),
        kinds=tuple(kinds),
        length=lengths,
        width=widths,
        is_round=tuple(kind == "pedestrian" for kind in kinds),
        is_static=(False,) * len(kinds),
        track=track.astype(np.int64),
        time=step * DT,
        x=x,
        y=y,
        heading=heading,
        speed=speed,
        dt=DT,
    )


def _states(one: Mapping[str, Any]) -> Floats:
    """Rows of step, x, y, heading and speed where an object is there."""
    valid, headings = one.get("valid"), one.get("heading")
    position, velocity = (numbers_of(one.get(name), ("x", "y")) for name in ("position", "velocity"))
    if not isinstance(valid, list):
        return np.zeros((0, 5))
    heading = numbers_of([{"heading": value} for value in headings] if isinstance(headings, list) else [], ("heading",))
    n = min(len(valid), len(position))
    # Sources that lack a heading or velocity at the end have it derived.
    heading, velocity = (_padded(table, n) for table in (heading, velocity))
    is_there = np.array([value in (True, 1) for value in valid[:n]], dtype=np.bool_)
    angle = heading[:, 0]
    speed = velocity[:, 0] * np.cos(angle) + velocity[:, 1] * np.sin(angle)
    return np.column_stack((np.arange(n, dtype=np.float64), position[:n], angle, speed))[is_there]


def _padded(table: Floats, n: int) -> Floats:
    missing = np.full((max(n - len(table), 0), table.shape[1]), np.nan)
    found = np.concatenate((table[:n], missing))
    found[~np.isfinite(found)] = np.nan
    return found


def _first(value: object) -> float:
    """A size [m], or the first one of a list with one for each state."""
    one = next((each for each in value if each), None) if isinstance(value, list) else value
    return float(one) if isinstance(one, int | float) and 0.0 < one < 1e6 else float("nan")


def _say_who(metadata: object, n_objects: int, notes: Notes) -> None:
    if not isinstance(metadata, dict):
        return
    sdc, chosen = metadata.get("sdc_track_index"), metadata.get("tracks_to_predict")
    parts = []
    if isinstance(sdc, int) and 0 <= sdc < n_objects:
        parts.append(f"the recording vehicle is {_FIRST_ID + sdc}")
    wanted = [one.get("track_index") for one in chosen if isinstance(one, dict)] if isinstance(chosen, list) else []
    numbers = [str(_FIRST_ID + one) for one in wanted if isinstance(one, int) and 0 <= one < n_objects]
    if numbers:
        parts.append(f"tracks to predict are {', '.join(sorted(numbers)[:10])}{' ...' if len(numbers) > 10 else ''}")
    if parts:
        notes.say("; ".join(parts))
