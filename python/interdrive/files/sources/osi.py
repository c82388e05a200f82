"""Traces of the Open Simulation Interface: ground truth over time, in files .osi and .mcap; read by betterosi."""

from __future__ import annotations

import io
import math
import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from interdrive.errors import InputError
from interdrive.files.osi_messages import betterosi, mcap_reader
from interdrive.files.sources.centre_lines import CentreLine, lanes_of
from interdrive.files.sources.model import Lane, Roads, Source, Tracks
from interdrive.files.sources.notes import Notes
from interdrive.files.sources.opendrive.reader import read as read_opendrive
from interdrive.files.sources.opening import SourceFile
from interdrive.files.sources.osi_control import ControlTrace
from interdrive.files.sources.osi_junctions import add_ways
from interdrive.files.sources.pairing import paired
from interdrive.files.sources.polylines import distinct
from interdrive.scenario.limits import LARGEST_DT, SMALLEST_DT

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from interdrive.array_types import Floats
    from interdrive.scenario import SourceOptions

#: An object of betterosi, which has no types.
Message: TypeAlias = Any

_MCAP = b"\x89MCAP"
_TRUTH, _VIEW, _OPENDRIVE = "GroundTruth", "SensorView", "MapAsamOpenDrive"
_VEHICLES = {
    **dict.fromkeys(("SMALL_CAR", "COMPACT_CAR", "CAR", "MEDIUM_CAR", "LUXURY_CAR", "VAN", "WHEELCHAIR"), "car"),
    **dict.fromkeys(("DELIVERY_VAN", "HEAVY_TRUCK", "SEMITRACTOR", "SEMITRAILER", "TRAILER", "WORK_MACHINE"), "truck"),
    **{"MOTORBIKE": "motorcycle", "MOTORCYCLE": "motorcycle", "BICYCLE": "bicycle", "STANDUP_SCOOTER": "bicycle"},
    **{"BUS": "bus", "TRAM": "train", "TRAIN": "train"},
}
_DRIVEN = ("DRIVING", "INTERSECTION")
_LINES = {"NO_LINE": "no_marking", "SOLID_LINE": "solid", "DASHED_LINE": "dashed", "CURB": "curb"}
#: The time between steps is taken from the trace if rounding it to this [s] changes it by at most this share.
_DT_UNIT, _DT_ROUNDED, _USUAL_DT = 1e-3, 0.02, 0.1


def read(file: SourceFile, options: SourceOptions) -> Source:
    """Reads participants and, unless another map is chosen, the lanes of the trace."""
    name, notes = str(file.path), Notes()
    trace = _Trace()
    opened = _mcap(file.data, name, trace) if file.data.startswith(_MCAP) else _osi(file.data, name)
    try:
        for truth in opened:
            trace.add(truth)
    except InputError:
        raise
    except Exception as error:  # readers of foreign formats raise anything
        raise InputError(f"{name}: a message cannot be read ({_one_line(error)}); give a whole file") from error
    if not trace.times:
        raise InputError(f"{name}: has no osi3.{_TRUTH}; give a trace with ground truth")
    if trace.has_offset:
        notes.say("proj_frame_offset of the trace is not applied")
    if trace.host:
        notes.say(f"the host vehicle is {trace.host}")
    roads = None if options.map is not None else _roads(trace, file, options, notes)
    if roads is not None:
        trace.control.add_to(roads, _clock(trace.times)[1], notes)
    elif n_control := len(trace.control.bulbs) + len(trace.control.signs):
        notes.leave_out("traffic lights and signs, which belong to lanes of the trace", "", n_control)
    return Source(roads, trace.tracks(notes), notes)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:80] or type(error).__name__


# Messages


