"""The definitions of docs/reference/criticality.md for one vehicle at one time step, slowly and without the core.

Lanelets and footprints are shapely geometry, feet on paths are found by bisection, roots by numpy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from bodies import body_of

if TYPE_CHECKING:
    from interdrive.scenario import Scenario, Shape

RADIUS, OPPOSITE, ALONG, EROSION, OVERLAP_MIN, STANDING = 100.0, 0.75 * np.pi, 0.25 * np.pi, 0.3, 0.1, 1e-3
LEAD_IN, SAME_VERTEX, LEADS_BACK = 10.0, 0.05, 3.0
#: The direction of a lanelet is that of its centre line over twice this [m]. The core smooths it across joints, too, so
#: a vehicle that drives nearly across a lanelet may be along or against it [rad].
DIRECTION_REACH, NEARLY_ACROSS = 2.0, 0.05
#: Joints of lanelets that are farther apart [m] are errors of the map and no joints.
SUCCESSOR_GAP_MAX = 10.0


def wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)


def angle_of(vector: np.ndarray) -> float:
    return float(np.arctan2(vector[1], vector[0]))


@dataclass(frozen=True)
class Foot:
    """Arc length [m], offset to the left [m] and direction of the path [rad]."""

    s: float
    d: float
    direction: float


@dataclass(frozen=True)
class Path:
    points: np.ndarray
    tangents: np.ndarray
    s: np.ndarray

    @classmethod
    def through(cls, vertices: np.ndarray) -> Path:
        """Tangents at inner vertices are bisectors."""
        points: list[np.ndarray] = []
        for vertex in vertices:
            step = vertex - points[-1] if points else np.zeros(2)
            if points and np.hypot(*step) <= SAME_VERTEX:
                continue
            if len(points) > 1 and step @ (points[-1] - points[-2]) < 0.0 and np.hypot(*step) <= LEADS_BACK:
                continue
            points.append(vertex)
        sides = np.diff(points, axis=0)
        lengths = np.hypot(*sides.T)
        units = sides / lengths[:, None]
        tangents = np.concatenate([units[:1], units[:-1] + units[1:], units[-1:]])
        return cls(np.array(points), tangents / np.hypot(*tangents.T)[:, None], np.append(0.0, lengths.cumsum()))

    def foot(self, point: np.ndarray) -> Foot | None:
        """The nearest point at which the interpolated tangent is at right angles to the way to `point`."""
        ahead = ((point - self.points) * self.tangents).sum(axis=1)
        best = None
        for i in np.flatnonzero((ahead[:-1] >= 0.0) & (ahead[1:] <= 0.0)).tolist():
            low, high = 0.0, 1.0
            for _ in range(60):
                u = 0.5 * (low + high)
                away = point - self.points[i] - u * (self.points[i + 1] - self.points[i])
                tangent = self.tangents[i] + u * (self.tangents[i + 1] - self.tangents[i])
                low, high = (u, high) if away @ tangent > 0.0 else (low, u)
            tangent /= np.hypot(*tangent)
            d = float(tangent[0] * away[1] - tangent[1] * away[0])
            if abs(d) <= RADIUS and (best is None or abs(d) < abs(best.d)):
                best = Foot(float(self.s[i] + u * (self.s[i + 1] - self.s[i])), d, angle_of(tangent))
        return best


@dataclass(frozen=True)
class Moment:
    """What the definitions say; nan without a path."""

    hw: float
    thw: float
    ttc: float
    a_long_req: float
    a_lat_req: float
    #: Distance to the nearest participant that counts [m].
    distance: float


class Definitions:
    """The recorded traffic of a scenario."""

    def __init__(self, scenario: Scenario, *, oncoming_filter: bool) -> None:
        self.obstacles, self.dt, self.oncoming_filter = scenario.obstacles, scenario.dt, oncoming_filter
        lanelets = scenario.lanelets
        bounds = list(zip(lanelets.left, lanelets.right, strict=True))
        self.centers = [0.5 * (left + right) for left, right in bounds]
        self.lengths = [float(np.hypot(*np.diff(center, axis=0).T).sum()) for center in self.centers]
        self.outlines = [shapely.Polygon(np.concatenate([left, right[::-1]])) for left, right in bounds]
        self._tree = shapely.STRtree(self.outlines)
        self.eroded = [outline.buffer(-EROSION, join_style="mitre") for outline in self.outlines]
        n = len(bounds)
        self.after: list[set[int]] = [set() for _ in range(n)]
        self.before: list[set[int]] = [set() for _ in range(n)]
        index = {number: i for i, number in enumerate(lanelets.ids.tolist())}
        stated = [(i, index[j]) for i in range(n) for j in lanelets.successors[i] if j in index]
        stated += [(index[j], i) for i in range(n) for j in lanelets.predecessors[i] if j in index]
        for i, j in stated:
            if np.hypot(*(self.centers[i][-1] - self.centers[j][0])) <= SUCCESSOR_GAP_MAX:
                self.after[i].add(j)
                self.before[j].add(i)
        self.bodies = [body_of(shape) for shape in self.obstacles.shapes]
        self._driven: dict[int, list[set[int]]] = {}

    def pose(self, row: int, k: int) -> tuple[float, float, float]:
        o = self.obstacles
        return float(o.x[row, k]), float(o.y[row, k]), float(o.orientation[row, k])

    def here(self, row: int, k: int) -> list[int]:
        """Lanelets that contain the centre."""
        return sorted(self._tree.query(shapely.Point(self.pose(row, k)[:2]), predicate="intersects").tolist())

    def place(self, lanelet: int, row: int, k: int) -> tuple[float, float]:
        """Heading relative to the lanelet [rad], and arc length on its centre line [m]."""
        x, y, heading = self.pose(row, k)
        line = shapely.LineString(self.centers[lanelet])
        s = line.project(shapely.Point(x, y))
        near = (min(max(s + way, 0.0), line.length) for way in (-DIRECTION_REACH, DIRECTION_REACH))
        ends = [line.interpolate(at).coords[0] for at in near]
        return wrapped(heading - angle_of(np.subtract(ends[1], ends[0]))), s

    def chains(self, start: int, *, reverse: bool) -> list[tuple[int, ...]]:
        """Lanelets in driving order until the radius lies behind the end of the first one."""
        found: list[tuple[int, ...]] = []

        def grow(chain: list[int], length: float) -> None:
            branches = (self.before if reverse else self.after)[chain[-1]] - set(chain)
            if length >= RADIUS or not branches:
                found.append(tuple(chain))
                return
            for branch in branches:
                grow([*chain, branch], length + self.lengths[branch])

        grow([start], 0.0)
        return found

    def corridor(self, chain: tuple[int, ...], ahead: float) -> tuple[int, ...]:
        """Its part until the radius lies ahead, of which `ahead` [m] on the first lanelet."""
        reached = ahead + np.append(0.0, np.cumsum([self.lengths[i] for i in chain[1:]]))
        enough = np.flatnonzero(reached >= RADIUS)
        return chain[: int(enough[0]) + 1] if len(enough) else chain

    def path(self, chain: tuple[int, ...], *, reverse: bool) -> Path:
        def driven(lanelet: int) -> np.ndarray:
            return self.centers[lanelet][::-1] if reverse else self.centers[lanelet]

        start = driven(chain[0])
        way = start[1] - start[0]
        before = (self.after if reverse else self.before)[chain[0]]
        if before:
            lines = [driven(i) for i in sorted(before)]
            line = min(lines, key=lambda line: abs(wrapped(angle_of(line[-1] - line[-2]) - angle_of(way))))
            s = np.append(0.0, np.hypot(*np.diff(line, axis=0).T).cumsum())
            first = max(float(s[-1]) - LEAD_IN, 0.0)
            cut = np.array([[np.interp(first, s, line[:, axis]) for axis in (0, 1)]])
            lead_in = np.concatenate([cut, line[s > first]])
        else:
            lead_in = (start[0] - LEAD_IN * way / np.hypot(*way))[None]
        return Path.through(np.concatenate([lead_in, *(driven(i) for i in chain)]))

    def reaches(self, shape: Shape, turn: float) -> tuple[float, float, float, float]:
        """How far a footprint turned by `turn` reaches forwards, backwards, to the left and to the right [m]."""
        body = body_of(shape)
        x, y = shapely.get_coordinates(body.geometry).T
        along, across = x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)
        ends = (along.max(), -along.min(), across.max(), -across.min())
        return tuple(float(end) + body.radius for end in ends)  # type: ignore[return-value]

    def motion(self, row: int, k: int) -> tuple[float, float]:
        """Speed and acceleration along the heading."""
        o = self.obstacles
        if o.is_static[row]:
            return 0.0, 0.0
        if np.isfinite(o.acceleration[row, k]):
            return float(o.velocity[row, k]), float(o.acceleration[row, k])
        near = [c for c in (k - 1, k, k + 1) if 0 <= c < o.n_steps and o.valid[row, c]]
        time = (near[-1] - near[0]) * self.dt
        change = float(o.velocity[row, near[-1]] - o.velocity[row, near[0]])
        return float(o.velocity[row, k]), change / time if time > 0.0 else 0.0

    def lane(self, row: int, k: int) -> set[int]:
        """Lanelets along which it drives from now on."""
        if row not in self._driven:
            self._driven[row] = [
                {i for i in self.here(row, c) if abs(self.place(i, row, c)[0]) <= ALONG} if there else set()
                for c, there in enumerate(self.obstacles.valid[row].tolist())
            ]
        return set().union(*self._driven[row][k:])

    def share(self, one: shapely.Geometry, other: shapely.Geometry) -> bool:
        return bool(one.intersection(other).area > OVERLAP_MIN)

    def ways_meet(self, row: int, other: int, k: int, corridor: set[int]) -> bool:
        own, others = (
            shapely.buffer(self.bodies[who].at(self.pose(who, k))[0], self.bodies[who].radius) for who in (row, other)
        )
        lane = self.lane(other, k)
        return (
            any(self.share(self.eroded[i], own) for i in lane)
            or any(self.share(self.eroded[i], self.eroded[j]) for i in lane for j in corridor)
            or any(self.share(self.eroded[j], others) for j in corridor)
        )

    def gap(self, row: int, other: int, k: int) -> float:
        one, two = self.bodies[row], self.bodies[other]
        apart = shapely.distance(one.at(self.pose(row, k))[0], two.at(self.pose(other, k))[0])
        return max(0.0, float(apart) - one.radius - two.radius)

    def moment(self, row: int, k: int) -> Moment | None:
        """None where the definitions leave open which lanelet before or behind a corridor directs it there.

        Likewise where a lanelet is driven nearly across.
        """
        o = self.obstacles
        x, y, heading = self.pose(row, k)
        places = {i: self.place(i, row, k) for i in self.here(row, k)}
        along = [i for i, (turn, _) in places.items() if abs(turn) <= 0.5 * np.pi]
        reverse = not along
        own: list[tuple[tuple[int, ...], Path, Foot]] = []
        ambiguous = any(abs(abs(turn) - 0.5 * np.pi) < NEARLY_ACROSS for turn, _ in places.values())
        for i in places if reverse else along:
            s = places[i][1]
            for chain in self.chains(i, reverse=reverse):
                path = self.path(chain, reverse=reverse)
                foot = path.foot(np.array([x, y]))
                if foot is not None:
                    first_side = np.diff(self.centers[i][-2:] if reverse else self.centers[i][:2], axis=0)[0]
                    ambiguous |= len(self.after[i] if reverse else self.before[i]) > 1 and foot.s < LEAD_IN + np.hypot(
                        *first_side
                    )
                    own.append((self.corridor(chain, s if reverse else self.lengths[i] - s), path, foot))
        if ambiguous or len({part for part, *_ in own}) < len(own):
            return None
        corridor = {i for part, *_ in own for i in part}
        hw = thw = ttc = distance = np.inf
        braking = steering = 0.0
        velocity, acceleration = self.motion(row, k)
        for other in np.flatnonzero(o.valid[:, k]).tolist():
            place, other_heading = np.array(self.pose(other, k)[:2]), self.pose(other, k)[2]
            if other == row or np.hypot(*(place - (x, y))) >= RADIUS:
                continue
            gap = self.gap(row, other, k)
            feet = [(part, mine, path.foot(place)) for part, path, mine in own]
            known = [foot for *_, foot in feet if foot is not None]
            direction = min(known, key=lambda foot: abs(foot.d)).direction if known else heading
            is_opposite = abs(wrapped(other_heading - direction)) > OPPOSITE
            if self.oncoming_filter and gap > 0.0 and is_opposite and not self.ways_meet(row, other, k, corridor):
                continue
            distance = min(distance, gap)
            if gap == 0.0:
                hw = thw = ttc = 0.0
                continue
            on = set(self.here(other, k))
            other_velocity, other_acceleration = self.motion(other, k)
            for part, mine, foot in feet:
                if foot is None or not on & set(part):
                    continue
                turn, other_turn = wrapped(heading - mine.direction), wrapped(other_heading - foot.direction)
                front, _, left, right = self.reaches(o.shapes[row], turn)
                _, back, other_left, other_right = self.reaches(o.shapes[other], other_turn)
                headway = foot.s - mine.s - front - back
                if headway <= 0.0:
                    continue
                own_speed, other_speed = velocity * np.cos(turn), other_velocity * np.cos(other_turn)
                closing, braked = other_speed - own_speed, other_acceleration * np.cos(other_turn)
                time = first_contact(headway, closing, braked - acceleration * np.cos(turn))
                hw, ttc = min(hw, headway), min(ttc, time)
                thw = min(thw, headway / own_speed if own_speed > STANDING else np.inf)
                braking = min(braking, braked - (closing**2 / (2.0 * headway) if closing < 0.0 else 0.0))
                if np.isfinite(time):
                    drift = other_velocity * np.sin(other_turn) - velocity * np.sin(turn)
                    offset = foot.d - mine.d + drift * time + 0.5 * other_acceleration * np.sin(other_turn) * time**2
                    room = min(offset + other_left + right, other_right + left - offset)
                    steering = max(steering, 2.0 * room / time**2)
        if not own:
            return Moment(*[np.nan] * 5, distance)
        return Moment(hw, thw, ttc, braking, steering, distance)


def first_contact(gap: float, velocity: float, acceleration: float) -> float:
    """Smallest time at which gap + velocity t + acceleration t² / 2 is 0."""
    roots = np.roots([0.5 * acceleration, velocity, gap]) if velocity or acceleration else np.array([])
    return min((float(root.real) for root in roots if abs(root.imag) < 1e-9 and root.real >= 0.0), default=np.inf)
