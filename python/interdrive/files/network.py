"""Roads that were made in Python as elements of a CommonRoad 2020a document."""

from __future__ import annotations

import itertools
from decimal import Decimal
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement, fromstring, tostring

import numpy as np

from interdrive.files.control import place_of_sign, turn_of
from interdrive.scenario import StopLine
from interdrive.scenario.limits import LARGEST_ID
from interdrive.scenario.signs import GREEN_ARROW_NUMBER, sign_of, sign_with

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from interdrive.scenario import Incoming, Scenario, TrafficLight

#: Names of the sets of ways for which a light counts.
_DIRECTIONS = {
    frozenset(("left", "straight", "right")): "all",
    frozenset(("left", "straight")): "leftStraight",
    frozenset(("straight", "right")): "straightRight",
    frozenset(("left", "right")): "leftRight",
    frozenset(("left",)): "left",
    frozenset(("straight",)): "straight",
    frozenset(("right",)): "right",
}


def plain_decimal(value: float) -> str:
    """A number, exactly, in plain decimal notation, as the format demands."""
    text = repr(float(value))
    if "e" in text:
        text = f"{Decimal(text):f}"
    text = text.removesuffix(".0")
    return "0" if text == "-0" else text


def free_id(taken: set[int]) -> int:
    """The next free id: after the largest, or the smallest free one if the largest is the last possible id."""
    after = max(taken, default=0) + 1
    return after if after <= LARGEST_ID else next(number for number in itertools.count(1) if number not in taken)


def taken_ids(root: Element, scenario: Scenario) -> set[int]:
    """Ids that no new element of a document may have: those in it, and those of the scenario's traffic."""
    own = {int(element.get("id", "0")) for element in root.iter() if element.get("id")}
    return own | {*scenario.obstacles.ids.tolist(), *(problem.id for problem in scenario.planning_problems)}


def network_document(scenario: Scenario) -> Element:
    """Lanelets, stop lines, signs, lights and intersections of a scenario, below a root element.

    New ids, those of signs, are none of the ids of the scenario.
    """
    root = Element("commonRoad")
    lanelets = _add_lanelets(root, scenario)
    for line in scenario.stop_lines:
        if line.lanelet_id in lanelets:
            _add_stop_line(lanelets[line.lanelet_id], line)
    for light in scenario.traffic_lights:
        _add_light(root, light)
    _add_intersections(root, scenario)
    taken = taken_ids(root, scenario)
    limits = zip(scenario.lanelets.ids.tolist(), scenario.lanelets.speed_limit.tolist(), strict=True)
    add_speed_signs(root, {number: limit for number, limit in limits if np.isfinite(limit)}, taken)
    _add_signs_of_control(root, scenario, lanelets, taken)
    return root


def _add_lanelets(root: Element, scenario: Scenario) -> dict[int, Element]:
    lanelets = scenario.lanelets
    known = set(lanelets.ids.tolist())
    found = {}
    for row, number in enumerate(lanelets.ids.tolist()):
        lanelet = found[number] = SubElement(root, "lanelet", id=str(number))
        for tag, bound, markings in (
            ("leftBound", lanelets.left[row], lanelets.left_marking),
            ("rightBound", lanelets.right[row], lanelets.right_marking),
        ):
            side = SubElement(lanelet, tag)
            heights = lanelets.heights[row].tolist() if lanelets.heights else []
            for (x, y), z in itertools.zip_longest(bound.tolist(), heights):
                _add_point(side, x, y, z)
            if markings:
                SubElement(side, "lineMarking").text = markings[row]
        for tag, relations in (("predecessor", lanelets.predecessors[row]), ("successor", lanelets.successors[row])):
            for other in relations:
                if other in known:
                    SubElement(lanelet, tag, ref=str(other))
        neighbours: Iterable[tuple[str, int, bool]] = (
            ("adjacentLeft", int(lanelets.adjacent_left[row]), bool(lanelets.adjacent_left_same_direction[row])),
            ("adjacentRight", int(lanelets.adjacent_right[row]), bool(lanelets.adjacent_right_same_direction[row])),
        )
        for tag, other, same in neighbours:
            if other in known:
                SubElement(lanelet, tag, ref=str(other), drivingDir="same" if same else "opposite")
        for kind in lanelets.types[row] or ("unknown",):
            SubElement(lanelet, "laneletType").text = kind
        for user in lanelets.users[row] if lanelets.users else ():
            SubElement(lanelet, "userOneWay").text = user
    return found


def _add_point(parent: Element, x: float, y: float, z: float | None = None) -> None:
    point = SubElement(parent, "point")
    for tag, value in (("x", x), ("y", y), ("z", z)):
        if value is not None:
            SubElement(point, tag).text = plain_decimal(value)


def _add_stop_line(lanelet: Element, line: StopLine) -> None:
    """A line of the file, before the lanelet's types; and the lights that count there, last."""
    if line.is_stated:
        element = Element("stopLine")
        for x, y in line.ends.tolist():
            _add_point(element, x, y)
        SubElement(element, "lineMarking").text = "solid"
        lanelet.insert([child.tag for child in lanelet].index("laneletType"), element)
    for number in sorted({number for _, lights in line.light_ids for number in lights}):
        SubElement(lanelet, "trafficLightRef", ref=str(number))


