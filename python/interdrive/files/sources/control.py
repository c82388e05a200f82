"""Signs, traffic lights and crosswalks of a source as those of a scenario."""

from __future__ import annotations

import itertools
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from interdrive.files.control import lights_of_ways, may_turn_on_red, turn_of
from interdrive.files.sources.model import Lane
from interdrive.scenario import StopLine, TrafficLight
from interdrive.scenario.control import TURNS
from interdrive.scenario.limits import LARGEST_TIME_STEP
from interdrive.scenario.signs import sign_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from interdrive.array_types import Floats
    from interdrive.files.sources.lanelets import Numbers
    from interdrive.files.sources.model import Light, Roads, Sign
    from interdrive.files.sources.notes import Notes
    from interdrive.scenario import Lanelets, Signal, Turn
    from interdrive.scenario.signs import Ranks

#: Phases in time steps, and the step at which the first one begins.
_Cycle: TypeAlias = tuple[tuple[tuple["Signal", int], ...], int]


@dataclass(frozen=True)
class Control:
    """Traffic lights, stop lines, ranks and crosswalks, as `Scenario` and `Priorities` hold them; labels of lights."""

    lights: tuple[TrafficLight, ...]
    lines: tuple[StopLine, ...]
    ranks: tuple[tuple[int, Ranks], ...]
    crosswalks: tuple[int, ...]
    labels: tuple[tuple[int, str], ...]


class _Builder:
    """Lights by what they show, with ids from a first one on."""

    def __init__(self, lanelets: Lanelets, notes: Notes) -> None:
        self.lanelets = lanelets
        self.rows = {number: row for row, number in enumerate(lanelets.ids.tolist())}
        self.notes = notes
        self.lights: dict[tuple[str, _Cycle, frozenset[Turn]], TrafficLight] = {}
        self.labels: dict[int, str] = {}

    def light(self, name: str, cycle: _Cycle, directions: frozenset[Turn], label: str) -> TrafficLight:
        key = (name, cycle, directions)
        if key not in self.lights:
            number = len(self.rows) + len(self.lights) + 1
            self.lights[key] = TrafficLight(number, cycle[0], cycle[1], frozenset(directions))
            if label:
                self.labels[number] = label
        return self.lights[key]

    def end_of(self, number: int) -> Floats:
        row = self.rows[number]
        return np.array([self.lanelets.left[row][-1], self.lanelets.right[row][-1]])

    def turns_at(self, number: int) -> dict[int, Turn]:
        """Turns that lanelets which follow take."""
        return {
            other: turn_of(self.lanelets, self.rows[other]) for other in self.lanelets.successors[self.rows[number]]
        }


def control_of(
    roads: Roads,
    lanelets: Lanelets,
    numbers: Numbers,
    benchmark_id: str,
    clock: tuple[float, float],
    notes: Notes,
) -> Control:
    """Signs and lights at the lanelets that became of their lanes, and the crosswalks.

    Args:
        roads: What the source says.
        lanelets: What became of its lanes.
        numbers: Which is which.
        benchmark_id: It begins with the country.
        clock: Time between steps and time of step 0 [s], in the source's times.
        notes: What has no place is counted.
    """
    built = _Builder(lanelets, notes)
    signs: dict[int, list[Sign]] = defaultdict(list)
    lights: dict[int, list[Light]] = defaultdict(list)
    for sign in roads.signs:
        if sign.lane in numbers.last:
            signs[numbers.last[sign.lane]].append(sign)
        else:
            notes.leave_out("signs of lanes that are left out", sign.kind)
    for light in roads.lights:
        if light.lane in numbers.last:
            lights[numbers.last[light.lane]].append(light)
        else:
            notes.leave_out("traffic lights of lanes that are left out", "")
    lines = [
        line
        for number in sorted({*signs, *lights})
        if (line := _line(number, signs[number], lights[number], built, numbers, clock, benchmark_id)) is not None
    ]
    # Of several signs of a lane the lowest rank counts.
    ranks = {number: min(sign_of(sign.kind).ranks for sign in found) for number, found in signs.items() if found}
    crossed = zip(lanelets.ids.tolist(), lanelets.types, strict=True)
    return Control(
        tuple(built.lights.values()),
        tuple(lines),
        tuple(sorted(ranks.items())),
        tuple(number for number, kinds in crossed if "crosswalk" in kinds),
        tuple(built.labels.items()),
    )


def _line(
    number: int,
    signs: Sequence[Sign],
    lights: Sequence[Light],
    built: _Builder,
    numbers: Numbers,
    clock: tuple[float, float],
    benchmark_id: str,
) -> StopLine | None:
    """Where vehicles stop at the end of a lanelet for lights or a stop sign; None: for neither."""
    stops = [sign for sign in signs if sign.kind == "stop"]
    found = _lights_at(number, lights, built, numbers, clock)
    if not stops and not found:
        return None
    on_red = any(light.turns_on_red for light in lights) or may_turn_on_red(benchmark_id)
    ways, turns_on_red = lights_of_ways(built.lanelets, built.rows, number, found, {}, on_red=on_red)
    lines = (*(sign.line for sign in stops), *(light.line for light in lights))
    stated = next((line for line in lines if line is not None), None)
    return StopLine(
        number,
        built.end_of(number) if stated is None else np.round(stated, 4) + 0.0,
        ways,
        has_stop_sign=bool(stops),
        # A sign without a line counts where the next junction begins, which may be behind the lane.
        is_stated=stated is not None or bool(signs) or bool(turns_on_red),
        turns_on_red=turns_on_red,
    )


