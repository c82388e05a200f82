"""Runs as traces of the Open Simulation Interface: ground truth for each time step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from interdrive.errors import InputError
from interdrive.files.content import content_of_file
from interdrive.files.osi_messages import betterosi
from interdrive.files.sources import SourceFile

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from interdrive.run import RunRecord, States

#: An object of betterosi, which has no types.
Message: TypeAlias = Any

_TOPIC, _MAP_TOPIC = "ground_truth", "ground_truth_map"
_ENDINGS = (".mcap", ".osi")
_VERSION = (3, 8, 0)
#: Never the present time, so that equal runs give equal bytes.
_CREATED = "1970-01-01T00:00:00Z"
#: Type of a vehicle, and whether its role is civil, by kind; others are no vehicles.
_VEHICLES = {
    **{"car": ("CAR", True), "truck": ("HEAVY_TRUCK", True), "motorcycle": ("MOTORBIKE", True)},
    **{"bicycle": ("BICYCLE", True), "parked_vehicle": ("CAR", True), "bus": ("BUS", False)},
    **{"priority_vehicle": ("CAR", False), "taxi": ("CAR", False), "train": ("TRAIN", False)},
}
#: Heights [m], which runs do not have.
_HEIGHTS = {"truck": 3.5, "bus": 3.2, "train": 3.8, "pedestrian": 1.75, "bicycle": 1.7, "motorcycle": 1.6}
_USUAL_HEIGHT = 1.5


def write_osi(run: RunRecord, path: Path) -> None:
    """Writes a run as a trace: topic `ground_truth`, one message for each time step.

    The host vehicle is the first agent. Heights are usual ones, z is 0. Where the run came from an OpenDRIVE file that
    is still there, unchanged, MCAP has it as `ground_truth_map`.

    Args:
        run: The run.
        path: File that ends in .mcap or .osi; it is replaced.

    Raises:
        InputError: Another ending, or the extra `osi` is not installed; one line.
    """
    if path.suffix.lower() not in _ENDINGS:
        raise InputError(f"{path}: name a file that ends in {' or '.join(_ENDINGS)}")
    osi = betterosi()
    is_mcap = path.suffix.lower() == ".mcap"
    metadata = {"metadata": {"creation_time": _CREATED}} if is_mcap else {}
    with osi.Writer(path, topic=_TOPIC, **metadata) as writer:
        roads = _opendrive(run) if is_mcap else ""
        if roads:
            writer.add(osi.MapAsamOpenDrive(open_drive_xml_content=roads), topic=_MAP_TOPIC, log_time=0)
        for truth in _truths(osi, run):
            writer.add(truth)


def _opendrive(run: RunRecord) -> str:
    """The map of the run as an OpenDRIVE document; empty where there is none."""
    scenario = run.scenario
    if scenario.source is None or scenario.source.format != "OpenDRIVE" or scenario.path is None:
        return ""
    try:
        content_of_file(scenario.path)
        file = SourceFile(scenario.path)
        return file.data.decode("utf-8-sig") if file.files[0][1] == scenario.sha256 else ""
    except (OSError, InputError, UnicodeDecodeError):
        return ""


def _truths(osi: Message, run: RunRecord) -> Iterator[Message]:
    """Ground truth of each time step; what it holds changes with the next one."""
    states, dt = run.states, run.scenario.dt
    standing = [
        _standing(osi, states, row) for row in np.flatnonzero(states.is_static & states.valid.any(axis=1)).tolist()
    ]
    host = {"host_vehicle_id": osi.Identifier(value=run.agents[0].id)} if run.agents else {}
    version = osi.InterfaceVersion(
        **dict(zip(("version_major", "version_minor", "version_patch"), _VERSION, strict=True))
    )
    moving: dict[int, _Moving] = {}
    tables = (states.x, states.y, states.orientation, states.velocity, states.acceleration, states.yaw_rate)
    for column in range(states.n_steps):
        nanos = round((states.first_time_step + column) * dt * 1e9)
        present = np.flatnonzero(states.valid[:, column] & ~states.is_static).tolist()
        values = np.column_stack([table[present, column] for table in tables]).tolist()
        for row in present:
            if row not in moving:
                moving[row] = _Moving(osi, states, row)
        yield osi.GroundTruth(
            version=version,
            timestamp=osi.Timestamp(seconds=nanos // 10**9, nanos=nanos % 10**9),
            moving_object=[moving[row].at(*state) for row, state in zip(present, values, strict=True)],
            stationary_object=standing,
            **host,
        )


class _Moving:
    """A participant as a message, which shows one time step after the other; it is written before the next one."""

    def __init__(self, osi: Message, states: States, row: int) -> None:
        self.position, self.velocity, self.acceleration = (_vector(osi, 0.0, 0.0) for _ in range(3))
        self.orientation, self.rate = (osi.Orientation3d(roll=0.0, pitch=0.0, yaw=0.0) for _ in range(2))
        self.base = osi.BaseMoving(
            dimension=_dimension(osi, states, row),
            position=self.position,
            orientation=self.orientation,
            velocity=self.velocity,
        )
        self.message = _named(osi, states.kinds[row], int(states.participant_id[row]), self.base)

    def at(self, x: float, y: float, heading: float, speed: float, acceleration: float, yaw_rate: float) -> Message:
        """The message with a state; what is nan is left out."""
        cos, sin = math.cos(heading), math.sin(heading)
        self.position.x, self.position.y, self.orientation.yaw = x, y, heading
        self.velocity.x, self.velocity.y = speed * cos, speed * sin
        if math.isnan(acceleration):
            self.base.acceleration = None
        else:
            self.acceleration.x, self.acceleration.y = acceleration * cos, acceleration * sin
            self.base.acceleration = self.acceleration
        if math.isnan(yaw_rate):
            self.base.orientation_rate = None
        else:
            self.rate.yaw = yaw_rate
            self.base.orientation_rate = self.rate
        return self.message


def _named(osi: Message, kind: str, number: int, base: Message) -> Message:
    """A moving object of a kind."""
    types = osi.MovingObject.Type
    named = {"id": osi.Identifier(value=number), "base": base}
    if kind not in _VEHICLES:
        return osi.MovingObject(type=types.PEDESTRIAN if kind == "pedestrian" else types.OTHER, **named)
    classification = osi.MovingObject.VehicleClassification
    name, is_civil = _VEHICLES[kind]
    role = {"role": classification.Role.CIVIL} if is_civil else {}
    vehicle = classification(type=getattr(classification.Type, name), **role)
    return osi.MovingObject(type=types.VEHICLE, vehicle_classification=vehicle, **named)


def _standing(osi: Message, states: States, row: int) -> Message:
    column = int(states.valid[row].argmax())
    base = osi.BaseStationary(
        dimension=_dimension(osi, states, row),
        position=_vector(osi, states.x[row, column], states.y[row, column]),
        orientation=osi.Orientation3d(roll=0.0, pitch=0.0, yaw=float(states.orientation[row, column])),
    )
    return osi.StationaryObject(id=osi.Identifier(value=int(states.participant_id[row])), base=base)


def _dimension(osi: Message, states: States, row: int) -> Message:
    height = _HEIGHTS.get(states.kinds[row], _USUAL_HEIGHT)
    return osi.Dimension3d(length=float(states.length[row]), width=float(states.width[row]), height=height)


def _vector(osi: Message, x: float, y: float) -> Message:
    return osi.Vector3d(x=float(x), y=float(y), z=0.0)
