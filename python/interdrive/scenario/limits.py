"""All bounds on the contents of a scenario, and the check of a converted scenario against them.

They are narrower than those of the core (`limits.rs`). Those that a document is checked against while it is read are
defined there (`crates/commonroad/src/limits.rs`, with units and reasons).

The bounds keep time and memory in proportion to the file: a mistyped exponent must not cost gigabytes. They are far
beyond real maps and recordings, whose lanelets are up to 10 km long and whose recordings have up to 30,000 steps.
"""

from __future__ import annotations

import itertools
import weakref
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from interdrive.array_types import Floats
    from interdrive.scenario.model import Lanelets, Obstacles, PlanningProblem, Scenario
    from interdrive.scenario.shape import Shape

LARGEST_ID = _core.LARGEST_ID
SMALLEST_DT, LARGEST_DT = _core.SMALLEST_DT, _core.LARGEST_DT
LARGEST_TIME_STEP, LARGEST_GOAL_TIME_STEP = _core.LARGEST_TIME_STEP, _core.LARGEST_GOAL_TIME_STEP
LARGEST_COORDINATE, LARGEST_ANGLE = _core.LARGEST_COORDINATE, _core.LARGEST_ANGLE
LARGEST_VELOCITY, LARGEST_ACCELERATION = _core.LARGEST_VELOCITY, _core.LARGEST_ACCELERATION
LARGEST_YAW_RATE = _core.LARGEST_YAW_RATE
MOST_LANELETS, MOST_POINTS_OF_A_LANELET = _core.MOST_LANELETS, _core.MOST_POINTS_OF_A_LANELET
MOST_POINTS, MOST_OBSTACLES = _core.MOST_POINTS, _core.MOST_OBSTACLES
DEEPEST = _core.DEEPEST
MOST_STATES, MOST_PROBLEMS, MOST_GOALS = _core.MOST_STATES, _core.MOST_PROBLEMS, 1_000
#: Lanelets end this far [m] before that, so that agents that drive beyond them still have valid coordinates.
ROOM_BEYOND_MAP = 1e6
#: Distance travelled in a recording [m]: an agent's reference path leads through all its positions.
LONGEST_RECORDING = 1e5
#: Size of a footprint [m]: walls and buildings are obstacles, too.
SMALLEST_SIZE, LARGEST_FOOTPRINT = 1e-6, 1e5
#: Time steps of a run that is as long as its settings say.
MOST_STEPS = 1_000_000
#: Speed limits above this [m/s] are probably in a wrong unit and are ignored.
LARGEST_SPEED_LIMIT = 150.0
#: Those above this [m/s] (162 km/h) are kept, and noted.
USUAL_SPEED_LIMIT = 45.0

#: Length of one lanelet, of all lanelets together, and extent of the map along an axis [m].
LONGEST_LANELET, LONGEST_ROADS, LARGEST_EXTENT = 1e5, 2e6, 1e6
#: Counted elements, and advice for too many of them.
LANELETS, POINTS = ("lanelets", "cut it"), ("points", "cut it")
POINTS_OF_A_LANELET = ("points on a bound", "thin them out or split it")
OBSTACLES, STATES, PROBLEMS = ("obstacles", "cut it"), ("states", "cut it"), ("planning problems", "split it")
_UNITS = {
    **{"coordinate": "m", "size": "m", "orientation": "rad"},
    **{"velocity": "m/s", "acceleration": "m/s²", "yaw rate": "rad/s"},
}
#: What each column of a state is called, and its largest value.
_LARGEST_OF_STATES = (
    *[("coordinate", LARGEST_COORDINATE)] * 2,
    ("orientation", LARGEST_ANGLE),
    ("velocity", LARGEST_VELOCITY),
    ("acceleration", LARGEST_ACCELERATION),
    ("yaw rate", LARGEST_YAW_RATE),
)
#: Vertices of a footprint and of an area; lanelets are areas, too.
MOST_VERTICES_OF_A_FOOTPRINT, MOST_VERTICES = 1_000, 2 * MOST_POINTS_OF_A_LANELET
#: Obstacles times steps of a table; more is a mistyped time step, not a recording.
LARGEST_TABLE = 5_000_000
#: Any table may have this many cells; larger ones at most `CELLS_PER_STATE` for every recorded state.
SMALL_TABLE, CELLS_PER_STATE = 500_000, 200


