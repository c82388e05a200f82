"""Checks the bounds of all numbers of an XML document before commonroad-io reads it, which does not check them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from interdrive.errors import InputError
from interdrive.scenario import limits

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

#: Attributes that hold ids.
_IDS = ("id", "ref", "outgoingId")
#: Largest absolute value by element; those of `_VALUES` depend on the surrounding element.
_BOUNDS = {
    **dict.fromkeys(("x", "y", "z", "length", "width", "radius", "originXShift"), limits.LARGEST_COORDINATE),
    **dict.fromkeys(("speedLimit", "duration", "timeOffset"), limits.LARGEST_COORDINATE),
    "geoNameId": limits.LARGEST_ID,
    **dict.fromkeys(("xTranslation", "yTranslation", "zRotation", "scaling"), math.inf),
    "orientation": limits.LARGEST_ANGLE,
}
_VALUES = frozenset(("exact", "intervalStart", "intervalEnd"))
#: The same by the surrounding element.
_VALUE_BOUNDS = {
    "orientation": limits.LARGEST_ANGLE,
    "velocity": limits.LARGEST_VELOCITY,
    "velocityY": limits.LARGEST_VELOCITY,
    "acceleration": limits.LARGEST_ACCELERATION,
    "yawRate": limits.LARGEST_YAW_RATE,
}
#: For all other values: the range in which commonroad-io's arithmetic stays finite.
_OTHER_VALUES = 1e12


def check_numbers(root: Element, file: str) -> None:
    """Refuses ids, time steps and values out of bounds, and documents that are too deep or too large.

    Text that is not a number is left to commonroad-io, which names it.

    Args:
        root: Root element of the document.
        file: Its name, for messages.

    Raises:
        InputError: One line that names file and element.
    """
    _check_depth(root, file)
    _check_counts(root, file)
    for owner in root:
        start = owner.find("initialState/time")
        for element in owner.iter():
            if element.attrib:
                _check_ids(element, owner, file)
            if len(element):
                for child in element:
                    if child.tag in _VALUES:
                        _check_exact_or_interval(child, element, owner, file, is_start=element is start)
            elif element.tag in _BOUNDS:
                _check_value(element, _BOUNDS[element.tag], owner, file)


def _check_depth(root: Element, file: str) -> None:
    level, depth = [root], 0
    while level:
        depth += 1
        limits.require(
            depth <= limits.DEEPEST,
            file,
            f"<{level[0].tag}>",
            f"is nested more than {limits.DEEPEST} elements deep; is the file damaged?",
        )
        level = [child for element in level for child in element]


def _check_counts(root: Element, file: str) -> None:
    """Checks counts that would cost much time before the arrays exist."""
    for path, most, counted, what in (
        ("lanelet", limits.MOST_LANELETS, limits.LANELETS, "the map"),
        ("lanelet/*/point", limits.MOST_POINTS, limits.POINTS, "the map"),
        ("planningProblem", limits.MOST_PROBLEMS, limits.PROBLEMS, "the scenario"),
        ("dynamicObstacle", limits.MOST_OBSTACLES, limits.OBSTACLES, "the scenario"),
        ("staticObstacle", limits.MOST_OBSTACLES, limits.OBSTACLES, "the scenario"),
        ("obstacle", limits.MOST_OBSTACLES, limits.OBSTACLES, "the scenario"),
        ("*/trajectory/state", limits.MOST_STATES, limits.STATES, "the recording"),
    ):
        limits.require_count(len(root.findall(path)), most, counted, what, file)
    for lanelet in root.iterfind("lanelet"):
        for bound in ("leftBound", "rightBound"):
            n, most = len(lanelet.findall(f"{bound}/point")), limits.MOST_POINTS_OF_A_LANELET
            limits.require_count(n, most, limits.POINTS_OF_A_LANELET, named(lanelet), file)


def named(owner: Element) -> str:
    """An element for messages: its tag and id."""
    return f"{owner.tag} {owner.get('id')}" if owner.get("id") else f"<{owner.tag}>"


def _check_ids(element: Element, owner: Element, file: str) -> None:
    for name in _IDS:
        text = element.get(name)
        if text is None:
            continue
        try:
            number = int(text)
        except ValueError:
            where = f"a <{element.tag}>" if element is owner else f"a <{element.tag}> of {named(owner)}"
            what = "id" if name == "id" else name
            raise InputError(f"{file}: {where} has the {what} '{text[:30]}'; it must be a whole number") from None
        limits.require_id(
            number, f"a <{element.tag}>" if element is owner else f"<{element.tag}> of {named(owner)}", file
        )


def _check_exact_or_interval(value: Element, around: Element, owner: Element, file: str, *, is_start: bool) -> None:
    """Checks the exact value or both ends of the interval in an element."""
    if around.tag == "time":
        _check_time(value, owner, file, is_start=is_start)
    else:
        _check_value(value, _VALUE_BOUNDS.get(around.tag, _OTHER_VALUES), owner, file, around.tag)


def _check_time(element: Element, owner: Element, file: str, *, is_start: bool) -> None:
    try:
        time_step = int(element.text or "0")
    except ValueError:
        # Some files have 0.0, which commonroad-io accepts as a start.
        _check_value(element, limits.LARGEST_TIME_STEP, owner, file, "time")
        return
    is_goal = owner.tag == "planningProblem" and not is_start
    last = limits.LARGEST_GOAL_TIME_STEP if is_goal else limits.LARGEST_TIME_STEP
    if not 0 <= time_step <= last:
        limits.require_time_step(time_step, named(owner), file, last)


def _check_value(element: Element, most: float, owner: Element, file: str, within: str = "") -> None:
    try:
        value = float(element.text or "0")
    except ValueError:
        return
    if abs(value) <= most and value - value == 0.0:
        return
    text = (element.text or "").strip()[:30]
    if most == limits.LARGEST_ANGLE and math.isfinite(value):
        raise InputError(f"{file}: {named(owner)} has the orientation {value:g}; give it in radians")
    wanted = f"between {-most:g} and {most:g}" if math.isfinite(value) else "a finite number"
    raise InputError(f"{file}: {named(owner)} has the value {text} in <{within or element.tag}>; it must be {wanted}")


def check_adjacency(root: Element, file: str) -> None:
    """Refuses lanelets whose neighbours form a circle, which commonroad-io would follow for ever.

    It looks for the outermost lanelet on one side to place signs and lights without a position.

    Args:
        root: Root element of the document.
        file: Its name, for messages.

    Raises:
        InputError: One line that names a lanelet of the cycle.
    """
    placed = all(
        element.find("position") is not None
        for tag in ("trafficSign", "trafficLight")
        for element in root.iterfind(tag)
    )
    if placed:
        return
    for side in ("Left", "Right"):
        beside = {
            int(lanelet.get("id", "-1")): int(neighbour.get("ref", "-1"))
            for lanelet in root.iterfind("lanelet")
            if (neighbour := lanelet.find(f"adjacent{side}")) is not None and neighbour.get("drivingDir") == "same"
        }
        done: set[int] = set()
        for start in beside:
            way: set[int] = set()
            at = start
            while at in beside and at not in done:
                limits.require(
                    at not in way,
                    file,
                    f"lanelet {at}",
                    f"is its own neighbour: adjacent{side} leads back "
                    "to it; correct the neighbours or give signs and lights a position",
                )
                way.add(at)
                at = beside[at]
            done |= way
