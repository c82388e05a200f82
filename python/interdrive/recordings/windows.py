"""Recordings that were cut into windows of time, put together again."""

from __future__ import annotations

import itertools
import re
from collections import Counter, defaultdict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.errors import InputError
from interdrive.recordings.headings import HeadingOffset, heading_offset, turned
from interdrive.recordings.repair import with_overlaps
from interdrive.scenario.limits import LARGEST_TIME_STEP
from interdrive.scenario.model import STATE_FIELDS, Obstacles

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from interdrive.array_types import Floats
    from interdrive.scenario.model import Scenario
    from interdrive.scenario.shape import Shape

#: Bounds of lanelets that differ by more than this [m] belong to different roads.
_SAME_ROAD = 1e-6
#: A vehicle continues if it is nearer than this [m] to where its speeds lead.
_RESIDUAL_MAX = 0.6
#: Sizes that differ by more than this [m] are those of different vehicles.
_SAME_SIZE = 1e-6
#: Ids that a note or an error names.
_NAMED = 5


@dataclass(frozen=True)
class _Window:
    """A recording and the time step of the whole at which it begins."""

    scenario: Scenario
    first: int

    @property
    def end(self) -> int:
        """The time step after its last one."""
        return self.first + self.scenario.obstacles.n_steps


@dataclass
class _Track:
    """A participant of the whole recording; `states` has a part of each window, as time steps and columns."""

    id: int
    kind: str
    shape: Shape
    is_static: bool
    derived: tuple[str, ...]
    file: str
    states: list[tuple[NDArray[np.int64], Floats]]


@dataclass(frozen=True)
class _Join:
    """A participant that begins in the next window: how far from where its speeds lead, and whether it moves."""

    id: int
    residual: float
    moves: bool


def joined(recordings: Sequence[Scenario], *, raw: bool = False) -> Scenario:
    """Windows of one recording as one scenario.

    Windows are ordered by the time steps in their names (`..._80_T-159`), otherwise by one running number in them,
    otherwise by the participants that continue. Time steps are those of the names, otherwise they begin at 0. A
    participant with the same id, kind and size continues in the next window if it begins there one step later, and at
    most 0.6 m from where the mean of both speeds leads along its heading; otherwise the rest is a new participant. A
    missing window leaves a gap in all tracks. Planning problems are left out, because they belong to one window.

    Args:
        recordings: At least two, in any order, read with `raw=True`.
        raw: Read recordings without repairs.

    Returns:
        The scenario; `path` is None, `notes` says how many participants continue, and what was cut or left out.

    Raises:
        InputError: They do not belong together: other lanelets, another time between steps, windows that overlap, or an
            id that is a participant of another kind or size.
    """
    if len(recordings) < 2:
        raise InputError("join: give at least two recordings that follow each other")
    for path, times in Counter(one.path for one in recordings if one.path is not None).items():
        if times > 1:
            raise InputError(f"{path} cannot be joined with itself; name each recording once")
    for other in recordings[1:]:
        _check_same_road(recordings[0], other)
    offset = heading_offset(one.obstacles for one in recordings)
    angle = offset.median if offset.is_constant else 0.0
    windows = _in_order(recordings, angle)
    tracks, notes = _tracks(windows, angle)
    first, last = windows[0], windows[-1]
    name = f"{_common([one.name for one in recordings])}_{first.first}_T-{last.end - 1}"
    whole = replace(
        first.scenario,
        name=name,
        benchmark_id=name,
        obstacles=_tables(tracks, last.end),
        planning_problems=(),
        path=None,
        sha256="",
        notes=(*_summed_up(recordings), *notes),
        traffic_lights=tuple(
            replace(light, offset=light.offset + first.first) for light in first.scenario.traffic_lights
        ),
        raw=raw,
    )
    return whole if raw else with_overlaps(_repaired(whole, offset))


def _repaired(whole: Scenario, offset: HeadingOffset) -> Scenario:
    return turned(whole, offset) if offset.is_constant else whole


def _file(scenario: Scenario) -> str:
    return str(scenario.path or scenario.name)