def _osi(data: bytes, file: str) -> Iterator[Message]:
    """Ground truths of a file of messages behind their lengths in four bytes."""
    osi = betterosi()
    kind = None
    at = 0
    while at < len(data):
        if at + 4 > len(data):
            raise InputError(f"{file}: ends within a message, at byte {at}; give a whole file")
        (size,) = struct.unpack_from("<I", data, at)
        body = data[at + 4 : at + 4 + size]
        if len(body) < size:
            raise InputError(f"{file}: ends within a message, at byte {at}; give a whole file")
        at += 4 + size
        kind = kind or (_TRUTH if _has_content(osi, body) else _VIEW)
        truth = _truth(osi, kind, body)
        if truth is not None:
            yield truth


def _mcap(data: bytes, file: str, trace: _Trace) -> Iterator[Message]:
    """Ground truths of an MCAP file; a map in OpenDRIVE is kept in the trace."""
    osi = betterosi()
    topics: dict[str, None] = {}
    n_truths = 0
    for schema, channel, message in mcap_reader()(io.BytesIO(data)).iter_messages():
        topics[channel.topic] = None
        kind = schema.name.removeprefix("osi3.") if schema is not None else ""
        if kind in (_TRUTH, _VIEW):
            truth = _truth(osi, kind, message.data)
            if truth is not None:
                n_truths += 1
                yield truth
        elif kind == _OPENDRIVE:
            trace.opendrive = osi.MapAsamOpenDrive.from_binary(message.data).open_drive_xml_content
    if not n_truths:
        listed = ", ".join(topics) or "none"
        raise InputError(f"{file}: has no osi3.{_TRUTH} (topics: {listed[:200]}); give a trace with ground truth")


def _has_content(osi: Message, body: bytes) -> bool:
    """Whether a message of a file, which does not say its type, is ground truth."""
    try:
        truth = osi.GroundTruth.from_binary(body)
    except ValueError:
        return False
    return bool(truth.moving_object or truth.stationary_object or truth.lane)


def _truth(osi: Message, kind: str, body: bytes) -> Message:
    """The ground truth of a message; None: there is none in a view of a sensor."""
    if kind == _TRUTH:
        return osi.GroundTruth.from_binary(body)
    return osi.SensorView.from_binary(body).global_ground_truth


@dataclass
class _Trace:
    """What is kept of the messages: rows of moving objects, and the first statement of all that stands."""

    rows: list[tuple[int, int, float, float, float, float, float]] = field(default_factory=list)
    first: dict[int, Message] = field(default_factory=dict)
    standing: dict[int, Message] = field(default_factory=dict)
    lanes: dict[int, Message] = field(default_factory=dict)
    boundaries: dict[int, Message] = field(default_factory=dict)
    times: list[float] = field(default_factory=list)
    opendrive: str | bytes = ""
    host: int = 0
    has_offset: bool = False
    control: ControlTrace = field(default_factory=ControlTrace)

    def add(self, truth: Message) -> None:
        time = truth.timestamp.seconds + 1e-9 * truth.timestamp.nanos if truth.timestamp is not None else 0.0
        self.times.append(time)
        for one in truth.moving_object:
            number, base = one.id.value, one.base
            if number not in self.first:
                self.first[number] = one
            place, turn, velocity = base.position, base.orientation, base.velocity
            vx, vy = (velocity.x, velocity.y) if velocity is not None else (math.nan, math.nan)
            self.rows.append(
                (number, len(self.times) - 1, place.x, place.y, turn.yaw if turn is not None else math.nan, vx, vy)
            )
        for known, found in (
            (self.standing, truth.stationary_object),
            (self.lanes, truth.lane),
            (self.boundaries, truth.lane_boundary),
        ):
            for one in found:
                known.setdefault(one.id.value, one)
        self.control.add(len(self.times) - 1, truth)
        self.has_offset |= truth.proj_frame_offset is not None
        if truth.host_vehicle_id is not None:
            self.host = truth.host_vehicle_id.value

    def tracks(self, notes: Notes) -> Tracks:
        """All rows of moving and standing objects."""
        table = np.array(self.rows, dtype=np.float64).reshape(-1, 7)
        moving = list(self.first.values())
        position = {number: index for index, number in enumerate(self.first)}
        track = np.array([position[row[0]] for row in self.rows], dtype=np.int64)
        still = list(self.standing.values())
        dt, times = _clock(self.times)
        begin = float(times.min())
        places = [(begin, one.base.position.x, one.base.position.y, _yaw(one.base), 0.0) for one in still]
        rest = np.array(places, dtype=np.float64).reshape(-1, 5)
        _, message, x, y, heading, vx, vy = table.T
        time = times[message.astype(np.int64)]
        speed = vx * np.cos(heading) + vy * np.sin(heading)
        rows = np.concatenate((np.column_stack((time, x, y, heading, speed)), rest))
        kinds = (*(_kind(one, notes) for one in moving), *(("structure",) * len(still)))
        sizes = np.array([_size(one.base) for one in (*moving, *still)], dtype=np.float64).reshape(-1, 2)
        round_ones = tuple(kind == "pedestrian" for kind in kinds)
        # The diameter of a circle is the larger side.
        lengths = np.where(round_ones, sizes.max(axis=1, initial=0.0), sizes[:, 0])
        taken = set(self.first)
        return Tracks(
            names=(*map(str, self.first), *(f"{'static ' if one in taken else ''}{one}" for one in self.standing)),
            kinds=kinds,
            length=lengths,
            width=sizes[:, 1].copy(),
            is_round=round_ones,
            is_static=(False,) * len(moving) + (True,) * len(still),
            track=np.concatenate((track, len(moving) + np.arange(len(still)))),
            time=rows[:, 0].copy(),
            x=rows[:, 1].copy(),
            y=rows[:, 2].copy(),
            heading=rows[:, 3].copy(),
            speed=rows[:, 4].copy(),
            dt=dt,
        )


