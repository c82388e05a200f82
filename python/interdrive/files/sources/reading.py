"""From what a reader returns to a scenario."""

from __future__ import annotations

import hashlib
import itertools
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError
from interdrive.files.control import priorities_of_map
from interdrive.files.sources.control import control_of
from interdrive.files.sources.lanelets import lanelets_of
from interdrive.files.sources.light_states import with_states
from interdrive.files.sources.recorded import far_from_map, recorded
from interdrive.scenario import Obstacles, Scenario, ScenarioSource
from interdrive.scenario.limits import require_scenario
from interdrive.storage.names import readable

if TYPE_CHECKING:
    from collections.abc import Callable

    from interdrive.files.sources.formats import Format
    from interdrive.files.sources.model import Source
    from interdrive.files.sources.opening import SourceFile
    from interdrive.scenario import SourceOptions, TrafficLight

#: Country of a map that states none; it drives on the right.
_NOWHERE = "ZAM"
#: Time between steps of a map without traffic [s].
_USUAL_DT = 0.1


def scenario_of(
    file: SourceFile, found: Format, options: SourceOptions, read_map: Callable[[Path, SourceOptions], Scenario]
) -> Scenario:
    """The scenario of a file whose format was recognised.

    Args:
        file: The file or folder.
        found: Its format.
        options: How it is read.
        read_map: Reads the map of a recording that has none, of any format.

    Raises:
        InputError: It cannot be read; one line that names it and says what to do.
    """
    source = found.read(file, options)
    name = stem(file.path)
    scenario = _on_roads(file, found, options, source) if source.roads is not None else None
    if scenario is None:
        if options.map is None:
            wanted = "a CommonRoad, OpenDRIVE, Lanelet2 or SUMO map, or lanes.parquet"
            raise InputError(f"{file.path}: tracks need --map ({wanted})")
        scenario = _on_map(read_map(Path(options.map), _of_map(options, source)), file, found, options)
    lanelets, dt = scenario.lanelets, options.dt or _USUAL_DT
    obstacles = _no_obstacles()
    if source.tracks is not None:
        # What is measured along the roads takes time and memory by their length.
        require_scenario(scenario, str(file.path))
        dt = options.dt or source.tracks.dt
        taken = [*lanelets.ids.tolist(), *(light.id for light in scenario.traffic_lights)]
        obstacles = recorded(source.tracks, options, taken, str(file.path), source.notes)
        map_name = str(options.map or "its map") if source.roads is None else "its map"
        bounds = (*lanelets.left, *lanelets.right)
        far_from_map(obstacles, bounds, str(file.path), map_name, source.notes)
    country = options.country or scenario.benchmark_id[:3]
    scenario = replace(
        scenario,
        name=readable(name),
        benchmark_id=f"{country}_{re.sub('[^A-Za-z0-9]', '', name) or 'Map'}-1_1_T-1",
        dt=dt,
        obstacles=obstacles,
        traffic_lights=_at_steps(scenario.traffic_lights, scenario.dt / dt),
    )
    scenario = with_states(scenario, source.light_states, _clock(source, options), source.notes)
    scenario = replace(scenario, notes=(*source.notes.lines(), *scenario.notes))
    require_scenario(scenario, str(file.path))
    return scenario


def _on_roads(file: SourceFile, found: Format, options: SourceOptions, source: Source) -> Scenario:
    """A scenario without traffic on the roads of a source."""
    assert source.roads is not None
    lanelets, keys, numbers = lanelets_of(source.roads, source.notes)
    if all("crosswalk" in kinds for kinds in lanelets.types):
        kinds = ", ".join(f"{kind} {count}" for kind, count in source.notes.left_out("lanes").items()) or "none"
        raise InputError(f"{file.path}: has no lane that vehicles may drive (lanes: {kinds}); --keep adds types")
    benchmark_id = f"{options.country or _NOWHERE}_Map-1_1_T-1"
    of_map = priorities_of_map(lanelets, benchmark_id)
    clock = _clock(source, options)
    found_control = control_of(source.roads, lanelets, numbers, benchmark_id, clock, source.notes)
    if source.roads.left_hand is not None and source.roads.left_hand != of_map.left_hand:
        side, example = ("left", "GBR") if source.roads.left_hand else ("right", "DEU")
        source.notes.say(
            f"vehicles drive on the {side}, which the lanelets do not show: give --country, e.g. {example}"
        )
    return Scenario(
        name="",
        benchmark_id=benchmark_id,
        dt=clock[0],
        lanelets=lanelets,
        obstacles=_no_obstacles(),
        planning_problems=(),
        path=file.path,
        sha256=_hash(file),
        traffic_lights=found_control.lights,
        stop_lines=found_control.lines,
        crosswalks=found_control.crosswalks,
        priorities=replace(of_map, ranks=found_control.ranks),
        source=ScenarioSource(
            format=found.name,
            files=file.files,
            options=_texts(options),
            keys=keys,
            location=source.roads.location,
            lights=found_control.labels,
        ),
    )


