"""Places, their recordings, and the windows of these that rollouts begin in."""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError
from interdrive.files import read_scenario, scenario_file
from interdrive.prediction_evaluation.repeats import KnownTracks
from interdrive.recordings import joined, part_of, repaired
from interdrive.scenario.native import core_shape
from interdrive.traffic_realism.tracks import GRID, Tracks

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from interdrive.array_types import Bools, Ints
    from interdrive.scenario import Scenario

#: Kinds of participants that are judged, and plan; others replay.
JUDGED_KINDS = frozenset(("car", "truck", "bus", "motorcycle", "taxi", "priority_vehicle"))
#: Judged vehicles are recorded without a gap for so long after the start [s], and get so far in their recording [m].
_KNOWN_MIN, _DISPLACEMENT_MIN = 3.2, 2.0
#: Before the start, so much of a recording is replayed [s].
PAST = 3.0
#: Starts: the first one, and the times between two of them in a recording, on quiet and busy roads [s].
_FIRST, _EVERY, _EVERY_BUSY, _BUSY = 1.0, 8.0, 16.0, 40
#: Starts of long rollouts in a recording.
_LONG_STARTS = 4
#: Words in the source or tags of a file that was simulated or invented.
_NOT_RECORDED = re.compile(r"SUMO|synthes|hand-?crafted|simulat", re.IGNORECASE)
#: A data set of recordings, whatever its name says: NGSIM.
_NGSIM = re.compile(r"next[ -]generation simulation", re.IGNORECASE)
#: Countries of CommonRoad that are on no map.
_NOWHERE = re.compile(r"(?<=benchmarkID=\")(?:[CS]-)?(?:ZAM|OSC)(?=[_-])")


@dataclass(frozen=True)
class Recording:
    """One recording of a place.

    Attributes:
        place: Name of the place.
        scenario: What was recorded, joined from all of its windows.
        files: Where it is from.
        known_before: Whether an earlier recording shows the same vehicle at that time step, shape (obstacles, steps).
        has_one_start: It is one of many windows of seconds that overlap, as those of NGSIM, and vehicles begin to plan
            in it once.
    """

    place: str
    scenario: Scenario
    files: tuple[Path, ...]
    known_before: Bools | None = None
    has_one_start: bool = False

    @property
    def stride(self) -> int:
        """Time steps between points of the grid."""
        return round(GRID / self.scenario.dt)


@dataclass(frozen=True)
class Window:
    """A part of a recording: some past, a start, and what follows.

    Attributes:
        place: Name of the place.
        recording: Number of the recording.
        index: Number of the window in all of them; in the bootstrap it goes as a whole.
        scenario: The part.
        start: Time step of the part from which vehicles plan.
        time: Of the start in the recording [s].
        n_points: Points of the grid after the start.
        judged: Ids of the judged vehicles, ascending.
    """

    place: str
    recording: int
    index: int
    scenario: Scenario
    start: int
    time: float
    n_points: int
    judged: Ints

    @property
    def stride(self) -> int:
        """Time steps between points of the grid."""
        return round(GRID / self.scenario.dt)

    @property
    def start_point(self) -> int:
        """Point of the grid at which vehicles begin to plan."""
        return self.start // self.stride

    def recorded(self) -> Tracks:
        """All participants as recorded, on the grid."""
        obstacles = self.scenario.obstacles
        columns = slice(self.start % self.stride, None, self.stride)
        extent = np.array([core_shape(shape).extent for shape in obstacles.shapes]).reshape(-1, 2)
        tables = (obstacles.x, obstacles.y, obstacles.orientation, obstacles.velocity)
        return Tracks(obstacles.ids, extent[:, 0], extent[:, 1], *(table[:, columns] for table in tables))


def place_of(name: str) -> str:
    """The place that a file shows, by its name: DEU_MONAEast for C-DEU_MONAEast-2_80_T-159."""
    found = re.match(r"(?:[CS]-)?([A-Za-z]+_[A-Za-z0-9]+)", name)
    return found[1] if found else name


def read_recordings(
    sources: Sequence[str | Path], *, raw: bool, any_traffic: bool, only: Collection[Path] | None = None
) -> tuple[list[Recording], list[str]]:
    """Recordings of files and folders; windows of one recording are joined.

    Args:
        sources: Files and folders.
        raw: Read them without repairs.
        any_traffic: Take simulated and invented traffic, too.
        only: Those of `files_of` that are read; None: all.

    Returns:
        The recordings, and a line per file that is left out.

    Raises:
        InputError: A file that is named cannot be used, or nothing is left.
    """
    notes: list[str] = []
    groups: dict[str, list[Scenario]] = defaultdict(list)
    for path, is_named in files_of(sources):
        if only is not None and path not in only:
            continue
        try:
            scenario = _read(path, any_traffic=any_traffic)
        except InputError as error:
            if is_named:
                raise
            notes.append(f"{path.name} is left out: {error.message}")
            continue
        groups[re.sub(r"[_-]?\d*_T-\d+$", "", scenario.name)].append(scenario)
    found = [
        Recording(place_of(name), whole, files, has_one_start=all(_NGSIM.search(_head(file)) for file in files))
        for name, windows in sorted(groups.items())
        for parts, whole in _wholes(windows, raw=raw)
        for files in [tuple(one.path for one in parts if one.path is not None)]
    ]
    known: dict[str, KnownTracks] = defaultdict(KnownTracks)
    found = [
        replace(one, known_before=known[one.place].repeated(one.scenario.obstacles, one.scenario.dt)) for one in found
    ]
    if not found:
        raise InputError("realism: no recorded traffic among the files" + (f" ({notes[0]})" if notes else ""))
    return found, notes


