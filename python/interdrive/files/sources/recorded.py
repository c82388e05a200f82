"""Recorded positions of participants, one row each and at any times, as obstacles of a scenario with time steps."""

from __future__ import annotations

import itertools
import math
import re
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from interdrive.errors import InputError
from interdrive.files.motion import Track, completed, wrapped
from interdrive.files.sources.stated_speeds import put_right
from interdrive.scenario import KINDS, STATE_FIELDS, Obstacles, Shape, limits

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.files.sources.model import Tracks
    from interdrive.files.sources.notes import Notes
    from interdrive.scenario import SourceOptions

#: Length and width [m] of participants whose source states none.
USUAL_SIZES = {
    "unknown": (4.6, 1.9),
    "car": (4.6, 1.9),
    "taxi": (4.6, 1.9),
    "priority_vehicle": (4.6, 1.9),
    "parked_vehicle": (4.6, 1.9),
    "truck": (10.0, 2.5),
    "bus": (12.0, 2.9),
    "train": (30.0, 2.6),
    "motorcycle": (2.2, 0.8),
    "bicycle": (1.8, 0.7),
    "pedestrian": (0.6, 0.6),
    "construction_zone": (1.0, 1.0),
    "structure": (1.0, 1.0),
}
#: A participant that is not seen for longer [s] comes back with another id.
LONGEST_GAP = 0.5
#: The same in median steps of the source, where these are long.
LONGEST_GAP_STEPS = 1.5
#: Times closer than this [s] are the same.
SAME_TIME = 1e-6
#: Length of the motion that tells a heading [m]; shorter chords are noise of what stands.
HEADING_BASE, HEADING_CHORD = 0.5, 0.25
#: Cells of the map [m]; what is in none beside those of a lanelet is farther from it than this.
FAR = 100.0
#: Share of the tracks that may be far from the map.
MOST_FAR = 0.9
#: Names that can be ids of a CommonRoad file, which are positive.
_OWN_ID = re.compile(r"[1-9][0-9]{0,14}")


class _Clock(NamedTuple):
    """Time steps: time between them, time of step 0 and of the last possible one [s], in those of the source."""

    dt: float
    first: float
    last: float


def kinds_of(words: Sequence[str], known: Mapping[str, str], notes: Notes) -> tuple[str, ...]:
    """Kinds that words of a source mean, without regard to case; unknown words are counted."""
    found = []
    unknown: Counter[str] = Counter()
    for word in words:
        plain = word.strip().lower()
        kind = known.get(plain, plain if plain in KINDS else "")
        if not kind:
            unknown[plain[:30] or "(empty)"] += 1
        found.append(kind or "unknown")
    if unknown:
        listed = ", ".join(f"{count} {word}" for word, count in sorted(unknown.items())[:8])
        notes.say(f"kinds of tracks that are not known, taken as unknown: {listed}")
    return tuple(found)


def recorded(tracks: Tracks, options: SourceOptions, taken: Sequence[int], file: str, notes: Notes) -> Obstacles:
    """Obstacles of tracks: states at the time steps, gaps closed or split, missing values derived.

    Args:
        tracks: All rows of a recording.
        options: dt, start, duration and shift are used.
        taken: Ids of lanelets.
        file: Name of the source in messages.
        notes: What was closed, split and left out is added.

    Raises:
        InputError: A track has a time twice, no row says when and where, or there are too many states; one line.
    """
    tracks = _sorted(_present(tracks, options, file, notes), file)
    if not len(tracks.time):
        return _tables([], [], [], [], [], [], file)
    first = float(tracks.time.min()) if options.start is None else options.start
    duration = np.inf if options.duration is None else options.duration
    clock = _Clock(tracks.dt if options.dt is None else options.dt, first, first + duration)
    pieces = _pieces(tracks, notes)
    sampled = [_sampled(tracks, slice(a, b), clock, file) for a, b in pieces.tolist()]
    owners = tracks.track[pieces[:, 0]].tolist()
    kept = [
        (owner, part)
        for owner, part in zip(owners, sampled, strict=True)
        if len(part.time_steps) > (0 if tracks.is_static[owner] else 1)
    ]
    if len(sampled) > len(kept):
        notes.leave_out("tracks", "with fewer than two time steps", len(sampled) - len(kept))
    if kept:
        last = max(int(part.time_steps[-1]) for _, part in kept)
        n_states = sum(len(part.time_steps) for _, part in kept)
        limits.require_table(len(kept), last + 1, n_states, "the recording", file)
    derived = [_missing_first(part) for _, part in kept]
    for owner, part in kept:
        if put_right(part.values[:, 3], clock.dt):
            notes.name(
                "speeds to which no vehicle can change taken from those around, tracks", tracks.names[owner][:20]
            )
    return _tables(
        _ids(tracks, [owner for owner, _ in kept], taken, file),
        [tracks.kinds[owner] for owner, _ in kept],
        [_footprint(tracks, owner) for owner, _ in kept],
        [tracks.is_static[owner] for owner, _ in kept],
        derived,
        [completed(_with_headings(part), clock.dt) for _, part in kept],
        file,
    )


