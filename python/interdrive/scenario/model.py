"""Contents of a CommonRoad file as arrays: roads, recorded traffic, planning problems. Immutable."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from interdrive.scenario.control import Priorities
from interdrive.scenario.shape import centred

if TYPE_CHECKING:
    from pathlib import Path

    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.scenario.control import StopLine, TrafficLight
    from interdrive.scenario.shape import Shape
    from interdrive.scenario.sumo import SumoTraffic

T = TypeVar("T")


def _freeze(instance: object) -> None:
    """Forbids writing to the arrays of a dataclass."""
    for name in instance.__dataclass_fields__:  # type: ignore[attr-defined]
        value = getattr(instance, name)
        for array in value if isinstance(value, tuple) else (value,):
            if isinstance(array, np.ndarray):
                array.setflags(write=False)


#: Kinds of participants; the position is the code that crosses the boundary to the core.
KINDS = (
    "unknown",
    "car",
    "truck",
    "bus",
    "motorcycle",
    "bicycle",
    "pedestrian",
    "priority_vehicle",
    "train",
    "taxi",
    "parked_vehicle",
    "construction_zone",
    "structure",
)

#: Fields of a state, in the order of the core.
STATE_FIELDS = ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate")


@dataclass(frozen=True)
class Lanelets:
    """The road network as the file states it, one entry per lanelet, sorted by id.

    Attributes:
        ids: Lanelet ids, shape (lanelets,).
        left: Left bound of each [m], shape (vertices, 2), in driving direction.
        right: Right bound of each [m], as many vertices as the left one.
        predecessors: Ids per lanelet.
        successors: Ids per lanelet.
        adjacent_left: Id of the left neighbour, -1 for none, shape (lanelets,).
        adjacent_left_same_direction: Whether it runs in the same direction, shape (lanelets,).
        adjacent_right: Id of the right neighbour, -1 for none, shape (lanelets,).
        adjacent_right_same_direction: Whether it runs in the same direction, shape (lanelets,).
        speed_limit: Speed limit [m/s], nan where the file states none, shape (lanelets,).
        types: CommonRoad's lanelet types per lanelet; what they mean: `interdrive.scenario.lanes`.
        left_marking: CommonRoad's name of the line on the left bound of each, such as "solid"; empty: none is known.
        right_marking: The same on the right bound.
        users: CommonRoad's road users per lanelet, such as "vehicle"; empty: none are stated.
        heights: Height of the middle between both bounds at each of their vertices [m], shape (vertices,) per lanelet;
            an empty array: of this lanelet none are stated; empty: of no lanelet.
    """

    ids: Ints
    left: tuple[Floats, ...]
    right: tuple[Floats, ...]
    predecessors: tuple[tuple[int, ...], ...]
    successors: tuple[tuple[int, ...], ...]
    adjacent_left: Ints
    adjacent_left_same_direction: Bools
    adjacent_right: Ints
    adjacent_right_same_direction: Bools
    speed_limit: Floats
    types: tuple[tuple[str, ...], ...]
    left_marking: tuple[str, ...] = ()
    right_marking: tuple[str, ...] = ()
    users: tuple[tuple[str, ...], ...] = ()
    heights: tuple[Floats, ...] = ()

    def __repr__(self) -> str:
        return f"<Lanelets: {len(self.ids)}>"

    def __post_init__(self) -> None:
        """Arrays are read-only from here on."""
        _freeze(self)


@dataclass(frozen=True)
class Obstacles:
    """Recorded traffic, one row per obstacle, sorted by id.

    The tables have shape (obstacles, time_steps) and start at time step 0; where `valid` is false the obstacle is
    absent and the numbers are nan. A static obstacle is valid at every step and stays for ever. Positions are the
    centres of footprints: a footprint whose centre is elsewhere in its body frame, such as that of a vehicle that was
    recorded by its rear axle or of a building in world coordinates, is moved there together with its states, and
    what never moves is turned along its footprint.

    Attributes:
        ids: Obstacle ids, shape (obstacles,).
        kinds: One of `KINDS` each.
        shapes: Footprints in the body frame.
        is_static: Static obstacle, shape (obstacles,).
        x: Position [m]. y: Position [m].
        orientation: Heading [rad]; derived from the motion where the file has none.
        velocity: Speed along the heading [m/s]; derived where the file has none.
        acceleration: Acceleration [m/s²]; derived where the file has none.
        yaw_rate: Change of heading [rad/s]; derived where the file has none.
        valid: Whether the obstacle is present at that time step.
        derived: For each obstacle the names in `STATE_FIELDS` of what the file does not state at its first time step;
            empty: it states everything.
    """

    ids: Ints
    kinds: tuple[str, ...]
    shapes: tuple[Shape, ...]
    is_static: Bools
    x: Floats
    y: Floats
    orientation: Floats
    velocity: Floats
    acceleration: Floats
    yaw_rate: Floats
    valid: Bools
    derived: tuple[tuple[str, ...], ...] = ()

    def standing(self) -> Obstacles:
        """Those that never move."""
        return self.only(np.flatnonzero(self.is_static))

    def only(self, rows: Ints, steps: slice = slice(None)) -> Obstacles:
        """The obstacles in some rows, repeated where a row is, at some time steps."""

        def kept(values: tuple[T, ...]) -> tuple[T, ...]:
            return tuple(values[row] for row in rows.tolist()) if values else ()

        tables = {name: getattr(self, name)[rows, steps] for name in (*STATE_FIELDS, "valid")}
        return replace(
            self,
            ids=self.ids[rows],
            kinds=kept(self.kinds),
            shapes=kept(self.shapes),
            is_static=self.is_static[rows],
            derived=kept(self.derived),
            **tables,
        )

    def __repr__(self) -> str:
        return f"<Obstacles: {len(self.ids)} over {self.x.shape[1]} time steps>"

    def __post_init__(self) -> None:
        """Positions become the centres of footprints; arrays are read-only from here on."""
        self._centre()
        _freeze(self)

    def _centre(self) -> None:
        moved = [centred(shape, stands=bool(stands)) for shape, stands in zip(self.shapes, self.is_static, strict=True)]
        object.__setattr__(self, "shapes", tuple(shape for shape, _, _ in moved))
        rows = [row for row, (_, offset, turn) in enumerate(moved) if offset != (0.0, 0.0) or turn != 0.0]
        if not rows:
            return
        x, y, heading = self.x.copy(), self.y.copy(), self.orientation.copy()
        for row in rows:
            _, (ahead, left), turn = moved[row]
            cos, sin = np.cos(heading[row]), np.sin(heading[row])
            x[row] += ahead * cos - left * sin
            y[row] += ahead * sin + left * cos
            if turn != 0.0:
                heading[row] = np.arctan2(np.sin(heading[row] + turn), np.cos(heading[row] + turn))
        for name, table in (("x", x), ("y", y), ("orientation", heading)):
            object.__setattr__(self, name, table)

    @property
    def n_steps(self) -> int:
        """Number of time steps of the tables (at least 1)."""
        return int(self.x.shape[1])


@dataclass(frozen=True)
class GoalState:
    """One alternative of a goal; all stated conditions must hold at once.

    Attributes:
        areas: Shapes in the world frame, any of which must contain the position. Lanelets of the goal are here as
            polygons. Empty: anywhere.
        lanelet_ids: Lanelets from which the areas were made, if the file states lanelets.
        time_step: First and last time step, both included.
        velocity: Interval of speeds [m/s], or None.
        orientation: Interval of headings [rad], counter-clockwise from the first to the second, or None.
    """

    areas: tuple[Shape, ...]
    lanelet_ids: tuple[int, ...]
    time_step: tuple[int, int]
    velocity: tuple[float, float] | None = None
    orientation: tuple[float, float] | None = None


@dataclass(frozen=True)
class InitialState:
    """State at the first time step of an agent.

    Attributes:
        time_step: When the agent starts.
        x: Centre of the footprint [m], world frame.
        y: The same [m].
        orientation: Heading [rad], world frame.
        velocity: Speed along the heading [m/s].
        acceleration: Along the heading [m/s²]; nan where unknown.
        yaw_rate: Change of heading [rad/s]; nan where unknown.
    """

    time_step: int
    x: float
    y: float
    orientation: float
    velocity: float
    acceleration: float = 0.0
    yaw_rate: float = float("nan")


@dataclass(frozen=True)
class PlanningProblem:
    """A planning problem of the file: start and goal of an agent.

    Attributes:
        id: Id of the problem, which is that of its agent.
        initial_state: Start.
        goal: Alternatives, of which one must be met; empty if the file states none.
    """

    id: int
    initial_state: InitialState
    goal: tuple[GoalState, ...]

    def __repr__(self) -> str:
        start = self.initial_state
        at = f"({start.x:.2f}, {start.y:.2f}) m at time step {start.time_step}, {start.velocity:.2f} m/s"
        return f"<PlanningProblem {self.id}: from {at}>"


@dataclass(frozen=True)
class Incoming:
    """One incoming element of an intersection, as stated in the file.

    Attributes:
        id: Id of the incoming element.
        intersection_id: Id of the intersection.
        lanelet_ids: Lanelets that lead to the intersection.
        connector_ids: Lanelets that lead across the intersection from there: to the right, straight on, to the left.
    """

    id: int
    intersection_id: int
    lanelet_ids: tuple[int, ...]
    connector_ids: tuple[int, ...]


@dataclass(frozen=True)
class ScenarioSource:
    """Files of another format from which a scenario was made.

    Attributes:
        format: Name of the format, such as "OpenDRIVE".
        files: Name and SHA-256 of every file that was read; the first one is that of the scenario.
        options: Name and text of every option that was not the default.
        keys: What the source calls each lanelet, in their order.
        location: Where on earth the roads are, in the words of the source; empty: unknown.
        lights: Ids of traffic lights that the source labels, and their labels.
    """

    format: str
    files: tuple[tuple[str, str], ...]
    options: tuple[tuple[str, str], ...] = ()
    keys: tuple[str, ...] = ()
    location: str = ""
    lights: tuple[tuple[int, str], ...] = ()

    def __repr__(self) -> str:
        return f"<ScenarioSource: {self.format}, {', '.join(name for name, _ in self.files)}>"


@dataclass(frozen=True)
class Scenario:
    """The contents of a CommonRoad file, or of a file of another format.

    Attributes:
        name: Name of the file without its ending, or the benchmark id of a scenario that came from memory.
        benchmark_id: The id written in the file; not unique in practice.
        dt: Time between steps [s].
        lanelets: The roads.
        obstacles: Recorded traffic.
        planning_problems: Sorted by id.
        path: The file; None if the scenario came from memory.
        sha256: Hash of the file's bytes; empty if the scenario came from memory.
        notes: Parts that were repaired, derived or left out while reading, one line each.
        incomings: Incoming elements of intersections, sorted by intersection and id; empty if the file has none.
        traffic_lights: Sorted by id.
        stop_lines: Where vehicles stop for lights and stop signs, sorted by lanelet.
        priorities: Right of way at junctions, as far as the file says.
        crosswalks: Lanelets on which people cross the road, ascending ids.
        raw: Its recordings were not repaired, see `interdrive.read_scenario`.
        start: Time step of the recording that is 0 here, where a run begins later than the file.
        turned: Angle by which all headings were turned when the file was read [rad].
        overlaps: Pairs of ids of recorded participants that overlap at some time; ascending.
        source: The files from which it was made; None: it is that of a CommonRoad file, or came from memory.
        sumo: Traffic that SUMO drives; None: there is none.
    """

    name: str
    benchmark_id: str
    dt: float
    lanelets: Lanelets
    obstacles: Obstacles
    planning_problems: tuple[PlanningProblem, ...]
    path: Path | None = None
    sha256: str = ""
    notes: tuple[str, ...] = ()
    incomings: tuple[Incoming, ...] = ()
    traffic_lights: tuple[TrafficLight, ...] = ()
    stop_lines: tuple[StopLine, ...] = ()
    priorities: Priorities = field(default_factory=Priorities)
    crosswalks: tuple[int, ...] = ()
    raw: bool = False
    start: int = 0
    turned: float = 0.0
    overlaps: tuple[tuple[int, int], ...] = ()
    source: ScenarioSource | None = None
    sumo: SumoTraffic | None = None

    @property
    def overlapping(self) -> frozenset[int]:
        """Ids of the recorded participants of `overlaps`, which are not scored."""
        return frozenset(number for pair in self.overlaps for number in pair)

    def __repr__(self) -> str:
        still = int(self.obstacles.is_static.sum())
        counts = (
            (len(self.lanelets.ids), "lanelets"), (len(self.obstacles.ids) - still, "recorded participants"),
            (still, "static obstacles"), (len(self.planning_problems), "planning problems"),
        )  # fmt: skip
        return f"<Scenario {self.name}: {', '.join(f'{count} {what}' for count, what in counts)}, dt {self.dt:g} s>"
