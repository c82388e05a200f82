"""Folders that hold a scenario for SUMO: its configuration, net and routes, and a CommonRoad file with the problems."""

from __future__ import annotations

import itertools
import math
import posixpath
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from interdrive.errors import InputError
from interdrive.files.sources.opening import SourceFile
from interdrive.files.sumo_config import NotUnderstoodError, values_of
from interdrive.files.sumo_lights import with_lights
from interdrive.scenario import Scenario, ScenarioSource, SumoTraffic

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

#: Name of the format in run.json.
FORMAT = "SUMO scenario"
_CONFIGS = ("*.sumo.cfg", "*.sumocfg")
_ROADS = "*.cr.xml"
_PICKLE = "simulation_config.p"
#: The boxes around the net and around the lanelets may differ by this [m].
_APART = 50.0
#: Steps of SUMO that make up a time step may differ from it by this share.
_ROUNDING = 1e-6
#: Inputs by all the names that SUMO has for them.
_INPUTS = {
    **dict.fromkeys(("n", "net", "net-file"), "net-file"),
    **dict.fromkeys(("r", "routes", "route-files"), "route-files"),
    **dict.fromkeys(("a", "additional", "additional-files"), "additional-files"),
}
#: Options by which SUMO writes files, or waits for programs or people.
_WRITING = re.compile(r"output|log$|^save-|^write-|^gui|^remote|^num-clients|state|^load|verbose|prefix|configuration")
#: Attributes in files of SUMO that name files.
_FILE_ATTRIBUTES = ("file", "output", "outputFile", "sourceFile", "href")
#: Time steps of a scenario that states no end, and the most that one may state.
_USUAL_STEPS, _STEPS_MAX = 300, 2**31 - 1
#: Sublanes are no wider [m].
_WIDEST = 100.0


def is_sumo_folder(path: Path) -> bool:
    """Whether a folder holds a configuration of SUMO."""
    return path.is_dir() and any(next(path.glob(pattern), None) for pattern in _CONFIGS)


def read_sumo_folder(path: Path, read_roads: Callable[[bytes, str, Path], Scenario]) -> Scenario:
    """The scenario of a folder: roads, what never moves and planning problems of its .cr.xml; the traffic is SUMO's.

    Args:
        path: The folder.
        read_roads: Reads a CommonRoad document from its content, its name and its path.

    Raises:
        InputError: A file is missing or lies elsewhere, or the files do not belong together; one line names it.
    """
    file = SourceFile(path)
    config = _only(file, _CONFIGS, "a configuration of SUMO (*.sumo.cfg)")
    roads = _only(file, (_ROADS,), "a CommonRoad file (*.cr.xml)")
    where = path / config
    document = SourceFile(where).document()
    data = {config: _without_outputs(document)}
    file.beside(config)  # its hash is that of what the user has
    named = _inputs(document, where)
    for option, names in named.items():
        for name in names:
            if not (path / name).is_file():
                raise InputError(f"{where}: names {name} ({option}), which is not there; put it there")
            data[name] = file.beside(name)
            _check_inside(SourceFile(path / name).document(), path / name)
    nets = named.get("net-file", [])
    if len(nets) != 1:
        raise InputError(f"{where}: names {len(nets) or 'no'} net{'s' * (len(nets) > 1)}; give one as net-file")
    net = SourceFile(path / nets[0]).document()
    if net.tag != "net":
        raise InputError(f"{path / nets[0]}: is no net of SUMO but <{net.tag[:40]}>; give what netconvert wrote")
    said, notes = _said(path, file)
    content = _with_own_ids(file.beside(roads), path / roads, notes)
    scenario = read_roads(content, str(path / roads), path / roads)
    offset = _place(net, "netOffset", 2, path / nets[0]) or (0.0, 0.0)
    _check_place(scenario, net, offset, path / nets[0])
    notes.append(f"SUMO drives the traffic, by {config}")
    moving = int((~scenario.obstacles.is_static).sum())
    if moving:
        notes.append(f"{moving} recorded vehicles are left out")
    sumo = SumoTraffic(
        config=config,
        files=tuple(data.items()),
        seed=_whole(said, "random_seed", 0),
        delta_steps=_delta(document, said, scenario.dt, where),
        presimulation_steps=_whole(said, "presimulation_steps", 0),
        n_steps=_n_steps(document, said, scenario.dt),
        lateral_resolution=_sublanes(document, said),
        offset=(offset[0], offset[1]),
    )
    hashes = dict(file.files)
    first = {roads: hashes.pop(roads)}
    scenario = replace(
        scenario,
        name=path.name,
        path=path,
        sha256=first[roads],
        obstacles=scenario.obstacles.standing(),
        notes=(*scenario.notes, *notes),
        overlaps=(),
        source=ScenarioSource(FORMAT, (*first.items(), *hashes.items())),
        sumo=sumo,
    )
    begin = (_number(document, "begin") or 0.0) + sumo.presimulation_steps * scenario.dt
    return with_lights(scenario, net, begin)