def far_from_map(obstacles: Obstacles, bounds: Sequence[Floats], file: str, map_file: str, notes: Notes) -> None:
    """Notes participants that are farther than `FAR` from every lanelet.

    Args:
        obstacles: The participants.
        bounds: Points of bounds of lanelets [m], shape (vertices, 2) each.
        file: Name of the source in messages.
        map_file: Name of the map in messages.
        notes: Gets the remark.

    Raises:
        InputError: Nearly all are: map and tracks are in different frames.
    """
    if not len(obstacles.ids) or not bounds:
        return
    points = np.concatenate([_densified(bound) for bound in bounds])
    cells = np.unique(np.floor(points / FAR), axis=0)
    # Cells as complex numbers, which compare as pairs.
    near = np.unique(np.concatenate([cells[:, 0] + i + 1j * (cells[:, 1] + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]))
    x, y = np.where(obstacles.valid, obstacles.x, np.nan), np.where(obstacles.valid, obstacles.y, np.nan)
    known: Bools = np.isin(np.floor(x / FAR) + 1j * np.floor(y / FAR), near)
    is_near = np.array(known.any(axis=1), dtype=np.bool_)
    n, n_far = len(is_near), int((~is_near).sum())
    if not n_far:
        return
    row = int(np.argmin(is_near))
    step = int(np.argmax(obstacles.valid[row]))
    nearest = float(np.hypot(points[:, 0] - x[row, step], points[:, 1] - y[row, step]).min())
    shown = f"{nearest / 1000.0:,.0f} km" if nearest >= 10_000.0 else f"{nearest:,.0f} m"
    found = f"{n_far} of {n} tracks are more than {FAR:.0f} m from {map_file} (nearest {shown})"
    if n_far > MOST_FAR * n:
        raise InputError(f"{file}: {found}: check --projection, --origin, --shift")
    notes.say(f"{found}; --shift moves tracks, --origin maps")


def _densified(bound: Floats) -> Floats:
    """Points of a line at most half a cell apart."""
    steps = np.hypot(*np.diff(bound, axis=0).T)
    along = np.concatenate(([0.0], np.cumsum(steps)))
    if along[-1] <= 0.5 * FAR:
        return bound
    at = np.linspace(0.0, along[-1], int(np.ceil(along[-1] / (0.5 * FAR))) + 1)
    return np.column_stack([np.interp(at, along, column) for column in bound.T])


def _present(tracks: Tracks, options: SourceOptions, file: str, notes: Notes) -> Tracks:
    """Without rows whose time or place is not a finite number; shifted."""
    is_there = np.isfinite(tracks.time) & np.isfinite(tracks.x) & np.isfinite(tracks.y)
    if len(is_there) and not is_there.any():
        raise InputError(f"{file}: no row has a time, x and y that are finite numbers")
    if not is_there.all():
        notes.leave_out("rows", "without time or position", int((~is_there).sum()))
    rest = _of_rows(tracks, is_there)
    heading, speed = (np.where(np.isfinite(values), values, np.nan) for values in (rest.heading, rest.speed))
    x, y = (values + move for values, move in zip((rest.x, rest.y), options.shift, strict=True))
    return replace(rest, x=x, y=y, heading=wrapped(heading), speed=speed)


def _of_rows(tracks: Tracks, rows: Ints | Bools) -> Tracks:
    """The same tracks with these rows only."""
    columns = ("track", "time", "x", "y", "heading", "speed")
    parts: dict[str, Any] = {name: getattr(tracks, name)[rows] for name in columns}
    return replace(tracks, **parts)


def _sorted(tracks: Tracks, file: str) -> Tracks:
    """Rows by participant and time."""
    rows = np.lexsort((tracks.time, tracks.track))
    found = _of_rows(tracks, rows)
    twice = (np.diff(found.track) == 0) & (np.diff(found.time) < SAME_TIME)
    if twice.any():
        row = int(np.argmax(twice))
        raise InputError(f"{file}: track {found.names[int(found.track[row])][:20]} has time {found.time[row]:g} twice")
    return found


def _pieces(tracks: Tracks, notes: Notes) -> Ints:
    """First rows of what is seen without a long gap, and the row after the last one, shape (pieces, 2)."""
    steps, same = np.diff(tracks.time), np.diff(tracks.track) == 0
    usual = float(np.median(steps[same])) if same.any() else 0.0
    longest = max(LONGEST_GAP, LONGEST_GAP_STEPS * usual)
    split = same & (steps > longest + SAME_TIME)
    closed = same & (steps > LONGEST_GAP_STEPS * usual) & ~split
    n_closed, n_split = int(closed.sum()), int(split.sum())
    if n_closed:
        notes.say(f"gaps up to {longest:g} s closed: {n_closed}")
    if n_split:
        notes.say(f"tracks split at gaps longer than {longest:g} s, the rest has a new id: {n_split}")
    begins = np.concatenate(([0], 1 + np.flatnonzero(~same | split)))
    return np.column_stack((begins, np.append(begins[1:], len(tracks.time))))


def _sampled(tracks: Tracks, rows: slice, clock: _Clock, file: str) -> Track:
    """States of one piece at the time steps, by linear interpolation between its rows."""
    time = tracks.time[rows]
    begin, end = ((float(at) - clock.first) / clock.dt for at in (time[0], min(time[-1], clock.last)))
    margin, most = SAME_TIME / clock.dt, limits.LARGEST_TIME_STEP
    if end > most + 1:
        name = tracks.names[int(tracks.track[rows.start])][:20]
        raise InputError(
            f"{file}: track {name} ends {end * clock.dt:g} s after the first one, more than {most} steps"
            f" of {clock.dt:g} s; choose a part with --start and --duration, or another --dt"
        )
    low, high = math.ceil(min(max(begin, 0.0), most + 1) - margin), math.floor(max(end, -1.0) + margin)
    steps = np.arange(low, high + 1)
    wanted = clock.first + steps * clock.dt
    after = np.searchsorted(time, wanted - SAME_TIME).clip(0, len(time) - 1)
    exact = np.abs(time[after] - wanted) <= 2.0 * SAME_TIME
    before = np.where(exact, after, (after - 1).clip(0))
    span = time[after] - time[before]
    share = np.where(span > 0.0, (wanted - time[before]) / np.where(span > 0.0, span, 1.0), 0.0)
    values = np.full((len(steps), 6), np.nan)
    for column, name in enumerate(("x", "y", "heading", "speed")):
        stated = getattr(tracks, name)[rows]
        change = stated[after] - stated[before]
        if name == "heading":
            change = wrapped(change)
        between = stated[before] + share * change
        if name == "heading":
            between = wrapped(between)
        # What only one of both neighbours states is not stated between them.
        values[:, column] = np.where(before == after, stated[before], between)
    return Track(steps, values + 0.0)  # no negative zeros, which files do not hold


def _with_headings(part: Track) -> Track:
    """The part with headings of the motion where its source states none; those of what stands stay missing."""
    heading = part.values[:, 2]
    missing = np.isnan(heading)
    if not missing.any() or len(heading) < 2:
        return part
    x, y = part.values[:, 0], part.values[:, 1]
    along = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))))
    low = (along - 0.5 * HEADING_BASE).clip(0.0, max(along[-1] - HEADING_BASE, 0.0))
    high = np.minimum(low + HEADING_BASE, along[-1])
    dx, dy = (np.interp(high, along, column) - np.interp(low, along, column) for column in (x, y))
    moves = np.hypot(dx, dy) > HEADING_CHORD
    if not moves.any():
        return part
    held = np.maximum.accumulate(np.where(moves, np.arange(len(moves)), -1))
    held[held < 0] = int(np.argmax(moves))
    part.values[:, 2] = np.where(missing, np.arctan2(dy, dx)[held], heading)
    return part


