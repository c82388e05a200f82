"""Reads traffic lights, stop lines, priority signs and crosswalks, and derives what the file leaves out."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from interdrive.files.shapes import name_of
from interdrive.scenario.control import SIGNALS, TURNS, Priorities, Signal, StopLine, TrafficLight, Turn
from interdrive.scenario.lanes import driving_side
from interdrive.scenario.signs import GREEN_ARROW, GREEN_ARROW_NUMBER, PRIORITY_SIGNS, sign_of

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from interdrive.files.facts import Facts
    from interdrive.files.shapes import Foreign
    from interdrive.scenario import Lanelets
    from interdrive.scenario.signs import Ranks

#: A lanelet that turns by more than this leads to the left or right [rad].
_TURN = math.radians(25.0)
#: Where no intersection says so, only such a turn leads around a corner, to the right on red [rad].
_CORNER = math.radians(45.0)
#: A sign counts where its lanelet ends, or this far beyond along single successors [m].
_SIGN_REACH = 50.0
#: A stop line this far from its lanelet is noted [m].
_LINE_AWAY = 2.0
#: A line so near to the start of its lanelet, and not ahead of it, is noted [m].
_LINE_NEAR = 10.0
#: A stop line shorter than this [m], or closer than this to the direction of its lanelet [rad], is noted.
_LINE_SHORT, _LINE_ALONG = 0.1, math.radians(30.0)
#: Names of signs by their numbers.
_NAMES = {number: sign.name for sign in PRIORITY_SIGNS for number in sign.numbers} | {GREEN_ARROW_NUMBER: GREEN_ARROW}
_STOP = sign_of("stop").name
#: A vehicle that comes from such a lanelet waits.
_MINOR = frozenset(("driveWay", "parking", "busStop", "accessRamp", "shoulder"))
#: Countries by their codes in benchmark ids.
_LEFT_HAND = frozenset(("AUS", "GBR", "HKG", "IND", "IRL", "JPN", "NZL", "SGP", "THA", "ZAF"))
_MAIN_ROAD = frozenset(("USA", "PRI"))
_RIGHT_ON_RED = frozenset(("CAN", "PRI", "USA"))


def control(
    network: Foreign, lanelets: Lanelets, benchmark_id: str
) -> tuple[tuple[TrafficLight, ...], tuple[StopLine, ...]]:
    """Traffic lights, sorted by id, and stop lines, sorted by lanelet.

    A line without points, and that of a lanelet with lights or a stop sign but without a line, is at the lanelet's end.
    Which lights count on the way to a following lanelet: those of the lanelet and of its line whose direction has the
    turn that the following lanelet takes, as its intersection states or by its change of heading. Turns on red are
    allowed to the right in the USA, Puerto Rico and Canada, and beside a green arrow sign (720), unless a light for
    the turn to the right alone can be red.
    """
    lights = tuple(_light(light) for light in sorted(network.traffic_lights, key=lambda one: int(one.traffic_light_id)))
    known = {light.id: light for light in lights}
    rows = {number: row for row, number in enumerate(lanelets.ids.tolist())}
    sources = {int(lanelet.lanelet_id): lanelet for lanelet in network.lanelets}
    stopping = _leading_from(network, lanelets, lambda sign: _STOP in _names(sign))
    turns = _stated_turns(network)
    arrows = _leading_from(network, lanelets, lambda sign: GREEN_ARROW in _names(sign))
    on_red = set(sources) if may_turn_on_red(benchmark_id) else arrows
    lines = []
    for number in sorted(sources):
        source, row = sources[number], rows[number]
        line = source.stop_line
        nexts = [i for i in lanelets.successors[row] if i in rows]
        found = sorted(_light_ids(source) & set(known))
        if not (number in stopping or (found and (line is not None or nexts))):
            continue
        ways, turns_on_red = lights_of_ways(
            lanelets, rows, number, [known[i] for i in found], turns, on_red=number in on_red
        )
        points = _stated_ends(source)
        if points is None:
            points = np.array([lanelets.left[row][-1], lanelets.right[row][-1]])
        stops, is_stated = number in stopping, line is not None
        lines.append(StopLine(number, points, ways, stops, is_stated, turns_on_red))
    return lights, tuple(lines)


def lights_of_ways(
    lanelets: Lanelets,
    rows: Mapping[int, int],
    number: int,
    lights: Sequence[TrafficLight],
    turns: Mapping[int, Turn],
    *,
    on_red: bool,
) -> tuple[tuple[tuple[int, tuple[int, ...]], ...], tuple[int, ...]]:
    """Which lights count on the way to each following lanelet, and onto which drivers may turn right on red.

    Args:
        lanelets: The roads.
        rows: Their rows by id.
        number: The lanelet that has the lights.
        lights: Its lights.
        turns: Turns that intersections state, by the lanelet that follows.
        on_red: Whether turns to the right on red are allowed where no light for them alone can be red.
    """
    ways, turns_on_red = [], []
    for following in (other for other in lanelets.successors[rows[number]] if other in rows):
        way = turns.get(following) or turn_of(lanelets, rows[following])
        counting = [light for light in lights if way in light.directions]
        ways.append((following, tuple(light.id for light in counting)))
        held = any(light.directions == {"right"} and _can_be_red(light) for light in counting)
        is_turn = turns.get(following) == "right" or turn_of(lanelets, rows[following], _CORNER) == "right"
        if is_turn and on_red and counting and not held:
            turns_on_red.append(following)
    return tuple(ways), tuple(turns_on_red)


def may_turn_on_red(benchmark_id: str) -> bool:
    """Whether drivers of the country may turn right on red without a sign."""
    return _country(benchmark_id) in _RIGHT_ON_RED


def _light(light: Foreign) -> TrafficLight:
    cycle = light.traffic_light_cycle
    elements = (getattr(cycle, "cycle_elements", None) or ()) if light.active else ()
    phases = tuple((_signal(element.state), int(element.duration)) for element in elements if element.duration > 0)
    stated = name_of(light.direction)
    directions = frozenset(turn for turn in TURNS if turn in stated.lower()) or frozenset(TURNS)
    number = int(light.traffic_light_id)
    place = light.position
    return TrafficLight(
        id=number,
        phases=phases if any(signal != "dark" for signal, _ in phases) else (),
        offset=int(getattr(cycle, "time_offset", 0) or 0),
        directions=directions,
        position=None if place is None else (float(place[0]), float(place[1])),
    )


def control_notes(network: Foreign, lanelets: Lanelets, lines: tuple[StopLine, ...]) -> tuple[str, ...]:
    """What cannot work as stated: phases without a duration, lights that are never green, stop lines elsewhere."""
    rows = {number: row for row, number in enumerate(lanelets.ids.tolist())}
    dark, off, cut, red, never, blank = [], [], [], [], [], []
    for light in network.traffic_lights:
        number = int(light.traffic_light_id)
        elements = getattr(light.traffic_light_cycle, "cycle_elements", None) or ()
        if not elements:
            dark.append(number)
        elif not light.active:
            off.append(number)
        if any(element.duration <= 0 for element in elements):
            cut.append(number)
        shown = {_signal(element.state) for element in elements if light.active and element.duration > 0}
        if shown == {"red"}:
            red.append(number)
        elif shown and shown <= {"red", "yellow"}:
            never.append(number)
        elif elements and light.active and shown <= {"dark"}:
            blank.append(number)
    # Also lines that no light and no stop sign uses.
    stated = {int(lanelet.lanelet_id): _stated_ends(lanelet) for lanelet in network.lanelets}
    ends = {number: points for number, points in stated.items() if points is not None and number in rows}
    found = (
        ("traffic lights without a cycle are dark", dark),
        ("traffic lights that are switched off are dark", off),
        ("traffic lights that never show a colour are dark", blank),
        ("phases without a positive duration left out, traffic lights", cut),
        ("traffic lights that are always red", red),
        ("traffic lights that are never green", never),
        ("traffic lights whose direction fits no way of their lanelet", _without_way(network, lines)),
        (
            f"stop lines more than {_LINE_AWAY:g} m from their lanelet, lanelets",
            [number for number, points in ends.items() if _is_away(points, lanelets, rows[number])],
        ),
        (
            "stop lines at or behind the start of their lanelet, lanelets",
            [number for number, points in ends.items() if _is_behind(points, lanelets, rows[number])],
        ),
        (
            "stop lines without a length, lanelets",
            [number for number, points in ends.items() if _length(points) < _LINE_SHORT],
        ),
        (
            "stop lines along their lanelet instead of across it, lanelets",
            [number for number, points in ends.items() if _is_along(points, lanelets, rows[number])],
        ),
    )
    return tuple(f"{what}: {', '.join(map(str, sorted(ids)))}" for what, ids in found if ids)


def _without_way(network: Foreign, lines: tuple[StopLine, ...]) -> list[int]:
    """Lights of lanelets with following ones, of which none is a way for which the light counts."""
    leading = {line.lanelet_id for line in lines if line.light_ids}
    counting = {number for line in lines for _, ids in line.light_ids for number in ids}
    stated: set[int] = set()
    for lanelet in network.lanelets:
        if int(lanelet.lanelet_id) in leading:
            stated |= {int(number) for number in _light_ids(lanelet)}
    known = {int(light.traffic_light_id) for light in network.traffic_lights}
    return sorted((stated & known) - counting)


def _stated_ends(lanelet: Foreign) -> NDArray[np.float64] | None:
    """Both ends of the stop line of a lanelet [m], (2, 2), if it has a line that states them."""
    line = lanelet.stop_line
    if line is None or line.start is None or line.end is None:
        return None
    return np.array([np.asarray(end, dtype=np.float64)[:2] for end in (line.start, line.end)])


def _is_behind(ends: NDArray[np.float64], lanelets: Lanelets, row: int) -> bool:
    """Whether the middle of a stop line is not ahead of the start of its lanelet, so that no vehicle comes to it."""
    middle = 0.5 * (lanelets.left[row] + lanelets.right[row])
    along = middle[1] - middle[0]
    ahead = float((ends.mean(axis=0) - middle[0]) @ along) / max(float(np.hypot(*along)), 1e-12)
    near = float(np.hypot(*(ends.mean(axis=0) - middle[0])))
    return ahead < _LINE_SHORT and near < _LINE_NEAR


def _length(ends: NDArray[np.float64]) -> float:
    return float(np.hypot(*(ends[1] - ends[0])))


def _is_along(ends: NDArray[np.float64], lanelets: Lanelets, row: int) -> bool:
    """Whether a stop line runs in the direction of its lanelet where it is."""
    if _length(ends) < _LINE_SHORT:
        return False
    middle = 0.5 * (lanelets.left[row] + lanelets.right[row])
    near = int(np.hypot(*(middle - ends.mean(axis=0)).T).argmin())
    start = max(0, min(near, len(middle) - 2))
    along, across = middle[start + 1] - middle[start], ends[1] - ends[0]
    cosine = abs(float(along @ across)) / max(float(np.hypot(*along) * np.hypot(*across)), 1e-12)
    return cosine > math.cos(_LINE_ALONG)


def _light_ids(lanelet: Foreign) -> set[int]:
    """Ids of the lights of a lanelet and of its stop line, whether they exist or not."""
    line = lanelet.stop_line
    refs = {*(lanelet.traffic_lights or ()), *(getattr(line, "traffic_light_ref", None) or ())}
    return {int(number) for number in refs}


def _is_away(ends: NDArray[np.float64], lanelets: Lanelets, row: int) -> bool:
    """Whether the middle of a stop line is far from every point between the bounds of its lanelet."""
    middle = ends.mean(axis=0)
    near = []
    for share in np.linspace(0.0, 1.0, 5):
        curve = (1.0 - share) * lanelets.left[row] + share * lanelets.right[row]
        start, step = curve[:-1], np.diff(curve, axis=0)
        lengths = np.maximum((step**2).sum(axis=1), 1e-12)
        part = np.clip(((middle - start) * step).sum(axis=1) / lengths, 0.0, 1.0)
        near.append(np.hypot(*(start + part[:, None] * step - middle).T).min())
    return bool(min(near) > _LINE_AWAY)


def _can_be_red(light: TrafficLight) -> bool:
    return any(signal == "red" for signal, _ in light.phases)


def _country(benchmark_id: str) -> str:
    return benchmark_id.removeprefix("C-")[:3]


def _signal(state: Foreign) -> Signal:
    name = "red" if name_of(state) == "redYellow" else name_of(state)
    return SIGNALS[SIGNALS.index(name)] if name in SIGNALS else "dark"


def _stated_turns(network: Foreign) -> dict[int, Turn]:
    """Lanelet -> turn at its intersection; commonroad-io 2024 and 2026 use different names."""
    return {
        int(number): turn
        for intersection in network.intersections
        for incoming in intersection.incomings
        for turn in TURNS
        for group in ("outgoing", "successors")
        for number in getattr(incoming, f"{group}_{turn}", None) or ()
    }


def turn_of(lanelets: Lanelets, row: int, least: float = _TURN) -> Turn:
    """The turn of a lanelet by its change of heading, if that is more than `least` [rad]."""
    middle = 0.5 * (lanelets.left[row] + lanelets.right[row])
    steps = np.diff(middle, axis=0)
    headings = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])[np.any(steps != 0.0, axis=1)])
    change = float(headings[-1] - headings[0]) if len(headings) else 0.0
    return "left" if change > least else "right" if change < -least else "straight"


def is_sign(sign: Foreign, names: Iterable[str]) -> bool:
    """Whether one of the sign's elements has one of these names in its country's list of signs."""
    return any(element.traffic_sign_element_id.name in names for element in sign.traffic_sign_elements)


def _leading_from(network: Foreign, lanelets: Lanelets, wanted: Callable[[Foreign], bool]) -> set[int]:
    """Lanelets at whose end signs count: the next one from the sign on that ends at a junction."""
    signs = {int(sign.traffic_sign_id) for sign in network.traffic_signs if wanted(sign)}
    sources = {int(lanelet.lanelet_id): lanelet for lanelet in network.lanelets} if signs else {}
    rows = {number: row for row, number in enumerate(lanelets.ids.tolist())}
    lined = {number for number, source in sources.items() if source.stop_line is not None}
    found = set()
    for number, source in sources.items():
        line = source.stop_line
        if signs & {int(i) for i in getattr(line, "traffic_sign_ref", None) or ()}:
            found.add(number)
        elif signs & {int(i) for i in source.traffic_signs or ()}:
            found.add(place_of_sign(number, lanelets, rows, lined))
    return found


def place_of_sign(number: int, lanelets: Lanelets, rows: Mapping[int, int], lined: Container[int]) -> int:
    """The lanelet at whose end a sign of a lanelet counts: it, or the last one of a chain without lines and forks.

    Args:
        number: The lanelet that has the sign.
        lanelets: The roads.
        rows: Their rows by id.
        lined: Lanelets with stop lines.
    """
    at, left = number, _SIGN_REACH
    while at not in lined:
        nexts = [i for i in lanelets.successors[rows[at]] if i in rows]
        if len(nexts) != 1 or len(lanelets.predecessors[rows[nexts[0]]]) != 1:
            break
        steps = np.diff(lanelets.left[rows[nexts[0]]], axis=0)
        left -= float(np.hypot(steps[:, 0], steps[:, 1]).sum())
        if left < 0.0:
            break
        at = nexts[0]
    return at


def priorities(network: Foreign, lanelets: Lanelets, benchmark_id: str, facts: Facts) -> Priorities:
    """What signs, lanelet types and intersections say about priority, and what follows from the country.

    Args:
        network: The lanelet network of commonroad-io.
        lanelets: The same as arrays.
        benchmark_id: It begins with the country.
        facts: What commonroad-io does not pass on.
    """
    ranks: dict[int, Ranks] = {}
    # Of several signs at a lanelet the lowest rank counts.
    for known in sorted(PRIORITY_SIGNS, key=lambda known: known.ranks[1], reverse=True):
        here = _leading_from(network, lanelets, lambda sign, name=known.name: name in _names(sign))  # type: ignore[misc]
        ranks |= dict.fromkeys(here, known.ranks)
    turns: list[tuple[int, Turn]] = sorted(_stated_turns(network).items())
    of_map = priorities_of_map(lanelets, benchmark_id)
    return replace(
        of_map,
        turns=tuple((number, turn) for number, turn in turns if number in lanelets.ids),
        ranks=tuple(sorted(ranks.items())),
        derives_main_road=of_map.derives_main_road or facts.version == "2018b",
    )


def priorities_of_map(lanelets: Lanelets, benchmark_id: str) -> Priorities:
    """What follows from lanelets and country alone: the side of driving, minor roads, rules of the country."""
    country = _country(benchmark_id)
    minor = [int(i) for i, kinds in zip(lanelets.ids, lanelets.types, strict=True) if _MINOR.intersection(kinds)]
    return Priorities(
        minor=tuple(minor),
        left_hand=(driving_side(lanelets) or ("left" if country in _LEFT_HAND else "right")) == "left",
        priority_side={"JPN": "left", "GBR": "none"}.get(country, "right"),  # type: ignore[arg-type]
        derives_main_road=country in _MAIN_ROAD,
    )


def crosswalks(network: Foreign, lanelets: Lanelets) -> tuple[int, ...]:
    """Lanelets on which people cross the road: of type crosswalk, or named as a crossing by an intersection."""
    stated = {
        int(number)
        for intersection in network.intersections
        for crossing in intersection.crossings or ()
        # A set of lanelets in commonroad-io 2024, of groups of them in 2026.
        for number in getattr(crossing, "crossing_lanelets", (crossing,)) or ()
    }
    found = zip(lanelets.ids.tolist(), lanelets.types, strict=True)
    return tuple(number for number, kinds in found if "crosswalk" in kinds or number in stated)


def is_priority_sign(sign: Foreign) -> bool:
    """Whether the sign tells which vehicle goes first."""
    return not _names(sign).isdisjoint(known.name for known in PRIORITY_SIGNS)


def _names(sign: Foreign) -> set[str]:
    """Names of the elements of a sign, by their codes also of those that are not known in its country."""
    elements = [element.traffic_sign_element_id for element in sign.traffic_sign_elements]
    codes = (str(element.value) for element in elements)
    return {str(element.name) for element in elements} | {_NAMES[text] for text in codes if text in _NAMES}
