"""Writes runs and recordings as CommonRoad 2020a documents, without commonroad-io, whose versions differ in that."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from interdrive.files.content import content_of_file
from interdrive.files.network import free_id, plain_decimal
from interdrive.files.read import quiet
from interdrive.files.roads import Header, road_elements
from interdrive.scenario import GoalState, PlanningProblem, Shape

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path

    from commonroad.planning.planning_problem import PlanningProblemSet
    from commonroad.scenario.scenario import Scenario as CommonRoadScenario

    from interdrive.array_types import Floats
    from interdrive.run import RunRecord, States
    from interdrive.scenario import Obstacles, Scenario

#: Decimals of the numbers of states: a hundredth of a micrometre.
DECIMALS = 8
#: Corners of the polygon that replaces a circle off its origin.
CIRCLE_CORNERS = 32

_MOVING = {
    "car": "car",
    "truck": "truck",
    "bus": "bus",
    "motorcycle": "motorcycle",
    "bicycle": "bicycle",
    "pedestrian": "pedestrian",
    "priority_vehicle": "priorityVehicle",
    "train": "train",
    "taxi": "taxi",
    "parked_vehicle": "car",
}
_STANDING = {"construction_zone": "constructionZone", "structure": "roadBoundary"} | dict.fromkeys(
    ("car", "truck", "bus", "motorcycle", "bicycle", "priority_vehicle", "train", "taxi", "parked_vehicle"),
    "parkedVehicle",
)
_COLUMNS = {"velocity": "velocity", "acceleration": "acceleration", "yaw_rate": "yawRate"}


@dataclass
class _Ids:
    """Gives every participant and planning problem an id that is unique in the document."""

    taken: set[int]

    def free(self, wanted: int) -> int:
        number = wanted if wanted > 0 and wanted not in self.taken else free_id(self.taken)
        self.taken.add(number)
        return number


class CommonRoadObjects(NamedTuple):
    """Objects of commonroad-io, as its reader returns them."""

    scenario: CommonRoadScenario
    planning_problem_set: PlanningProblemSet


def commonroad_objects(document: bytes) -> CommonRoadObjects:
    """A document of `run_document` as objects of commonroad-io."""
    from commonroad.common.reader.file_reader_xml import XMLFileReader  # noqa: PLC0415 - a fifth of a second

    with quiet("scenario.xml"):
        return CommonRoadObjects(*XMLFileReader(document).open(lanelet_assignment=False))


def run_document(run: RunRecord) -> bytes:
    """The simulated world as a CommonRoad 2020a document, for commonroad-io and tools based on it.

    - Roads, signs, lights and intersections are those of the scenario's file if it still exists unchanged; otherwise
      they are written from the scenario, as far as the format can hold them (`road_losses`).
    - Every participant is an obstacle: agents and recorded vehicles with the states of the run, static ones as static
      obstacles of the kinds that the format has for them. Rectangles and circles off their origin and footprints of
      several parts (as their convex hull) become polygons, since commonroad-io 2026.1 does not read them.
    - Planning problems are kept. Ids must be unique and positive in this format: obstacles whose id belongs to the
      road, then planning problems whose id belongs to an obstacle or the road, get the next free ones.

    Args:
        run: The run, finished or not.

    Returns:
        The document in UTF-8, states with 8 decimals, all other numbers exact; equal runs give equal bytes.
    """
    scenario = run.scenario
    header, roads, road_ids = road_elements(scenario)
    source = f"{header.source}; simulated with interdrive" if header.source else "simulated with interdrive"
    header = replace(header, source=source, tags=(*header.tags, "simulated"))
    ids = _Ids(set(road_ids))
    footprints = dict(zip(scenario.obstacles.ids.tolist(), scenario.obstacles.shapes, strict=True))
    static, dynamic = [], []
    for row, participant in enumerate(run.states.participant_id.tolist()):
        if not run.states.valid[row].any():
            continue
        number = ids.free(participant)
        size = Shape("rectangle", float(run.states.length[row]), float(run.states.width[row]))
        shape = _footprint(footprints.get(participant, size))
        if run.states.is_static[row]:
            static.append(_static_obstacle(run.states, row, number, shape))
        else:
            dynamic.append(_dynamic_obstacle(run.states, run.states.first_time_step, row, number, shape))
    problems = [_planning_problem(problem, ids.free(problem.id)) for problem in scenario.planning_problems]
    return _document(scenario, header, [*roads, *static, *dynamic, *problems])


def scenario_document(scenario: Scenario, map_file: Path | None = None) -> bytes:
    """A scenario as a CommonRoad 2020a document, all numbers exact.

    Args:
        scenario: Roads, recorded traffic, planning problems. Accelerations and yaw rates that its
            file did not state are left out.
        map_file: File from which roads, signs, lights and intersections are taken; by default that of the scenario.

    Returns:
        The document in UTF-8; equal scenarios give equal bytes.
    """
    if map_file is not None:
        scenario = replace(scenario, path=map_file, sha256=hashlib.sha256(content_of_file(map_file)).hexdigest())
    header, roads, road_ids = road_elements(scenario)
    ids, obstacles = _Ids(set(road_ids)), scenario.obstacles
    static, dynamic = [], []
    for row, (participant, shape) in enumerate(zip(obstacles.ids.tolist(), obstacles.shapes, strict=True)):
        number = ids.free(participant)
        if obstacles.is_static[row]:
            static.append(_static_obstacle(obstacles, row, number, _footprint(shape), plain_decimal))
        else:
            unknown = obstacles.derived[row] if obstacles.derived else ()
            dynamic.append(_dynamic_obstacle(obstacles, 0, row, number, _footprint(shape), plain_decimal, unknown))
    problems = [
        _planning_problem(problem, ids.free(problem.id), states_all=False) for problem in scenario.planning_problems
    ]
    return _document(scenario, header, [*roads, *static, *dynamic, *problems])


def _document(scenario: Scenario, header: Header, elements: Sequence[str]) -> bytes:
    attributes = {
        "timeStepSize": plain_decimal(scenario.dt),
        "commonRoadVersion": "2020a",
        "author": header.author,
        "affiliation": header.affiliation,
        "source": header.source,
        "benchmarkID": scenario.benchmark_id,
        "date": header.date,
    }
    from xml.sax.saxutils import quoteattr  # noqa: PLC0415 - loads what reads from the network

    opening = " ".join(f"{name}={quoteattr(value)}" for name, value in attributes.items())
    parts = [
        "<?xml version='1.0' encoding='UTF-8'?>",
        f"<commonRoad {opening}>",
        header.location,
        f"<scenarioTags>{''.join(f'<{tag}/>' for tag in header.tags)}</scenarioTags>",
        *elements,
        "</commonRoad>\n",
    ]
    return "\n".join(parts).encode()


def _rounded(value: float) -> str:
    """A number of a state in plain decimal notation, as the format demands."""
    text = f"{value:.{DECIMALS}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _exact(tag: str, value: str) -> str:
    return f"<{tag}><exact>{value}</exact></{tag}>"


def _interval(tag: str, values: tuple[float, float]) -> str:
    first, last = map(plain_decimal, values)
    return f"<{tag}><intervalStart>{first}</intervalStart><intervalEnd>{last}</intervalEnd></{tag}>"


def _point(x: float, y: float, tag: str = "point") -> str:
    return f"<{tag}><x>{plain_decimal(x)}</x><y>{plain_decimal(y)}</y></{tag}>"


# Obstacles


def _static_obstacle(
    states: States | Obstacles, row: int, number: int, shape: str, text: Callable[[float], str] = _rounded
) -> str:
    kind = _STANDING.get(states.kinds[row], "unknown")
    first = int(states.valid[row].argmax())
    (state,) = _states(states, row, [first], 0, ("velocity",), text)
    state = f"<initialState>{state}</initialState>"
    return f'<staticObstacle id="{number}"><type>{kind}</type><shape>{shape}</shape>{state}</staticObstacle>'


def _dynamic_obstacle(
    states: States | Obstacles,
    first_time_step: int,
    row: int,
    number: int,
    shape: str,
    text: Callable[[float], str] = _rounded,
    unknown: tuple[str, ...] = (),
) -> str:
    kind = _MOVING.get(states.kinds[row], "unknown")
    columns = np.flatnonzero(states.valid[row]).tolist()
    # All states of a trajectory must have the same values.
    names = tuple(
        name
        for name in _COLUMNS
        if (name == "velocity" or name not in unknown) and np.isfinite(getattr(states, name)[row, columns]).all()
    )
    first, *later = _states(states, row, columns, first_time_step + columns[0], names, text)
    lines = ["<trajectory>", *(f"<state>{state}</state>" for state in later), "</trajectory>"]
    trajectory = "\n".join(lines) if later else ""
    return (
        f'<dynamicObstacle id="{number}"><type>{kind}</type><shape>{shape}</shape>\n'
        f"<initialState>{first}</initialState>\n{trajectory}"
        "</dynamicObstacle>"
    )


def _states(
    states: States | Obstacles,
    row: int,
    columns: Sequence[int],
    time_step: int,
    names: tuple[str, ...],
    text: Callable[[float], str],
) -> Iterable[str]:
    """Contents of the elements of states, one for each column; the first column is at the time step."""
    own = {name: map(text, getattr(states, name)[row, columns].tolist()) for name in ("x", "y", "orientation", *names)}
    tags = "".join(_exact(_COLUMNS[name], "%s") for name in names)
    form = (
        "<position><point><x>%s</x><y>%s</y></point></position>"
        f"{_exact('orientation', '%s')}{_exact('time', '%d')}{tags}"
    )
    times = (time_step + column - columns[0] for column in columns)
    return map(form.__mod__, zip(own.pop("x"), own.pop("y"), own.pop("orientation"), times, *own.values(), strict=True))


def _footprint(shape: Shape) -> str:
    off_origin = shape.center != (0.0, 0.0) or shape.orientation != 0.0
    if shape.kind == "group" or (off_origin and shape.kind != "polygon"):
        return _area(Shape("polygon", vertices=_hull(np.concatenate(list(_corners(shape))))))
    return _area(shape)


def _area(shape: Shape) -> str:
    """A shape as an element of the format; centre and orientation only where they are not 0."""
    off_origin = shape.center != (0.0, 0.0) or shape.orientation != 0.0
    center = _point(*shape.center, tag="center") if off_origin else ""
    if shape.kind == "rectangle":
        turn = f"<orientation>{plain_decimal(shape.orientation)}</orientation>" if off_origin else ""
        size = f"<length>{plain_decimal(shape.length)}</length><width>{plain_decimal(shape.width)}</width>"
        return f"<rectangle>{size}{turn}{center}</rectangle>"
    if shape.kind == "circle":
        return f"<circle><radius>{plain_decimal(shape.radius)}</radius>{center}</circle>"
    if shape.kind == "polygon":
        return f"<polygon>{''.join(_point(x, y) for x, y in shape.vertices.tolist())}</polygon>"
    return "".join(_area(member) for member in shape.members)


def _corners(shape: Shape) -> Iterable[Floats]:
    if shape.kind == "group":
        for member in shape.members:
            yield from _corners(member)
    elif shape.kind == "polygon":
        yield shape.vertices
    elif shape.kind == "circle":
        angle = np.linspace(0.0, 2.0 * np.pi, CIRCLE_CORNERS, endpoint=False)
        yield np.array(shape.center) + shape.radius * np.column_stack((np.cos(angle), np.sin(angle)))
    else:
        cos, sin = np.cos(shape.orientation), np.sin(shape.orientation)
        corners = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (shape.length, shape.width)
        yield np.array(shape.center) + corners @ np.array([[cos, sin], [-sin, cos]])


def _hull(points: Floats) -> Floats:
    """Convex hull, counter-clockwise (Andrew's monotone chain)."""
    ordered = sorted(set(map(tuple, points.tolist())))

    def chain(sequence: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
        hull: list[tuple[float, ...]] = []
        for x, y in sequence:
            while len(hull) > 1:
                (x0, y0), (x1, y1) = hull[-2:]
                if (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) > 0.0:
                    break
                hull.pop()
            hull.append((x, y))
        return hull[:-1]

    return np.array(chain(ordered) + chain(ordered[::-1]))


# Planning problems


def _planning_problem(problem: PlanningProblem, number: int, *, states_all: bool = True) -> str:
    """The element; commonroad-io requires accelerations and yaw rates, which are 0 where unknown or left out."""
    start = problem.initial_state
    values = {
        "orientation": start.orientation,
        "time": start.time_step,
        "velocity": start.velocity,
        "acceleration": 0.0 if np.isnan(start.acceleration) else start.acceleration,
        "yawRate": 0.0 if np.isnan(start.yaw_rate) else start.yaw_rate,
        "slipAngle": 0.0,
    }
    if not states_all:
        unknown = {"acceleration": np.isnan(start.acceleration), "yawRate": np.isnan(start.yaw_rate)}
        values = {tag: value for tag, value in values.items() if not unknown.get(tag)}
    initial = (
        f"<initialState><position>{_point(start.x, start.y)}</position>"
        f"{''.join(_exact(tag, plain_decimal(value)) for tag, value in values.items())}</initialState>"
    )
    goals = "\n".join(_goal_state(goal) for goal in problem.goal)
    return f'<planningProblem id="{number}">{initial}\n{goals}</planningProblem>'


def _goal_state(goal: GoalState) -> str:
    if goal.lanelet_ids:
        areas = "".join(f'<lanelet ref="{number}"/>' for number in goal.lanelet_ids)
    else:
        areas = "".join(_area(area) for area in goal.areas)
    position = f"<position>{areas}</position>" if areas else ""
    orientation = "" if goal.orientation is None else _interval("orientation", goal.orientation)
    velocity = "" if goal.velocity is None else _interval("velocity", goal.velocity)
    return f"<goalState>{position}{orientation}{_interval('time', goal.time_step)}{velocity}</goalState>"
