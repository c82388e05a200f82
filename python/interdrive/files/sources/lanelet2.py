"""Lanelet2 maps (.osm): lanelets between two borders that other lanelets share."""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError
from interdrive.files.sources.lanelet2_rules import Place, add_rules
from interdrive.files.sources.model import Lane, Roads, Source
from interdrive.files.sources.notes import Notes
from interdrive.files.sources.pairing import paired
from interdrive.files.sources.polylines import distinct
from interdrive.files.sources.projection import central_meridian, transverse_mercator, utm

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from xml.etree.ElementTree import Element

    from interdrive.array_types import Floats
    from interdrive.files.sources.opening import SourceFile
    from interdrive.scenario import SourceOptions

#: Subtypes of lanelets that vehicles drive on, and CommonRoad's types of them.
_ROADS = {
    **{"": "urban", "road": "urban", "main_road": "urban", "play_street": "urban"},
    **{"highway": "highway", "exit": "exitRamp"},
    "crosswalk": "crosswalk",
}
_CROSSWALK = "crosswalk"
#: Those that are read on demand: the word of the option, and the type.
_ON_DEMAND = {
    "bus_lane": ("bus", "busLane"),
    "bicycle_lane": ("bike", "bicycleLane"),
    "emergency_lane": ("shoulder", "shoulder"),
    "parking": ("parking", "parking"),
}
_LINES = {
    **{"solid": "solid", "dashed": "dashed", "solid_solid": "solid_solid", "dashed_dashed": "dashed_dashed"},
    **{"solid_dashed": "solid_dashed", "dashed_solid": "dashed_solid"},
}
_TURNED = {"solid_dashed": "dashed_solid", "dashed_solid": "solid_dashed"}
_SPEED = re.compile(r"\s*(\d{1,4}(?:\.\d{1,6})?)\s*(km/?h|kmph|kph|mph|m/s|mps)?\s*", re.IGNORECASE)
_UNITS = {"mph": 0.44704, "m/s": 1.0, "mps": 1.0}


@dataclass(frozen=True)
class _Way:
    nodes: tuple[str, ...]
    tags: dict[str, str]


@dataclass(frozen=True)
class _Border:
    """One side of a lanelet in driving direction: its nodes, their places [m], the line along it."""

    nodes: tuple[str, ...]
    places: Floats
    line: str


def read(file: SourceFile, options: SourceOptions) -> Source:
    """Reads the lanelets of a map."""
    root, notes = file.document(), Notes()
    relations = [one for one in root.iter("relation") if one.get("action") != "delete"]
    if not any(_tags(one).get("type") == "lanelet" for one in relations):
        raise InputError(f"{file.path}: is an OpenStreetMap file without lanelets; only Lanelet2 maps are read")
    places, location = _places(root, options, notes, str(file.path))
    ways = {
        key: _Way(tuple(one.get("ref", "") for one in way.iter("nd")), _tags(way))
        for key, way in _by_id(root.iter("way"), "ways", str(file.path)).items()
    }
    limits = _limits_by_sign(relations)
    lanes, borders, crossed = [], [], []
    elements = _by_id(relations, "relations", str(file.path))
    for key, relation in elements.items():
        tags = _tags(relation)
        if tags.get("type") != "lanelet":
            continue
        kind = _kind(tags.get("subtype", ""), options, notes)
        sides = _borders(relation, ways, places) if kind else None
        if kind and sides is None:
            notes.name("lanelets without one left and one right border left out", key)
        if not kind or sides is None:
            continue
        if tags.get("one_way") == "no" and kind != _CROSSWALK:
            notes.name("lanelets for both directions, read in the one in which they are drawn", key)
        left, right = paired(sides[0].places, sides[1].places)
        if kind == _CROSSWALK:
            crossed.append(Lane(key, left, right, kind=kind))
            continue
        lanes.append(Lane(key, left, right, _limit(tags, relation, limits), sides[0].line, sides[1].line, kind))
        borders.append(sides)
    _add_neighbours(lanes, borders)
    roads = Roads([*lanes, *crossed], _links(borders), location=location)
    add_rules(roads, elements, _rule_ways(ways, places), notes)
    return Source(roads, notes=notes)


def _tags(element: Element) -> dict[str, str]:
    return {tag.get("k", ""): tag.get("v", "") for tag in element.iter("tag")}


def _by_id(elements: Iterable[Element], what: str, file: str) -> dict[str, Element]:
    found: dict[str, Element] = {}
    for element in elements:
        key = element.get("id", "")
        if element.get("action") == "delete" or not key:
            continue
        if key in found:
            raise InputError(f"{file}: two {what} have the id {key[:30]}; give each its own")
        found[key] = element
    return found


# Places


