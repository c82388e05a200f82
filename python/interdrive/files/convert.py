"""Converts scenarios, states and goals of a document, or of commonroad-io, to arrays."""

from __future__ import annotations

import itertools
from collections import defaultdict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from interdrive.errors import InputError
from interdrive.files.control import control, control_notes, crosswalks, is_priority_sign, is_sign, priorities
from interdrive.files.heights import heights_of, missing_heights
from interdrive.files.motion import Track, completed, track, wrapped
from interdrive.files.references import dangling_in_network
from interdrive.files.shapes import Foreign, middle_of, name_of, polygon, shape_of
from interdrive.scenario import (
    STATE_FIELDS,
    GoalState,
    Incoming,
    InitialState,
    Lanelets,
    Obstacles,
    PlanningProblem,
    Scenario,
    Shape,
    limits,
)
from interdrive.storage.names import readable

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from interdrive.files.facts import Facts

Value = TypeVar("Value")

_KINDS = {
    "priorityVehicle": "priority_vehicle",
    "parkedVehicle": "parked_vehicle",
    "constructionZone": "construction_zone",
    "roadBoundary": "structure",
    "building": "structure",
    "pillar": "structure",
    "median_strip": "structure",
}
#: Limit of each sign that has no value of its own [m/s]; every country's list of signs has one named MAX_SPEED.
_LIMITS = {"MAX_SPEED": np.nan, "MAX_SPEED_ZONE_START": 30.0 / 3.6, "TOWN_SIGN": 50.0 / 3.6}
#: A lanelet that turns by this much in one sense comes back to where it began [rad].
_CLOSED = 1.5 * np.pi
#: Values that recordings seldom state; derived ones are no remark where no vehicle states them.
_OFTEN_ABSENT = ("acceleration", "yaw_rate")
_PLAIN_KINDS = ("car", "truck", "bus", "motorcycle", "bicycle", "pedestrian", "train", "taxi")


@dataclass
class _Notes:
    """Collects ids per remark, so that each remark becomes one line."""

    ids: dict[str, list[int]] = field(default_factory=lambda: defaultdict(list))

    def add(self, remark: str, number: int) -> None:
        if number not in self.ids[remark]:
            self.ids[remark].append(number)

    def lines(self) -> tuple[str, ...]:
        return tuple(f"{remark}: {_listed(ids)}" for remark, ids in self.ids.items())


def _listed(ids: list[int]) -> str:
    shown = ", ".join(str(number) for number in sorted(ids)[:5])
    return shown if len(ids) <= 5 else f"{shown} and {len(ids) - 5} more"


def converted(
    scenario: Foreign, problems: Mapping[int, Foreign], *, file: str, path: Path | None, sha256: str, facts: Facts
) -> Scenario:
    """Converts a scenario and planning problems of commonroad-io or of `elements` to a `Scenario`.

    Args:
        scenario: `commonroad.scenario.scenario.Scenario`, or an `elements.Document`.
        problems: `commonroad.planning.planning_problem.PlanningProblem` by id, or those of the document.
        file: Name of the input in messages.
        path: File of the input, or None.
        sha256: Hash of that file.
        facts: What a file states beside them; empty for objects from memory.

    Returns:
        The scenario; all its coordinates are finite.

    Raises:
        InputError: The scenario cannot be used; the message names the element.
    """
    dt = float(scenario.dt)
    notes = _Notes()
    benchmark_id = facts.benchmark_id or str(scenario.scenario_id)
    lanelets = _lanelets(scenario.lanelet_network, notes)
    obstacles = _obstacles(scenario, dt, file, notes)
    planning_problems = tuple(_planning_problem(problems[number], lanelets, file, notes) for number in sorted(problems))
    lights, lines = control(scenario.lanelet_network, lanelets, benchmark_id)
    dangling = dangling_in_network(scenario.lanelet_network) if facts.dangling is None else facts.dangling
    found = Scenario(
        name=readable(path.stem) if path is not None else benchmark_id,
        benchmark_id=benchmark_id,
        dt=dt,
        lanelets=lanelets,
        obstacles=obstacles,
        planning_problems=planning_problems,
        path=path,
        sha256=sha256,
        notes=(
            *dangling,
            *facts.notes,
            *missing_heights(scenario.lanelet_network.lanelets),
            *notes.lines(),
            *control_notes(scenario.lanelet_network, lanelets, lines),
            *_not_obeyed(scenario.lanelet_network),
        ),
        incomings=_incomings(scenario.lanelet_network),
        traffic_lights=lights,
        stop_lines=lines,
        priorities=priorities(scenario.lanelet_network, lanelets, benchmark_id, facts),
        crosswalks=crosswalks(scenario.lanelet_network, lanelets),
    )
    limits.require_scenario(found, file)
    return found


