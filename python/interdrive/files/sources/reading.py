"""From what a reader returns to a scenario."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from interdrive.files.control import priorities_of_map
from interdrive.files.sources.lanelets import lanelets_of
from interdrive.scenario import Obstacles, Scenario, ScenarioSource
from interdrive.scenario.limits import require_scenario
from interdrive.storage.names import readable

if TYPE_CHECKING:
    from interdrive.files.sources.formats import Format
    from interdrive.files.sources.opening import SourceFile
    from interdrive.scenario import SourceOptions

#: Country of a map that states none; it drives on the right.
_NOWHERE = "ZAM"
#: Time between steps of a map without traffic [s].
_USUAL_DT = 0.1


def scenario_of(file: SourceFile, found: Format, options: SourceOptions) -> Scenario:
    """The scenario of a file whose format was recognised.

    Raises:
        InputError: It cannot be read; one line that names it and says what to do.
    """
    source = found.read(file, options)
    assert source.roads is not None
    lanelets, keys = lanelets_of(source.roads, source.notes)
    name = stem(file.path)
    benchmark_id = f"{options.country or _NOWHERE}_{re.sub('[^A-Za-z0-9]', '', name) or 'Map'}-1_1_T-1"
    of_map = priorities_of_map(lanelets, benchmark_id)
    if source.roads.left_hand is not None and source.roads.left_hand != of_map.left_hand:
        side, example = ("left", "GBR") if source.roads.left_hand else ("right", "DEU")
        source.notes.say(
            f"vehicles drive on the {side}, which the lanelets do not show: give --country, e.g. {example}"
        )
    scenario = Scenario(
        name=readable(name),
        benchmark_id=benchmark_id,
        dt=options.dt or _USUAL_DT,
        lanelets=lanelets,
        obstacles=_no_obstacles(),
        planning_problems=(),
        path=file.path,
        sha256=_hash(file),
        notes=source.notes.lines(),
        priorities=of_map,
        source=ScenarioSource(
            format=found.name,
            files=file.files,
            options=_texts(options),
            keys=keys,
            location=source.roads.location,
        ),
    )
    require_scenario(scenario, str(file.path))
    return scenario


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
