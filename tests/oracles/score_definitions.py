"""The definitions of docs/reference/scoring.md in shapely and numpy: lanes below a point, times, ways, verdicts.

Nothing here calls the core. Motion is sampled and bisected, lanes are polygons, ways are unions of rectangles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from shapely import affinity

from interdrive.scenario import Lanelets, Scenario

#: Ways are wider by this on each side, and longer by this at each end [m].
SIDE, END = 0.1, 1e-3
#: Lane of a footprint: its lanelet with this many before and behind it.
LANELETS_ON = 2


def turned(angle: float) -> float:
    """An angle without full turns, in (-π, π]."""
    return math.remainder(angle, 2.0 * math.pi)


def rectangle(length: float, width: float, x: float, y: float, orientation: float) -> shapely.Polygon:
    box = shapely.box(-0.5 * length, -0.5 * width, 0.5 * length, 0.5 * width)
    return affinity.translate(affinity.rotate(box, orientation, origin=(0, 0), use_radians=True), x, y)


class Lanes:
    """The lanelets of a scenario as polygons."""

    def __init__(self, scenario: Scenario) -> None:
        self.lanelets: Lanelets = scenario.lanelets
        rings = [np.vstack([a, b[::-1]]) for a, b in zip(self.lanelets.left, self.lanelets.right, strict=True)]
        self.polygons = np.array([shapely.Polygon(ring) for ring in rings], dtype=object)
        self.index = {int(number): row for row, number in enumerate(self.lanelets.ids)}

    @cached_property
    def tree(self) -> shapely.STRtree:
        return shapely.STRtree(self.polygons)

    @cached_property
    def borders(self) -> shapely.Geometry:
        """All borders: points close to one are under a lanelet or not by rounding."""
        return shapely.union_all([polygon.exterior for polygon in self.polygons])

    def below(self, x: float, y: float) -> list[int]:
        point = shapely.Point(x, y)
        return sorted(int(row) for row in self.tree.query(point) if self.polygons[row].intersects(point))

    def heading(self, row: int, x: float, y: float) -> float:
        """Direction of a lanelet's centre line where it is closest to a point."""
        center = 0.5 * (self.lanelets.left[row] + self.lanelets.right[row])
        steps = np.diff(center, axis=0)
        share = ((np.array([x, y]) - center[:-1]) * steps).sum(axis=1) / np.maximum((steps**2).sum(axis=1), 1e-30)
        feet = center[:-1] + np.clip(share, 0.0, 1.0)[:, None] * steps
        nearest = int(np.hypot(feet[:, 0] - x, feet[:, 1] - y).argmin())
        return math.atan2(steps[nearest, 1], steps[nearest, 0])

    def angles(self, x: float, y: float, orientation: float) -> list[float]:
        """Angles between a heading and the lanelets below."""
        return [abs(turned(orientation - self.heading(row, x, y))) for row in self.below(x, y)]

    def limit(self, x: float, y: float, orientation: float) -> float:
        """Largest speed limit of the lanelets below that lead the way, if all of them state one."""
        leading = [row for row in self.below(x, y) if abs(turned(orientation - self.heading(row, x, y))) <= math.pi / 2]
        limits = [float(self.lanelets.speed_limit[row]) for row in leading]
        return max(limits) if limits and all(math.isfinite(one) for one in limits) else math.nan

    def lane(self, row: int) -> set[int]:
        """A lanelet with those before and behind it."""
        found = {row}
        for links in (self.lanelets.predecessors, self.lanelets.successors):
            ends = [row]
            for _ in range(LANELETS_ON):
                ends = [self.index[number] for end in ends for number in links[end] if number in self.index]
                found.update(ends)
        return found

    def is_within_one(self, body: shapely.Polygon, x: float, y: float) -> bool:
        corners = [{*self.below(*corner)} for corner in list(body.exterior.coords)[:4]]
        return any(all(here & self.lane(row) for here in corners) for row in self.below(x, y))

    def is_against(self, body: shapely.Polygon, x: float, y: float, orientation: float) -> bool:
        """A corner or the centre is where all lanelets lead against the heading."""
        points = [*list(body.exterior.coords)[:4], (x, y)]
        return any(min(self.angles(*point, orientation), default=0.0) > math.pi / 2 for point in points)