def _clock(source: Source, options: SourceOptions) -> tuple[float, float]:
    """Time between steps and time of step 0 [s], in the source's times."""
    if source.tracks is None:
        return options.dt or _USUAL_DT, 0.0
    times = source.tracks.time[np.isfinite(source.tracks.time)]
    first = float(times.min()) if options.start is None and len(times) else options.start or 0.0
    return options.dt or source.tracks.dt, first


def _at_steps(lights: tuple[TrafficLight, ...], ratio: float) -> tuple[TrafficLight, ...]:
    """Lights of a map whose time steps are so many times as long as those of the recording."""
    if ratio == 1.0:
        return lights
    found = []
    for light in lights:
        ends = [round(end * ratio) for end in itertools.accumulate(steps for _, steps in light.phases)]
        phases = zip((signal for signal, _ in light.phases), (0, *ends), ends, strict=False)
        kept = tuple((signal, end - begin) for signal, begin, end in phases if end > begin)
        found.append(replace(light, phases=kept, offset=round(light.offset * ratio)))
    return tuple(found)


def _of_map(options: SourceOptions, source: Source) -> SourceOptions:
    """Options for the map of a recording: those of the user, and those that the recording knows."""
    of_map = replace(options, map=None, dt=None, start=None, duration=None, shift=(0.0, 0.0), case=None)
    if options.projection is None and options.origin is None and options.utm_origin is None:
        return replace(of_map, **source.map_options)
    return of_map


def _on_map(roads: Scenario, file: SourceFile, found: Format, options: SourceOptions) -> Scenario:
    """A scenario without traffic on the roads of another file."""
    of_map = (
        roads.source.files if roads.source is not None else ((roads.path.name, roads.sha256),) if roads.path else ()
    )
    return replace(
        roads,
        obstacles=_no_obstacles(),
        planning_problems=(),
        path=file.path,
        sha256=_hash(file),
        source=ScenarioSource(
            format=found.name,
            files=(*file.files, *of_map),
            options=_texts(options),
            keys=roads.source.keys if roads.source is not None else tuple(map(str, roads.lanelets.ids.tolist())),
            location=roads.source.location if roads.source is not None else "",
            lights=roads.source.lights if roads.source is not None else (),
        ),
    )


def _texts(options: SourceOptions) -> tuple[tuple[str, str], ...]:
    """Options from which the same source is read again, from any folder."""
    texts = options.texts()
    if options.map is not None:
        texts["map"] = str(Path(options.map).resolve())
    return tuple(texts.items())


def stem(path: Path) -> str:
    """Name of a file without its endings, such as `.xodr.gz` and `.net.xml`."""
    name = path.resolve().name if path.name in ("", ".", "..") else path.name
    return re.sub(r"(\.net)?(\.[A-Za-z0-9]+)?(\.gz)?$", "", name) or name


def _hash(file: SourceFile) -> str:
    """SHA-256 of the file; of several, or those of a folder, that of their names and hashes."""
    if len(file.files) == 1:
        return file.files[0][1]
    return hashlib.sha256("\n".join(f"{name} {sha256}" for name, sha256 in file.files).encode()).hexdigest()


def _no_obstacles() -> Obstacles:
    empty = np.zeros((0, 1))
    return Obstacles(
        ids=np.zeros(0, dtype=np.int64),
        kinds=(),
        shapes=(),
        is_static=np.zeros(0, dtype=np.bool_),
        x=empty,
        y=empty,
        orientation=empty,
        velocity=empty,
        acceleration=empty,
        yaw_rate=empty,
        valid=empty.astype(np.bool_),
    )