def require(fits: bool, file: str, what: str, problem: str) -> None:
    """Raises `InputError` with file, element and problem unless a condition holds."""
    if not fits:
        raise InputError(f"{file}: {what} {problem}")


def require_count(n: int, most: int, counted: tuple[str, str], what: str, file: str) -> None:
    """Refuses too many elements; their name and the advice are as in `LANELETS`."""
    name, advice = counted
    require(n <= most, file, what, f"has {n} {name}; at most {most} are possible, {advice}")


def require_dt(dt: float, file: str, text: str | None = None) -> None:
    """Refuses a time step size out of bounds."""
    if not SMALLEST_DT <= dt <= LARGEST_DT:
        shown = f"{dt:g}" if text is None else text[:30]
        raise InputError(
            f"{file}: the time step size (dt) is {shown}; it must be between {SMALLEST_DT:g} and {LARGEST_DT:g} seconds"
        )


def require_roads(n_lanelets: int, file: str) -> None:
    """Refuses a scenario without lanelets."""
    if not n_lanelets:
        raise InputError(f"{file}: has no lanelets; a scenario needs a road network")


def require_id(number: int, what: str, file: str) -> None:
    """Refuses ids that are negative or not exact in every format."""
    if not 0 <= number <= LARGEST_ID:
        shown = str(number) if abs(number) < 10**30 else "of more than 30 digits"
        raise InputError(f"{file}: {what} has the id {shown}; ids must be between 0 and {LARGEST_ID}")


def require_values(values: Floats | Iterable[float], most: float, what: str, file: str, name: str) -> None:
    """Refuses values that are not finite or larger than `most`."""
    array = np.asarray(values, dtype=np.float64)
    if not np.all(np.abs(array) <= most):
        worst = array[~(np.abs(array) <= most)].flat[0]
        beyond = f"larger than {most:g}" if worst > 0.0 else f"smaller than {-most:g}"
        why = f"{beyond} {_UNITS[name]}" if np.isfinite(worst) else "not a finite number"
        raise InputError(f"{file}: {what} has the {name} {worst:g}, which is {why}; correct it")


def require_scenario(scenario: Scenario, file: str) -> None:
    """Refuses a scenario that violates any bound.

    Args:
        scenario: A scenario from a file or built in memory.
        file: Its name in messages.

    Raises:
        InputError: One line that names file and element.
    """
    require_dt(scenario.dt, file)
    _require_lanelets(scenario.lanelets, file)
    _require_obstacles(scenario.obstacles, file)
    require_count(len(scenario.planning_problems), MOST_PROBLEMS, PROBLEMS, "the scenario", file)
    for problem in scenario.planning_problems:
        _require_problem(problem, file)


#: By the identity of lanelets that are in use and within the bounds: a reference to them.
_WITHIN: dict[int, weakref.ref[Lanelets]] = {}


def _require_lanelets(lanelets: Lanelets, file: str) -> None:
    """Refuses lanelets out of bounds; those of many runs are looked at once, since they cannot change."""
    number = id(lanelets)
    if number not in _WITHIN:
        _require_each_lanelet(lanelets, file)
        _WITHIN[number] = weakref.ref(lanelets, lambda _: _WITHIN.pop(number, None))