@dataclass(frozen=True)
class Body:
    """Rectangle of one participant and its states at consecutive steps; arrays of shape (steps,)."""

    length: float
    width: float
    x: np.ndarray
    y: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray

    def at(self, step: float, *, is_way: bool = False) -> shapely.Polygon:
        """Footprint at a step, which may have a fraction; as part of a way it is larger."""
        x, y, orientation, _ = self.state(step)
        grown = (2.0 * END, 2.0 * SIDE) if is_way else (0.0, 0.0)
        return rectangle(self.length + grown[0], self.width + grown[1], x, y, orientation)

    def state(self, step: float) -> tuple[float, float, float, float]:
        """Position, heading and speed between two steps."""
        low = min(int(step), len(self.x) - 2)
        share = step - low

        def between(values: np.ndarray) -> float:
            return float(values[low] + share * (values[low + 1] - values[low]))

        change = turned(float(self.orientation[low + 1] - self.orientation[low]))
        return between(self.x), between(self.y), float(self.orientation[low]) + share * change, between(self.velocity)


def first_true(test, low: float, high: float, n: int) -> float | None:
    """The first place of n equal parts at which a test holds, made exact by halving; None if it never holds."""
    places = np.linspace(low, high, n + 1)
    for i, place in enumerate(places.tolist()):
        if not test(place):
            continue
        before, found = (float(places[i - 1]), place) if i else (place, place)
        for _ in range(40):
            middle = 0.5 * (before + found)
            before, found = (before, middle) if test(middle) else (middle, found)
        return found
    return None


@dataclass(frozen=True)
class Entry:
    """When one came into the way of the other, what was left there, and what was needed [m]."""

    step: int
    gap: float
    needed: float


def entry(intruder: Body, owner: Body, contact: float, reaction: tuple[float, float]) -> Entry:
    """The first step of the unbroken stretch up to the contact in which the intruder meets the owner's way."""
    last = math.ceil(contact - 1e-12) - 1  # the last recorded step before the contact
    steps = list(range(last + 1))
    way = [owner.at(step, is_way=True) for step in steps] + [owner.at(contact, is_way=True)]
    begun = contact
    for step in reversed(steps):
        if not any(part.intersects(intruder.at(step)) for part in way[step:]):
            break
        begun = step
    still = intruder.at(begun)
    places = [float(step) for step in steps if step > begun] + [contact]
    gap, before = 0.0, float(begun)
    for place in places:
        ends = [owner.state(one)[:2] for one in (before, place)]
        length = math.dist(*ends)
        touched = first_true(lambda at: owner.at(at, is_way=True).intersects(still), before, place, 20)
        if touched is not None:
            gap += length * (touched - before) / max(place - before, 1e-12)
            break
        gap, before = gap + length, place
    _, _, heading, speed = owner.state(begun)
    _, _, other_heading, other_speed = intruder.state(begun)
    difference = max(0.0, speed - max(0.0, other_speed * math.cos(other_heading - heading)))
    delay, deceleration = reaction
    return Entry(begun if begun < contact else len(steps), gap, difference * delay + difference**2 / (2 * deceleration))


