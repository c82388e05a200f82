"""Converts shapes, roads and scenarios to handles of the core."""

from __future__ import annotations

import math
import os
import weakref
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from interdrive import _core
from interdrive.errors import InputError
from interdrive.native_settings import RoadSettings
from interdrive.scenario.control import CLOSED, SIGNALS, TURNS
from interdrive.scenario.lanes import lane_users
from interdrive.scenario.model import KINDS, STATE_FIELDS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from interdrive.scenario.model import Lanelets, Obstacles, Scenario
    from interdrive.scenario.shape import Shape

    _Point = tuple[float, float]


#: As in the core, so that an impossible number is refused before files are read.
_THREADS_MAX = 1024


def thread_count(threads: int | None) -> int:
    """A number of threads for the core; the number of cores for None.

    Raises:
        InputError: The number is impossible.
    """
    if threads is not None and (isinstance(threads, bool) or not isinstance(threads, int | np.integer)):
        raise InputError(f"threads must be a whole number, is {threads!r}")
    if threads is not None and not 1 <= threads <= _THREADS_MAX:
        raise InputError(f"threads must be at least 1 and at most {_THREADS_MAX}, not {threads}")
    return threads or os.cpu_count() or 1


#: As in the core: ways that are farther apart in height do not meet [m].
CLEARANCE = 3.0
#: More than this share of the free memory is not asked for.
MEMORY_SHARE = 0.8


def free_memory() -> float:
    """Memory that is free [bytes]; inf where the system does not say."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return 1024.0 * next(float(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    except (OSError, ValueError, IndexError, StopIteration):
        return math.inf


@contextmanager
def _naming(scenario: Scenario) -> Iterator[None]:
    """Puts the file in front of the core's messages about its elements."""
    try:
        yield
    except InputError as error:
        raise error.within(str(scenario.path or scenario.name)) from None


def core_shape(shape: Shape) -> _core.Shape:
    """The core's handle for a shape.

    Raises:
        InputError: The shape is impossible (size not positive, polygon that crosses itself).
    """
    if shape.kind == "rectangle":
        return _core.Shape.rectangle(shape.length, shape.width, *shape.center, shape.orientation)
    if shape.kind == "circle":
        return _core.Shape.circle(shape.radius, *shape.center)
    if shape.kind == "polygon":
        return _core.Shape.polygon(np.ascontiguousarray(shape.vertices, dtype=np.float64))
    return _core.Shape.group([core_shape(member) for member in shape.members])


#: By the identity of lanelets that are in use: a reference to them, and their road networks by settings.
_ROADS: dict[int, tuple[weakref.ref[Lanelets], list[tuple[RoadSettings, _core.RoadNetwork]]]] = {}


def core_road(scenario: Scenario, settings: RoadSettings) -> _core.RoadNetwork:
    """The core's road network; runs with the same lanelets share it.

    Raises:
        InputError: There are no lanelets, or a bound has fewer than two vertices or a value that is not a number.
    """
    lanelets = scenario.lanelets
    number = id(lanelets)
    if number not in _ROADS:
        _ROADS[number] = weakref.ref(lanelets, lambda _: _ROADS.pop(number, None)), []
    _, known = _ROADS[number]
    for own, road in known:
        if own == settings:
            return road
    road = _core_road(scenario, settings)
    known.append((settings, road))
    return road


def _core_road(scenario: Scenario, settings: RoadSettings) -> _core.RoadNetwork:
    """The core's road network, made anew.

    Raises:
        InputError: There are no lanelets, or a bound has fewer than two vertices or a value that is not a number.
    """
    lanelets = scenario.lanelets
    with _naming(scenario):
        return _core.RoadNetwork(
            lanelets.ids.tolist(),
            [np.ascontiguousarray(bound, dtype=np.float64) for bound in lanelets.left],
            [np.ascontiguousarray(bound, dtype=np.float64) for bound in lanelets.right],
            [list(ids) for ids in lanelets.predecessors],
            [list(ids) for ids in lanelets.successors],
            lanelets.adjacent_left.tolist(),
            lanelets.adjacent_left_same_direction.tolist(),
            lanelets.adjacent_right.tolist(),
            lanelets.adjacent_right_same_direction.tolist(),
            lanelets.speed_limit.tolist(),
            [sum(1 << KINDS.index(kind) for kind in kinds) for kinds in lane_users(lanelets)],
            settings,
            _storeys(lanelets),
        )