def _missing_first(part: Track) -> tuple[str, ...]:
    """Names of the values that the source does not state at the first time step."""
    return tuple(name for name, lacks in zip(STATE_FIELDS, np.isnan(part.values[0]), strict=True) if lacks)


def _ids(tracks: Tracks, owners: Sequence[int], taken: Sequence[int], file: str) -> list[int]:
    """An id for each part: the source's own where they are numbers and free; parts after the first get new ones."""
    used = set(taken)
    n = len(tracks.names)
    if all(_OWN_ID.fullmatch(name) for name in tracks.names) and used.isdisjoint(map(int, tracks.names)):
        own = [int(name) for name in tracks.names]
    else:
        base = 10_000
        while base <= max(used, default=0) or base < n:
            base *= 10
        own = [base + 1 + order for order in range(n)]
    for number in own:
        limits.require_id(number, "a track", file)
    free = max([*own, *used], default=0) + 1
    given: set[int] = set()
    found = []
    for owner in owners:
        number = own[owner]
        if number in given:
            number, free = free, free + 1
        given.add(number)
        found.append(number)
    return found


def _footprint(tracks: Tracks, owner: int) -> Shape:
    kind = tracks.kinds[owner]
    sizes = [
        float(stated) if np.isfinite(stated) and stated >= limits.SMALLEST_SIZE else usual
        for stated, usual in zip((tracks.length[owner], tracks.width[owner]), USUAL_SIZES[kind], strict=True)
    ]
    if tracks.is_round[owner]:
        return Shape("circle", radius=0.5 * sizes[0])
    return Shape("rectangle", length=sizes[0], width=sizes[1])