# Lanelets


def _lanelets(network: Foreign, notes: _Notes) -> Lanelets:
    lanelets = sorted(network.lanelets, key=lambda lanelet: int(lanelet.lanelet_id))
    ids = np.array([lanelet.lanelet_id for lanelet in lanelets], dtype=np.int64)
    left, right = [], []
    for lanelet in lanelets:
        bounds = [np.array(side, dtype=np.float64)[:, :2] for side in (lanelet.left_vertices, lanelet.right_vertices)]
        turned = turned_bound(*bounds)
        if turned is not None:
            bounds[turned] = bounds[turned][::-1]
            side = ("left", "right")[turned]
            notes.add(
                f"bounds in opposite directions, the {side} one is turned round, lanelets", int(lanelet.lanelet_id)
            )
        left.append(np.ascontiguousarray(bounds[0]))
        right.append(np.ascontiguousarray(bounds[1]))
    signs = {sign.traffic_sign_id: sign for sign in network.traffic_signs}

    def neighbours(side: str) -> tuple[Any, Any]:
        numbers = [getattr(lanelet, f"adj_{side}") for lanelet in lanelets]
        same = [bool(getattr(lanelet, f"adj_{side}_same_direction")) for lanelet in lanelets]
        return np.array([-1 if number is None else number for number in numbers], dtype=np.int64), np.array(
            same, dtype=bool
        )

    adjacent_left, left_same = neighbours("left")
    adjacent_right, right_same = neighbours("right")
    heights = tuple(heights_of(lanelet) for lanelet in lanelets)
    return Lanelets(
        ids=ids,
        left=tuple(left),
        right=tuple(right),
        predecessors=tuple(tuple(int(i) for i in lanelet.predecessor or ()) for lanelet in lanelets),
        successors=tuple(tuple(int(i) for i in lanelet.successor or ()) for lanelet in lanelets),
        adjacent_left=adjacent_left,
        adjacent_left_same_direction=left_same,
        adjacent_right=adjacent_right,
        adjacent_right_same_direction=right_same,
        speed_limit=np.array([_speed_limit(lanelet, signs, notes) for lanelet in lanelets]),
        types=tuple(
            tuple(sorted(name for kind in lanelet.lanelet_type or () if (name := name_of(kind)) != "unknown"))
            for lanelet in lanelets
        ),
        left_marking=_stated(tuple(name_of(lanelet.line_marking_left_vertices) for lanelet in lanelets), "unknown"),
        right_marking=_stated(tuple(name_of(lanelet.line_marking_right_vertices) for lanelet in lanelets), "unknown"),
        users=_stated(
            tuple(
                tuple(sorted({name_of(user) for user in (*lanelet.user_one_way, *lanelet.user_bidirectional)}))
                for lanelet in lanelets
            ),
            (),
        ),
        heights=heights if any(len(one) for one in heights) else (),
    )


def _stated(values: tuple[Value, ...], nothing: Value) -> tuple[Value, ...]:
    """Values of all lanelets or obstacles; empty where none states anything."""
    return () if all(value == nothing for value in values) else values


