"""Writes scenarios, those made in Python above all, as files from which they can be read again."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import InputError
from interdrive.files.read import read_document
from interdrive.files.write import scenario_document
from interdrive.scenario import STATE_FIELDS, Obstacles
from interdrive.scenario.limits import require_scenario
from interdrive.storage import keep_inputs, replacing, resolved

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator

    from interdrive.scenario import Scenario

#: What says where a scenario came from, or follows from the rest.
_ASIDE = frozenset(("name", "path", "sha256", "notes", "raw", "turned", "overlaps", "derived", "source"))
#: Headings that differ by less than this are the same [rad].
_SAME_HEADING = 1e-12
#: What may be different for lack of a place in the format, and how it can be stated.
_ADVICE = {
    "lanelets": "relations must lead to lanelets of the scenario, markings, types and users be names of CommonRoad",
    "obstacles": "ids must be unique in the file (lanelets, lights, ... have ids, too), what stands must be a "
    "parked_vehicle, construction_zone or structure, and footprints must be rectangles, circles or polygons",
    "planning_problems": "ids must be unique in the file, goals with lanelet_ids have these lanelets as areas",
    "incomings": "ids must be unique in the file, and every lanelet exist",
    "traffic_lights": "give it phases with a colour and of at least one time step, and a direction",
    "stop_lines": "a line needs a stop sign or lights that count on the ways for which their directions are, onto "
    "following lanelets; if it is not stated, it lies at the end of its lanelet",
    "priorities": "ways of incomings have turns, stop signs the rank (1, 1, 1), minor lanelets a type such as "
    "driveWay; left_hand, priority_side and derives_main_road follow from the map and the country in the benchmark id",
    "crosswalks": "every lanelet of type crosswalk is one",
}


def write_scenario(scenario: Scenario, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Writes a scenario as a CommonRoad 2020a file that `read_scenario` reads as the same scenario.

    Roads, lights, stop lines, signs of priority, crosswalks and intersections, recorded traffic and planning problems
    are written with all digits. A scenario from a file keeps the roads of that file.

    Args:
        scenario: A scenario from a file or made in Python.
        path: The new file, with the ending `.xml`.
        overwrite: Replace a file that is there.

    Raises:
        InputError: The format cannot hold a part of the scenario; one line names it and says what is possible. Or the
            file exists or cannot be written; nothing is changed then.
    """
    target = resolved(Path(path))
    if target.suffix.lower() != ".xml":
        raise InputError(f"{target}: give the file the ending .xml")
    if target.exists() and not overwrite:
        raise InputError(f"{target}: exists; choose another name or overwrite=True")
    if scenario.path is not None:
        keep_inputs(target, (scenario.path,))
    require_scenario(scenario, scenario.name)
    document = scenario_document(scenario)
    lost = losses(scenario, document)
    if lost:
        raise InputError(f"{scenario.name}: cannot be written as a CommonRoad file: {'; '.join(lost)}")
    with replacing(target) as partial:
        partial.write_bytes(document)


def road_losses(scenario: Scenario) -> tuple[str, ...]:
    """What a document cannot hold of a scenario without file, besides obstacles and planning problems."""
    empty = np.zeros((0, 1))
    tables: dict[str, Any] = dict.fromkeys(STATE_FIELDS, empty)
    nothing = Obstacles(
        ids=np.zeros(0, dtype=np.int64),
        kinds=(),
        shapes=(),
        is_static=np.zeros(0, dtype=np.bool_),
        **tables,
        valid=empty.astype(np.bool_),
    )
    roads = replace(scenario, obstacles=nothing, planning_problems=())
    return losses(roads, scenario_document(roads))


def losses(scenario: Scenario, document: bytes) -> tuple[str, ...]:
    """What a document does not hold of the scenario from which it was made, one line for each field of `Scenario`."""
    try:
        read = read_document(document, scenario.name)
    except InputError as error:
        return (str(error).removeprefix(f"{scenario.name}: "),)
    found: dict[str, str] = {}
    one, other = (replace(each, obstacles=_recorded(each.obstacles)) for each in (scenario, read))
    for where in _differences(one, other, ""):
        found.setdefault(where.split(".")[0].split("[")[0], where)
    return tuple(f"{where} ({_ADVICE.get(name, 'the format has no place for it')})" for name, where in found.items())


def _recorded(obstacles: Obstacles) -> Obstacles:
    """Without time steps after the last recorded one, and without values where nothing is."""
    moving = obstacles.valid & ~obstacles.is_static[:, None]
    n_steps = int(np.flatnonzero(moving.any(axis=0)).max(initial=0)) + 1
    valid = obstacles.valid[:, :n_steps]
    tables: dict[str, Any] = {
        name: np.where(valid, getattr(obstacles, name)[:, :n_steps], np.nan) for name in STATE_FIELDS
    }
    return replace(obstacles, **tables, valid=valid)


def _differences(one: Any, other: Any, where: str) -> Iterator[str]:  # noqa: ANN401 - any field of a scenario
    if is_dataclass(one) and type(one) is type(other):
        for name in (field.name for field in fields(one)):
            if name not in _ASIDE:
                a, b = getattr(one, name), getattr(other, name)
                yield from _differences(*_alike(name, a, b), f"{where}.{name}" if where else name)
    elif isinstance(one, tuple) and isinstance(other, tuple):
        if len(one) != len(other):
            yield where
        for index, (a, b) in enumerate(zip(one, other, strict=False)):
            number = getattr(a, "lanelet_id", getattr(a, "id", index))
            yield from _differences(a, b, f"{where}[{number}]")
    elif isinstance(one, np.ndarray):
        if one.shape != np.shape(other) or not np.array_equal(one, other, equal_nan=one.dtype.kind == "f"):
            yield where
    elif one != other and not (one != one and other != other):  # noqa: PLR0124 - nan
        yield where


def _alike(name: str, one: Any, other: Any) -> tuple[Any, Any]:  # noqa: ANN401 - any field of a scenario
    """Values in the same form where two forms mean the same."""
    if name in ("left_marking", "right_marking", "users"):
        nothing: object = () if name == "users" else "unknown"
        return tuple(() if all(value == nothing for value in values) else values for values in (one, other))  # type: ignore[return-value]
    if name == "light_ids":
        return tuple({way: set(lights) for way, lights in ways if lights} for ways in (one, other))  # type: ignore[return-value]
    if name == "orientation" and isinstance(one, np.ndarray | float) and np.shape(one) == np.shape(other):
        apart = np.abs(np.remainder(np.asarray(one) - np.asarray(other) + np.pi, 2.0 * np.pi) - np.pi)
        same = np.all((apart < _SAME_HEADING) | (np.isnan(one) & np.isnan(other)))
        return (one, one) if same else (one, other)
    return one, other
