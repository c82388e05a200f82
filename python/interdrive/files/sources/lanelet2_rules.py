"""What the regulatory elements of Lanelet2 maps say: traffic lights, stop and yield signs, with their lines."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.files.sources.model import DARK, Light, Roads, Sign
from interdrive.scenario.signs import KIND_BY_NUMBER

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from xml.etree.ElementTree import Element

    from interdrive.array_types import Floats
    from interdrive.files.sources.model import Lane
    from interdrive.files.sources.notes import Notes
    from interdrive.scenario.signs import SignKind

#: Signs by the words of maps that name no country's number.
_WORDS: dict[str, SignKind] = {"stop_sign": "stop", "stop": "stop", "yield": "yield", "give_way": "yield"}
_COUNTRY = re.compile(r"(de|us|jp|fr|uk|gb)(?=[0-9r])", re.IGNORECASE)
#: A lane that no element names ends this near to its line [m], and heads across it by this cosine at most.
_AT_LINE, _ALONG_LINE = 4.0, 0.6
#: Subtypes of the elements that are read.
_RULES = ("traffic_light", "right_of_way", "all_way_stop", "traffic_sign")


@dataclass(frozen=True)
class Place:
    """A way that a rule names: its type and subtype, its points [m], and its own name."""

    kind: str
    subtype: str
    points: Floats
    name: str = ""


def add_rules(
    roads: Roads,
    relations: Mapping[str, Element],
    ways: Mapping[str, Place],
    notes: Notes,
) -> None:
    """Adds the signs and lights of regulatory elements to lanes, whose keys are the ids of their relations.

    Args:
        roads: Lanes and links.
        relations: All relations by id.
        ways: Ways that can be lines, signs and lights, by id.
        notes: What has no place or no cycle is counted.
    """
    places = {lane.key: place for place, lane in enumerate(roads.lanes)}
    before: dict[int, list[int]] = {}
    for start, end in roads.links:
        before.setdefault(end, []).append(start)
    users: dict[str, list[int]] = {}
    for key, place in places.items():
        for member in relations[key].iter("member"):
            if member.get("role") == "regulatory_element":
                users.setdefault(member.get("ref", ""), []).append(place)
    named: set[str] = set()
    for key, relation in relations.items():
        tags = {tag.get("k", ""): tag.get("v", "") for tag in relation.iter("tag")}
        rule = tags.get("subtype", "")
        if tags.get("type") != "regulatory_element" or rule not in _RULES:
            continue
        members = [(one.get("role", ""), one.get("ref", "")) for one in relation.iter("member")]
        lines = [ways[ref].points for role, ref in members if role == "ref_line" and ref in ways]
        signs = [ways[ref] for role, ref in members if role == "refers" and ref in ways]
        named |= {ref for role, ref in members if role == "ref_line"}
        obliged = [places[ref] for role, ref in members if role == "yield" and ref in places]
        lanes = obliged if rule == "right_of_way" else obliged or users.get(key, []) or _at_lines(roads.lanes, lines)
        if not lanes:
            notes.leave_out("regulatory elements of no lane that is read", rule.replace("_", " "))
            continue
        for lane in lanes:
            line = _nearest(lines, roads.lanes[lane])
            is_ahead = line is None or not _is_at_start(line, roads.lanes[lane])
            # What stands at the start of a lane is for those that lead to it.
            approaches = [(lane, ())] if is_ahead else [(other, (lane,)) for other in before.get(lane, ())]
            across = None if line is None else _across(line, roads.lanes[lane])
            if rule == "traffic_light":
                label = next((sign.name for sign in signs if sign.name), "")
                roads.lights += [Light(key, approach, ways, line=across, label=label) for approach, ways in approaches]
                continue
            kind = _kind(rule, tags, signs, roads.lanes[lane])
            if kind is None:
                notes.leave_out("regulatory elements of other signs", rule.replace("_", " "))
                break
            # A lane that gives way may lie in the junction.
            obliged_there = [approach for approach, _ in approaches] if kind == "stop" else [lane]
            roads.signs += [Sign(approach, kind, across) for approach in obliged_there]
    unused = sum(way.kind == "stop_line" for ref, way in ways.items() if ref not in named)
    if unused:
        notes.leave_out("stop lines without sign or light", "", unused)
    n_lights = len({light.name for light in roads.lights})
    if n_lights:
        notes.say(f"{DARK}: {n_lights}")


def _kind(rule: str, tags: Mapping[str, str], signs: Sequence[Place], lane: Lane) -> SignKind | None:
    """What the nearest sign of priority says to a lane; None: it is another sign."""
    if rule == "all_way_stop":
        return "stop"
    end = 0.5 * (lane.left[-1] + lane.right[-1])
    known = [(one, kind) for one in signs if (kind := _meaning(one.subtype)) in ("stop", "yield")]
    if known:
        return min(known, key=lambda pair: float(np.hypot(*(pair[0].points - end).T).min()))[1]
    stated = _meaning(tags.get("sign_type", ""))
    return stated if stated in ("stop", "yield") else "yield" if rule == "right_of_way" else None


def _meaning(subtype: str) -> SignKind | None:
    """What a sign such as "de206" or "stop_sign" says of priority."""
    return _WORDS.get(subtype) or KIND_BY_NUMBER.get(_COUNTRY.sub("", subtype, count=1))


def _at_lines(lanes: Sequence[Lane], lines: Sequence[Floats]) -> list[int]:
    """Lanes that end at a line, for elements that no lane names."""
    found = []
    for place, lane in enumerate(lanes):
        end = 0.5 * (lane.left[-1] + lane.right[-1])
        ahead = end - 0.5 * (lane.left[-2] + lane.right[-2])
        for line in lines:
            across = line[-1] - line[0]
            size = float(np.hypot(*across) * np.hypot(*ahead))
            is_near = lane.kind != "crosswalk" and size > 0.0 and _distance(line, end) <= _AT_LINE
            share = float((end - line[0]) @ across) / max(float(across @ across), 1e-12)
            if is_near and 0.0 <= share <= 1.0 and abs(float(across @ ahead)) <= _ALONG_LINE * size:
                found.append(place)
                break
    return found


def _nearest(lines: Iterable[Floats], lane: Lane) -> Floats | None:
    """The line that is nearest to one of both ends of a lane."""
    ends = (0.5 * (lane.left[0] + lane.right[0]), 0.5 * (lane.left[-1] + lane.right[-1]))
    return min(lines, key=lambda line: min(_distance(line, end) for end in ends), default=None)


def _is_at_start(line: Floats, lane: Lane) -> bool:
    start, end = (0.5 * (lane.left[at] + lane.right[at]) for at in (0, -1))
    return _distance(line, start) < _distance(line, end)


def _across(line: Floats, lane: Lane) -> Floats:
    """The ends of a line, that on the left of a lane first."""
    ends = line[[0, -1]]
    return ends if np.hypot(*(ends[0] - lane.left[-1])) <= np.hypot(*(ends[1] - lane.left[-1])) else ends[::-1]


def _distance(line: Floats, point: Floats) -> float:
    """Distance of a point from a polyline [m]."""
    start, step = line[:-1], np.diff(line, axis=0)
    share = np.clip(((point - start) * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-12), 0.0, 1.0)
    return float(np.hypot(*(start + share[:, None] * step - point).T).min())