def _places(
    root: Element, options: SourceOptions, notes: Notes, file: str
) -> tuple[dict[str, tuple[float, float]], str]:
    """Places of the nodes [m], and the projection as a PROJ string."""
    nodes = _by_id(root.iter("node"), "nodes", file)
    local = {key: _tags(node) for key, node in nodes.items()} if options.projection in (None, "local") else {}
    has_local = bool(local) and all("local_x" in tags and "local_y" in tags for tags in local.values())
    if options.projection == "local" and not has_local:
        raise InputError(f"{file}: not every node has local_x and local_y; choose --projection tm or utm")
    pairs = {
        key: (local[key]["local_x"], local[key]["local_y"]) if has_local else (node.get("lat"), node.get("lon"))
        for key, node in nodes.items()
    }
    keys, numbers = [], []
    for key, pair in pairs.items():
        numeric = _numbers(pair)
        if numeric is None or (not has_local and not (abs(numeric[0]) <= 90.0 and abs(numeric[1]) <= 360.0)):
            notes.name("nodes without a place left out", key)
        else:
            keys.append(key)
            numbers.append(numeric)
    if not numbers:
        return {}, ""
    table, location = np.array(numbers), ""
    if not has_local:
        table, location = _projected(table, options, notes)
    return {key: (x, y) for key, (x, y) in zip(keys, table.tolist(), strict=True)}, location


def _numbers(pair: tuple[str | None, str | None]) -> tuple[float, float] | None:
    try:
        first, second = (float(text or "") for text in pair)
    except ValueError:
        return None
    return (first, second) if np.isfinite(first) and np.isfinite(second) else None


def _projected(table: Floats, options: SourceOptions, notes: Notes) -> tuple[Floats, str]:
    latitude, longitude = table.T
    origin = options.origin or (float(latitude[0]), float(longitude[0]))
    with np.errstate(all="ignore"):  # places on the other side of the earth are refused by their coordinates
        if options.projection != "utm":
            notes.say(f"projected by transverse Mercator about latitude {origin[0]:.8f}, longitude {origin[1]:.8f}")
            found = transverse_mercator(latitude, longitude, origin)
            location = f"+proj=tmerc +lat_0={origin[0]!r} +lon_0={origin[1]!r} +k=1 +datum=WGS84"
        else:
            found = utm(latitude, longitude, origin)
            if options.utm_origin is not None:
                at = np.array(options.utm_origin)
                notes.say(f"projected by UTM, minus ({at[0]:.4f}, {at[1]:.4f}) m")
            else:
                at = utm(np.array([origin[0]]), np.array([origin[1]]), origin)[0]
                notes.say(f"projected by UTM about latitude {origin[0]:.8f}, longitude {origin[1]:.8f}")
            found = found - at
            location = (
                f"+proj=tmerc +lat_0=0 +lon_0={central_meridian(origin):g} +k=0.9996"
                f" +x_0={500_000.0 - at[0]!r} +y_0={(10_000_000.0 if origin[0] < 0.0 else 0.0) - at[1]!r} +datum=WGS84"
            )
    return found, location


# Borders


def _borders(
    relation: Element, ways: dict[str, _Way], places: dict[str, tuple[float, float]]
) -> tuple[_Border, _Border] | None:
    """Left and right border in driving direction; None unless each is one chain of ways with known nodes."""
    found = []
    for role in ("left", "right"):
        refs = [one.get("ref", "") for one in relation.iter("member") if one.get("role") == role]
        chain = _chain([ways[ref] for ref in refs]) if all(ref in ways for ref in refs) else None
        if chain is None or not all(node in places for node, _ in chain):
            return None
        nodes, points = [node for node, _ in chain], np.array([places[node] for node, _ in chain])
        lines = {line for _, line in chain[1:]}
        found.append(_Border(tuple(nodes), points, lines.pop() if len(lines) == 1 else "unknown"))
    left, right = found
    a, b = left.places, right.places
    if _apart(a[0], b[0]) + _apart(a[-1], b[-1]) > _apart(a[0], b[-1]) + _apart(a[-1], b[0]):
        right = _turned(right)
    if not _is_left(left.places, right.places):
        left, right = _turned(left), _turned(right)
    left, right = (replace(one, places=one.places[distinct(one.places)]) for one in (left, right))
    return (left, right) if min(len(left.places), len(right.places)) > 1 else None


def _chain(ways: Sequence[_Way]) -> list[tuple[str, str]] | None:
    """Nodes of ways that meet at their ends, in a row, each with the line that leads to it; None: they do not meet."""
    parts = [[(node, _line(way.tags)) for node in way.nodes] for way in ways if way.nodes]
    if not parts:
        return None
    chain, rest = parts[0], parts[1:]
    while rest:
        for index, part in enumerate(rest):
            joined = _joined(chain, part)
            if joined is not None:
                chain = joined
                del rest[index]
                break
        else:
            return None
    return chain


