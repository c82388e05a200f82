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
    states, dt = run.states, run.scenario.dt
    standing = [
        _standing(osi, states, row) for row in np.flatnonzero(states.is_static & states.valid.any(axis=1)).tolist()
    ]
    host = {"host_vehicle_id": osi.Identifier(value=run.agents[0].id)} if run.agents else {}
    version = osi.InterfaceVersion(
        **dict(zip(("version_major", "version_minor", "version_patch"), _VERSION, strict=True))
    )
    for column in range(states.n_steps):
        nanos = round((states.first_time_step + column) * dt * 1e9)
        present = np.flatnonzero(states.valid[:, column] & ~states.is_static).tolist()
        yield osi.GroundTruth(
            version=version,
            timestamp=osi.Timestamp(seconds=nanos // 10**9, nanos=nanos % 10**9),
            moving_object=[_moving(osi, states, row, column) for row in present],
            stationary_object=standing,
            **host,
        )


def _moving(osi: Message, states: States, row: int, column: int) -> Message:
    kind = states.kinds[row]
    heading, speed = float(states.orientation[row, column]), float(states.velocity[row, column])
    acceleration, yaw_rate = (float(table[row, column]) for table in (states.acceleration, states.yaw_rate))
    ahead = (math.cos(heading), math.sin(heading))
    base = osi.BaseMoving(
        dimension=_dimension(osi, states, row),
        position=_vector(osi, states.x[row, column], states.y[row, column]),
        orientation=osi.Orientation3d(roll=0.0, pitch=0.0, yaw=heading),
        velocity=_vector(osi, speed * ahead[0], speed * ahead[1]),
        **({} if math.isnan(acceleration) else
           {"acceleration": _vector(osi, acceleration * ahead[0], acceleration * ahead[1])}),
        **({} if math.isnan(yaw_rate) else {"orientation_rate": osi.Orientation3d(roll=0.0, pitch=0.0, yaw=yaw_rate)}),
    )  # fmt: skip
    types = osi.MovingObject.Type
    named = {"id": osi.Identifier(value=int(states.participant_id[row])), "base": base}
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