def _only(file: SourceFile, patterns: tuple[str, ...], what: str) -> str:
    found = sorted({name for pattern in patterns for name in file.names(pattern)})
    if len(found) != 1:
        there = f"there are {', '.join(found)}" if found else "there is none"
        raise InputError(f"{file.path}: needs {what}, {there}")
    return found[0]


def _with_own_ids(content: bytes, where: Path, notes: list[str]) -> bytes:
    """The document; incoming elements of intersections that share ids have their own.

    Converters of these scenarios number them by intersection.
    """
    root = SourceFile.within(where, content).document()
    numbers = [element.get("id", "") for element in root.iter("incoming")]
    if len(set(numbers)) == len(numbers):
        return content
    taken = [int(number) for element in root.iter() if (number := element.get("id", "")).isdecimal()]
    following = itertools.count(max(taken, default=0) + 1)
    for intersection in root.iter("intersection"):
        own = {element.get("id", ""): str(next(following)) for element in intersection.iterfind("incoming")}
        for element in intersection.iter():
            for name, number in (("incoming", "id"), ("isLeftOf", "ref")):
                if element.tag == name and element.get(number, "") in own:
                    element.set(number, own[element.get(number, "")])
    notes.append(f"{len(numbers)} incoming elements of intersections share ids: they have new ones")
    return tostring(root)


def _inputs(document: Element, where: Path) -> dict[str, list[str]]:
    """Files that a configuration reads, by option, whatever the section.

    Raises:
        InputError: It reads a file outside its folder.
    """
    found: dict[str, list[str]] = {}
    for element in document.iter():
        option = _INPUTS.get(element.tag)
        if option is None:
            continue
        names = [name.strip() for name in _value(element).split(",")]
        for name in names:
            if _is_outside(name):
                raise InputError(f"{where}: names {name} ({option}), which lies outside its folder; put it there")
        found.setdefault(option, []).extend(name for name in names if name)
    return found


def _without_outputs(document: Element) -> bytes:
    """The configuration without options by which SUMO writes files, or waits for programs or people."""
    kept = Element("configuration")
    for element in document.iter():
        is_option = element.get("value") is not None or element.get("v") is not None
        if is_option and not len(element) and not _WRITING.search(element.tag):
            SubElement(kept, element.tag, value=_value(element))
    return tostring(kept)


def _value(element: Element) -> str:
    return element.get("value") or element.get("v") or ""


def _check_inside(document: Element, where: Path) -> None:
    """Raises InputError if a file that SUMO reads makes it read or write elsewhere."""
    for element in document.iter():
        for name in _FILE_ATTRIBUTES:
            if _is_outside(element.get(name, "")):
                raise InputError(
                    f"{where}: names {element.get(name)} ({element.tag}), which lies outside its folder; put it there"
                )


def _is_outside(name: str) -> bool:
    return posixpath.isabs(name) or ".." in name.replace("\\", "/").split("/")


