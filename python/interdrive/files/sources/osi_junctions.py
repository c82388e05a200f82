"""Ways through junctions of OSI traces, which state an area and pairs of lanes, as lanes between their ends."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from interdrive.files.sources.model import Lane

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.array_types import Floats
    from interdrive.files.sources.model import Roads
    from interdrive.files.sources.notes import Notes

#: An object of betterosi, which has no types.
Message: TypeAlias = Any

#: Share of the distance between its ends at which a border still heads as at the end: a quarter circle is nearly round.
_STRAIGHT = 0.39
#: Points of a border, and how far apart its ends are at most [m].
_POINTS, _WIDEST = 13, 150.0


def add_ways(roads: Roads, position: Mapping[int, int], driven: Mapping[int, Message], notes: Notes) -> None:
    """Adds the ways through what has no boundaries.

    Args:
        roads: Lanes with borders, and their links.
        position: Positions of these lanes by id.
        driven: Classifications of all lanes by id; which end of a lane is at a junction follows from its pairings.
        notes: Junctions are named, lanes without boundaries that are no junctions counted.
    """
    lanes = {number: roads.lanes[place] for number, place in position.items()}
    n_left_out = 0
    for number in [one for one in driven if one not in lanes]:
        ways = _ways_through(number, driven[number], lanes, driven)
        for before, lane, after in ways:
            roads.links += [(position[before], len(roads.lanes)), (len(roads.lanes), position[after])]
            roads.lanes.append(lane)
        if ways:
            notes.name("junctions without boundaries crossed as their pairings of lanes say", number)
        n_left_out += not ways
    if n_left_out:
        notes.leave_out("lanes", "without two boundaries", n_left_out)


def _ways_through(
    number: int, junction: Message, lanes: Mapping[int, Lane], driven: Mapping[int, Message]
) -> list[tuple[int, Lane, int]]:
    """Lanes through a junction, each with the ids of the lane that leads in and of the one that leads out."""
    found: dict[tuple[int, int], Lane] = {}
    for pairing in junction.lane_pairing:
        if pairing.antecessor_lane_id is None or pairing.successor_lane_id is None:
            continue
        before, after = pairing.antecessor_lane_id.value, pairing.successor_lane_id.value
        if before not in lanes or after not in lanes or (before, after) in found:
            continue
        if number not in _ahead(driven[before]) or number not in _behind(driven[after]):
            continue
        lane = _between(f"{number}/{before}-{after}", lanes[before], lanes[after])
        if lane is not None:
            found[before, after] = lane
    return [(before, lane, after) for (before, after), lane in found.items()]


def _ahead(lane: Message) -> set[int]:
    """Ids of what follows a lane in driving direction."""
    forward = lane.centerline_is_driving_direction
    ends = (pairing.successor_lane_id if forward else pairing.antecessor_lane_id for pairing in lane.lane_pairing)
    return {end.value for end in ends if end is not None}


def _behind(lane: Message) -> set[int]:
    """Ids of what leads to a lane in driving direction."""
    forward = lane.centerline_is_driving_direction
    ends = (pairing.antecessor_lane_id if forward else pairing.successor_lane_id for pairing in lane.lane_pairing)
    return {end.value for end in ends if end is not None}


def _between(key: str, before: Lane, after: Lane) -> Lane | None:
    """A lane whose borders go on as the lanes at both ends head; None: these are together, or too far apart."""
    middles = [0.5 * (lane.left + lane.right) for lane in (before, after)]
    into, out = _direction(middles[0][-2:]), _direction(middles[1][:2])
    left, right = (
        _curve(start[-1], end[0], into, out) for start, end in ((before.left, after.left), (before.right, after.right))
    )
    lengths = [float(np.hypot(*(border[-1] - border[0]))) for border in (left, right)]
    return Lane(key, left, right) if 0.5 < max(lengths) <= _WIDEST and min(lengths) > 0.1 else None


def _direction(points: Floats) -> Floats:
    step = points[1] - points[0]
    found: Floats = step / max(float(np.hypot(*step)), 1e-9)
    return found


def _curve(start: Floats, end: Floats, into: Floats, out: Floats) -> Floats:
    """A cubic from a point to another with these directions at its ends, shape (points, 2)."""
    t = np.linspace(0.0, 1.0, _POINTS)[:, None]
    handle = _STRAIGHT * float(np.hypot(*(end - start)))
    first, second = start + handle * into, end - handle * out
    found: Floats = (
        (1.0 - t) ** 3 * start + 3.0 * (1.0 - t) ** 2 * t * first + 3.0 * (1.0 - t) * t**2 * second + t**3 * end
    )
    return found