def storeys(scenario: Scenario) -> _core.RoadNetwork | None:
    """The core's road network if ways can be one above the other, else None: then all that touch meet.

    Raises:
        InputError: As `core_road`.
    """
    return core_road(scenario, RoadSettings(open_end_length=0.0)) if _storeys(scenario.lanelets) else None


def _storeys(lanelets: Lanelets) -> list[tuple[int, NDArray[np.float64], NDArray[np.float64]]]:
    """Lanelets with heights, points of their middle and the height at each, if ways can be one above the other."""
    known = [row for row, heights in enumerate(lanelets.heights) if len(heights) == len(lanelets.left[row])]
    if not known or np.ptp(np.concatenate([lanelets.heights[row] for row in known])) <= CLEARANCE:
        return []
    return [
        (
            int(lanelets.ids[row]),
            np.ascontiguousarray(0.5 * (lanelets.left[row] + lanelets.right[row])),
            np.ascontiguousarray(lanelets.heights[row], dtype=np.float64),
        )
        for row in known
    ]


def core_scenario(scenario: Scenario, road: _core.RoadNetwork) -> _core.Scenario:
    """The core's scenario: road and recorded traffic."""
    o: Obstacles = scenario.obstacles
    tables: dict[str, Any] = {name: np.ascontiguousarray(getattr(o, name), dtype=np.float64) for name in STATE_FIELDS}
    with _naming(scenario):
        return _core.Scenario(
            scenario.dt,
            road,
            _core.Participants(
                o.ids.tolist(),
                [_footprint(number, shape) for number, shape in zip(o.ids.tolist(), o.shapes, strict=True)],
                o.is_static.tolist(),
                0,
                valid=np.ascontiguousarray(o.valid),
                **tables,
            ),
            [KINDS.index(kind) for kind in o.kinds],
            [
                (light.id, light.offset, [(length, SIGNALS.index(signal)) for signal, length in light.phases])
                for light in scenario.traffic_lights
            ],
            _lines(scenario),
            _priorities(scenario),
            (_closed(scenario.lanelets, "left"), _closed(scenario.lanelets, "right")),
            list(scenario.crosswalks),
            list(scenario.overlaps),
            [("acceleration" in names, "yaw_rate" in names) for names in o.derived],
        )


def _closed(lanelets: Lanelets, side: Literal["left", "right"]) -> list[int]:
    """Ids of the lanelets whose line on a side must not be crossed from there."""
    markings = lanelets.left_marking if side == "left" else lanelets.right_marking
    return [number for number, name in zip(lanelets.ids.tolist(), markings, strict=False) if name in CLOSED[side]]


def _priorities(
    scenario: Scenario,
) -> tuple[list[tuple[int, int]], list[tuple[int, tuple[int, int, int]]], list[int], bool, int, bool]:
    found = scenario.priorities
    return (
        [(number, TURNS.index(turn)) for number, turn in found.turns],
        list(found.ranks),
        list(found.minor),
        found.left_hand,
        {"right": 1, "left": -1, "none": 0}[found.priority_side],
        found.derives_main_road,
    )


def _lines(scenario: Scenario) -> list[tuple[int, tuple[_Point, _Point], bool, list[tuple[int, list[int]]], list[int]]]:
    place = {light.id: row for row, light in enumerate(scenario.traffic_lights)}
    found = []
    for line in scenario.stop_lines:
        missing = sorted({i for _, lights in line.light_ids for i in lights} - place.keys())
        if missing:
            raise InputError(f"stop line of lanelet {line.lanelet_id}: there is no traffic light {missing[0]}")
        ways = [(following, [place[i] for i in lights]) for following, lights in line.light_ids]
        left, right = line.ends.tolist()
        ends = tuple(left), tuple(right)
        found.append((line.lanelet_id, ends, line.has_stop_sign, ways, list(line.turns_on_red)))
    return found


def _footprint(number: int, shape: Shape) -> _core.Shape:
    try:
        return core_shape(shape)
    except InputError as error:
        raise error.within(f"obstacle {number}") from None