def _check_same_road(first: Scenario, other: Scenario) -> None:
    pair = f"{_file(first)} and {_file(other)}"
    if first.dt != other.dt:
        raise InputError(f"{pair} cannot be joined: {first.dt:g} s between time steps, and {other.dt:g} s")
    roads = first.lanelets, other.lanelets
    same = np.array_equal(roads[0].ids, roads[1].ids) and all(
        a.shape == b.shape and np.allclose(a, b, rtol=0.0, atol=_SAME_ROAD)
        for side in ("left", "right")
        for a, b in zip(*(getattr(road, side) for road in roads), strict=True)
    )
    if not same:
        raise InputError(f"{pair} cannot be joined: their lanelets differ; join windows of one recording")


# Order


def _in_order(recordings: Sequence[Scenario], angle: float) -> list[_Window]:
    windows = _by_time_steps(recordings) or _by_number(recordings) or _by_participants(recordings, angle)
    windows.sort(key=lambda window: window.first)
    for before, after in itertools.pairwise(windows):
        if after.first < before.end:
            raise InputError(
                f"{_file(after.scenario)} cannot be joined: it begins at time step {after.first}, before "
                f"{_file(before.scenario)} ends ({before.end - 1})"
            )
    if windows[-1].end > LARGEST_TIME_STEP:
        raise InputError(f"{_file(windows[-1].scenario)} cannot be joined: it ends after step {LARGEST_TIME_STEP}")
    return windows


def _by_time_steps(recordings: Sequence[Scenario]) -> list[_Window]:
    """Windows by the steps that names state, such as 80 and 159 in `C-DEU_MONAEast-2_80_T-159`; empty if they do not.

    Digits of other numbers may stand before the first step, and the first step may be off by one.
    """
    windows, ends = [], []
    for one in recordings:
        found = re.search(r"(\d+)_T-(\d+)$", one.name)
        if found is None:
            return []
        digits, end = found[1], int(found[2])
        latest = end + 1 - one.obstacles.n_steps
        if latest < 0:
            return []
        starts = [int(digits[i:]) for i in range(len(digits)) if int(digits[i:]) <= latest]
        windows.append(_Window(one, max(starts, default=latest)))
        ends.append(end)
    return windows if len(set(ends)) == len(ends) else []


def _by_number(recordings: Sequence[Scenario]) -> list[_Window]:
    """Windows by the only number in which their names differ, if no number is missing; empty otherwise."""
    split = [re.split(r"(\d+)", one.name) for one in recordings]
    if len({len(parts) for parts in split}) > 1:
        return []
    places = [place for place, values in enumerate(zip(*split, strict=True)) if len(set(values)) > 1]
    if len(places) != 1 or places[0] % 2 == 0:
        return []
    numbered = sorted(zip((int(parts[places[0]]) for parts in split), recordings, strict=True), key=lambda one: one[0])
    numbers = [number for number, _ in numbered]
    if numbers != list(range(numbers[0], numbers[0] + len(numbers))):
        return []
    return _one_after_the_other([one for _, one in numbered])


def _by_participants(recordings: Sequence[Scenario], angle: float) -> list[_Window]:
    """Windows in the only order in which participants that move continue."""
    follows: dict[int, int] = {}
    for i, before in enumerate(recordings):
        counts = Counter(
            {
                j: sum(
                    join.moves and join.residual < _RESIDUAL_MAX for join in _joins(_Window(before, 0), after, angle)
                )
                for j, after in enumerate(recordings)
                if i != j
            }
        )
        best, count = counts.most_common(1)[0]
        if count:
            follows[i] = best
    starts = set(range(len(recordings))) - set(follows.values())
    order = [min(starts)] if len(starts) == 1 else []
    while order and order[-1] in follows and len(order) <= len(recordings):
        order.append(follows[order[-1]])
    if len(order) != len(recordings):
        raise InputError(
            f"{_file(recordings[0])} and {len(recordings) - 1} others cannot be joined: neither their names nor their "
            "participants say which one follows which; name them like NAME_80_T-159, by first and last time step"
        )
    return _one_after_the_other([recordings[i] for i in order])


def _one_after_the_other(recordings: Iterable[Scenario]) -> list[_Window]:
    windows: list[_Window] = []
    for one in recordings:
        windows.append(_Window(one, windows[-1].end if windows else 0))
    return windows


