"""Checks the XML of a CommonRoad file before commonroad-io reads it, and keeps what commonroad-io would lose.

commonroad-io 2026.1 drops centre and orientation of a recorded obstacle's rectangle, refuses footprints of several
parts, and sets values that are missing in an initial state to 0. So footprints and the names of stated values are read
here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from commonroad_io.completion import is_any_heading
from commonroad_io.numbers import check_adjacency, check_numbers
from interdrive.errors import InputError
from interdrive.files.shapes import polygon
from interdrive.scenario import Shape
from interdrive.scenario.limits import require_dt, require_roads

if TYPE_CHECKING:
    from collections.abc import Iterator

VERSIONS = ("2018b", "2020a")
OBSTACLE_TAGS = ("obstacle", "staticObstacle", "dynamicObstacle", "environmentObstacle", "phantomObstacle")
#: XML elements of the columns of a state, and all elements that are read from a state.
_COLUMNS = ("x", "y", "orientation", "velocity", "acceleration", "yawRate")
_STATED = frozenset(("position", "time", "velocityY", *_COLUMNS[2:]))


#: Elements of an initial state besides position and time, in the order of `STATE_FIELDS`.
INITIAL_VALUES = ("orientation", "velocity", "acceleration", "yawRate")


@dataclass(frozen=True)
class Facts:
    """Contents of the XML that commonroad-io does not pass on.

    Attributes:
        benchmark_id: As written; commonroad-io rewrites ids that it cannot parse.
        stated: Names of the elements in the initial state, by obstacle id.
        stated_by_problem: The same by planning problem id.
        footprints: Footprints by obstacle id.
        trajectories: By obstacle id the states of those trajectories that are certain: time step and columns as in
            `STATE_FIELDS`, nan where not stated. commonroad-io takes twenty times as long for them.
        version: Version of the format; empty if unknown.
        signs: Ids of the elements of each traffic sign, by its id; commonroad-io drops unknown ones.
        unplaced_lights: Ids of traffic lights without position, for which commonroad-io invents one.
    """

    benchmark_id: str = ""
    stated: dict[int, frozenset[str]] = field(default_factory=dict)
    stated_by_problem: dict[int, frozenset[str]] = field(default_factory=dict)
    footprints: dict[int, Shape] = field(default_factory=dict)
    trajectories: dict[int, list[tuple[int, tuple[float, ...]]]] = field(default_factory=dict)
    version: str = ""
    signs: dict[int, tuple[str, ...]] = field(default_factory=dict)
    unplaced_lights: frozenset[int] = frozenset()


def check(root: Element, file: str) -> None:
    """Refuses documents that cannot become a scenario, and adds meaningless elements that commonroad-io requires.

    Args:
        root: Root element; changed in place.
        file: Name for messages.

    Raises:
        InputError: Not a CommonRoad document, unsupported version, invalid dt, no lanelets, broken bounds, duplicate
            ids, numbers out of bounds (see `limits`), or goal lanelets that do not exist.
    """
    _check_header(root, file)
    check_numbers(root, file)
    _check_ids(root, file)
    check_adjacency(root, file)
    for lanelet in root.iterfind("lanelet"):
        counts = [len(lanelet.findall(f"{side}/point")) for side in ("leftBound", "rightBound")]
        if counts[0] != counts[1] or min(counts) < 2:
            raise InputError(
                f"{file}: lanelet {lanelet.get('id')} has {counts[0]} points on its left bound and {counts[1]} on its "
                "right one; give both the same number, at least 2"
            )
        for line in lanelet.iterfind("stopLine"):
            n_points = len(line.findall("point"))
            if n_points not in (0, 2):
                raise InputError(
                    f"{file}: the stop line of lanelet {lanelet.get('id')} has {n_points} "
                    f"{'point' if n_points == 1 else 'points'}; give it both ends, or none for the lanelet's end"
                )
    drop_dangling_relations(root)
    lanelet_ids = {lanelet.get("id") for lanelet in root.iterfind("lanelet")}
    for problem in root.iterfind("planningProblem"):
        for reference in problem.iterfind("goalState/position/lanelet"):
            if reference.get("ref") not in lanelet_ids:
                raise InputError(
                    f"{file}: the goal of planning problem {problem.get('id')} is lanelet "
                    f"{reference.get('ref', '(without ref)')}, which does not exist; correct the reference"
                )


def drop_dangling_relations(root: Element) -> None:
    """Removes relations to lanelets that do not exist, as in maps that were cut out of larger ones.

    commonroad-io follows some of them without a check.
    """
    known = {int(lanelet.get("id", "-1")) for lanelet in root.iterfind("lanelet")}
    for lanelet in root.iterfind("lanelet"):
        for tag in ("predecessor", "successor", "adjacentLeft", "adjacentRight"):
            for relation in lanelet.findall(tag):
                if int(relation.get("ref", "-1")) not in known:
                    lanelet.remove(relation)


def _check_header(root: Element, file: str) -> None:
    if root.tag != "commonRoad":
        raise InputError(
            f"{file}: <{root.tag}> is no map or scenario that is read here; give a CommonRoad, OpenDRIVE, Lanelet2 or "
            "SUMO net file"
        )
    version = root.get("commonRoadVersion")
    if version is None:
        raise InputError(f"{file}: states no commonRoadVersion; add it, {' or '.join(VERSIONS)}")
    if version not in VERSIONS:
        raise InputError(f"{file}: CommonRoad version {version} is not supported; convert it to {VERSIONS[-1]}")
    text = root.get("timeStepSize", "missing")
    try:
        dt = float(text)
    except ValueError:
        dt = math.nan
    require_dt(dt, file, text)
    require_roads(len(root.findall("lanelet")), file)
    if not root.get("benchmarkID"):
        root.set("benchmarkID", "ZAM_Unnamed-1_1_T-1")
    if root.get("tags") is None:
        root.set("tags", "")
    if root.find("scenarioTags") is None:
        SubElement(root, "scenarioTags")


def _check_ids(root: Element, file: str) -> None:
    for name, tags in (
        ("lanelets", ("lanelet",)),
        ("obstacles", OBSTACLE_TAGS),
        ("planning problems", ("planningProblem",)),
    ):
        seen = set()
        for number in (integer_id(element, file) for tag in tags for element in root.iterfind(tag)):
            if number in seen:
                raise InputError(f"{file}: two {name} have the id {number}; give each its own")
            seen.add(number)


def integer_id(element: Element, file: str) -> int:
    """The id of an element, or `InputError` if it has none."""
    text = element.get("id", "missing")
    try:
        return int(text)
    except ValueError:
        raise InputError(f"{file}: a <{element.tag}> has the id '{text}'; it must be a whole number") from None


def facts(root: Element, file: str) -> Facts:
    """Extracts the contents of the XML that commonroad-io loses, and simplifies footprints so that it reads them.

    Args:
        root: Root element; footprints are simplified in place.
        file: Name for messages.

    Returns:
        The facts.

    Raises:
        InputError: A footprint cannot be read.
    """
    stated = {}
    footprints = {}
    trajectories = {}
    for tag in ("obstacle", "staticObstacle", "dynamicObstacle"):
        for element in root.iterfind(tag):
            number = integer_id(element, file)
            if tag == "obstacle" and element.findtext("role") not in ("static", "dynamic"):
                raise InputError(f"{file}: obstacle {number} has no role static or dynamic; add it")
            initial = element.find("initialState")
            if initial is None:
                raise InputError(f"{file}: obstacle {number} has no initial state; add one")
            for heading in initial.findall("orientation"):
                if is_any_heading(heading):
                    initial.remove(heading)
            stated[number] = _stated(initial, f"obstacle {number}", file)
            shape = element.find("shape")
            if shape is None or len(shape) == 0:
                raise InputError(f"{file}: obstacle {number} has no shape; add one")
            try:
                footprint = _footprint(list(_primitives(shape)))
            except (ValueError, AttributeError, TypeError) as error:
                raise InputError(f"{file}: the shape of obstacle {number} cannot be read; correct it") from error
            if footprint is not None:
                footprints[number] = footprint
                _simplify(shape)
            trajectory = element.find("trajectory")
            states = None if trajectory is None else _certain_states(trajectory)
            if trajectory is not None and states:
                trajectories[number] = states
                for one in element.findall("trajectory"):
                    element.remove(one)
    by_problem = {
        integer_id(element, file): _stated(initial, f"planning problem {element.get('id')}", file)
        for element in root.iterfind("planningProblem")
        if (initial := element.find("initialState")) is not None
    }
    signs = {
        integer_id(sign, file): tuple(found.text or "" for found in sign.iterfind("trafficSignElement/trafficSignID"))
        for sign in reversed(root.findall("trafficSign"))  # of several with one id the first counts
    }
    lights = (light for light in root.iterfind("trafficLight") if light.find("position") is None)
    return Facts(
        benchmark_id=root.get("benchmarkID", ""),
        stated=stated,
        stated_by_problem=by_problem,
        footprints=footprints,
        trajectories=trajectories,
        version=root.get("commonRoadVersion", ""),
        signs=signs,
        unplaced_lights=frozenset(integer_id(light, file) for light in lights),
    )


def _stated(initial: Element, owner: str, file: str) -> frozenset[str]:
    """Names of the elements in an initial state; missing ones are filled in as commonroad-io expects them.

    Where one of them is missing, commonroad-io takes 0 for others, too.
    """
    names = frozenset(child.tag for child in initial)
    if not names >= {"position", "time"}:
        raise InputError(f"{file}: {owner} has a state without position or time; add it")
    if "velocityY" not in names:  # a point mass has other ones
        for tag in INITIAL_VALUES:
            if tag not in names:
                SubElement(SubElement(initial, tag), "exact").text = "0"
    return names


def _certain_states(trajectory: Element) -> list[tuple[int, tuple[float, ...]]] | None:
    """Time step and columns of all states; None where one is uncertain, broken, or has velocities along two axes."""
    rows = []
    for state in trajectory.iterfind("state"):
        values: dict[str, float] = {}
        time_step = None
        for child in state:
            tag = child.tag
            inner = child.find("point" if tag == "position" else "exact")
            if tag not in _STATED or tag in values:
                continue
            if inner is None or tag == "velocityY":
                return None
            try:
                if tag == "position":
                    values["x"], values["y"] = _number(inner, "x"), _number(inner, "y")
                elif tag == "time":
                    time_step = int(inner.text or "missing")
                values[tag] = math.nan if tag in ("position", "time") else float(inner.text or "missing")
            except ValueError:
                return None
        if time_step is None or "x" not in values:
            return None
        rows.append((time_step, tuple(values.get(tag, math.nan) for tag in _COLUMNS)))
    return rows


def _primitives(shape: Element) -> Iterator[Element]:
    for child in shape:
        if child.tag in ("shapeGroup", "shape"):
            yield from _primitives(child)
        else:
            yield child


def _footprint(primitives: list[Element]) -> Shape | None:
    """The footprint, or None for kinds of shape that only commonroad-io knows."""
    shapes = [_primitive(element) for element in primitives]
    members = tuple(shape for shape in shapes if shape is not None)
    if len(members) != len(shapes):
        return None
    return members[0] if len(members) == 1 else Shape("group", members=members)


def _primitive(element: Element) -> Shape | None:
    if element.tag == "rectangle":
        shift = element.findtext("originXShift")
        center = (-float(shift), 0.0) if shift is not None else _center(element)
        return Shape(
            "rectangle",
            length=_number(element, "length"),
            width=_number(element, "width"),
            center=center,
            orientation=float(element.findtext("orientation") or 0.0),
        )
    if element.tag == "circle":
        return Shape("circle", radius=_number(element, "radius"), center=_center(element))
    if element.tag == "polygon":
        points = [(_number(point, "x"), _number(point, "y")) for point in element.iterfind("point")]
        return polygon(np.array(points, dtype=np.float64).reshape(-1, 2))
    return None


def _number(element: Element, tag: str) -> float:
    return float(element.findtext(tag) or "missing")


def _center(element: Element) -> tuple[float, float]:
    center = element.find("center")
    return (0.0, 0.0) if center is None else (_number(center, "x"), _number(center, "y"))


def _simplify(shape: Element) -> None:
    """Replaces a footprint by a square, which every commonroad-io reads; the real one is in the facts."""
    for child in list(shape):
        shape.remove(child)
    rectangle = SubElement(shape, "rectangle")
    for tag in ("length", "width"):
        SubElement(rectangle, tag).text = "1.0"