def _tables(
    ids: Sequence[int],
    kinds: Sequence[str],
    shapes: Sequence[Shape],
    stands: Sequence[bool],
    derived: Sequence[tuple[str, ...]],
    parts: Sequence[Track],
    file: str,
) -> Obstacles:
    order = sorted(range(len(ids)), key=lambda index: ids[index])
    for one, other in itertools.pairwise(order):
        if ids[one] == ids[other]:
            raise InputError(f"{file}: two tracks have the id {ids[one]}; give each its own")
    n_steps = max((int(part.time_steps[-1]) for part in parts), default=0) + 1
    table = np.full((6, len(ids), n_steps), np.nan)
    for row, index in enumerate(order):
        part = parts[index]
        if stands[index]:
            table[:, row, :] = part.values[0][:, None]
            table[3:, row, :] = 0.0
        else:
            table[:, row, part.time_steps] = part.values.T
    columns: dict[str, Any] = dict(zip(STATE_FIELDS, table, strict=True))
    return Obstacles(
        ids=np.array([ids[index] for index in order], dtype=np.int64),
        kinds=tuple(kinds[index] for index in order),
        shapes=tuple(shapes[index] for index in order),
        is_static=np.array([stands[index] for index in order], dtype=np.bool_),
        **columns,
        valid=np.isfinite(table[0]),
        derived=tuple(derived[index] for index in order) if any(derived) else (),
    )
