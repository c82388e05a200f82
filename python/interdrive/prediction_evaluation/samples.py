"""Samples: vehicles at time steps, what every predictor said of them, and what it is worth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import PredictorError
from interdrive.prediction_evaluation.measures import HORIZONS, Predicted, joined, judged
from interdrive.prediction_evaluation.repeats import KnownTracks

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from interdrive.array_types import Floats
    from interdrive.prediction_evaluation.recordings import Moment, Recording
    from interdrive.predictors.calls import BoundPredictor
    from interdrive.scenario import Obstacles


@dataclass(frozen=True)
class Samples:
    """Vehicles at time steps, one row each, and every measure of every predictor.

    Attributes:
        file: Place in `PredictionEvaluation.files`, shape (n,).
        category: Category of the file.
        traffic: Where its traffic comes from, one of `split.TRAFFIC`.
        time_step: When.
        participant_id: The predicted participant.
        kind: Code of `interdrive.scenario.KINDS`.
        speed: Distance covered in the last time step over its length [m/s]; the stated speed without a past.
        known: How long the vehicle has been recorded [s].
        stands: It stands now.
        stays: It stands now and in the 3 s to come.
        departure: Distance after 3 s from where it would be with its present velocity [m]; nan if the recording ends.
        values: Predictor -> measure -> array, as `measures.judged` has them.
    """

    file: Any
    category: Any
    traffic: Any
    time_step: Any
    participant_id: Any
    kind: Any
    speed: Any
    known: Any
    stands: Any
    stays: Any
    departure: Any
    values: dict[str, dict[str, Any]]

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.time_step)


@dataclass(frozen=True)
class FileSamples:
    """All samples of a file, also of recordings that other files show.

    Attributes:
        columns: Those of `Samples` that the file alone determines.
        values: Predictor -> measure -> array.
        obstacles: The recording, by which repeated ones are found.
        dt: Time between its steps [s].
    """

    columns: dict[str, Any]
    values: dict[str, dict[str, Any]]
    obstacles: Obstacles
    dt: float


def file_samples(recording: Recording, asked: Sequence[BoundPredictor], every: int) -> FileSamples | None:
    """Asks predictors at every `every`-th time step; None if no vehicle can be evaluated.

    Raises:
        PredictorError: A predictor raised or returned garbage.
    """
    moments: list[Moment] = []
    answers: list[list[Predicted]] = [[] for _ in asked]
    for moment in recording.moments(every):
        moments.append(moment)
        for predictor, answer in zip(asked, answers, strict=True):
            answer.append(answered(predictor, recording, moment))
    if not moments:
        return None
    truth = np.concatenate([moment.truth for moment in moments])
    now = np.concatenate([_now(moment) for moment in moments])
    dt = recording.scenario.dt
    columns = {
        "time_step": np.repeat([m.scene.time_step for m in moments], [len(m.row) for m in moments]),
        "participant_id": np.concatenate([m.scene.ids[m.row] for m in moments]),
        "kind": np.concatenate([m.scene.kinds[m.row] for m in moments]),
        "speed": np.concatenate([_speed(m) for m in moments]),
        "departure": np.concatenate([_departure(m) for m in moments]),
        **{name: np.concatenate([getattr(m, name) for m in moments]) for name in ("known", "stands", "stays")},
    }
    values = {
        predictor.name: judged(joined(answer), truth, now, dt, recording.road)
        for predictor, answer in zip(asked, answers, strict=True)
    }
    return FileSamples(columns, values, recording.scenario.obstacles, dt)


class Gathered:
    """Samples of one file after the other; of recordings that several files show, those of the first."""

    def __init__(self) -> None:
        """No file yet."""
        self.files: list[Path] = []
        #: Samples, vehicles and files that were left out because earlier files show the same.
        self.left_out = np.zeros(3, dtype=np.int64)
        self._tracks = KnownTracks()
        self._columns: list[dict[str, Any]] = []
        self._values: dict[str, list[dict[str, Any]]] = {}

    def add(self, path: Path, labels: tuple[str, str], found: FileSamples) -> None:
        """Adds the samples of a file that no earlier file has; the labels are its category and traffic."""
        repeated = self._tracks.repeated(found.obstacles, found.dt)
        ids = found.columns["participant_id"]
        is_new = ~repeated[np.searchsorted(found.obstacles.ids, ids), found.columns["time_step"]]
        gone = ids[~is_new]
        self.left_out += np.array([len(gone), len(np.unique(gone)), bool(len(gone))])
        if not is_new.any():
            return
        n = int(is_new.sum())
        for name, values in found.values.items():
            kept = {measure: array[is_new] for measure, array in values.items()}
            self._values.setdefault(name, []).append(kept)
        self._columns.append(
            {
                "file": np.full(n, len(self.files)),
                "category": np.full(n, labels[0], dtype=object),
                "traffic": np.full(n, labels[1], dtype=object),
                **{name: array[is_new] for name, array in found.columns.items()},
            }
        )
        self.files.append(path)

    def note(self) -> tuple[str, ...]:
        """A line about what was left out, if anything was."""
        samples, vehicles, files = self.left_out.tolist()
        if not samples:
            return ()
        return (f"{samples} samples of {vehicles} vehicles in {files} files are left out: earlier files contain them",)

    def samples(self) -> Samples:
        """Everything collected."""
        values = {
            name: {measure: np.concatenate([part[measure] for part in parts]) for measure in parts[0]}
            for name, parts in self._values.items()
        }
        columns = {name: np.concatenate([part[name] for part in self._columns]) for name in self._columns[0]}
        return Samples(**columns, values=values)


def answered(predictor: BoundPredictor, recording: Recording, moment: Moment) -> Predicted:
    """Predictions for the evaluated vehicles of a moment until 3 s; those left out go straight on.

    Raises:
        PredictorError: It raised or returned garbage; the text names it, the time step and the scenario.
    """
    try:
        found = predictor.predict(recording.world, moment.scene, recording.n_steps)
    except PredictorError as error:
        raise PredictorError(f"{recording.scenario.name}: {error}") from error
    found = found.completed(moment.scene)
    row = moment.row
    return Predicted(
        probability=found.probability[row],
        mean=np.stack([found.x[row], found.y[row]], axis=-1),
        covariance=found.covariance[row],
        valid=found.valid[row],
    )


def _now(moment: Moment) -> Floats:
    return np.stack([moment.scene.x[moment.row, -1], moment.scene.y[moment.row, -1]], axis=1)


def _speed(moment: Moment) -> Floats:
    scene, row = moment.scene, moment.row
    stated: Floats = np.abs(scene.velocity[row, -1])
    if scene.x.shape[1] < 2:
        return stated
    way = np.hypot(scene.x[row, -1] - scene.x[row, -2], scene.y[row, -1] - scene.y[row, -2])
    speed: Floats = np.where(scene.valid[row, -2], way / scene.dt, stated)
    return speed


def _departure(moment: Moment) -> Floats:
    scene, row = moment.scene, moment.row
    orientation, way = scene.orientation[row, -1], float(HORIZONS[-1]) * _speed(moment)
    way = np.where(scene.velocity[row, -1] < 0.0, -way, way)
    straight = _now(moment) + way[:, None] * np.stack([np.cos(orientation), np.sin(orientation)], axis=1)
    departure: Floats = np.linalg.norm(moment.truth[:, -1] - straight, axis=1)
    return departure
