"""The evaluation: recordings in, measures per predictor and category out."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import InputError, InterdriveError, PredictorError
from interdrive.plugins import Choice, read_choice
from interdrive.prediction_evaluation.measures import HORIZONS, Predicted, judged
from interdrive.prediction_evaluation.recordings import Recording, category_of, found_files, opened
from interdrive.prediction_evaluation.split import read_split
from interdrive.prediction_evaluation.timing import measured_timings
from interdrive.predictors import NATIVE
from interdrive.predictors.calls import Called, called, name_of
from interdrive.run_settings import SimulationSettings
from interdrive.settings import flatten

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from interdrive.prediction_evaluation.recordings import Moment
    from interdrive.prediction_evaluation.split import Split
from interdrive.prediction_evaluation.timing import Timing

#: Predictors that "all" leaves out: no planner in a car could have them.
_FOR_STUDIES = ("ground_truth",)


@dataclass(frozen=True)
class Samples:
    """Vehicles at time steps, one row each, and every measure of every predictor.

    Attributes:
        file: Place in `PredictionEvaluation.files`, shape (n,).
        category: Category of the file.
        time_step: When.
        participant_id: Who.
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
class PredictionEvaluation:
    """What `evaluate_predictors` found.

    Attributes:
        files: The files with samples, in order.
        predictors: Names, in order.
        samples: Every sample.
        timings: Milliseconds per call.
        notes: What was left out, and why.
        settings: What was asked for, as plain values.
        choices: The predictors, for asking them again.
        simulation: Settings of predictors, road and steps.
    """

    files: tuple[Path, ...]
    predictors: tuple[str, ...]
    samples: Samples
    timings: tuple[Timing, ...] = ()
    notes: tuple[str, ...] = ()
    settings: dict[str, Any] = field(default_factory=dict)
    choices: tuple[Choice, ...] = ()
    simulation: SimulationSettings = field(default_factory=SimulationSettings)


def chosen_predictors(
    predictors: str | Sequence[object], settings: SimulationSettings, recording: Recording
) -> tuple[list[Choice], list[str]]:
    """Predictors by choice; "all" are the native ones that can be used here, without `ground_truth`.

    Args:
        predictors: "all", or choices, among which "all" stands for the others.
        settings: Of the run.
        recording: Where they are tried.

    Returns:
        Choices whose names differ, and lines about those of "all" that cannot be used.

    Raises:
        InputError: One that was asked for cannot be used, or is there twice.
    """
    notes: list[str] = []
    choices: list[Choice] = []
    for one in [predictors] if isinstance(predictors, str) else predictors:
        if one != "all":
            choices.append(read_choice(one, "predictor"))
            called(choices[-1], settings.predictor, recording.core_scenario)
            continue
        for name in NATIVE:
            if name in _FOR_STUDIES or name in map(name_of, choices):
                continue
            try:
                called(name, settings.predictor, recording.core_scenario)
            except InterdriveError as error:
                notes.append(f"{name} is left out: {error}")
            else:
                choices.append(Choice(name))
    names = [name_of(choice) for choice in choices]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"predictor {name} is there twice")
    if not choices:
        raise InputError("there is no predictor to evaluate")
    return choices, notes


def evaluate_predictors(
    files: str | Path | Sequence[str | Path],
    predictors: str | Sequence[object] = "all",
    *,
    every: int = 5,
    settings: SimulationSettings | None = None,
    split: str | Path | None = None,
    part: str = "validation",
    with_timing: bool = True,
    on_step: Callable[[str, int, int], None] | None = None,
) -> PredictionEvaluation:
    """Compares predictions with what recorded vehicles did next.

    Recordings are replayed without agents; at every `every`-th time step each predictor is asked, from present and past
    alone, and judged for cars, trucks, buses, motorcycles and bicycles that are recorded for at least another second.

    Args:
        files: CommonRoad files, folders of them, and names of shipped scenarios.
        predictors: "all", or choices as `simulate` takes them; "all" may be among them.
        every: Time steps between two questions.
        settings: Settings of the predictors, and of what counts as road; predictor.horizon is 3 s here.
        split: File that says which recordings are for what (`interdrive.prediction_evaluation.split`), and which
            category they have. None: all are taken, with the category of their folder.
        part: The part of the split that is judged; the other files are left out.
        with_timing: Measure how long a call takes, too.
        on_step: Called with what is going on, how much is done, and how much there is.

    Returns:
        Samples with all measures; `interdrive.prediction_evaluation.tables` sums them up.

    Raises:
        InputError: A file that was named itself, or a predictor, cannot be used; nobody can be judged.
        PredictorError: A predictor raised or returned garbage; one line with its name, time step and file.
    """
    if every < 1:
        raise InputError(f"every must be at least 1, not {every}")
    settings = settings or SimulationSettings()
    settings = replace(settings, predictor=replace(settings.predictor, horizon=float(HORIZONS[-1])))
    choices: list[Choice] = []
    notes: list[str] = []
    gathered = _Gathered()
    paths = found_files([files] if isinstance(files, str | Path) else files)
    categories = {path: category_of(path) for path, _ in paths}
    if split is not None:
        categories, line = _of_part(read_split(split), part, list(categories))
        notes.append(line)
    paths = [(path, is_needed) for path, is_needed in paths if path in categories]
    for number, (path, is_needed) in enumerate(paths):
        if on_step is not None:
            on_step(path.name, number, len(paths))
        recording = opened(path, settings, is_needed=is_needed)
        if isinstance(recording, str):
            notes.append(recording if path.name in recording else f"{path.name}: {recording}")
            continue
        if not choices:
            choices, lines = chosen_predictors(predictors, settings, recording)
            notes += lines
        asked = [called(choice, settings.predictor, recording.core_scenario) for choice in choices]
        gathered.add(path, categories[path], recording, asked, every)
    if not gathered.files:
        raise InputError("nobody can be judged: no vehicle in these files is recorded for a second")
    timings = measured_timings(choices, settings, on_step) if with_timing else ()
    return PredictionEvaluation(
        tuple(gathered.files),
        tuple(name_of(choice) for choice in choices),
        gathered.samples(),
        timings,
        tuple(notes),
        {
            "every": every,
            "split": None if split is None else str(split),
            "part": None if split is None else part,
            "files": [str(path) for path in gathered.files],
            "settings": {
                name: value
                for name, value in flatten(settings).items()
                if name.startswith(("predictor.", "road.", "step."))
            },
        },
        tuple(choices),
        settings,
    )


