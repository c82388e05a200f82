"""Elements of a CommonRoad document as the core reads them, by the names that commonroad-io has for the same things.

`convert` takes either: these, or the objects of commonroad-io, which has no part in reading XML.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

from interdrive import _core
from interdrive.errors import InputError
from interdrive.files.facts import Facts
from interdrive.scenario import Shape

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.array_types import Floats
    from interdrive.files.shapes import Foreign


class Interval(NamedTuple):
    """An uncertain number."""

    start: float
    end: float


class SignName(NamedTuple):
    """Meaning of an element of a sign, and its code in the document."""

    name: str
    value: str


@dataclass(frozen=True)
class State:
    """What a document states of a state; None for what it leaves out."""

    position: Floats | Shape | None = None
    time_step: int | Interval | None = None
    orientation: float | Interval | None = None
    velocity: float | Interval | None = None
    acceleration: float | Interval | None = None
    yaw_rate: float | Interval | None = None
    velocity_y: float | Interval | None = None


@dataclass(frozen=True)
class Obstacle:
    """An obstacle; `prediction` has a `trajectory` with a `state_list`, or none if it is a set of areas."""

    obstacle_id: int
    obstacle_type: str
    obstacle_shape: Shape | None
    initial_state: State
    prediction: Foreign = None


@dataclass(frozen=True)
class Network:
    """The roads and what stands beside them."""

    lanelets: Sequence[Foreign]
    traffic_signs: Sequence[Foreign]
    traffic_lights: Sequence[Foreign]
    intersections: Sequence[Foreign]


@dataclass(frozen=True)
class Document:
    """The contents of a document; the names are those of a scenario of commonroad-io."""

    dt: float
    scenario_id: str
    lanelet_network: Network
    problems: Mapping[int, Foreign]
    facts: Facts
    static_obstacles: list[Obstacle] = field(default_factory=list)
    dynamic_obstacles: list[Obstacle] = field(default_factory=list)
    environment_obstacle: list[Obstacle] = field(default_factory=list)
    phantom_obstacle: list[Obstacle] = field(default_factory=list)


def read_elements(text: str, file: str) -> Document:
    """Reads a document.

    Args:
        text: The document.
        file: Its name, for messages.

    Raises:
        InputError: It cannot become a scenario; one line names file and element.
        SyntaxError: It is not well-formed, or has a document type declaration; in the words of the parser.
    """
    try:
        read = _core.read_commonroad(text)
    except InputError as error:
        raise error.within(file) from None
    facts = Facts(
        benchmark_id=read["benchmark_id"],
        version=read["version"],
        dangling=(),
        notes=read["notes"],
    )
    network = Network(
        lanelets=[_lanelet(one) for one in read["lanelets"]],
        traffic_signs=[_sign(*one) for one in read["signs"]],
        traffic_lights=[_light(**one) for one in read["lights"]],
        intersections=[_intersection(*one) for one in read["intersections"]],
    )
    problems = {number: _problem(number, start, goals) for number, start, goals in read["problems"]}
    document = Document(read["dt"], read["benchmark_id"], network, problems, facts)
    by_role = {
        "static": document.static_obstacles,
        "dynamic": document.dynamic_obstacles,
        "environment": document.environment_obstacle,
        "phantom": document.phantom_obstacle,
    }
    for one in read["obstacles"]:
        by_role[one["role"]].append(_obstacle(one))
    return document


def _lanelet(read: dict[str, Any]) -> SimpleNamespace:
    line = read.pop("stop_line")
    users = read.pop("users")
    return SimpleNamespace(
        **read,
        user_one_way=users,
        user_bidirectional=(),
        stop_line=None
        if line is None
        else SimpleNamespace(start=line[0][0], end=line[0][1], traffic_sign_ref=line[1], traffic_light_ref=line[2]),
    )


def _sign(number: int, elements: Sequence[tuple[str, str, str | None]]) -> SimpleNamespace:
    return SimpleNamespace(
        traffic_sign_id=number,
        traffic_sign_elements=[
            SimpleNamespace(
                traffic_sign_element_id=SignName(name, code), additional_values=[] if value is None else [value]
            )
            for name, code, value in elements
        ],
    )


def _light(*, phases: Sequence[tuple[str, int]], time_offset: int, **rest: Any) -> SimpleNamespace:  # noqa: ANN401
    elements = [SimpleNamespace(state=state, duration=duration) for state, duration in phases]
    cycle = SimpleNamespace(cycle_elements=elements, time_offset=time_offset)
    return SimpleNamespace(traffic_light_cycle=cycle, **rest)


def _intersection(number: int, incomings: Sequence[dict[str, Any]], crossings: Sequence[int]) -> SimpleNamespace:
    return SimpleNamespace(
        intersection_id=number, incomings=[SimpleNamespace(**one) for one in incomings], crossings=crossings
    )


def _problem(number: int, start: dict[str, Any], goals: Sequence[tuple[dict[str, Any], Sequence[int]]]) -> Foreign:
    lanelets = {index: ids for index, (_, ids) in enumerate(goals) if ids}
    goal = SimpleNamespace(state_list=[_state(state) for state, _ in goals], lanelets_of_goal_position=lanelets)
    return SimpleNamespace(planning_problem_id=number, initial_state=_state(start), goal=goal)


def _obstacle(read: dict[str, Any]) -> Obstacle:
    prediction = None
    if read["states"] is not None:
        states = [_state(state) for state in read["states"]]
        prediction = SimpleNamespace(trajectory=SimpleNamespace(state_list=states))
    elif read["table"] is not None:
        prediction = SimpleNamespace(trajectory=SimpleNamespace(state_list=(), table=read["table"]))
    elif read["has_set"]:
        prediction = SimpleNamespace(trajectory=None)
    shape = None if read["shape"] is None else _shape(read["shape"])
    return Obstacle(read["obstacle_id"], read["obstacle_type"], shape, _state(read["initial_state"]), prediction)


def _state(read: dict[str, Any]) -> State:
    position = read.pop("position")
    if isinstance(position, tuple):
        position = _shape(position)
    values = {name: Interval(*value) if isinstance(value, tuple) else value for name, value in read.items()}
    return State(position, **values)


def _shape(read: tuple[Any, ...]) -> Shape:
    """A shape of its kind and numbers."""
    kind, *numbers = read
    if kind == "rectangle":
        length, width, center, orientation = numbers
        return Shape("rectangle", length=length, width=width, center=center, orientation=orientation)
    if kind == "circle":
        return Shape("circle", radius=numbers[0], center=numbers[1])
    if kind == "polygon":
        return Shape("polygon", vertices=numbers[0])
    return Shape("group", members=tuple(_shape(member) for member in numbers[0]))