def side(agent: Body, other: Body, contact: float) -> str:
    """Side of the agent on which the other one is, by where the boxes are farthest apart."""
    bodies = agent.at(contact), other.at(contact)
    corners = [np.array(body.exterior.coords)[:4] for body in bodies]
    heading = agent.state(contact)[2]
    best, direction = -math.inf, 0.0
    for angle in (heading, heading + math.pi / 2, *(other.state(contact)[2] + turn for turn in (0.0, math.pi / 2))):
        axis = np.array([math.cos(angle), math.sin(angle)])
        own, theirs = (points @ axis for points in corners)
        for gap, towards in ((theirs.min() - own.max(), angle), (own.min() - theirs.max(), angle + math.pi)):
            if gap > best + 1e-9:
                best, direction = gap, towards
    relative = turned(direction - heading)
    if abs(math.cos(relative)) >= abs(math.sin(relative)) - 1e-9:
        return "front" if math.cos(relative) > 0.0 else "rear"
    return "left" if math.sin(relative) > 0.0 else "right"


def keeps_lane(lanes: Lanes, agent: Body, other: Body, steps: list[float]) -> bool:
    """At all steps both head the same way within 45°, and the agent is within a lane that is not the other one's."""
    theirs = {row for below in lanes.below(*other.state(steps[0])[:2]) for row in lanes.lane(below)}
    for step in steps:
        x, y, heading, _ = agent.state(step)
        points = [*list(agent.at(step).exterior.coords)[:4], (x, y)]
        is_apart = not any(theirs & {*lanes.below(*point)} for point in points)
        beside = abs(turned(other.state(step)[2] - heading)) < math.pi / 4
        if not (beside and is_apart and lanes.is_within_one(agent.at(step), x, y)):
            return False
    return True


@dataclass(frozen=True)
class Judgement:
    """Verdict with the two entries, and whether rounding could turn it around."""

    kind: str
    into_theirs: Entry | None
    into_ours: Entry | None
    is_close: bool = False


def judgement(
    lanes: Lanes,
    agent: Body,
    other: Body,
    contact: float,
    *,
    is_oncoming_traffic: bool,
    is_crossing: bool,
    dt: float,
) -> Judgement:
    """The section "Blame" of docs/reference/scoring.md, without rules of the road."""
    x, y, heading, speed = agent.state(contact)
    _, _, other_heading, other_speed = other.state(contact)
    angle = abs(turned(other_heading - heading))
    body = agent.at(contact)
    if angle > math.radians(135) and is_oncoming_traffic and other_speed > 0.05:
        if lanes.is_against(body, x, y, heading):
            return Judgement("wrong_side", None, None)
        before = max(0.0, math.ceil(contact - 1e-12) - round(3.0 / dt))
        turns = [abs(turned(one.state(contact)[2] - one.state(before)[2])) for one in (agent, other)]
        if not is_crossing or turns[0] <= turns[1]:
            return Judgement("", None, None)
    theirs, ours = entry(agent, other, contact, (0.75, 4.0)), entry(other, agent, contact, (0.25, 6.0))
    touched = side(agent, other, contact)
    is_close = (
        any(one.needed > 0.0 and abs(one.gap - one.needed) < 0.05 for one in (theirs, ours))
        or abs(angle - math.pi / 4) < 0.01
    )
    since = [*range(theirs.step, math.ceil(contact - 1e-12)), contact]
    has_entered, too_late = theirs.step > 0, theirs.gap < theirs.needed

    def found(kind: str) -> Judgement:
        return Judgement(kind, theirs, ours, is_close)

    if has_entered and touched in ("left", "right") and angle < math.pi / 4 and not lanes.is_within_one(body, x, y):
        return found("cut_off")
    has_left = not lanes.is_within_one(other.at(contact), *other.state(contact)[:2])
    if other_speed > 0.05 and ours.step >= theirs.step and has_left and keeps_lane(lanes, agent, other, since):
        return found("")
    if 0 < ours.step < theirs.step and ours.gap < ours.needed:
        return found("")
    if has_entered and too_late and ours.step >= theirs.step:
        return found("cut_off")
    if touched == "front" and speed > 0.05 and ours.gap >= ours.needed:
        return found("ran_into")
    return found("cut_off" if has_entered and too_late else "")