class _Gathered:
    """Samples of one file after the other."""

    def __init__(self) -> None:
        self.files: list[Path] = []
        self._columns: list[dict[str, Any]] = []
        self._values: dict[str, list[dict[str, Any]]] = {}

    def add(self, path: Path, category: str, recording: Recording, asked: Sequence[Called], every: int) -> None:
        moments: list[Moment] = []
        answers: list[list[Predicted]] = [[] for _ in asked]
        for moment in recording.moments(every):
            moments.append(moment)
            for predictor, answer in zip(asked, answers, strict=True):
                answer.append(answered(predictor, recording, moment))
        if not moments:
            return
        truth = np.concatenate([moment.truth for moment in moments])
        now = np.concatenate([_now(moment) for moment in moments])
        for predictor, answer in zip(asked, answers, strict=True):
            values = judged(joined(answer), truth, now, recording.scenario.dt, recording.road)
            self._values.setdefault(predictor.name, []).append(values)
        self._columns.append(
            {
                "file": np.full(len(truth), len(self.files)),
                "category": np.full(len(truth), category, dtype=object),
                "time_step": np.repeat([m.scene.time_step for m in moments], [len(m.row) for m in moments]),
                "participant_id": np.concatenate([m.scene.ids[m.row] for m in moments]),
                "kind": np.concatenate([m.scene.kinds[m.row] for m in moments]),
                "speed": np.concatenate([_speed(m) for m in moments]),
                "departure": np.concatenate([_departure(m) for m in moments]),
                **{name: np.concatenate([getattr(m, name) for m in moments]) for name in ("known", "stands", "stays")},
            }
        )
        self.files.append(path)

    def samples(self) -> Samples:
        values = {
            name: {measure: np.concatenate([part[measure] for part in parts]) for measure in parts[0]}
            for name, parts in self._values.items()
        }
        columns = {name: np.concatenate([part[name] for part in self._columns]) for name in self._columns[0]}
        return Samples(**columns, values=values)


def _of_part(split: Split, part: str, paths: list[Path]) -> tuple[dict[Path, str], str]:
    """Categories of the files of a part, and a line about the others.

    Raises:
        InputError: The split has no such part, or none of the files is of it.
    """
    if part not in split.parts:
        raise InputError(f"{split.path}: there is no part {part!r}; there are {', '.join(split.parts)}")
    places = {path: split.place_of(path) for path in paths}
    chosen = {path: place.category for path, place in places.items() if place is not None and place.part == part}
    if not chosen:
        raise InputError(f"{split.path}: none of the {len(paths)} files is of the part {part}")
    unknown = sum(place is None for place in places.values())
    others = len(paths) - len(chosen) - unknown
    return chosen, f"part {part} of {split.path}: {len(chosen)} files; {others} of other parts, {unknown} of no place"


def answered(predictor: Called, recording: Recording, moment: Moment) -> Predicted:
    """What a predictor says about the judged vehicles of a moment until 3 s; who is left out goes straight on.

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


def joined(parts: Sequence[Predicted]) -> Predicted:
    """One after the other; modes and steps that only some have are not valid in the others."""
    n_modes = max(part.valid.shape[1] for part in parts)
    n_steps = max(part.valid.shape[2] for part in parts)

    def grown(values: Any) -> Any:  # noqa: ANN401 - array
        shape = (n_modes, n_steps)[: 1 if values.ndim == 2 else 2]
        missing = [(0, 0), *((0, wanted - given) for wanted, given in zip(shape, values.shape[1:], strict=False))]
        return np.pad(values, missing + [(0, 0)] * (values.ndim - len(missing)))

    names = ("probability", "mean", "covariance", "valid")
    return Predicted(*(np.concatenate([grown(getattr(part, name)) for part in parts]) for name in names))


def _now(moment: Moment) -> Any:  # noqa: ANN401 - array
    return np.stack([moment.scene.x[moment.row, -1], moment.scene.y[moment.row, -1]], axis=1)


def _speed(moment: Moment) -> Any:  # noqa: ANN401 - array
    scene, row = moment.scene, moment.row
    stated = np.abs(scene.velocity[row, -1])
    if scene.x.shape[1] < 2:
        return stated
    way = np.hypot(scene.x[row, -1] - scene.x[row, -2], scene.y[row, -1] - scene.y[row, -2])
    return np.where(scene.valid[row, -2], way / scene.dt, stated)


def _departure(moment: Moment) -> Any:  # noqa: ANN401 - array
    scene, row = moment.scene, moment.row
    orientation, way = scene.orientation[row, -1], float(HORIZONS[-1]) * _speed(moment)
    straight = _now(moment) + way[:, None] * np.stack([np.cos(orientation), np.sin(orientation)], axis=1)
    return np.linalg.norm(moment.truth[:, -1] - straight, axis=1)