def _require_each_lanelet(lanelets: Lanelets, file: str) -> None:
    n = len(lanelets.ids)
    require_roads(n, file)
    require_count(n, MOST_LANELETS, LANELETS, "the map", file)
    total, low, high = 0.0, np.full(2, np.inf), np.full(2, -np.inf)
    for number, left, right in zip(lanelets.ids.tolist(), lanelets.left, lanelets.right, strict=True):
        what = f"lanelet {number}"
        require_id(number, "a lanelet", file)
        lengths = []
        for bound in (left, right):
            require(len(bound) >= 2, file, f"a bound of {what}", "has fewer than 2 points; add some")
            require_count(len(bound), MOST_POINTS_OF_A_LANELET, POINTS_OF_A_LANELET, what, file)
            require_values(bound, LARGEST_COORDINATE - ROOM_BEYOND_MAP, what, file, "coordinate")
            low, high = np.minimum(low, bound.min(axis=0)), np.maximum(high, bound.max(axis=0))
            length = float(np.hypot(*np.diff(bound, axis=0).T).sum())
            lengths.append(length)
            require(
                length <= LONGEST_LANELET,
                file,
                what,
                f"is {length:.0f} m long; at most {LONGEST_LANELET:.0f} m are possible, correct its points or split it",
            )
        width = float(np.hypot(*(left[0] - right[0])))
        require(width <= LONGEST_LANELET, file, what, f"is {width:.0f} m wide; correct its points")
        total += max(lengths)
    extent = float((high - low).max())
    require(
        extent <= LARGEST_EXTENT,
        file,
        "the map",
        f"extends over {extent:.0f} m, from ({low[0]:.0f}, {low[1]:.0f})"
        f" to ({high[0]:.0f}, {high[1]:.0f}); at most {LARGEST_EXTENT:.0f} m are possible, correct the lanelets",
    )
    require(
        total <= LONGEST_ROADS,
        file,
        "the map",
        f"has lanelets of {total:.0f} m together; at most {LONGEST_ROADS:.0f} m are possible, cut it",
    )
    points = sum(len(bound) for bound in itertools.chain(lanelets.left, lanelets.right))
    require_count(points, MOST_POINTS, POINTS, "the map", file)


def _require_obstacles(obstacles: Obstacles, file: str) -> None:
    require_count(len(obstacles.ids), MOST_OBSTACLES, OBSTACLES, "the scenario", file)
    require_count(obstacles.n_steps, LARGEST_TIME_STEP + 1, ("time steps", "cut it"), "the recording", file)
    for row, (number, shape) in enumerate(zip(obstacles.ids.tolist(), obstacles.shapes, strict=True)):
        what = f"obstacle {number}"
        require_id(number, "an obstacle", file)
        require_footprint(shape, what, file)
        valid = obstacles.valid[row]
        tables = (
            obstacles.x,
            obstacles.y,
            obstacles.orientation,
            obstacles.velocity,
            obstacles.acceleration,
            obstacles.yaw_rate,
        )
        values = np.column_stack([table[row, valid] for table in tables])
        require(not np.isnan(values).any(), file, what, "has a value that is not a number where it is present")
        require_states(values, what, file)


def require_states(values: Floats, what: str, file: str) -> None:
    """Refuses states out of bounds: columns as in `STATE_FIELDS`, nan where not stated, shape (states, 6)."""
    fits = np.abs(values) <= [most for _, most in _LARGEST_OF_STATES]
    fits[:, 2:] |= np.isnan(values[:, 2:])
    if not fits.all():
        column = int(np.flatnonzero(~fits.all(axis=0))[0])
        name, most = _LARGEST_OF_STATES[column]
        require_values(values[~fits[:, column], column], most, what, file, name)
    travelled = float(np.hypot(*np.diff(values[:, :2], axis=0).T).sum())
    problem = f"travels {travelled:.0f} m; at most {LONGEST_RECORDING:.0f} are possible, correct its positions"
    require(travelled <= LONGEST_RECORDING, file, what, problem)


def require_footprint(shape: Shape, what: str, file: str) -> None:
    """Refuses footprints without area or larger than any real obstacle."""
    require_shape(shape, what, file, LARGEST_FOOTPRINT, MOST_VERTICES_OF_A_FOOTPRINT)


def require_shape(
    shape: Shape, what: str, file: str, largest: float = LARGEST_COORDINATE, most_vertices: int = MOST_VERTICES
) -> None:
    """Refuses shapes without area, with too many vertices or beyond a size and distance from the origin [m].

    The vertices of all parts of a group are counted together.
    """
    require_count(_n_vertices(shape), most_vertices, ("vertices", "thin them out"), f"the shape of {what}", file)
    _require_measures(shape, what, file, largest)