def _lights_at(
    number: int, lights: Sequence[Light], built: _Builder, numbers: Numbers, clock: tuple[float, float]
) -> list[TrafficLight]:
    """A light for each set of turns that have the same cycle."""
    turns = built.turns_at(number)
    if lights and not turns:
        built.notes.leave_out("traffic lights of lanes that lead nowhere", "", len(lights))
    labels = {light.name: light.label for light in lights}
    shown: dict[Turn, tuple[str, _Cycle]] = {}
    for light in lights:
        found = (light.name, cycle_of(light, clock, built.notes))
        ways = {numbers.first[way] for way in light.ways if way in numbers.first}
        counting = {turn for other, turn in turns.items() if not light.ways or other in ways}
        counting &= light.turns or counting
        if counting and any(shown.setdefault(turn, found)[1] != found[1] for turn in counting):
            built.notes.name("lights that differ for one turn of a lane: the first counts, lights", light.name)
    cycles: dict[tuple[str, _Cycle], set[Turn]] = defaultdict(set)
    for turn, (name, cycle) in shown.items():
        cycles[name, cycle].add(turn)
    is_for_all = len(cycles) == 1 and set(shown) == set(turns.values())
    return [
        built.light(name, cycle, frozenset(TURNS if is_for_all else directions), labels[name])
        for (name, cycle), directions in cycles.items()
    ]


def cycle_of(light: Light, clock: tuple[float, float], notes: Notes) -> _Cycle:
    """Phases in time steps, and the step at which the first begins.

    Without any that last, and where none shows a colour, the light is dark.

    Args:
        light: The light.
        clock: Time between steps and time of step 0 [s], in the source's times.
        notes: Cycles that are too long are named.
    """
    dt, first = clock
    ends = np.cumsum([seconds for _, seconds in light.phases]) / dt
    begin = (light.begin - first) / dt
    if not len(ends) or all(signal == "dark" for signal, _ in light.phases):
        return (), 0
    if not (np.isfinite(begin) and 0.0 < ends[-1] <= LARGEST_TIME_STEP and abs(begin) <= LARGEST_TIME_STEP):
        notes.name("traffic lights are dark whose cycle is too long, lights", light.name)
        return (), 0
    if light.repeats:
        phases = _phases([signal for signal, _ in light.phases], np.round(ends).astype(np.int64).tolist())
        total = sum(steps for _, steps in phases)
        return phases, round(begin) % total if total else 0
    ends = np.maximum(np.round(ends + begin), 0.0).astype(np.int64)
    ends[-1] = LARGEST_TIME_STEP
    return _phases([signal for signal, _ in light.phases], ends.tolist()), 0


def _phases(signals: Iterable[Signal], ends: Sequence[int]) -> tuple[tuple[Signal, int], ...]:
    """Signals and how many steps each lasts, those that follow each other and are equal as one."""
    lasting = [
        (signal, end - begin) for signal, begin, end in zip(signals, (0, *ends), ends, strict=False) if end > begin
    ]
    return tuple(
        (signal, sum(steps for _, steps in group))
        for signal, group in itertools.groupby(lasting, key=lambda one: one[0])
    )


def crosswalk(key: str, outline: Floats) -> Lane | None:
    """A crosswalk with an outline [m], shape (points, 2): its four sides, or the smallest rectangle around it."""
    corners = outline[:-1] if len(outline) > 1 and np.array_equal(outline[0], outline[-1]) else outline
    if len(corners) < 3:
        return None
    sides = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(*sides.T)
    turns = sides[:, 0] * np.roll(sides[:, 1], -1) - sides[:, 1] * np.roll(sides[:, 0], -1)
    if len(corners) != 4 or lengths.min() < 1e-3 or not ((turns > 0.0).all() or (turns < 0.0).all()):
        corners = _rectangle(corners, sides[lengths >= 1e-3])
        turns = np.ones(4)
    if turns[0] > 0.0:
        corners = corners[::-1]
    # Corners run clockwise: what begins at the first side has the next two corners, backwards, on its right.
    lengths = np.hypot(*(np.roll(corners, -1, axis=0) - corners).T)
    if lengths[0] + lengths[2] < lengths[1] + lengths[3]:
        corners = np.roll(corners, -1, axis=0)
    return Lane(key, corners[:2].copy(), corners[[3, 2]].copy(), kind="crosswalk")


def _rectangle(points: Floats, sides: Floats) -> Floats:
    """The smallest rectangle along one of some sides around points, its corners counter-clockwise."""
    best, least = points[:4], np.inf
    for side in sides:
        ahead = side / np.hypot(*side)
        frame = np.array([ahead, (-ahead[1], ahead[0])])
        along = points @ frame.T
        low, high = along.min(axis=0), along.max(axis=0)
        area = float((high - low).prod())
        if area < least:
            corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
            best, least = corners @ frame, area
    return best
