"""Contents of a scenario before a run: size, traffic, which vehicles can become agents, and why others cannot."""

from __future__ import annotations

import weakref
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.scenario.lanes import driving_side
from interdrive.scenario.map_defects import map_defects

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.scenario.model import GoalState, Lanelets, PlanningProblem, Scenario

#: Kinds of recorded obstacles that a planner can drive.
DRIVABLE_KINDS = ("car", "truck", "bus", "motorcycle", "bicycle", "taxi", "priority_vehicle")

#: How two ways share an area, and why one of them goes first; the positions are the codes of the core.
AREA_KINDS = ("crossing", "merge", "opposed")
PRECEDENCE = (
    "by arrival",
    "by signs",
    "left turns wait",
    "minor roads wait",
    "main road first",
    "by side",
    "lane that goes on first",
    "smaller turn first",
)


@dataclass(frozen=True)
class Candidates:
    """Which recorded obstacles can become agents; one row per obstacle, sorted by id.

    Attributes:
        ids: Obstacle ids, shape (obstacles,).
        accepted: Whether it can become an agent, shape (obstacles,).
        reasons: Why it cannot; "" where accepted.
    """

    ids: Ints
    accepted: Bools
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class ProblemSummary:
    """Summary of a planning problem: its start, initial speed [m/s], and its goal in words."""

    id: int
    x: float
    y: float
    velocity: float
    start_lanelet_ids: tuple[int, ...]
    goal: str


