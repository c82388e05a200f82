"""Traffic lights and signs of SUMO nets."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import TYPE_CHECKING

from interdrive.files.sources.model import Light, Sign

if TYPE_CHECKING:
    from collections.abc import Mapping
    from xml.etree.ElementTree import Element

    from interdrive.files.sources.notes import Notes
    from interdrive.scenario import Signal

#: What the letters of a state mean; "s" is red with a green arrow to the right, "o" and "O" are switched off.
_SIGNALS: dict[str, Signal] = {
    **dict.fromkeys("rus", "red"),
    **dict.fromkeys("yY", "yellow"),
    **dict.fromkeys("gG", "green"),
    **dict.fromkeys("oO", "dark"),
}
_ARROW = "s"
#: Junctions whose minor roads have signs; at others vehicles from the right go first, or lights tell.
_SIGNED = ("priority", "priority_stop", "allway_stop")
#: What the letters of connections mean for an edge all of whose connections have them.
_STOPS, _YIELDS = frozenset("sw"), frozenset("m")


def lights_of(root: Element, places: Mapping[str, int], notes: Notes) -> list[Light]:
    """A light for each connection that has one: what its program shows at its place in the state.

    Args:
        root: The net.
        places: Positions of lanes by their names.
        notes: What is left out or not as in SUMO.
    """
    programs: dict[str, Element] = {}
    for logic in root.iterfind("tlLogic"):
        programs.setdefault(logic.get("id", ""), logic)  # further programs are alternatives
    found = []
    for connection in root.iterfind("connection"):
        name = connection.get("tl")
        if name is None:
            continue
        start = places.get(f"{connection.get('from')}_{connection.get('fromLane')}")
        way = connection.get("via") or f"{connection.get('to')}_{connection.get('toLane')}"
        program, index = programs.get(name), connection.get("linkIndex", "")
        if start is None or way not in places:
            continue
        if program is None or not index.isdecimal() or len(index) > 6:
            notes.name("traffic lights without a program left out", name)
            continue
        phases = [(phase.get("state", "")[int(index) :][:1], _seconds(phase)) for phase in program.iterfind("phase")]
        if not phases or any(letter not in _SIGNALS or not seconds >= 0.0 for letter, seconds in phases):
            notes.name("traffic lights without a program left out", name)
            continue
        if program.get("type", "static") != "static":
            notes.name("traffic lights that depend on traffic in SUMO have the durations of their phases", name)
        found.append(
            Light(
                name,
                start,
                (places[way],),
                tuple((_SIGNALS[letter], seconds) for letter, seconds in phases),
                begin=finite(program.get("offset"), 0.0),
                turns_on_red=any(letter == _ARROW for letter, _ in phases),
            )
        )
    return found


def signs_of(root: Element, places: Mapping[str, int]) -> list[Sign]:
    """Signs at edges from which all ways across a junction give way, at junctions where that is shown by signs."""
    kinds = {junction.get("id"): junction.get("type", "") for junction in root.iterfind("junction")}
    signed = {
        edge.get("id", "")
        for edge in root.iterfind("edge")
        if kinds.get(edge.get("to"), "") in _SIGNED and edge.get("function", "") == ""
    }
    letters: dict[str, set[str]] = defaultdict(set)
    lanes: dict[str, dict[int, None]] = defaultdict(dict)
    for connection in root.iterfind("connection"):
        edge = connection.get("from", "")
        start = places.get(f"{edge}_{connection.get('fromLane')}")
        # Everybody gives way when turning around.
        if edge in signed and start is not None and connection.get("dir") != "t" and not connection.get("tl"):
            letters[edge].add(connection.get("state", ""))
            lanes[edge][start] = None
    found = []
    for edge, stated in letters.items():
        if stated <= _YIELDS | _STOPS:
            found += [Sign(lane, "stop" if stated <= _STOPS else "yield") for lane in lanes[edge]]
    return found


def finite(text: str | None, usual: float) -> float:
    """A finite number, or the usual one."""
    try:
        number = float(text or "")
    except ValueError:
        return usual
    return number if abs(number) < 1e12 else usual


def _seconds(phase: Element) -> float:
    return finite(phase.get("duration"), math.nan)