def _yaw(base: Message) -> float:
    return float(base.orientation.yaw) if base.orientation is not None else math.nan


def _size(base: Message) -> tuple[float, float]:
    size = base.dimension
    return (float(size.length), float(size.width)) if size is not None else (math.nan, math.nan)


def _kind(one: Message, notes: Notes) -> str:
    kind = getattr(one.type, "name", "")
    if kind == "PEDESTRIAN":
        return "pedestrian"
    if kind != "VEHICLE":
        notes.name("objects that are neither vehicles nor pedestrians, taken as unknown", one.id.value)
        return "unknown"
    word = getattr(one.vehicle_classification.type, "name", "") if one.vehicle_classification is not None else ""
    return _VEHICLES.get(word, "car")


def _clock(times: Sequence[float]) -> tuple[float, Floats]:
    """Time between steps [s] and the times of the messages [s].

    The time between steps is that of the trace if this is a whole number of milliseconds or nearly so. If all of them
    are, the times are multiples of it.
    """
    table = np.array(times, dtype=np.float64)
    distinct_times, order = np.unique(table, return_inverse=True)
    steps = np.diff(distinct_times)
    usual = float(np.median(steps)) if len(steps) else 0.0
    rounded = round(round(usual / _DT_UNIT) * _DT_UNIT, 3) if usual < LARGEST_DT else 0.0
    if not (SMALLEST_DT <= rounded <= LARGEST_DT and abs(rounded - usual) <= _DT_ROUNDED * rounded):
        return _USUAL_DT, table
    is_even = bool((np.abs(steps - rounded) <= _DT_ROUNDED * rounded).all())
    return rounded, distinct_times[0] + order * rounded if is_even else table


# The map


