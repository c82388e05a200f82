"""WALENET: a published network that expects one path with a covariance per step from 3 s of positions and the road.

Geisslinger, Karle, Betz, Lienkamp, "Watch-and-Learn-Net", IEEE SMC 2021, after Deo and Trivedi, "Convolutional social
pooling", CVPRW 2018. Its graph (`walenet.onnx`) is run by onnxruntime, an optional library: `pip install
interdrive[walenet]`. Its authors published the weights: `interdrive models install walenet`.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np

from interdrive._core import Predictions
from interdrive.errors import InputError, MissingExtraError
from interdrive.predictors.models import weights, weights_file
from interdrive.scenario import KINDS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive._core import RoadNetwork, Scene

    _Floats = NDArray[np.float64]
    _Singles = NDArray[np.float32]
    _Ints = NDArray[np.int64]
    _Bools = NDArray[np.bool_]

#: Standard operators only; the weights are not in it.
GRAPH = Path(__file__).with_name("walenet.onnx")
#: Participants that the network is asked about; the others go straight on.
_VEHICLES = ("car", "truck", "bus", "motorcycle", "bicycle", "priority_vehicle", "taxi")
#: Time between the network's steps, past and future [s].
_STEP = 0.1
#: Positions of a history, the last is now, and steps of an answer.
N_HISTORY, N_ANSWER = 30, 40
#: Cells around a vehicle across (from the left) and along (from far ahead), and half the size of them all [m].
_CELLS, _FIELD = np.array([3, 13]), np.array([9.0, 39.0])
N_CELLS = 39
#: Pixels along a side of the picture; half the side, size of a pixel, distance of the points drawn along a bound [m].
SIDE = 256
_REACH, _PIXEL, _SPACING = 64.0, 0.5, 0.4
#: Grey values of bounds with and without a lanelet beyond.
_MARKING, _EDGE = 127, 255
#: Below this speed the heading is kept [m/s], as in the published predictor.
_SLOW = 0.3
#: Variance of the position of a vehicle that stands [m²].
_STANDING_VARIANCE = 0.02
#: Smallest and largest standard deviation [m], and largest correlation: a covariance can have these numbers.
_SIGMA, _CORRELATION_MAX = (1e-3, 1e3), 0.999
#: Number of last steps whose mean velocity is kept beyond its answer.
_LAST_STEPS = 5


@dataclass(frozen=True)
class Walenet:
    """The published network WALENET: one path per vehicle from 3 s of positions and a picture of the road.

    The defaults correct what the published framework does wrong. Pedestrians go straight on.

    Source: Geisslinger, Karle, Betz, Lienkamp, "Watch-and-Learn-Net", IEEE SMC 2021.

    Attributes:
        anchor: The state that the network takes as the present one: "now", as in training; or "next", with the answer
            taken one step early, as in the published framework (the present state moved on by velocity and yaw rate).
        standing_guard: Vehicles that have not moved for half a second stay, although the network expects them to drive
            off.
        backfill: Extend a short past at the first known speed; otherwise the vehicle counts as standing there.
        horizon: Length of predictions; the network predicts 4 s, beyond that the velocity is kept.
    """

    anchor: Literal["now", "next"] = "now"
    standing_guard: bool = True
    backfill: bool = True
    horizon: Annotated[float, "s"] = 3.0

    def __post_init__(self) -> None:
        """Checks library, weights and ranges."""
        if self.anchor not in ("now", "next"):
            raise InputError("anchor", f"expected one of now, next, not {self.anchor!r}")
        if not 0 < self.horizon <= 30:
            raise InputError("horizon", f"must be more than 0 and at most 30 s, not {self.horizon}")
        network()

    def predict(self, scene: Scene) -> Predictions:
        """Predictions for all participants of `scene`, with one mode; shapes as in `interdrive.Predictor`."""
        x, y, orientation = (values[:, -1] for values in (scene.x, scene.y, scene.orientation))
        velocity = scene.observed_velocity
        is_known = np.isfinite(x + y + orientation + velocity) & ~scene.is_static
        rows = np.flatnonzero(is_known)
        poses, histories = _histories(scene, rows, velocity[rows], self)
        is_vehicle = np.isin(scene.kinds, [KINDS.index(kind) for kind in _VEHICLES]) & is_known
        stands = is_vehicle & scene.is_standing & self.standing_guard
        asked = np.flatnonzero((is_vehicle & ~stands)[rows])
        answers = _answers(poses, histories, asked, scene.road)
        n_steps = max(2, round(self.horizon / scene.dt))
        moving = _forecast(answers, poses[asked], n_steps, scene.dt)
        standing = _standing(np.column_stack([x, y, orientation])[stands], n_steps)
        ids = np.concatenate([scene.ids[rows[asked]], scene.ids[stands]])
        order = np.argsort(ids)
        x, y, orientation, velocity, covariance = (
            np.concatenate(parts)[order, None] for parts in zip(moving, standing, strict=True)
        )
        probability, valid = np.ones((len(ids), 1)), np.ones(x.shape, dtype=bool)
        return Predictions(
            scene.time_step, ids[order], probability, x, y, orientation, velocity, covariance, valid
        ).completed(scene)


def network(values: _Singles | None = None) -> Any:  # noqa: ANN401 - a session of onnxruntime, which need not be there
    """The network as a session of onnxruntime, made anew only if the file of weights has changed.

    Inputs: `tracks` (30, m, 2), histories in the frame of the predicted vehicle (x to the right, y forward) [m];
    `cells` (n, 40), which of them is the vehicle's own, and which is in each of the 39 cells around it (a track of
    zeros for an empty cell); `pictures` (n, 256, 256). Output (n, 40, 5): mean to the right and forward [m], inverse
    standard deviations [1/m], correlation. It runs on the calling thread; the rows of the output are independent.

    Args:
        values: Weights in the order of the published file; None: the installed weights.

    Raises:
        MissingExtraError: onnxruntime is not installed.
        InputError: The weights are not installed or damaged; the text says what to do.
    """
    try:
        import onnxruntime  # noqa: F401, PLC0415 - takes a while, and is not needed to list settings
    except ImportError as error:
        raise MissingExtraError("predictor walenet needs the extra: pip install interdrive[walenet]") from error
    if values is not None:
        return _session(values)
    file = weights_file()
    return _installed(file, file.stat().st_mtime_ns if file.is_file() else 0)


@lru_cache(maxsize=1)
def _installed(_file: Path, _changed: int) -> Any:  # noqa: ANN401
    return _session(weights())


def _session(values: _Singles) -> Any:  # noqa: ANN401
    import onnxruntime  # noqa: PLC0415

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.add_external_initializers(["weights"], [onnxruntime.OrtValue.ortvalue_from_numpy(values)])
    return onnxruntime.InferenceSession(GRAPH.read_bytes(), options, providers=["CPUExecutionProvider"])


def _histories(scene: Scene, rows: _Ints, velocity: _Floats, settings: Walenet) -> tuple[_Floats, _Floats]:
    """Poses (n, 3) that the network takes for the present ones, and positions before (n, 30, 2), every 0.1 s.

    Positions are nan where they are not known; gaps are bridged by straight lines.
    """
    x, y, orientation, stated = (v[rows, ::-1] for v in (scene.x, scene.y, scene.orientation, scene.velocity))
    poses = np.column_stack([x[:, 0], y[:, 0], orientation[:, 0]])
    times, age = scene.dt * np.arange(x.shape[1]), _STEP * np.arange(N_HISTORY)
    if settings.anchor == "next":
        turn = np.nan_to_num(scene.yaw_rate[rows, -1])
        poses += scene.dt * np.column_stack([velocity * np.cos(poses[:, 2]), velocity * np.sin(poses[:, 2]), turn])
        times = np.concatenate([[0.0], times + scene.dt])
        x, y = np.column_stack([poses[:, 0], x]), np.column_stack([poses[:, 1], y])
        orientation, stated = (np.column_stack([values[:, 0], values]) for values in (orientation, stated))
    histories = np.full((len(rows), N_HISTORY, 2), np.nan)
    for i, known in enumerate(np.isfinite(x + y)):
        last = np.flatnonzero(known)[-1]
        unknown = np.maximum(age - times[last], 0.0)
        for axis, values in enumerate((x, y)):
            histories[i, :, axis] = np.interp(age, times[known], values[i, known])
        heading, speed = orientation[i, last], stated[i, last]
        # Where positions contradict the stated speeds, the positions are right.
        if velocity[i] != stated[i, 0] or not np.isfinite(heading + speed):
            heading, speed = orientation[i, 0], velocity[i]
        drift = speed * np.array([np.cos(heading), np.sin(heading)])
        histories[i] -= np.outer(unknown, drift if settings.backfill else (0.0, 0.0))
        if not settings.backfill:
            histories[i, unknown > 1e-6] = np.nan
    return poses, histories[:, ::-1]


def _seen_from(pose: _Floats, points: _Floats) -> _Floats:
    """Points (..., 2) in the frame of a vehicle: x to the right, y forward [m]."""
    sin, cos = np.sin(pose[2]), np.cos(pose[2])
    x, y = np.moveaxis(points - pose[:2], -1, 0)
    return np.stack([x * sin - y * cos, x * cos + y * sin], axis=-1)


def _answers(poses: _Floats, histories: _Floats, asked: _Ints, road: RoadNetwork) -> _Floats:
    """What the network says about some of the vehicles, (n, 40, 5)."""
    session, borders = network(), Borders(road)

    def ask(own: int) -> _Floats:
        tracks, cells = _neighbours(own, poses, histories)
        pictures = borders.picture(*poses[own])[None]
        answer: _Floats = session.run(None, {"tracks": tracks, "cells": cells, "pictures": pictures})[0][0]
        return answer.astype(float)

    if not len(asked):
        return np.zeros((0, N_ANSWER, 5))
    with ThreadPoolExecutor(min(len(asked), len(os.sched_getaffinity(0)))) as threads:
        return np.stack(list(threads.map(ask, asked.tolist())))


def _neighbours(own: int, poses: _Floats, histories: _Floats) -> tuple[_Singles, _Ints]:
    """Histories (30, m, 2) around a vehicle, the first all zero, and which is its own and in which cell, (1, 40).

    Of several in a cell the nearest counts, so the vehicle itself is always in its own.
    """
    here = _seen_from(poses[own], poses[:, :2])
    distance = np.hypot(*here.T)
    distance[own] = -1.0
    near = np.flatnonzero((np.abs(here) < _FIELD).all(axis=1))
    near = near[np.argsort(distance[near], kind="stable")]
    places = (_CELLS * (_FIELD + here[near] * (1, -1)) / (2.0 * _FIELD)).astype(int)
    across, along = np.minimum(places, _CELLS - 1).T
    cells = np.zeros((1, 1 + N_CELLS), dtype=np.int64)
    cells[0, 0] = 1
    cells[0, 1 + across[::-1] * _CELLS[1] + along[::-1]] = np.arange(len(near), 0, -1)
    tracks = np.zeros((N_HISTORY, 1 + len(near), 2), dtype=np.float32)
    tracks[:, 1:] = np.nan_to_num(_seen_from(poses[own], histories[near])).swapaxes(0, 1)
    return tracks, cells


class Borders:
    """The bounds of all lanelets of a road, to be drawn."""

    def __init__(self, road: RoadNetwork) -> None:
        """Takes them from the road."""
        bounds = road.bounds()
        self._lines = [vertices for vertices, _ in bounds]
        self._grey = np.array([_EDGE if is_outer else _MARKING for _, is_outer in bounds], dtype=np.uint8)
        self._low = np.array([line.min(axis=0) for line in self._lines])
        self._high = np.array([line.max(axis=0) for line in self._lines])

    def picture(self, x: float, y: float, orientation: float) -> NDArray[np.uint8]:
        """Grey values around a pose, (256, 256): rows grow forward, columns to the right, half a metre per pixel.

        Later bounds cover earlier ones.
        """
        image = np.zeros((SIDE, SIDE), dtype=np.uint8)
        reach = np.sqrt(2.0) * _REACH
        near = ((self._low <= (x + reach, y + reach)) & (self._high >= (x - reach, y - reach))).all(axis=1)
        lines = [self._lines[i] for i in np.flatnonzero(near)]
        if not lines:
            return image
        line = np.repeat(np.arange(len(lines)), [len(vertices) for vertices in lines])
        local = _seen_from(np.array([x, y, orientation]), np.concatenate(lines))
        inside: _Bools = np.abs(local).max(axis=1) <= _REACH
        # A vertex outside counts if one beside it is inside.
        kept: _Bools = inside.copy()
        goes_on = line[1:] == line[:-1]
        kept[1:] |= inside[:-1] & goes_on
        kept[:-1] |= inside[1:] & goes_on
        line, local = line[kept], local[kept]
        if not len(line):
            return image
        first = np.flatnonzero(np.append(True, line[1:] != line[:-1]))
        last = np.append(first[1:], len(line)) - 1
        step = np.diff(local, axis=0, append=0.0)
        length = np.sqrt((step * step).sum(axis=1))
        s = np.concatenate([np.append(0.0, np.cumsum(part[:-1])) for part in np.split(length, first[1:])])
        # Points every 0.4 m from the first vertex of each line on; `i` is the vertex before a point.
        count = np.ceil(s[last] / _SPACING).astype(int)
        owner = np.repeat(np.arange(len(first)), count)
        at = _SPACING * (np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count))
        apart = s.max() + 1.0
        place = np.cumsum(np.bincount(first, minlength=len(line))) - 1
        i = np.searchsorted(s + apart * place, at + apart * owner, side="right") - 1
        i = np.minimum(i, last[owner] - 1)
        points = local[i] + step[i] * ((at - s[i]) / np.maximum(length[i], 1e-12))[:, None]
        column, row = np.floor(points.T / _PIXEL + SIDE // 2).astype(int)
        drawn = (row >= 0) & (row < SIDE) & (column >= 0) & (column < SIDE) & (at < s[last][owner])
        image[row[drawn], column[drawn]] = self._grey[near][line[first]][owner][drawn]
        return image


def _forecast(answers: _Floats, poses: _Floats, n_steps: int, dt: float) -> tuple[_Floats, ...]:
    """x, y, orientation and velocity (n, steps), and covariance (n, steps, 2, 2), in the world.

    Between the network's steps on straight lines; behind the last one with constant velocity and a standard deviation
    in proportion to time.
    """
    sx, sy = np.clip(1.0 / (answers[..., 2:4] + np.finfo(float).eps), *_SIGMA).transpose(2, 0, 1)
    sxy = np.clip(answers[..., 4], -_CORRELATION_MAX, _CORRELATION_MAX) * sx * sy
    spread = np.stack([sx * sx, sxy, sxy, sy * sy], axis=-1).reshape(-1, N_ANSWER, 2, 2)
    # Step 0 is the vehicle's own place.
    mean = np.pad(answers[..., :2], ((0, 0), (1, 0), (0, 0)))
    spread = np.concatenate([spread[:, :1], spread], axis=1)
    step = np.arange(1, n_steps + 1) * dt / _STEP
    i = np.minimum(step.astype(int), N_ANSWER - 1)
    part, beyond = np.minimum(step - i, 1.0)[:, None], np.maximum(step - N_ANSWER, 0.0)[:, None]
    last = (mean[:, -1:] - mean[:, -1 - _LAST_STEPS, None]) / _LAST_STEPS
    mean = mean[:, i] + (mean[:, i + 1] - mean[:, i]) * part + last * beyond
    spread = spread[:, i] + (spread[:, i + 1] - spread[:, i]) * part[..., None]
    spread = spread * (np.maximum(step / N_ANSWER, 1.0) ** 2)[:, None, None]
    sin, cos = np.sin(poses[:, 2]), np.cos(poses[:, 2])
    turn = np.stack([sin, cos, -cos, sin], axis=-1).reshape(-1, 1, 2, 2)  # columns: right, forward
    positions = poses[:, None, :2] + (turn @ mean[..., None])[..., 0]
    vx, vy = np.gradient(positions, dt, axis=1).transpose(2, 0, 1)
    speed = np.hypot(vx, vy)
    turned = (np.arctan2(vy, vx) - poses[:, None, 2] + np.pi) % (2 * np.pi) - np.pi
    orientation = poses[:, None, 2] + np.where(speed < _SLOW, 0.0, turned)
    return positions[..., 0], positions[..., 1], orientation, speed, turn @ spread @ turn.swapaxes(2, 3)


def _standing(poses: _Floats, n_steps: int) -> tuple[_Floats, ...]:
    """The same for vehicles that stay."""
    x, y, orientation = np.broadcast_to(poses.T[..., None], (3, len(poses), n_steps))
    covariance = np.broadcast_to(_STANDING_VARIANCE * np.eye(2), (len(poses), n_steps, 2, 2))
    return x, y, orientation, np.zeros_like(x), covariance