def _joins(before: _Window, after: Scenario, angle: float) -> list[_Join]:
    """Participants at the last step of a window and at the first one of the next."""
    a, b = before.scenario.obstacles, after.obstacles
    moving_a, moving_b = (o.ids[o.valid[:, column] & ~o.is_static] for o, column in ((a, -1), (b, 0)))
    ids = np.intersect1d(moving_a, moving_b)
    rows = np.searchsorted(a.ids, ids), np.searchsorted(b.ids, ids)
    from_, to = (
        {name: getattr(o, name)[row, column] for name in STATE_FIELDS[:4]}
        for o, row, column in ((a, rows[0], -1), (b, rows[1], 0))
    )
    residuals = _residual(from_, to, angle, after.dt)
    moves = np.abs(from_["velocity"]) > _core.STANDSTILL_SPEED  # what stands tells no order
    return [_Join(*values) for values in zip(ids.tolist(), residuals.tolist(), moves.tolist(), strict=True)]


def _residual(before: dict[str, Floats], after: dict[str, Floats], angle: float, dt: float) -> Floats:
    """Distance between a position and where the mean speed leads from the one before along its heading [m]."""
    way, heading = 0.5 * (before["velocity"] + after["velocity"]) * dt, before["orientation"] + angle
    along_x, along_y = way * np.cos(heading), way * np.sin(heading)
    found: Floats = np.hypot(after["x"] - before["x"] - along_x, after["y"] - before["y"] - along_y)
    return found


# Tracks


def _tracks(windows: Sequence[_Window], angle: float) -> tuple[list[_Track], list[str]]:
    """Participants of the whole recording, and what there is to say about them."""
    tracks: list[_Track] = []
    current: dict[int, _Track] = {}
    everywhere = set.intersection(
        *(set(one.scenario.obstacles.ids[one.scenario.obstacles.is_static].tolist()) for one in windows)
    )
    free = max((int(one.scenario.obstacles.ids.max(initial=0)) for one in windows), default=0) + 1
    residuals: list[float] = []
    cut: list[int] = []
    absent: list[int] = []
    for window in windows:
        obstacles = window.scenario.obstacles
        for row, number in enumerate(obstacles.ids.tolist()):
            found = _part(window, row, is_static=number in everywhere)
            before = current.get(number)
            if before is None:
                current[number] = found
                tracks.append(found)
                continue
            _check_same_participant(before, found)
            if found.is_static:
                continue
            residual = _step_between(before, found, angle, window.scenario.dt)
            if residual is not None and residual >= _RESIDUAL_MAX:
                cut.append(number)
                found.id, free = free, free + 1
                current[number] = found
                tracks.append(found)
                continue
            if residual is None:
                absent.append(number)
            else:
                residuals.append(residual)
            before.states += found.states
    return sorted(tracks, key=lambda track: track.id), _remarks(windows, len(tracks), residuals, absent, cut)


def _part(window: _Window, row: int, *, is_static: bool) -> _Track:
    """An obstacle of one window; a static obstacle that is present for a part of the time stands then."""
    obstacles = window.scenario.obstacles
    steps = np.flatnonzero(obstacles.valid[row])
    values = np.array([getattr(obstacles, name)[row, steps] for name in STATE_FIELDS])
    return _Track(
        id=int(obstacles.ids[row]),
        kind=obstacles.kinds[row],
        shape=obstacles.shapes[row],
        is_static=is_static,
        derived=obstacles.derived[row] if obstacles.derived else (),
        file=_file(window.scenario),
        states=[(steps + window.first, values)],
    )


def _check_same_participant(before: _Track, after: _Track) -> None:
    pair = f"{before.file} and {after.file} cannot be joined: obstacle {after.id}"
    if before.kind != after.kind:
        raise InputError(f"{pair} is a {before.kind} in one and a {after.kind} in the other")
    if not _same_size(before.shape, after.shape):
        raise InputError(f"{pair} has another size in the other")
    if before.is_static and not np.allclose(before.states[0][1][:3, 0], after.states[0][1][:3, 0], rtol=0.0, atol=1e-3):
        raise InputError(f"{pair} is static, but stands elsewhere in the other")


