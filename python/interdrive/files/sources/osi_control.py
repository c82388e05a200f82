"""Traffic lights, signs and crosswalks of OSI traces."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from interdrive.files.sources.control import crosswalk
from interdrive.files.sources.model import Light, Sign

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from interdrive.array_types import Floats
    from interdrive.files.sources.model import Lane, Roads
    from interdrive.files.sources.notes import Notes
    from interdrive.scenario import Signal, Turn
    from interdrive.scenario.signs import SignKind

#: An object of betterosi, which has no types.
Message: TypeAlias = Any

#: Of bulbs that shine together the first one here counts: red and yellow are red.
_COLOURS: dict[str, Signal] = {"RED": "red", "YELLOW": "yellow", "GREEN": "green"}
_SIGNS: dict[str, SignKind] = {"STOP": "stop", "GIVE_WAY": "yield", "ROUNDABOUT": "yield"}
_PRIORITY = ("RIGHT_OF_WAY_NEXT_INTERSECTION", "RIGHT_OF_WAY_BEGIN")
#: Turns that the arrows of lights are for, by words of their names; lights without an arrow are for all.
_ARROWS: dict[str, Turn] = {"LEFT": "left", "STRAIGHT": "straight", "RIGHT": "right"}
_OTHERS = ("PEDESTRIAN", "WALK", "BICYCLE", "COUNTDOWN", "TRAM", "BUS")


class ControlTrace:
    """What the messages say of lights, signs and markings: what stands is kept once, what shines at each message."""

    def __init__(self) -> None:
        self.bulbs: dict[int, Message] = {}
        self.signs: dict[int, Message] = {}
        self.markings: dict[int, Message] = {}
        self.shining: dict[int, set[int]] = defaultdict(set)

    def add(self, message: int, truth: Message) -> None:
        """Takes the content of a message with this number."""
        for known, found in (
            (self.bulbs, truth.traffic_light),
            (self.signs, truth.traffic_sign),
            (self.markings, truth.road_marking),
        ):
            for one in found:
                known.setdefault(one.id.value, one)
        for bulb in truth.traffic_light:
            if bulb.classification is not None and _name(bulb.classification.mode) == "CONSTANT":
                self.shining[bulb.id.value].add(message)

    def add_to(self, roads: Roads, times: Floats, notes: Notes) -> None:
        """Adds lights, signs and crosswalks to the roads of the trace, whose lanes have the ids of OSI as keys.

        Args:
            roads: The roads.
            times: Of the messages [s].
            notes: What is left out is counted.
        """
        places = {lane.key: place for place, lane in enumerate(roads.lanes)}
        roads.lights += self._lights(places, times, notes)
        roads.signs += self._signs(places, notes)
        roads.lanes += self._crosswalks()

    def _lights(self, places: Mapping[str, int], times: Floats, notes: Notes) -> list[Light]:
        heads: dict[tuple[tuple[int, ...], frozenset[Turn]], list[int]] = defaultdict(list)
        for number, bulb in self.bulbs.items():
            said = bulb.classification
            icon, colour = ("", "") if said is None else (_name(said.icon), _name(said.color))
            lanes = () if said is None else _lanes(said.assigned_lane_id, places)
            if colour not in _COLOURS or any(word in icon for word in _OTHERS):
                notes.leave_out("traffic lights that are not for vehicles", "")
            elif not lanes:
                notes.leave_out("traffic lights of no lane that is read", "")
            else:
                turns = frozenset(turn for word, turn in _ARROWS.items() if icon.startswith("ARROW") and word in icon)
                heads[lanes, turns].append(number)
        found = []
        for (lanes, turns), bulbs in heads.items():
            phases, begin = self._phases(bulbs, times)
            name = str(min(bulbs))
            found += [Light(name, lane, turns=turns, phases=phases, begin=begin, repeats=False) for lane in lanes]
        return found

    def _phases(self, bulbs: Iterable[int], times: Floats) -> tuple[tuple[tuple[Signal, float], ...], float]:
        """What bulbs show together and how long, and when that begins [s]."""
        order = np.argsort(times, kind="stable")
        shown: list[Signal] = []
        by_colour = {_name(self.bulbs[bulb].classification.color): self.shining[bulb] for bulb in bulbs}
        for message in order.tolist():
            lit = [signal for name, signal in _COLOURS.items() if message in by_colour.get(name, ())]
            shown.append(lit[0] if lit else "dark")
        changes = [at for at, signal in enumerate(shown) if not at or signal != shown[at - 1]]
        begins = times[order][changes].tolist()
        ends = [*begins[1:], float(times.max()) + 1.0]
        phases = tuple((shown[at], end - begin) for at, begin, end in zip(changes, begins, ends, strict=True))
        return phases, begins[0]

    def _signs(self, places: Mapping[str, int], notes: Notes) -> list[Sign]:
        found = []
        for sign in self.signs.values():
            said = sign.main_sign.classification if sign.main_sign is not None else None
            name = "" if said is None else _name(said.type)
            kind: SignKind | None = "priority" if name in _PRIORITY else _SIGNS.get(name)
            lanes = _lanes(said.assigned_lane_id, places) if said is not None else ()
            if kind and lanes:
                found += [Sign(lane, kind) for lane in lanes]
            else:
                notes.leave_out("signs", "" if kind else "other")
        return found

    def _crosswalks(self) -> list[Lane]:
        found = []
        for number, marking in self.markings.items():
            said, base = marking.classification, marking.base
            if said is None or base is None or _name(said.traffic_main_sign_type) != "ZEBRA_CROSSING":
                continue
            made = crosswalk(f"crosswalk {number}", _outline(base))
            found += [made] if made is not None else []
        return found


def _name(value: object) -> str:
    return str(getattr(value, "name", ""))


def _lanes(references: Sequence[Message], places: Mapping[str, int]) -> tuple[int, ...]:
    found = dict.fromkeys(places[str(ref.value)] for ref in references if str(ref.value) in places)
    return tuple(found)


def _outline(base: Message) -> Floats:
    """The rectangle of a marking [m]; without a size it has no points."""
    if base.dimension is None or base.position is None:
        return np.zeros((0, 2))
    yaw = float(base.orientation.yaw) if base.orientation is not None else 0.0
    half = 0.5 * np.array([base.dimension.length, base.dimension.width], dtype=np.float64)
    middle = np.array([base.position.x, base.position.y], dtype=np.float64)
    if not (np.isfinite([yaw, *half, *middle]).all() and half.min() > 0.0):
        return np.zeros((0, 2))
    cos, sin = np.cos(yaw), np.sin(yaw)
    corners = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) * half
    turned: Floats = corners @ np.array([(cos, sin), (-sin, cos)]) + middle
    return turned