def turned_bound(left: NDArray[np.float64], right: NDArray[np.float64]) -> int | None:
    """Which bound runs against the other and is on its side if turned round (0: left, 1: right); None if none does."""
    if min(len(left), len(right)) < 2:
        return None

    def apart(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
        return float(np.hypot(*(a - b)))

    along = apart(left[0], right[0]) + apart(left[-1], right[-1])
    against = apart(left[0], right[-1]) + apart(left[-1], right[0])
    # Ends of a bend, or of a wide and short lanelet, may be nearer to the wrong ones: the first steps tell, too.
    steps = [bound[-1] - bound[0] for bound in (left, right)]
    if not (against < along and float(steps[0] @ steps[1]) < 0.0):
        return None
    outline = np.concatenate((left, right))
    x, y = outline.T
    # Clockwise along the left and back along the right bound: the left one lies on the left of its own direction.
    area = float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    return 1 if area < 0.0 else 0


def _not_obeyed(network: Foreign) -> tuple[str, ...]:
    """One line if there are signs that planners do not obey."""
    count = sum(not (is_sign(sign, _LIMITS) or is_priority_sign(sign)) for sign in network.traffic_signs)
    what = "1 traffic sign is" if count == 1 else f"{count} traffic signs are"
    return (
        (f"{what} not obeyed: planners know speed limits, signs of priority and traffic lights only",) if count else ()
    )


def _incomings(network: Foreign) -> tuple[Incoming, ...]:
    """Incoming elements of all intersections; commonroad-io 2024 and 2026 use different names for their parts."""

    def ids(owner: Foreign, *names: str) -> tuple[int, ...]:
        return tuple(sorted({int(number) for name in names for number in getattr(owner, name, None) or ()}))

    ways = ("right", "straight", "left")
    found = [
        Incoming(
            id=int(incoming.incoming_id),
            intersection_id=int(intersection.intersection_id),
            lanelet_ids=ids(incoming, "incoming_lanelets"),
            connector_ids=ids(incoming, *(f"{group}_{way}" for group in ("outgoing", "successors") for way in ways)),
        )
        for intersection in network.intersections
        for incoming in intersection.incomings
    ]
    return tuple(sorted(found, key=lambda one: (one.intersection_id, one.id)))


def _speed_limit(lanelet: Foreign, signs: dict[int, Any], notes: _Notes) -> float:
    """Lowest limit among the lanelet's signs [m/s]; that of a town counts only where there is no other."""
    found, town = [], []
    for number in lanelet.traffic_signs or ():
        for element in signs[number].traffic_sign_elements if number in signs else ():
            name = element.traffic_sign_element_id.name
            if name == "TOWN_SIGN":
                town.append(_LIMITS[name])
            if name == "TOWN_SIGN" or name not in _LIMITS:
                continue
            try:
                limit = float(element.additional_values[0])
            except (IndexError, TypeError, ValueError):
                limit = _LIMITS[name]
            if 0.0 < limit <= limits.LARGEST_SPEED_LIMIT:
                found.append(limit)
                if limit > limits.USUAL_SPEED_LIMIT:
                    notes.add(
                        f"speed limits above {limits.USUAL_SPEED_LIMIT:g} m/s, probably km/h, kept; traffic signs",
                        int(number),
                    )
            else:
                notes.add("speed limits without a sensible value left out, traffic signs", int(number))
    return min(found or town, default=np.nan)


# States


def _scalar(value: Foreign) -> float:
    """A number, or the middle of an interval; nan for None."""
    if value is None:
        return float("nan")
    if hasattr(value, "start"):
        return 0.5 * (float(value.start) + float(value.end))
    return float(value)


def _area(source: Foreign, what: str, file: str) -> Shape:
    """A non-empty area, which has a middle."""
    area = source if isinstance(source, Shape) else shape_of(source)
    parts = [area]
    while parts:
        part = parts.pop()
        parts += part.members
        if (part.kind == "group" and not part.members) or (part.kind == "polygon" and len(part.vertices) < 3):
            raise InputError(f"{file}: {what} an area without any shape; give it one")
    return area


def _first_step(value: Foreign) -> int:
    return int(value.start) if hasattr(value, "start") else int(value)


def _row(state: Foreign, what: str, file: str) -> tuple[int, tuple[float, ...], bool]:
    """Time step, columns as in `STATE_FIELDS` (nan: not stated) and whether anything was uncertain."""
    values = vars(state)
    position = values.get("position")
    time_step = values.get("time_step")
    if position is None or time_step is None:
        raise InputError(f"{file}: {what} has a state without position or time; add it")
    exact = isinstance(position, (np.ndarray, list, tuple))
    x, y = position[:2] if exact else middle_of(_area(position, f"{what} has a state whose position is", file))
    numbers = [values.get(name) for name in ("orientation", "velocity", "acceleration", "yaw_rate")]
    uncertain = not exact or hasattr(time_step, "start") or any(hasattr(number, "start") for number in numbers)
    orientation, velocity, acceleration, yaw_rate = (_scalar(number) for number in numbers)
    velocity_y = _scalar(values.get("velocity_y"))
    if not np.isnan(velocity_y) and np.isnan(orientation):
        # A point mass has no heading: its two velocities are those along the axes of the world.
        speed = float(np.hypot(velocity, velocity_y))
        if speed > 1e-3:
            orientation = float(np.arctan2(velocity_y, velocity))
        velocity = speed
    row = (float(x), float(y), orientation, velocity, acceleration, yaw_rate)
    return _first_step(time_step), row, uncertain


# Obstacles


def _obstacles(scenario: Foreign, dt: float, file: str, notes: _Notes) -> Obstacles:
    for obstacle in getattr(scenario, "phantom_obstacle", ()):
        notes.add("phantom obstacles left out", int(obstacle.obstacle_id))
    buildings = [_Standing(obstacle, file) for obstacle in getattr(scenario, "environment_obstacle", ())]
    statics = {int(obstacle.obstacle_id) for obstacle in (*scenario.static_obstacles, *buildings)}
    sources = sorted(
        [*scenario.static_obstacles, *scenario.dynamic_obstacles, *buildings],
        key=lambda obstacle: int(obstacle.obstacle_id),
    )
    ids = [int(obstacle.obstacle_id) for obstacle in sources]
    for first, second in itertools.pairwise(ids):
        if first == second:
            raise InputError(f"{file}: two obstacles have the id {first}; give each its own")
    tracks, shapes = [], []
    for obstacle, number in zip(sources, ids, strict=True):
        if isinstance(obstacle, _Standing):
            tracks.append(track(np.zeros(1, dtype=np.int64), np.zeros((1, 6))))
            shapes.append(obstacle.shape)
            continue
        tracks.append(_track(obstacle, number in statics, dt, file, notes))
        shape = _shape(obstacle.obstacle_shape, number, file)
        # Footprints may be made anywhere in the world; their size is checked around their centres.
        limits.require_shape(shape, f"obstacle {number}", file)
        shapes.append(shape)
    _note_derived(dict(zip(ids, tracks, strict=True)), len(set(ids) - statics), notes)
    is_static = np.array([number in statics for number in ids], dtype=np.bool_)
    kinds = tuple(_kind(obstacle) for obstacle in sources)
    return _tables(ids, kinds, tuple(shapes), is_static, tracks, file)


def _note_derived(tracks: Mapping[int, Track], n_moving: int, notes: _Notes) -> None:
    """Notes what was derived; acceleration and yaw rate only where others have them, because most files state none."""
    for name in STATE_FIELDS:
        lacking = [number for number, one in tracks.items() if name in one.derived]
        if name in _OFTEN_ABSENT and len(lacking) == n_moving:
            continue
        for number in lacking:
            notes.add(f"{name.replace('_', ' ')} derived from the motion, obstacles", number)


class _Standing:
    """An environment obstacle of the format 2020a as a static one; its shape is in the world frame."""

    def __init__(self, obstacle: Foreign, file: str) -> None:
        self.obstacle_id, self.obstacle_type = obstacle.obstacle_id, obstacle.obstacle_type
        occupied = obstacle.occupancy if hasattr(obstacle, "occupancy") else obstacle.obstacle_shape
        self.shape = _shape(getattr(occupied, "shape", occupied), int(self.obstacle_id), file)


def _shape(source: Foreign, number: int, file: str) -> Shape:
    if isinstance(source, Shape):
        return source
    try:
        return shape_of(source)
    except (AttributeError, IndexError, TypeError, ValueError) as error:
        raise InputError(f"{file}: the shape of obstacle {number} cannot be read; correct it") from error


def _kind(obstacle: Foreign) -> str:
    value = name_of(obstacle.obstacle_type)
    return value if value in _PLAIN_KINDS else _KINDS.get(value, "unknown")


def _track(obstacle: Foreign, is_static: bool, dt: float, file: str, notes: _Notes) -> Track:
    number = int(obstacle.obstacle_id)
    prediction = None if is_static else obstacle.prediction
    trajectory = getattr(prediction, "trajectory", None)
    if prediction is not None and trajectory is None:
        notes.add("set-based predictions left out, the obstacle is there at its initial time step only", number)
    states = [obstacle.initial_state, *(trajectory.state_list if trajectory is not None else ())]
    steps, rows = [], []
    for state in states:
        step, row, uncertain = _row(state, f"obstacle {number}", file)
        if uncertain:
            notes.add("uncertain states replaced by their middle, obstacles", number)
        limits.require_time_step(step, f"obstacle {number}", file)
        steps.append(step)
        rows.append(row)
    time_steps, values = np.array(steps, dtype=np.int64), np.array(rows, dtype=np.float64)
    table = getattr(trajectory, "table", None)
    if table is not None:
        time_steps, values = np.concatenate((time_steps, table[0])), np.concatenate((values, table[1]))
    recorded = track(time_steps, values)
    limits.require_states(recorded.values, f"obstacle {number}", file)
    if recorded.contradicts:
        notes.add("a time step stated twice at different places, the first counts, obstacles", number)
    if is_static:
        recorded.values[:, 3:] = 0.0
    result = completed(recorded, dt)
    if len(result.time_steps) > 1 and np.any(np.diff(result.time_steps) > 1):
        notes.add("absent between recorded time steps, obstacles", number)
    return result


def _tables(
    ids: list[int],
    kinds: tuple[str, ...],
    shapes: tuple[Shape, ...],
    is_static: NDArray[np.bool_],
    tracks: list[Track],
    file: str,
) -> Obstacles:
    last = [0 if static else int(one.time_steps[-1]) for one, static in zip(tracks, is_static, strict=True)]
    n_steps = max(last, default=0) + 1
    if ids:
        n_states = sum(len(one.time_steps) for one in tracks)
        limits.require_table(len(ids), n_steps, n_states, f"obstacle {ids[int(np.argmax(last))]}", file)
    table = np.full((6, len(ids), n_steps), np.nan)
    for row, (one, static) in enumerate(zip(tracks, is_static, strict=True)):
        if static:
            table[:, row, :] = one.values[0][:, None]
        else:
            table[:, row, one.time_steps] = one.values.T
    x, y, orientation, velocity, acceleration, yaw_rate = table
    return Obstacles(
        ids=np.array(ids, dtype=np.int64),
        kinds=kinds,
        shapes=shapes,
        is_static=is_static,
        x=x,
        y=y,
        orientation=orientation,
        velocity=velocity,
        acceleration=acceleration,
        yaw_rate=yaw_rate,
        valid=np.isfinite(x),
        derived=_stated(tuple(one.derived_first for one in tracks), ()),
    )


# Planning problems


def _planning_problem(problem: Foreign, lanelets: Lanelets, file: str, notes: _Notes) -> PlanningProblem:
    number = int(problem.planning_problem_id)
    what = f"planning problem {number}"
    step, row, uncertain = _row(problem.initial_state, what, file)
    if uncertain:
        notes.add("uncertain initial states replaced by their middle, planning problems", number)
    x, y, orientation, velocity, acceleration, yaw_rate = row
    if np.isnan(orientation) or np.isnan(velocity):
        raise InputError(f"{file}: the initial state of {what} lacks orientation or velocity; add it")
    limits.require_values((x, y), limits.LARGEST_COORDINATE, what, file, "coordinate")
    initial = InitialState(
        time_step=step,
        x=x,
        y=y,
        orientation=float(wrapped(np.array(orientation))),
        velocity=velocity,
        acceleration=acceleration,
        yaw_rate=yaw_rate,
    )
    states = problem.goal.state_list
    if not states:
        notes.add("no goal, planning problems", number)
    by_lanelet = problem.goal.lanelets_of_goal_position or {}
    goal = tuple(
        _goal_state(state, by_lanelet.get(index, ()), lanelets, what, file) for index, state in enumerate(states)
    )
    return PlanningProblem(number, initial, goal)


def _goal_state(state: Foreign, lanelet_ids: Iterable[int], lanelets: Lanelets, what: str, file: str) -> GoalState:
    values = vars(state)
    ids = tuple(int(number) for number in lanelet_ids)
    if ids:
        areas = tuple(area for number in ids for area in _lanelet_areas(number, lanelets, what, file))
    elif values.get("position") is None:
        areas = ()
    elif isinstance(values["position"], np.ndarray):
        raise InputError(f"{file}: the goal of {what} is a point, which no vehicle can reach; give an area")
    else:
        area = _area(values["position"], f"the goal of {what} is", file)
        areas = area.members if area.kind == "group" else (area,)
    time_step = values.get("time_step")
    first, last = _interval(time_step) or (0.0, float(limits.LARGEST_GOAL_TIME_STEP))
    return GoalState(
        areas=areas,
        lanelet_ids=ids,
        time_step=(int(first), int(last)),
        velocity=_interval(values.get("velocity")),
        orientation=_interval(values.get("orientation")),
    )


def _interval(value: Foreign) -> tuple[float, float] | None:
    if value is None:
        return None
    if hasattr(value, "start"):
        return float(value.start), float(value.end)
    return float(value), float(value)


def _lanelet_areas(number: int, lanelets: Lanelets, what: str, file: str) -> tuple[Shape, ...]:
    """The area of a lanelet, in pieces if it turns back to its beginning: a polygon must not touch itself."""
    row = int(np.searchsorted(lanelets.ids, number))
    if row == len(lanelets.ids) or lanelets.ids[row] != number:
        raise InputError(f"{file}: the goal of {what} is lanelet {number}, which does not exist; correct the reference")
    left, right = lanelets.left[row], lanelets.right[row]
    cuts = _cuts(0.5 * (left + right)) if len(left) == len(right) else [0, len(left) - 1]
    if len(cuts) == 2:
        return (polygon(np.concatenate((left, right[::-1]))),)
    return tuple(
        polygon(np.concatenate((left[a : b + 1], right[a : b + 1][::-1]))) for a, b in itertools.pairwise(cuts)
    )


def _cuts(center: NDArray[np.float64]) -> list[int]:
    """First vertices of pieces of a line that turn by half a circle each, and the last vertex."""
    last = len(center) - 1
    side = np.diff(center, axis=0)
    heading = np.unwrap(np.arctan2(side[:, 1], side[:, 0]))
    turned = np.abs(heading - heading[0])
    if len(heading) < 4 or turned.max() < _CLOSED:
        return [0, last]
    n = int(np.ceil(turned.max() / np.pi))
    inner = (int(np.argmax(turned >= turned.max() * i / n)) for i in range(1, n))
    return sorted({0, last, *inner})