def _same_size(a: Shape, b: Shape) -> bool:
    first, second = (np.array([*one.center, one.length, one.width, one.radius, one.orientation]) for one in (a, b))
    return (
        a.kind == b.kind
        and a.vertices.shape == b.vertices.shape
        and np.allclose(a.vertices, b.vertices, rtol=0.0, atol=_SAME_SIZE)
        and np.allclose(first, second, rtol=0.0, atol=_SAME_SIZE)
        and len(a.members) == len(b.members)
        and all(_same_size(*members) for members in zip(a.members, b.members, strict=True))
    )


def _step_between(before: _Track, after: _Track, angle: float, dt: float) -> float | None:
    """The residual of a participant that goes on one step later [m]; None if it was absent in between."""
    (*_, (steps, values)), (next_steps, next_values) = before.states, after.states[0]
    if next_steps[0] - steps[-1] != 1:
        return None
    end, begin = (dict(zip(STATE_FIELDS, column, strict=True)) for column in (values[:, -1:], next_values[:, :1]))
    return float(_residual(end, begin, angle, dt)[0])


def _tables(tracks: Sequence[_Track], n_steps: int) -> Obstacles:
    table = np.full((len(STATE_FIELDS), len(tracks), n_steps), np.nan)
    for row, track in enumerate(tracks):
        for steps, values in track.states:
            if track.is_static:
                table[:, row, :] = values[:, :1]
            else:
                table[:, row, steps] = values
    x, y, orientation, velocity, acceleration, yaw_rate = table
    return Obstacles(
        ids=np.array([track.id for track in tracks], dtype=np.int64),
        kinds=tuple(track.kind for track in tracks),
        shapes=tuple(track.shape for track in tracks),
        is_static=np.array([track.is_static for track in tracks], dtype=np.bool_),
        x=x,
        y=y,
        orientation=orientation,
        velocity=velocity,
        acceleration=acceleration,
        yaw_rate=yaw_rate,
        valid=np.isfinite(x),
        derived=tuple(track.derived for track in tracks),
    )


# Words


def _remarks(
    windows: Sequence[_Window], n_participants: int, residuals: Sequence[float], absent: list[int], cut: list[int]
) -> list[str]:
    notes = [f"{len(windows)} recordings joined: {n_participants} participants, {len(residuals)} continue in the next"]
    if residuals:
        middle, most = np.percentile(residuals, (50, 99)).tolist()
        notes[0] += (
            f", {middle:.3f} m from where their speeds lead (median; 99 %: {most:.3f} m, "
            f"largest: {max(residuals):.3f} m)"
        )
    for before, after in itertools.pairwise(windows):
        if after.first > before.end:
            notes.append(f"no recording of time steps {before.end} to {after.first - 1}: all tracks are cut there")
    if absent:
        notes.append(f"absent between two recordings, obstacles: {_listed(absent)}")
    if cut:
        notes.append(f"another vehicle with the same id in the next recording, which got a new id: {_listed(cut)}")
    n_problems = sum(len(window.scenario.planning_problems) for window in windows)
    if n_problems:
        notes.append(f"{n_problems} planning problems left out: each belongs to one of the recordings")
    return notes


def _listed(ids: Sequence[int]) -> str:
    numbers = sorted(set(ids))
    named = ", ".join(str(number) for number in numbers[:_NAMED])
    return named if len(numbers) <= _NAMED else f"{named} and {len(numbers) - _NAMED} more"


def _summed_up(recordings: Sequence[Scenario]) -> list[str]:
    """One line per kind of note of the windows."""
    kinds: dict[str, list[str]] = defaultdict(list)
    for one in recordings:
        for note in one.notes:
            kinds[re.sub(r"[\d, ]+( and \d+ more)?$", "", note)].append(note)
    return [
        notes[0] if len(notes) == 1 else f"{kind.rstrip(':')} (in {len(notes)} of {len(recordings)} recordings)"
        for kind, notes in kinds.items()
    ]


def _common(names: Sequence[str]) -> str:
    """What names have in common at their beginning, without parts of numbers."""
    parts = [re.split(r"(?<=[_.\- ])", Path(name).name) for name in names]
    same = []
    for values in zip(*parts, strict=False):
        if len(set(values)) > 1:
            break
        same.append(values[0])
    return "".join(same).rstrip("_.- ") or names[0]