def _said(path: Path, file: SourceFile) -> tuple[dict[str, Any], list[str]]:
    """What simulation_config.p says, and notes."""
    if not (path / _PICKLE).is_file():
        return {}, []
    try:
        return values_of(file.beside(_PICKLE)), []
    except NotUnderstoodError as error:
        return {}, [f"{_PICKLE} is not understood ({error}): defaults are used"]


def _whole(said: dict[str, Any], name: str, usual: int) -> int:
    value = said.get(name, usual)
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**31 else usual


def _number(document: Element, option: str) -> float | None:
    """A number of an option; times may be as H:M:S or D:H:M:S."""
    element = next(document.iter(option), None)
    try:
        parts = [float(part) for part in _value(element).split(":")] if element is not None else []
    except ValueError:
        return None
    weights = (1.0, 60.0, 3600.0, 86400.0)
    if not 0 < len(parts) <= len(weights) or not all(map(math.isfinite, parts)):
        return None
    return sum(part * weight for part, weight in zip(reversed(parts), weights, strict=False))


def _n_steps(document: Element, said: dict[str, Any], dt: float) -> int:
    """Time steps from the first one of the run to the end of the scenario."""
    begin, end = _number(document, "begin") or 0.0, _number(document, "end") or 0.0
    stated = round(min((end - begin) / dt, _STEPS_MAX)) - _whole(said, "presimulation_steps", 0)
    return max(1, _whole(said, "simulation_steps", stated if stated > 0 else _USUAL_STEPS))


def _sublanes(document: Element, said: dict[str, Any]) -> float:
    value = said.get("lateral_resolution", _number(document, "lateral-resolution"))
    return float(value) if isinstance(value, int | float) and 0.0 < value < _WIDEST else 0.0


def _delta(document: Element, said: dict[str, Any], dt: float, where: Path) -> int:
    """Steps of SUMO per time step.

    Raises:
        InputError: They do not make up a time step, or SUMO would round their length.
    """
    if "delta_steps" in said:
        steps = float(max(1, _whole(said, "delta_steps", 1)))
    else:
        stated = next(document.iter("step-length"), None)
        length = dt if stated is None else _number(document, "step-length")
        if length is None:
            raise InputError(f"{where}: step-length is no number; correct it")
        steps = dt / length if length else 0.0
        if steps < 1.0 - _ROUNDING or abs(steps - round(steps)) > _ROUNDING * steps:
            raise InputError(f"{where}: step-length {length:g} s does not divide the time step of {dt:g} s; change it")
    milliseconds = 1000.0 * dt / round(steps)
    if round(milliseconds) < 1 or abs(milliseconds - round(milliseconds)) > _ROUNDING * milliseconds:
        raise InputError(f"{where}: SUMO rounds its steps of {milliseconds:g} ms to whole ones; change their length")
    return round(steps)


def _place(net: Element, name: str, count: int, where: Path) -> tuple[float, ...] | None:
    """Numbers that say where a net lies; None where it does not say so.

    Raises:
        InputError: They are no such numbers.
    """
    location = net.find("location")
    text = None if location is None else location.get(name)
    if text is None:
        return None
    try:
        found = tuple(float(part) for part in text.split(","))
    except ValueError:
        found = ()
    if len(found) != count or not all(map(math.isfinite, found)):
        raise InputError(f"{where}: {name} is not {count} numbers; correct it")
    return found


def _check_place(scenario: Scenario, net: Element, offset: tuple[float, ...], where: Path) -> None:
    """Raises InputError if net and lanelets lie elsewhere."""
    box = _place(net, "convBoundary", 4, where)
    if box is None or not len(scenario.lanelets.ids):
        return
    points = np.concatenate([*scenario.lanelets.left, *scenario.lanelets.right])
    own = (*points.min(axis=0), *points.max(axis=0))
    there = (box[0] - offset[0], box[1] - offset[1], box[2] - offset[0], box[3] - offset[1])
    apart = max(abs(a - b) for a, b in zip(own, there, strict=True))
    if apart > _APART:
        raise InputError(f"{where}: the net lies up to {apart:.0f} m from the lanelets; give files of one scenario")