@dataclass(frozen=True)
class Inspection:
    """Contents of a scenario.

    Attributes:
        name: Name of the scenario.
        benchmark_id: The id written in the file.
        dt: Time between steps [s].
        n_steps: Number of recorded time steps, including the first.
        duration: From the first to the last recorded time step [s].
        n_lanelets: Number of lanelets.
        lane_length: Total length of the centre lines of all lanelets [m].
        extent: Size of the map along x and y [m].
        speed_limits: Lowest and highest speed limit [m/s]; nan where no lanelet has one.
        n_traffic_lights: Number of traffic lights.
        n_stop_lines: Number of stop lines, those with a stop sign among them.
        n_stop_signs: Number of lines with a stop sign.
        n_turns_on_red: Number of ways behind lines onto which drivers may turn right on red.
        n_priority_signs: Number of lanelets that lead to a junction and have a sign of priority there: to stop, to give
            way, or to go first.
        n_crosswalks: Number of lanelets on which people cross the road.
        kinds: Number of obstacles per kind, the most frequent first.
        n_static: Number of static obstacles among them.
        planning_problems: Sorted by id.
        candidates: Which recorded vehicles can become agents, and why not.
        map_notes: Defects of the map, and what it does not tell.
        notes: What was repaired, derived or left out while reading.
    """

    name: str
    benchmark_id: str
    dt: float
    n_steps: int
    duration: float
    n_lanelets: int
    lane_length: float
    extent: tuple[float, float]
    speed_limits: tuple[float, float]
    n_traffic_lights: int
    n_stop_lines: int
    n_stop_signs: int
    n_turns_on_red: int
    n_priority_signs: int
    n_crosswalks: int
    kinds: tuple[tuple[str, int], ...]
    n_static: int
    planning_problems: tuple[ProblemSummary, ...]
    candidates: Candidates
    map_notes: tuple[str, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Junction:
    """Areas that vehicles on different ways share, connected by common lanelets.

    Attributes:
        x: Centre [m].
        y: Centre [m].
        n_lanelets: Number of lanelets that lead across.
        kinds: Number of areas per kind, one of `AREA_KINDS`.
        reasons: Number of areas per reason why one way goes first, one of `PRECEDENCE`.
    """

    x: float
    y: float
    n_lanelets: int
    kinds: tuple[tuple[str, int], ...]
    reasons: tuple[tuple[str, int], ...]


def junctions(areas: Mapping[str, NDArray[np.generic]]) -> tuple[Junction, ...]:
    """Summary of what `_core.Scenario.junctions` found, in its order."""
    found = []
    for number in np.unique(areas["junction"]):
        here = areas["junction"] == number
        counts = [
            tuple((name, n) for code, name in enumerate(names) if (n := int(np.sum(areas[field][here] == code))))
            for field, names in (("kind", AREA_KINDS), ("reason", PRECEDENCE))
        ]
        x, y = (float(np.mean(areas[axis][here].astype(np.float64))) for axis in ("x", "y"))
        found.append(Junction(x, y, len(np.unique(areas["lanelet"][here])), *counts))
    return tuple(found)


def candidates(scenario: Scenario, min_displacement: float = 10.0) -> Candidates:
    """Which recorded obstacles can become agents.

    An obstacle can if it is a vehicle (`DRIVABLE_KINDS`), not static, has at least two states, starts on a lanelet and
    gets far enough away from its start.

    Args:
        scenario: The scenario.
        min_displacement: Straight-line distance that it must get away from its start [m].

    Returns:
        One row per obstacle.
    """
    obstacles = scenario.obstacles
    rows = np.arange(len(obstacles.ids))
    first = obstacles.valid.argmax(axis=1)
    x, y = obstacles.x[rows, first], obstacles.y[rows, first]
    distance = np.hypot(obstacles.x - x[:, None], obstacles.y - y[:, None])
    displacement = np.where(obstacles.valid, distance, 0.0).max(axis=1, initial=0.0)
    n_states = obstacles.valid.sum(axis=1)
    on_lanelet = np.count_nonzero(lanelets_at(scenario.lanelets, x, y), axis=1) > 0

    def reason(row: int) -> str:
        if obstacles.is_static[row]:
            return "static obstacle"
        if obstacles.kinds[row] not in DRIVABLE_KINDS:
            return f"{obstacles.kinds[row].replace('_', ' ')}, not a vehicle that a planner can drive"
        if n_states[row] < 2:
            return "recorded at one time step only"
        if displacement[row] < min_displacement:
            return f"gets {displacement[row]:.1f} m away from its start, less than {min_displacement:g} m"
        return "" if on_lanelet[row] else "starts off every lanelet"

    reasons = tuple(reason(row) for row in rows.tolist())
    return Candidates(obstacles.ids, np.array([not text for text in reasons], dtype=np.bool_), reasons)


def inspect(scenario: Scenario, min_displacement: float = 10.0) -> Inspection:
    """Inspects a scenario, for `interdrive check`.

    Args:
        scenario: The scenario.
        min_displacement: See `candidates` [m].

    Returns:
        The inspection.
    """
    lanelets, obstacles = scenario.lanelets, scenario.obstacles
    points = np.concatenate((*lanelets.left, *lanelets.right))
    width, height = (points.max(axis=0) - points.min(axis=0)).tolist()
    limits = lanelets.speed_limit[np.isfinite(lanelets.speed_limit)]
    lowest, highest = (float(limits.min()), float(limits.max())) if limits.size else (np.nan, np.nan)
    kinds = sorted(Counter(obstacles.kinds).items(), key=lambda entry: (-entry[1], entry[0]))
    return Inspection(
        name=scenario.name,
        benchmark_id=scenario.benchmark_id,
        dt=scenario.dt,
        n_steps=obstacles.n_steps,
        duration=(obstacles.n_steps - 1) * scenario.dt,
        n_lanelets=len(lanelets.ids),
        lane_length=_lane_length(lanelets),
        extent=(width, height),
        speed_limits=(lowest, highest),
        n_traffic_lights=len(scenario.traffic_lights),
        n_stop_lines=len(scenario.stop_lines),
        n_stop_signs=sum(line.has_stop_sign for line in scenario.stop_lines),
        n_turns_on_red=sum(len(line.turns_on_red) for line in scenario.stop_lines),
        n_priority_signs=len(scenario.priorities.ranks),
        n_crosswalks=len(scenario.crosswalks),
        kinds=tuple(kinds),
        n_static=int(obstacles.is_static.sum()),
        planning_problems=tuple(_summary(problem, scenario) for problem in scenario.planning_problems),
        candidates=candidates(scenario, min_displacement),
        map_notes=(*map_defects(lanelets), *_side_by_country(scenario)),
        notes=scenario.notes,
    )


def _side_by_country(scenario: Scenario) -> tuple[str, ...]:
    """A line if the side of driving does not follow from the map."""
    if driving_side(scenario.lanelets) is not None:
        return ()
    side = "left" if scenario.priorities.left_hand else "right"
    return (
        f"the map does not tell on which side vehicles drive: on the {side}, by the country of {scenario.benchmark_id}",
    )


def lanelets_at(lanelets: Lanelets, x: Floats, y: Floats) -> Bools:
    """The lanelets on which each point lies: inside the polygon between their bounds (even-odd rule) or on its edge.

    Args:
        lanelets: The roads.
        x: Shape (points,) [m].
        y: Shape (points,) [m].

    Returns:
        Shape (points, lanelets). False for nan.
    """
    outlines = _outlines(lanelets)
    inside = np.zeros((len(x), len(lanelets.ids)), dtype=np.bool_)
    low, high = outlines.low, outlines.high
    boxed = (
        (x[:, None] >= low[:, 0]) & (x[:, None] <= high[:, 0]) & (y[:, None] >= low[:, 1]) & (y[:, None] <= high[:, 1])
    )
    points, columns = np.nonzero(boxed)
    for first in range(0, len(points), _AT_ONCE):
        pairs = slice(first, first + _AT_ONCE)
        inside[points[pairs], columns[pairs]] = outlines.contain(columns[pairs], x[points[pairs]], y[points[pairs]])
    return inside


#: Pairs of a point and a lanelet that are looked at together.
_AT_ONCE = 4096


@dataclass(frozen=True)
class _Outlines:
    """The polygons between the bounds of lanelets, their edges one after another.

    Attributes:
        low: Smallest x and y of each polygon [m], shape (lanelets, 2).
        high: Largest ones.
        first: First edge of each.
        n_edges: Number of edges of each.
        x: Where each edge starts [m].
        y: Likewise.
        end_x: Where it ends [m].
        end_y: Likewise.
    """

    low: Floats
    high: Floats
    first: Ints
    n_edges: Ints
    x: Floats
    y: Floats
    end_x: Floats
    end_y: Floats

    @classmethod
    def of(cls, lanelets: Lanelets) -> _Outlines:
        """Those of some lanelets."""
        polygons = [
            np.concatenate((left, right[::-1])) for left, right in zip(lanelets.left, lanelets.right, strict=True)
        ]
        sizes = np.array([len(polygon) for polygon in polygons], dtype=np.int64)
        starts = np.concatenate([np.empty((0, 2)), *polygons])
        ends = np.concatenate([np.empty((0, 2)), *(np.roll(polygon, -1, axis=0) for polygon in polygons)])
        low, high = (
            np.array([find(polygon, axis=0) for polygon in polygons]).reshape(-1, 2) for find in (np.min, np.max)
        )
        return cls(low, high, np.cumsum(sizes) - sizes, sizes, *starts.T.copy(), *ends.T.copy())

    def contain(self, lanelets: Ints, x: Floats, y: Floats) -> Bools:
        """Whether each polygon contains the point at its place, or has it within a micrometre of an edge."""
        sizes = self.n_edges[lanelets]
        begin = np.cumsum(sizes) - sizes
        edges = np.arange(int(sizes.sum())) + np.repeat(self.first[lanelets] - begin, sizes)
        x, y, x0, y0 = np.repeat(x, sizes), np.repeat(y, sizes), self.x[edges], self.y[edges]
        x1, y1 = self.end_x[edges], self.end_y[edges]
        crosses = (y0 > y) != (y1 > y)
        edge_x, edge_y, from_x, from_y = x1 - x0, y1 - y0, x - x0, y - y0
        with np.errstate(divide="ignore", invalid="ignore"):
            is_left = crosses & (x < x0 + from_y * edge_x / edge_y)
        length_squared = np.maximum(edge_x**2 + edge_y**2, 1e-18)
        along = np.clip((from_x * edge_x + from_y * edge_y) / length_squared, 0.0, 1.0)
        away = np.hypot(from_x - along * edge_x, from_y - along * edge_y)
        inside: Bools = np.add.reduceat(is_left, begin, dtype=np.int64) % 2 == 1
        inside |= np.minimum.reduceat(away, begin) < 1e-6
        return inside


#: By the identity of lanelets that are in use: a reference to them, and their outlines.
_OUTLINES: dict[int, tuple[weakref.ref[Lanelets], _Outlines]] = {}


def _outlines(lanelets: Lanelets) -> _Outlines:
    """The outlines of some lanelets, made once."""
    number = id(lanelets)
    if number not in _OUTLINES:
        _OUTLINES[number] = weakref.ref(lanelets, lambda _: _OUTLINES.pop(number, None)), _Outlines.of(lanelets)
    return _OUTLINES[number][1]


def _lane_length(lanelets: Lanelets) -> float:
    centers = (0.5 * (left + right) for left, right in zip(lanelets.left, lanelets.right, strict=True))
    return float(sum(np.hypot(*np.diff(center, axis=0).T).sum() for center in centers))


def _summary(problem: PlanningProblem, scenario: Scenario) -> ProblemSummary:
    start = problem.initial_state
    here = lanelets_at(scenario.lanelets, np.array([start.x]), np.array([start.y]))[0]
    goal = " or ".join(_in_words(state, scenario.dt) for state in problem.goal) or "no goal"
    start_lanelet_ids = tuple(scenario.lanelets.ids[here].tolist())
    return ProblemSummary(problem.id, start.x, start.y, start.velocity, start_lanelet_ids, goal)


def _in_words(goal: GoalState, dt: float) -> str:
    if goal.lanelet_ids:
        plural = "s" if len(goal.lanelet_ids) > 1 else ""
        where = f"lanelet{plural} " + ", ".join(str(number) for number in goal.lanelet_ids)
    elif goal.areas:
        centers = [area.center if area.kind != "polygon" else area.vertices.mean(axis=0) for area in goal.areas]
        where = " or ".join(
            f"a {area.kind} at ({x:.1f}, {y:.1f})" for area, (x, y) in zip(goal.areas, centers, strict=True)
        )
    else:
        where = "anywhere"
    first, last = goal.time_step
    steps = f"steps {first} to {last} ({first * dt:.1f} to {last * dt:.1f} s)"
    words = [where, f"step {first} ({first * dt:.1f} s)" if first == last else steps]
    if goal.velocity is not None:
        words.append(f"speed {goal.velocity[0]:.1f} to {goal.velocity[1]:.1f} m/s")
    if goal.orientation is not None:
        degrees = np.degrees(goal.orientation)
        words.append(f"heading {degrees[0]:.0f} to {degrees[1]:.0f} degrees")
    return ", ".join(words)