def _read(path: Path, *, any_traffic: bool) -> Scenario:
    why = "" if any_traffic else _not_recorded(path)
    if why:
        raise InputError(str(path), f"{why}; any_traffic takes it")
    scenario = read_scenario(path, raw=True)
    if abs(GRID / scenario.dt - round(GRID / scenario.dt)) > 1e-6:
        raise InputError(str(path), f"its time step of {scenario.dt:g} s does not divide {GRID:g} s")
    return scenario


def files_of(sources: Sequence[str | Path]) -> Iterable[tuple[Path, bool]]:
    """Files that are given by themselves or in folders, and whether by themselves."""
    for source in sources:
        path = Path(source)
        if path.is_dir():
            inside = sorted(file for file in path.rglob("*") if file.suffix in (".xml", ".pb") and file.is_file())
            if not inside:
                raise InputError(f"{source}: this folder has no CommonRoad file (.xml, .pb)")
            yield from ((file, False) for file in inside)
        else:
            yield scenario_file(source), True


def _not_recorded(path: Path) -> str:
    """Why the traffic of a file was not recorded; empty if it may have been."""
    head = _head(path)
    said = " ".join([*re.findall(r'source="([^"]*)"', head), *re.findall(r"<scenarioTags>(.*?)</scenarioTags>", head)])
    word = _NOT_RECORDED.search(_NGSIM.sub("", said)) or _NOWHERE.search(head)
    return f"its traffic was not recorded ({word[0]})" if word else ""


def _head(path: Path) -> str:
    """The beginning of a file, with what it says of itself."""
    return path.read_bytes()[:20_000].decode("utf-8", "replace")


def _wholes(windows: Sequence[Scenario], *, raw: bool) -> list[tuple[Sequence[Scenario], Scenario]]:
    """Windows that follow each other as one recording; otherwise each file by itself."""
    if len(windows) > 1 and all(_states_steps(one) for one in windows):
        return [(windows, joined(windows, raw=raw))]
    return [([one], one if raw else repaired(one)) for one in windows]


def _states_steps(scenario: Scenario) -> bool:
    """Its name ends with its first and last time step in a longer recording."""
    found = re.search(r"\d+_T-(\d+)$", scenario.name)
    return found is not None and int(found[1]) + 1 >= scenario.obstacles.n_steps


def windows_of(
    recordings: Sequence[Recording], *, horizon: float, starts: Sequence[float] = (), is_long: bool = False
) -> list[Window]:
    """All windows with a judged vehicle.

    Args:
        recordings: What was recorded.
        horizon: Of the rollouts [s].
        starts: Times of the starts in each recording [s]; empty: every 8 s, on busy roads every 16 s, from 1 s on, and
            in windows of NGSIM at 1 s alone.
        is_long: Four starts per recording instead, none where a recording is too short.
    """
    found: list[Window] = []
    for number, recording in enumerate(recordings):
        for time in starts or _starts(recording, horizon, is_long=is_long):
            if round(time / recording.scenario.dt) >= recording.scenario.obstacles.n_steps:
                continue
            window = _cut(recording, number, len(found), time, horizon)
            if len(window.judged):
                found.append(window)
    return found


def _starts(recording: Recording, horizon: float, *, is_long: bool) -> list[float]:
    scenario = recording.scenario
    dt, there = scenario.dt, scenario.obstacles.valid & ~scenario.obstacles.is_static[:, None]
    present = there.sum(axis=0)
    first, last = np.flatnonzero(present)[[0, -1]] * dt if present.any() else (0.0, 0.0)
    if is_long:
        span = last - first - _FIRST
        if span < horizon:
            return []
        count = int(min(_LONG_STARTS, max(1.0, span // horizon)))
        return [_on_grid(first + _FIRST + (i + 0.5) * span / count - 0.5 * horizon, dt) for i in range(count)]
    every = _EVERY_BUSY if present.max(initial=0) > _BUSY else _EVERY
    times = np.arange(first + _FIRST, last - _KNOWN_MIN, every)
    return [_on_grid(float(time), dt) for time in (times[:1] if recording.has_one_start else times)]


def _on_grid(time: float, dt: float) -> float:
    return round(max(time, 0.0) / dt) * dt


def _cut(recording: Recording, number: int, index: int, time: float, horizon: float) -> Window:
    """The part of a recording around a start, with its judged vehicles."""
    scenario, stride = recording.scenario, recording.stride
    dt, obstacles = scenario.dt, scenario.obstacles
    start = round(time / dt)
    n_points = round(horizon / GRID)
    first = max(start % stride, start - round(PAST / GRID) * stride)
    last = min(obstacles.n_steps, start + n_points * stride + 1)
    part = part_of(scenario, first, last)
    at, known = start - first, round(_KNOWN_MIN / dt)
    there = part.obstacles.valid[:, at : at + known + 1]
    judged = there.all(axis=1) if there.shape[1] == known + 1 else np.zeros(len(there), dtype=np.bool_)
    judged &= np.array([kind in JUDGED_KINDS for kind in part.obstacles.kinds], dtype=np.bool_)
    judged &= ~np.isin(part.obstacles.ids, list(scenario.overlapping)) & ~part.obstacles.is_static
    if recording.known_before is not None:
        judged &= ~recording.known_before[np.searchsorted(obstacles.ids, part.obstacles.ids), start]
    x, y = part.obstacles.x, part.obstacles.y
    moved = np.hypot(x[:, at:] - x[:, at : at + 1], y[:, at:] - y[:, at : at + 1])
    moved = np.where(np.isfinite(moved), moved, 0.0).max(axis=1, initial=0.0)
    judged &= moved >= _DISPLACEMENT_MIN
    ids = part.obstacles.ids[judged]
    return Window(recording.place, number, index, part, at, time, n_points, ids)