def _add_light(root: Element, light: TrafficLight) -> None:
    element = SubElement(root, "trafficLight", id=str(light.id))
    cycle = SubElement(element, "cycle")
    for signal, steps in light.phases or (("dark", 1),):
        phase = SubElement(cycle, "cycleElement")
        SubElement(phase, "duration").text = str(steps)
        SubElement(phase, "color").text = "inactive" if signal == "dark" else signal
    SubElement(cycle, "timeOffset").text = str(light.offset)
    if light.position is not None:
        _add_point(SubElement(element, "position"), *light.position)
    SubElement(element, "direction").text = _DIRECTIONS.get(light.directions, "all")
    SubElement(element, "active").text = "true" if light.phases else "false"


def _add_intersections(root: Element, scenario: Scenario) -> None:
    """Intersections with their incoming elements; crosswalks that no lanelet type states are crossings of the first."""
    lanelets = scenario.lanelets
    rows = {number: row for row, number in enumerate(lanelets.ids.tolist())}
    stated = dict(scenario.priorities.turns)
    intersections: dict[int, Element] = {}
    for incoming in scenario.incomings:
        number = incoming.intersection_id
        if number not in intersections:
            intersections[number] = SubElement(root, "intersection", id=str(number))
        _add_incoming(intersections[number], incoming, scenario, rows, stated)
    crossed = [number for number in scenario.crosswalks if number in rows]
    crossed = [number for number in crossed if "crosswalk" not in lanelets.types[rows[number]]]
    if not crossed:
        return
    if not intersections:
        SubElement(root, "intersection", id=str(free_id(taken_ids(root, scenario))))
    first = root.find("intersection")
    if first is not None:
        crossing = SubElement(first, "crossing")
        for number in crossed:
            SubElement(crossing, "crossingLanelet", ref=str(number))


def _add_incoming(
    intersection: Element, incoming: Incoming, scenario: Scenario, rows: dict[int, int], stated: Mapping[int, str]
) -> None:
    element = SubElement(intersection, "incoming", id=str(incoming.id))
    for number in incoming.lanelet_ids:
        SubElement(element, "incomingLanelet", ref=str(number))
    # The format knows ways only with their turns.
    turns = [
        (stated.get(number) or (turn_of(scenario.lanelets, rows[number]) if number in rows else "straight"), number)
        for number in incoming.connector_ids
    ]
    for way in ("right", "straight", "left"):
        for number in (number for turn, number in turns if turn == way):
            SubElement(element, f"successors{way.capitalize()}", ref=str(number))


def _add_signs_of_control(root: Element, scenario: Scenario, lanelets: dict[int, Element], taken: set[int]) -> None:
    """Signs of priority, and green arrows where drivers may turn on red."""
    stop = sign_of("stop").numbers[0]
    # Ranks that no sign has are refused by what compares the document with the scenario (`scenario_file.losses`).
    signs = {number: one.numbers[0] for number, ranks in scenario.priorities.ranks if (one := sign_with(ranks))}
    placed = [(number, sign) for number, sign in sorted(signs.items())]
    for line in scenario.stop_lines:
        if line.has_stop_sign and signs.get(line.lanelet_id) != stop:
            placed.append((line.lanelet_id, stop))
        if line.turns_on_red:
            placed.append((line.lanelet_id, GREEN_ARROW_NUMBER))
    rows = {number: row for row, number in enumerate(scenario.lanelets.ids.tolist())}
    lined = {number for number, lanelet in lanelets.items() if lanelet.find("stopLine") is not None}
    for number, sign in placed:
        if number not in lanelets:
            continue
        if place_of_sign(number, scenario.lanelets, rows, lined) != number:
            # Read again, it would count where the next junction begins.
            row = rows[number]
            ends = np.array([scenario.lanelets.left[row][-1], scenario.lanelets.right[row][-1]])
            _add_stop_line(lanelets[number], StopLine(number, ends))
            lined.add(number)
        _add_sign(root, [lanelets[number]], sign, taken, at_line=True)


def add_speed_signs(root: Element, limits: dict[int, float], taken: set[int]) -> None:
    """Adds a sign per limit [m/s]. 274 is Germany's number, which commonroad-io accepts for any country.

    Args:
        root: The document.
        limits: Limits by lanelet.
        taken: Ids that no sign may have (`taken_ids`); new ones are added.
    """
    lanelets = {int(lanelet.get("id", "0")): lanelet for lanelet in root.iterfind("lanelet")}
    for limit in sorted(set(limits.values())):
        owners = [lanelets[number] for number in sorted(limits) if limits[number] == limit]
        _add_sign(root, owners, "274", taken, value=repr(limit))


def _add_sign(
    root: Element, owners: list[Element], sign_id: str, taken: set[int], *, value: str = "", at_line: bool = False
) -> None:
    """A sign that all owners refer to; where it belongs to a stop line, the line of each refers to it, too."""
    number = free_id(taken)
    taken.add(number)
    for lanelet in owners:
        lights = [index for index, child in enumerate(lanelet) if child.tag == "trafficLightRef"]
        # Signs precede lights in the format.
        lanelet.insert(lights[0] if lights else len(lanelet), Element("trafficSignRef", ref=str(number)))
        line = lanelet.find("stopLine")
        if at_line and line is not None:
            SubElement(line, "trafficSignRef", ref=str(number))
    sign = SubElement(root, "trafficSign", id=str(number))
    element = SubElement(sign, "trafficSignElement")
    SubElement(element, "trafficSignID").text = sign_id
    if value:
        SubElement(element, "additionalValue").text = value
    points = owners[0].findall("rightBound/point")
    if points:
        SubElement(sign, "position").append(fromstring(tostring(points[-1 if at_line else 0])))
