"""The manoeuvres of UN R157 as scenarios: a straight road of two lanes, the system as agent, the others replayed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from interdrive.scenario import STATE_FIELDS, Lanelets, Obstacles, Scenario, Shape

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.array_types import Floats

#: The agent.
EGO = 1
#: The vehicle that cuts in, or the leader; what a cut-out reveals; the leader once it has hit that.
OTHER, REVEALED, WRECK = 2, 3, 4

#: Step [s], footprints [m], lanes [m], as in the cases in one dimension.
DT, LENGTH, WIDTH, LANE = 0.1, 4.3, 1.9, 3.5
_REVEALED_LENGTH = 5.0
#: Between the sides before a cut-in [m], and how fast its sideways speed grows [m/s²].
_SIDE, SIDEWAYS_ACCELERATION = 1.6, 1.5
#: Where the agent's rear bumper starts, and how far the road goes on behind its recording [m].
_START, _BEYOND = 20.0, 150.0


@dataclass(frozen=True)
class Track:
    """A vehicle along the road: its states at consecutive time steps from 0 on.

    Attributes:
        number: Participant id.
        length: Of its footprint [m].
        x: Centre [m]. y: Centre [m], 0 in the middle of the agent's lane.
        velocity: Along the road [m/s]. sideways: Across it [m/s].
        first: First time step at which it is there. last: Last one; None: to the end.
    """

    number: int
    length: float
    x: Floats
    y: Floats
    velocity: Floats
    sideways: Floats
    first: int = 0
    last: int | None = None


def cut_in(case: Mapping[str, float], steps: int) -> tuple[Track, ...]:
    """A vehicle comes from the lane on the left: `velocity`, `other_velocity`, `gap`, `sideways`."""
    velocity, other, lateral = case["velocity"], case["other_velocity"], case["sideways"]
    n_ramp = int(lateral / (SIDEWAYS_ACCELERATION * DT))
    n_lateral = math.floor((_SIDE + WIDTH) / lateral / DT) + 1 if lateral > 0.0 else steps
    sideways = np.zeros(steps)
    sideways[:n_ramp] = SIDEWAYS_ACCELERATION * DT * np.arange(1, n_ramp + 1)[:steps]
    sideways[n_ramp : n_ramp + n_lateral] = lateral
    before = float(sideways[:n_ramp].sum()) * DT
    x: Floats = case["gap"] + LENGTH + (velocity - other) * n_ramp * DT + other * _times(steps)
    y: Floats = _SIDE + WIDTH + before - DT * np.concatenate([[0.0], np.cumsum(sideways[:-1])])
    return _ego(velocity, steps), Track(OTHER, LENGTH, x, y, np.full(steps, other), -sideways)


def cut_out(case: Mapping[str, float], steps: int, kept_distance: float) -> tuple[Track, ...]:
    """The leader leaves the lane before a standing vehicle: `velocity`, `front_distance`, `sideways`."""
    velocity, lateral = case["velocity"], case["sideways"]
    start = kept_distance + LENGTH
    standing = start + LENGTH + case["front_distance"]
    x = start + velocity * _times(steps)
    y = lateral * _times(steps)
    touches = np.flatnonzero((y < WIDTH) & (np.abs(standing - x) < 0.5 * (LENGTH + _REVEALED_LENGTH)))
    # Otherwise it ends in the middle of the lane beside.
    aside = np.flatnonzero(y > LANE)
    sideways = np.full(steps, lateral)
    if len(aside):
        y[aside[0] :], sideways[aside[0] :] = y[aside[0]], 0.0
    still = np.zeros(steps)
    tracks = [_ego(velocity, steps), Track(OTHER, LENGTH, x, y, np.full(steps, velocity), sideways)]
    tracks.append(Track(REVEALED, _REVEALED_LENGTH, np.full(steps, standing), still, still, still))
    if len(touches) and touches[0] > 0:
        # It stands where it hits, at once: as another vehicle, since its speed jumps.
        end = int(touches[0])
        tracks[1] = replace(tracks[1], last=end - 1)
        tracks.append(Track(WRECK, LENGTH, np.full(steps, x[end]), np.full(steps, y[end]), still, still, first=end))
    return tuple(tracks)


def car_following(case: Mapping[str, float], steps: int, kept_distance: float) -> tuple[Track, ...]:
    """The leader brakes to a halt: `velocity`, `deceleration`."""
    velocity = case["velocity"]
    speed = np.maximum(velocity - case["deceleration"] * _times(steps), 0.0)
    x: Floats = kept_distance + LENGTH + DT * np.concatenate([[0.0], np.cumsum(speed[1:])])
    return _ego(velocity, steps), Track(OTHER, LENGTH, x, np.zeros(steps), speed, np.zeros(steps))


def _times(steps: int) -> Floats:
    """Seconds of the time steps."""
    return DT * np.arange(steps, dtype=np.float64)


def _ego(velocity: float, steps: int) -> Track:
    still = np.zeros(steps)
    return Track(EGO, LENGTH, velocity * _times(steps), still, np.full(steps, velocity), still)


def scenario(name: str, tracks: Sequence[Track], speed_limit: float) -> Scenario:
    """The tracks on a straight road of two lanes with a speed limit [m/s]; headings follow the motion."""
    offset = _START + 0.5 * LENGTH
    steps = len(tracks[0].x)
    far = max(float(track.x.max()) for track in tracks)
    shape = (len(tracks), steps)
    table = {field: np.zeros(shape) for field in STATE_FIELDS}
    valid = np.zeros(shape, dtype=np.bool_)
    for row, track in enumerate(tracks):
        heading = np.arctan2(track.sideways, np.maximum(track.velocity, 1e-9))
        heading[track.sideways == 0.0] = 0.0
        table["x"][row], table["y"][row], table["orientation"][row] = track.x + offset, track.y, heading
        table["velocity"][row] = np.hypot(track.velocity, track.sideways)
        table["acceleration"][row, :-1] = np.diff(track.velocity) / DT
        valid[row, track.first : None if track.last is None else track.last + 1] = True
    obstacles = Obstacles(
        ids=np.array([track.number for track in tracks], dtype=np.int64),
        kinds=("car",) * len(tracks),
        shapes=tuple(Shape("rectangle", length=track.length, width=WIDTH) for track in tracks),
        is_static=np.zeros(len(tracks), dtype=np.bool_),
        valid=valid,
        x=table["x"],
        y=table["y"],
        orientation=table["orientation"],
        velocity=table["velocity"],
        acceleration=table["acceleration"],
        yaw_rate=table["yaw_rate"],
    )
    return Scenario(name, name, DT, _road(far + offset + _BEYOND, speed_limit), obstacles, ())


def _road(length: float, speed_limit: float) -> Lanelets:
    x = np.linspace(0.0, length, max(2, int(length / 10.0) + 1))
    right, middle, left = (np.column_stack([x, np.full_like(x, y)]) for y in (-0.5 * LANE, 0.5 * LANE, 1.5 * LANE))
    return Lanelets(
        ids=np.array([1, 2], dtype=np.int64),
        left=(middle, left),
        right=(right, middle),
        predecessors=((), ()),
        successors=((), ()),
        adjacent_left=np.array([2, -1], dtype=np.int64),
        adjacent_left_same_direction=np.array([True, False]),
        adjacent_right=np.array([-1, 1], dtype=np.int64),
        adjacent_right_same_direction=np.array([False, True]),
        speed_limit=np.full(2, speed_limit),
        types=((), ()),
        left_marking=("dashed", "solid"),
        right_marking=("solid", "dashed"),
    )
