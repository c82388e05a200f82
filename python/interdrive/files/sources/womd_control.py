"""Stop signs, traffic lights and crosswalks of Waymo scenes in JSON, which name lanes for lights alone."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.files.sources.control import crosswalk
from interdrive.files.sources.json_documents import numbers_of, points_of
from interdrive.files.sources.model import Light, Sign

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.array_types import Floats
    from interdrive.files.sources.model import Lane, Roads
    from interdrive.files.sources.notes import Notes
    from interdrive.scenario import Signal

#: Time between states [s].
DT = 0.1
#: A stop sign is at most this far from the end of its lane [m], and beside rather than ahead of it: at most so far from
#: the direction across the lane [rad].
_SIGN_AWAY, _SIGN_ASIDE = 8.0, math.radians(60.0)
#: Ends of lanes beside each other that one sign is for differ by at most this along the lane [m].
_SAME_END = 5.0
#: What lights show; those that flash or are unknown show nothing.
_SIGNALS: dict[str, Signal] = {
    **dict.fromkeys(("go", "arrow_go"), "green"),
    **dict.fromkeys(("caution", "arrow_caution"), "yellow"),
    **dict.fromkeys(("stop", "arrow_stop"), "red"),
}


def signs_of(roads: Roads, parts: Sequence[Mapping[str, Any]], notes: Notes) -> list[Sign]:
    """Stop signs at the nearest ends of lanes, and of those beside them in the same direction."""
    ends = np.array([_end(lane) for lane in roads.lanes]).reshape(-1, 4)
    found: dict[int, None] = {}
    for part in parts:
        if part.get("type") != "stop_sign":
            continue
        points = points_of(part.get("geometry"))
        lane = _lane_of_sign(ends, points[0]) if len(points) else None
        if lane is None:
            notes.leave_out("stop signs beside no end of a lane", "")
        else:
            found.update(dict.fromkeys(_beside(roads, ends, lane)))
    return [Sign(lane, "stop") for lane in found]


def _end(lane: Lane) -> tuple[float, float, float, float]:
    """Middle of the end of a lane [m], and its direction there."""
    end, before = (0.5 * (lane.left[at] + lane.right[at]) for at in (-1, -2))
    step = end - before
    x, y = step / max(float(np.hypot(*step)), 1e-9)
    return float(end[0]), float(end[1]), float(x), float(y)


def _lane_of_sign(ends: Floats, sign: Floats) -> int | None:
    if not len(ends):
        return None
    away = sign - ends[:, :2]
    distance = np.hypot(*away.T)
    along = np.abs((away * ends[:, 2:]).sum(axis=1))
    fits = (distance <= _SIGN_AWAY) & (along <= np.sin(_SIGN_ASIDE) * distance)
    return int(np.argmin(np.where(fits, distance, np.inf))) if fits.any() else None


def _beside(roads: Roads, ends: Floats, lane: int) -> list[int]:
    """A lane and those beside it in the same direction that end beside it."""
    found = [lane]
    for side in ("left_neighbour", "right_neighbour"):
        at = lane
        while (other := getattr(roads.lanes[at], side)) is not None and other[1] and other[0] not in found:
            at = other[0]
            if abs(float((ends[at, :2] - ends[lane, :2]) @ ends[lane, 2:])) > _SAME_END:
                break
            found.append(at)
    return found


def lights_of(roads: Roads, states: object, notes: Notes) -> list[Light]:
    """Lights with their states, which belong to the lane that is entered there, or to the one that ends."""
    if not isinstance(states, dict):
        return []
    before: dict[int, list[int]] = {}
    for start, end in roads.links:
        before.setdefault(end, []).append(start)
    pieces: dict[str, list[int]] = {}
    for place, lane in enumerate(roads.lanes):
        pieces.setdefault(lane.key.split("/")[0], []).append(place)
    found = []
    for key, one in states.items():
        phases = _phases(one) if isinstance(one, dict) else ()
        places = pieces.get(str(key), [])
        if not phases or not places:
            notes.leave_out("traffic lights without a known state or lane", "")
            continue
        first, last = places[0], places[-1]
        approaches: list[tuple[int, tuple[int, ...]]] = [(start, (first,)) for start in before.get(first, ())]
        if _is_at_end(roads.lanes[first], roads.lanes[last], one):
            approaches = [(last, ())]
        found += [Light(str(key)[:30], lane, ways, phases, repeats=False) for lane, ways in approaches]
    return found


def _phases(one: Mapping[str, Any]) -> tuple[tuple[Signal, float], ...]:
    """What a light shows and how long; what is unknown is as before, or as what is known first."""
    words, steps = one.get("state"), one.get("time_index")
    if not isinstance(words, list):
        return ()
    times = steps if isinstance(steps, list) and len(steps) == len(words) else list(range(len(words)))
    known = sorted(
        (float(at) * DT, signal)
        for at, word in zip(times, words, strict=True)
        if (signal := _SIGNALS.get(str(word))) and isinstance(at, int) and not isinstance(at, bool) and 0 <= at < 10**5
    )
    changes = [pair for place, pair in enumerate(known) if not place or pair[1] != known[place - 1][1]]
    ends = [time for time, _ in changes[1:]] + [known[-1][0] + DT] if known else []
    begins = [0.0, *ends[:-1]]
    return tuple((signal, end - begin) for (_, signal), begin, end in zip(changes, begins, ends, strict=True))


def _is_at_end(first: Lane, last: Lane, one: Mapping[str, Any]) -> bool:
    """Whether the line of a light is at the end of its lane rather than at its start, where it usually is."""
    stated = {name: value[0] if isinstance(value := one.get(name), list) and value else value for name in ("x", "y")}
    place = numbers_of([stated], ("x", "y"))[0]
    if not np.isfinite(place).all():
        return False
    start, end = (0.5 * (lane.left[at] + lane.right[at]) for lane, at in ((first, 0), (last, -1)))
    return bool(np.hypot(*(place - end)) < np.hypot(*(place - start)))


def crosswalks_of(parts: Sequence[Mapping[str, Any]], notes: Notes) -> list[Lane]:
    """Crosswalks by their outlines."""
    found = []
    for place, part in enumerate(parts):
        if part.get("type") != "crosswalk":
            continue
        made = crosswalk(f"crosswalk {str(part.get('id', place))[:30]}", points_of(part.get("geometry")))
        if made is None:
            notes.leave_out("crosswalks without an outline", "")
        else:
            found.append(made)
    return found
