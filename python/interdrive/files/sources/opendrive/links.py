"""Which lane leads to which: within roads, between them, and through junctions."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from xml.etree.ElementTree import Element

    from interdrive.files.sources.notes import Notes
    from interdrive.files.sources.opendrive.records import LaneRecord, Road

End = Literal["start", "end"]


class LaneKey(NamedTuple):
    """A lane by road, position of its section, and id."""

    road: str
    section: int
    number: int

    def __str__(self) -> str:
        return f"{self.road}/{self.section}/{self.number}"


def links_of(roads: Mapping[str, Road], root: Element, notes: Notes) -> list[tuple[LaneKey, LaneKey]]:
    """Pairs of lanes of which the second is driven after the first, each pair once, in the order of the document."""
    found: dict[tuple[LaneKey, LaneKey], None] = {}
    lanes = {
        LaneKey(road.name, place, lane.number): lane
        for road in roads.values()
        for place, section in enumerate(road.sections)
        for lane in section.lanes
    }

    def add(one: LaneKey, one_end: End, other: LaneKey, other_end: End) -> None:
        """Both touch at these ends: the one that is driven towards them leads to the one that is driven away."""
        for before, at, after, there in ((one, one_end, other, other_end), (other, other_end, one, one_end)):
            if before not in lanes or after not in lanes or 0 in (before.number, after.number):
                continue
            leads = roads[before.road].is_forward(lanes[before]) == (at == "end")
            goes_on = roads[after.road].is_forward(lanes[after]) == (there == "start")
            if leads and goes_on:
                found[before, after] = None

    for road in roads.values():
        for key, lane in _lanes(road):
            for number in lane.successors if key.section + 1 < len(road.sections) else ():
                add(key, "end", LaneKey(road.name, key.section + 1, number), "start")
            for number in lane.predecessors if key.section > 0 else ():
                add(key, "start", LaneKey(road.name, key.section - 1, number), "end")
        for which, end in (("predecessor", "start"), ("successor", "end")):
            link = road.links.get(which)
            other = roads.get(link.element) if link is not None and link.kind == "road" else None
            if link is None or other is None or link.contact not in ("start", "end"):
                continue
            place = _section_at(road, end)  # type: ignore[arg-type]
            for lane in road.sections[place].lanes:
                for number in lane.predecessors if which == "predecessor" else lane.successors:
                    there: End = link.contact  # type: ignore[assignment]
                    key = LaneKey(road.name, place, lane.number)
                    add(key, end, LaneKey(other.name, _section_at(other, there), number), there)  # type: ignore[arg-type]
    for junction in root.iterfind("junction"):
        for one, one_end, another, there in _connections(roads, junction, notes):
            add(one, one_end, another, there)
    return list(found)


def _lanes(road: Road) -> Iterator[tuple[LaneKey, LaneRecord]]:
    for place, section in enumerate(road.sections):
        for lane in section.lanes:
            yield LaneKey(road.name, place, lane.number), lane


def _section_at(road: Road, end: End) -> int:
    return 0 if end == "start" else len(road.sections) - 1


def _connections(
    roads: Mapping[str, Road], junction: Element, notes: Notes
) -> Iterator[tuple[LaneKey, End, LaneKey, End]]:
    name = junction.get("id", "")
    if junction.get("type") == "virtual":
        notes.name("virtual junctions are not read", name)
        return
    for connection in junction.iterfind("connection"):
        incoming = roads.get(connection.get("incomingRoad", ""))
        connecting = roads.get(connection.get("connectingRoad") or connection.get("linkedRoad") or "")
        contact = connection.get("contactPoint")
        if incoming is None or connecting is None or contact not in ("start", "end"):
            continue
        there: End = contact  # type: ignore[assignment]
        end = _incoming_end(incoming, connecting, name, there)
        for link in connection.iterfind("laneLink"):
            try:
                one, other = int(link.get("from", "missing")), int(link.get("to", "missing"))
            except ValueError:
                continue
            yield (
                LaneKey(incoming.name, _section_at(incoming, end), one),
                end,
                LaneKey(connecting.name, _section_at(connecting, there), other),
                there,
            )


def _incoming_end(incoming: Road, connecting: Road, junction: str, contact: End) -> End:
    """The end of a road at a junction: the one that is linked to it, else the one that is nearer."""
    named: list[End] = [
        end  # type: ignore[misc]
        for which, end in (("predecessor", "start"), ("successor", "end"))
        if which in incoming.links
        and incoming.links[which].kind == "junction"
        and incoming.links[which].element == junction
    ]
    if len(named) == 1:
        return named[0]
    at = _end_point(connecting, contact)
    ends: tuple[End, End] = ("start", "end")
    return min(ends, key=lambda end: math.dist(_end_point(incoming, end), at))


def _end_point(road: Road, end: End) -> tuple[float, float]:
    s = 0.0 if end == "start" else max(0.0, road.length - 1e-6)
    x, y, _ = road.line.at(np.array([s]))
    return float(x[0]), float(y[0])