def _joined(chain: list[tuple[str, str]], part: list[tuple[str, str]]) -> list[tuple[str, str]] | None:
    turned = [(node, _TURNED.get(line, line)) for node, line in reversed(part)]
    for one in (part, turned):
        if chain[-1][0] == one[0][0]:
            return chain + one[1:]
        if chain[0][0] == one[-1][0]:
            return one + chain[1:]
    return None


def _line(tags: dict[str, str]) -> str:
    """CommonRoad's name of the line that a way is."""
    kind, subtype = tags.get("type", ""), tags.get("subtype", "")
    if kind == "line_thin":
        return _LINES.get(subtype, "unknown")
    if kind == "line_thick":
        return {"solid": "broad_solid", "dashed": "broad_dashed"}.get(subtype, _LINES.get(subtype, "unknown"))
    if kind == "curbstone":
        return "lowered_curb" if subtype == "low" else "curb"
    return {"road_border": "curb", "virtual": "no_marking"}.get(kind, "unknown")


def _turned(border: _Border) -> _Border:
    return _Border(border.nodes[::-1], border.places[::-1], _TURNED.get(border.line, border.line))


def _apart(one: Floats, other: Floats) -> float:
    return float(np.hypot(*(one - other)))


def _is_left(left: Floats, right: Floats) -> bool:
    """Whether the first border is on the left of the second: their outline then runs clockwise."""
    x, y = (np.concatenate((left, right[::-1])) - left[0]).T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) <= 0.0


# Relations


def _links(borders: Sequence[tuple[_Border, _Border]]) -> list[tuple[int, int]]:
    """Pairs of lanelets of which the second begins at the nodes where the first ends."""
    begins = defaultdict(list)
    for index, (left, right) in enumerate(borders):
        begins[left.nodes[0], right.nodes[0]].append(index)
    return [
        (index, after)
        for index, (left, right) in enumerate(borders)
        for after in begins.get((left.nodes[-1], right.nodes[-1]), ())
        if after != index
    ]


def _add_neighbours(lanes: Sequence[Lane], borders: Sequence[tuple[_Border, _Border]]) -> None:
    """Neighbours share the nodes of a border: those in the same direction come first."""
    by_left, by_right = defaultdict(list), defaultdict(list)
    for index, (left, right) in enumerate(borders):
        by_left[left.nodes].append(index)
        by_right[right.nodes].append(index)
    for index, (lane, (left, right)) in enumerate(zip(lanes, borders, strict=True)):
        for side, same, opposite in (
            ("left", by_right[left.nodes], by_left[left.nodes[::-1]]),
            ("right", by_left[right.nodes], by_right[right.nodes[::-1]]),
        ):
            known = [(one, True) for one in same if one != index] + [(one, False) for one in opposite if one != index]
            if known:
                setattr(lane, f"{side}_neighbour", known[0])


def _kind(subtype: str, options: SourceOptions, notes: Notes) -> str:
    """CommonRoad's type of a lanelet; empty: it is left out."""
    word, kind = _ON_DEMAND.get(subtype, ("", ""))
    if subtype in _ROADS or word in options.keep:
        return _ROADS.get(subtype, kind)
    notes.leave_out("lanes", subtype[:30])
    return ""


def _rule_ways(ways: dict[str, _Way], places: dict[str, tuple[float, float]]) -> dict[str, Place]:
    """Ways that can be stop lines, signs and lights."""
    found = {}
    for key, way in ways.items():
        kind = way.tags.get("type", "")
        points = np.array([places[node] for node in way.nodes if node in places])
        if kind in ("stop_line", "traffic_sign", "traffic_light") and len(points) > 1:
            found[key] = Place(kind, way.tags.get("subtype", ""), points, way.tags.get("name", "").strip()[:50])
    return found


def _limits_by_sign(relations: Iterable[Element]) -> dict[str, float]:
    """Limits [m/s] of regulatory elements by id; nan where none can be read."""
    found = {}
    for relation in relations:
        tags = _tags(relation)
        if tags.get("type") == "regulatory_element" and tags.get("subtype") == "speed_limit":
            found[relation.get("id", "")] = _speed(tags.get("sign_type", ""))
    return found


def _limit(tags: dict[str, str], relation: Element, signs: dict[str, float]) -> float:
    stated = [signs[ref] for one in relation.iter("member") if (ref := one.get("ref", "")) in signs]
    usable = [limit for limit in stated if np.isfinite(limit)]
    return min(usable) if usable else _speed(tags.get("speed_limit", ""))


def _speed(text: str) -> float:
    """Metres per second of "50", "50 km/h", "50kmh", "30 mph" or "8.33 m/s"; nan for anything else."""
    found = _SPEED.fullmatch(text)
    if found is None or not float(found[1]) > 0.0:
        return float("nan")
    return float(found[1]) * _UNITS.get((found[2] or "").lower(), 1.0 / 3.6)