def _n_vertices(shape: Shape) -> int:
    """Number of vertices of all parts; circles and rectangles count as polygons of four vertices."""
    if shape.members:
        return sum(map(_n_vertices, shape.members))
    return len(shape.vertices) if shape.kind == "polygon" else 4


def _require_measures(shape: Shape, what: str, file: str, largest: float) -> None:
    sizes = {"rectangle": (shape.length, shape.width), "circle": (shape.radius,)}.get(shape.kind, ())
    require_values(shape.center, largest, what, file, "coordinate")
    require_values((shape.orientation,), LARGEST_ANGLE, what, file, "orientation")
    require_values(sizes, largest, what, file, "size")
    require(all(size > 0.0 for size in sizes), file, f"the shape of {what}", "has no area; give it a size above 0")
    require(
        all(size >= SMALLEST_SIZE for size in sizes),
        file,
        f"the shape of {what}",
        f"is smaller than {SMALLEST_SIZE:g} m; correct its size",
    )
    if shape.kind == "polygon":
        require(len(shape.vertices) >= 3, file, f"the shape of {what}", "has no area; give it a size above 0")
        require_values(shape.vertices, largest, what, file, "coordinate")
    for member in shape.members:
        _require_measures(member, what, file, largest)


def _require_problem(problem: PlanningProblem, file: str) -> None:
    what = f"planning problem {problem.id}"
    require_id(problem.id, "a planning problem", file)
    start = problem.initial_state
    require_time_step(start.time_step, what, file)
    near = LARGEST_COORDINATE - ROOM_BEYOND_MAP
    for name, value, most in (
        ("coordinate", start.x, near),
        ("coordinate", start.y, near),
        ("orientation", start.orientation, LARGEST_ANGLE),
        ("velocity", start.velocity, LARGEST_VELOCITY),
        ("acceleration", 0.0 if np.isnan(start.acceleration) else start.acceleration, LARGEST_ACCELERATION),
        ("yaw rate", 0.0 if np.isnan(start.yaw_rate) else start.yaw_rate, LARGEST_YAW_RATE),
    ):
        require_values((value,), most, what, file, name)
    require(len(problem.goal) <= MOST_GOALS, file, what, f"has more than {MOST_GOALS} goal states; leave some out")
    for goal in problem.goal:
        for area in goal.areas:
            require_shape(area, f"the goal of {what}", file)
        for time_step in goal.time_step:
            require_time_step(time_step, f"the goal of {what}", file, LARGEST_GOAL_TIME_STEP)
        require_values(goal.orientation or (), LARGEST_ANGLE, f"the goal of {what}", file, "orientation")
        require_values(goal.velocity or (), LARGEST_VELOCITY, f"the goal of {what}", file, "velocity")


def require_time_step(time_step: int, what: str, file: str, last: int = LARGEST_TIME_STEP) -> None:
    """Refuses negative time steps and those beyond `last`."""
    if 0 <= time_step <= last:
        return  # called for every state
    require(time_step >= 0, file, what, f"has the time step {_shown(time_step)}; time steps start at 0")
    shown = f"has the time step {_shown(time_step)}, the largest possible one is {last}; is that a typing error?"
    raise InputError(f"{file}: {what} {shown}")


def _shown(number: int) -> str:
    return str(number) if abs(number) < 10**30 else "of more than 30 digits"


def require_table(n_rows: int, n_steps: int, n_states: int, what: str, file: str) -> None:
    """Refuses a recording whose table would be large only because a time step is far from the others."""
    n_cells = n_rows * n_steps
    most = min(LARGEST_TABLE, max(SMALL_TABLE, CELLS_PER_STATE * n_states))
    require(
        n_cells <= most,
        file,
        what,
        f"has the time step {n_steps - 1}, with {n_rows} obstacles of {n_states} "
        "states in all; is that a typing error?",
    )
