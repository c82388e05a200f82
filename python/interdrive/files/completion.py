"""Makes documents readable for commonroad-io where they mean something that it refuses."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement

from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from interdrive.files.shapes import Foreign

#: Intervals of headings from this width on [rad] hold every heading; decimals of 2 pi are cut in files.
_ANY_HEADING = 2.0 * math.pi - 1e-4
#: Elements that interdrive does not read; commonroad-io refuses names in them that it does not know.
_UNUSED = ("location", "initialSignalState", "signalSeries")
#: Countries whose list of signs in commonroad-io has no speed limit; its default list has one.
_WITHOUT_LIMIT = ("AUS",)
_DEFAULT_COUNTRY = "ZAM"


def completed_document(root: Element, file: str) -> tuple[str, ...]:
    """Changes a checked document so that commonroad-io reads it.

    A traffic light without a cycle is dark, so it gets a phase without colour; a stop line without marking gets an
    unknown one. An interval of a full turn or more as a goal's heading is no condition, and as an obstacle's heading it
    states none, so it is left out. Where commonroad-io knows no speed limit in a country, it is told the default
    country; the benchmark id of the scenario stays. Heights that only one bound of a lanelet has count for both.
    Places, tags and signals of vehicles are not read.

    Args:
        root: Root element, changed in place.
        file: Name for messages.

    Returns:
        Notes on what the file lacks.

    Raises:
        InputError: The start of a planning problem has any heading.
    """
    _drop_unused(root)
    for line in root.iterfind("lanelet/stopLine"):
        if line.find("lineMarking") is None:
            SubElement(line, "lineMarking").text = "unknown"
    notes = []
    dark = [light for light in root.iterfind("trafficLight") if light.find("cycle/cycleElement") is None]
    for light in dark:
        for cycle in light.findall("cycle"):
            light.remove(cycle)
        element = SubElement(SubElement(light, "cycle"), "cycleElement")
        SubElement(element, "duration").text, SubElement(element, "color").text = "1", "inactive"
    if dark:
        notes.append(f"traffic lights without a cycle are dark: {', '.join(light.get('id', '?') for light in dark)}")
    for lanelet in root.iterfind("lanelet"):
        _complete_heights(lanelet)
    for owner, state in _states(root):
        for heading in state.findall("orientation"):
            if _is_any(heading):
                if state.tag == "initialState" and owner.tag == "planningProblem":
                    raise InputError(f"{file}: planning problem {owner.get('id')} starts with any heading; state one")
                state.remove(heading)
    name = root.get("benchmarkID", "")
    country = name.removeprefix("C-")[:3]
    if country in _WITHOUT_LIMIT:
        root.set("benchmarkID", name.replace(country, _DEFAULT_COUNTRY, 1))
    return tuple(notes)


def _complete_heights(lanelet: Element) -> None:
    """Gives points without a height that of the point opposite; where both have none, the lanelet loses all of them."""
    sides = [lanelet.findall(f"{side}/point") for side in ("leftBound", "rightBound")]
    points = [point for side in sides for point in side]
    if all(point.find("z") is None for point in points) or all(point.find("z") is not None for point in points):
        return
    for pair in zip(*sides, strict=True):
        known = [point.findtext("z") for point in pair if point.find("z") is not None]
        if not known:
            for point in points:
                for height in point.findall("z"):
                    point.remove(height)
            return
        for point in pair:
            if point.find("z") is None:
                SubElement(point, "z").text = known[0]


def _drop_unused(root: Element) -> None:
    for owner in (root, *root):
        for child in [child for child in owner if child.tag in _UNUSED]:
            owner.remove(child)
    for tags in root.iterfind("scenarioTags"):
        tags.clear()


def _states(root: Element) -> Iterator[tuple[Element, Element]]:
    """States whose headings may be intervals, with the element that has them."""
    for owner in root:
        for path in ("initialState", "goalState", "trajectory/state", "occupancySet/occupancy"):
            yield from ((owner, state) for state in owner.iterfind(path))


def _is_any(heading: Element) -> bool:
    try:
        ends = [float(heading.findtext(f"interval{end}", "")) for end in ("Start", "End")]
    except ValueError:
        return False
    return ends[1] - ends[0] >= _ANY_HEADING


def completed_messages(
    roads: Foreign, traffic: Foreign, problems: Foreign, signs: Mapping[str, Collection[str]], file: str
) -> tuple[str, ...]:
    """The same for the three messages of a scenario in protobuf, as far as they can lack something.

    A sign that is not in the list of its country is read as an unknown sign.

    Args:
        roads: Message of the map, changed in place, as are the others.
        traffic: Message of the traffic.
        problems: Message of the planning problems; may be empty.
        signs: Names of the signs of each country that commonroad-io knows.
        file: Name for messages.

    Returns:
        Notes on cycles of traffic lights that do not exist, which are left out.

    Raises:
        InputError: The start of a planning problem has any heading.
    """
    place = roads.map_meta_information.map_id
    if place.country_id not in signs or place.country_id in _WITHOUT_LIMIT:
        place.country_id = _DEFAULT_COUNTRY
    known = signs[place.country_id]
    for sign in roads.traffic_signs:
        for element in sign.traffic_sign_elements:
            names = element.DESCRIPTOR.fields_by_name["element_id"].enum_type
            if names.values_by_number[element.element_id].name not in known:
                element.element_id = names.values_by_name["UNKNOWN"].number
    # Values that signs show for a time are never read.
    traffic.ClearField("traffic_sign_value")
    for problem in problems.planning_problems:
        if _is_any_angle(problem.initial_state.orientation):
            raise InputError(
                f"{file}: planning problem {problem.planning_problem_id} starts with any heading; state one"
            )
        _drop_any_headings(goal.state for goal in problem.goal_states)
    for obstacle in (*traffic.static_obstacles, *traffic.dynamic_obstacles):
        _drop_any_headings((obstacle.initial_state,))
    for obstacle in traffic.dynamic_obstacles:
        _drop_any_headings(obstacle.trajectory_prediction.trajectory.states)
    lights = {light.traffic_light_id for light in roads.traffic_lights}
    lost = [cycle for cycle in traffic.traffic_light_cycle if cycle.traffic_light_id not in lights]
    for cycle in lost:
        traffic.traffic_light_cycle.remove(cycle)
    return tuple(
        f"a cycle is for traffic light {number}, which does not exist"
        for number in sorted({cycle.traffic_light_id for cycle in lost})
    )


def _drop_any_headings(states: Iterable[Foreign]) -> None:
    for state in states:
        if _is_any_angle(state.orientation):
            state.ClearField("orientation")


def _is_any_angle(angle: Foreign) -> bool:
    return bool(angle.interval.end - angle.interval.start >= _ANY_HEADING)
