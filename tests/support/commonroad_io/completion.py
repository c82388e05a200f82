"""Makes documents readable for commonroad-io where they mean something that it refuses."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement

from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

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
            if is_any_heading(heading):
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


def is_any_heading(heading: Element) -> bool:
    """Whether a heading is an interval of a full turn or more."""
    try:
        ends = [float(heading.findtext(f"interval{end}", "")) for end in ("Start", "End")]
    except ValueError:
        return False
    return ends[1] - ends[0] >= _ANY_HEADING