def _roads(trace: _Trace, file: SourceFile, options: SourceOptions, notes: Notes) -> Roads | None:
    """Lanes of the trace; None where it has none. A map in OpenDRIVE comes first."""
    if trace.opendrive:
        text = trace.opendrive
        part = SourceFile.within(file.path, text.encode() if isinstance(text, str) else bytes(text))
        if part.root != "OpenDRIVE":
            raise InputError(f"{file.path}: its osi3.{_OPENDRIVE} is no OpenDRIVE document; choose a map with --map")
        found = read_opendrive(part, options)
        for line in found.notes.lines():
            notes.say(line)
        return found.roads
    driven = {
        number: one.classification
        for number, one in trace.lanes.items()
        if one.classification is not None and getattr(one.classification.type, "name", "") in _DRIVEN
    }
    if len(driven) < len(trace.lanes):
        notes.leave_out("lanes", "not for driving", len(trace.lanes) - len(driven))
    if not driven:
        return None
    lanes: dict[int, Lane] = {}
    for number, one in driven.items():
        lane = _bounded(str(number), one, trace.boundaries)
        if lane is not None:
            lanes[number] = lane
    if lanes:
        position = {number: index for index, number in enumerate(lanes)}
        roads = Roads(list(lanes.values()), _links(driven, position))
        add_ways(roads, position, driven, notes)
        return roads
    centres = {number: _centre(one) for number, one in driven.items()}
    lines = [CentreLine(str(number), centre) for number, centre in centres.items() if len(centre) > 1]
    if len(lines) < len(driven):
        notes.leave_out("lanes", "without a centre line", len(driven) - len(lines))
    notes.say("lanes have centre lines only; their borders are derived from what lies beside them")
    return lanes_of(lines, [], str(file.path), notes)


def _places(points: Sequence[Message]) -> Floats:
    table = np.array([(point.x, point.y) for point in points], dtype=np.float64).reshape(-1, 2)
    table = table[np.isfinite(table).all(axis=1)]
    return table[distinct(table)]


def _centre(one: Message) -> Floats:
    """Centre line in driving direction [m]."""
    line = _places(one.centerline)
    return line if one.centerline_is_driving_direction else line[::-1].copy()


def _bounded(key: str, one: Message, boundaries: Mapping[int, Message]) -> Lane | None:
    """A lane between its boundaries in driving direction; None if it lacks one."""
    centre = _centre(one)
    sides, lines = [], []
    for references in (one.left_lane_boundary_id, one.right_lane_boundary_id):
        parts = [boundaries[ref.value] for ref in references if ref.value in boundaries]
        border = _chained([_places([point.position for point in part.boundary_line]) for part in parts], centre)
        if border is None:
            return None
        sides.append(border)
        kinds = {getattr(part.classification.type, "name", "") for part in parts if part.classification is not None}
        lines.append(_LINES.get(kinds.pop(), "unknown") if len(kinds) == 1 else "unknown")
    left, right = sides
    x, y = (np.concatenate((left, right[::-1])) - left[0]).T
    if float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) > 0.0:
        left, right, lines = right, left, lines[::-1]
    return Lane(key, *paired(left, right), left_line=lines[0], right_line=lines[1])


def _chained(parts: Sequence[Floats], centre: Floats) -> Floats | None:
    """Parts of a boundary one after the other along a centre line; None if there is nothing."""
    turned = []
    for part in parts:
        if len(part) < 2 or len(centre) < 2:
            continue
        ends = [float(np.argmin(np.hypot(*(centre - end).T))) for end in (part[0], part[-1])]
        forward = ends[0] < ends[1] or (
            ends[0] == ends[1] and float((part[-1] - part[0]) @ (centre[-1] - centre[0])) > 0.0
        )
        turned.append((min(ends), part if forward else part[::-1]))
    if not turned:
        return None
    line = np.concatenate([part for _, part in sorted(turned, key=lambda one: one[0])])
    return line[distinct(line)]


def _links(driven: Mapping[int, Message], position: Mapping[int, int]) -> list[tuple[int, int]]:
    """Links of the pairings, in driving direction, by the side that both lanes have in common."""
    found: dict[tuple[int, int], None] = {}
    for number, one in driven.items():
        for pairing in one.lane_pairing:
            before, after = pairing.antecessor_lane_id, pairing.successor_lane_id
            if not one.centerline_is_driving_direction:
                before, after = after, before
            if before is not None and before.value in position and number in position:
                found[position[before.value], position[number]] = None
            if after is not None and after.value in position and number in position:
                found[position[number], position[after.value]] = None
    return list(found)
