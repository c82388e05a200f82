"""The evaluation: recordings in, measures per predictor and category out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

from interdrive.config.binding import flatten
from interdrive.config.schema import SimulationSettings, settings_of
from interdrive.config.specs import bound_predictor, read_predictor
from interdrive.errors import InputError, InterdriveError
from interdrive.files import read_scenario, shipped_scenario
from interdrive.prediction_evaluation.measures import HORIZONS
from interdrive.prediction_evaluation.recordings import Recording, category_of, found_files
from interdrive.prediction_evaluation.samples import Gathered
from interdrive.prediction_evaluation.split import UNKNOWN, read_split
from interdrive.prediction_evaluation.tables import PredictionEvaluation
from interdrive.prediction_evaluation.workers import FileTask, samples_of_files
from interdrive.predictors import NATIVE

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from interdrive.config.schema import SettingsSpec
    from interdrive.config.specs import PredictorSpec, Resolved
    from interdrive.prediction_evaluation.split import Split

#: What "all" stands for; no planner in a car could have the others.
_ALL = (*(name for name in NATIVE if name != "ground_truth"), "walenet")


def chosen_predictors(
    predictors: PredictorSpec | Sequence[PredictorSpec], settings: SimulationSettings, recording: Recording
) -> tuple[list[Resolved], list[str]]:
    """Predictors that were chosen; "all" are the native ones without `ground_truth`, and `walenet` if it can be used.

    Args:
        predictors: "all", a choice, or a list of choices, among which "all" stands for the others.
        settings: Of the run.
        recording: Where they are tried.

    Returns:
        Predictors whose labels differ, and lines about those of "all" that cannot be used.

    Raises:
        InputError: A predictor cannot be used, or is given twice.
    """
    notes: list[str] = []
    choices: list[Resolved] = []
    for one in predictors if isinstance(predictors, list | tuple) else [predictors]:
        for spec in _ALL if one == "all" else (cast("PredictorSpec", one),):
            try:
                found = read_predictor(spec, settings.predictor)
                bound_predictor(found, settings.predictor, recording.core_scenario)
            except InterdriveError as error:
                if one != "all":
                    raise
                notes.append(f"{spec} is left out: {error}")
            else:
                if one != "all" or found.label not in (choice.label for choice in choices):
                    choices.append(found)
    names = [choice.label for choice in choices]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"predictor {name} is given twice")
    if not choices:
        raise InputError("no predictor to evaluate")
    return choices, notes


def evaluate_predictors(
    files: str | Path | Sequence[str | Path],
    predictors: PredictorSpec | Sequence[PredictorSpec] = "all",
    *,
    every: int = 5,
    settings: SettingsSpec | None = None,
    split: str | Path | None = None,
    part: str = "validation",
    workers: int = 1,
    on_step: Callable[[str, int, int], None] | None = None,
) -> PredictionEvaluation:
    """Compares predictions with what recorded vehicles did next.

    Recordings are replayed without agents; at every `every`-th time step each predictor predicts from present and past
    alone, and is evaluated for cars, trucks, buses, motorcycles and bicycles that are recorded for at least another
    second. If several files contain the same vehicle of the same recording, the first file counts.

    Args:
        files: CommonRoad files, folders of them, and names of shipped scenarios.
        predictors: "all", a choice as in `simulate`, or a list of choices, which may include "all".
        every: Number of time steps between predictions.
        settings: Settings, or a mapping of dotted names, for predictors and road; predictor.horizon is 3 s here.
        split: File that assigns recordings to parts, categories and kinds of traffic
            (`interdrive.prediction_evaluation.split`). None: use all files, with the category of their folder and
            unknown traffic.
        part: The part of the split to evaluate; other files are left out.
        workers: Processes that share the files; results do not depend on it. With more than one, scripts need
            `if __name__ == "__main__":`.
        on_step: Called with the current activity, the amount done, and the total.

    Returns:
        Samples with all measures; `table` summarises them.

    Raises:
        InputError: A file that was named itself, or a predictor, cannot be used; no vehicle can be evaluated.
        PredictorError: A predictor raised an exception or returned invalid predictions; one line with its name, time
            step and file.
    """
    if every < 1:
        raise InputError(f"every must be at least 1, not {every}")
    if workers < 1:
        raise InputError(f"workers: expected at least 1, not {workers}")
    simulation = settings_of(settings)
    simulation = replace(simulation, predictor=replace(simulation.predictor, horizon=float(HORIZONS[-1])))
    probe = Recording(read_scenario(shipped_scenario("lane_merge")), simulation)
    choices, notes = chosen_predictors(predictors, simulation, probe)
    if workers > 1:
        for choice in choices:
            choice.check_found_elsewhere(simulation.predictor)
    gathered = Gathered()
    paths = found_files([files] if isinstance(files, str | Path) else files)
    labels = {path: (category_of(path), UNKNOWN) for path, _ in paths}
    if split is not None:
        labels, line = _of_part(read_split(split), part, list(labels))
        notes.append(line)
    tasks = [
        FileTask(path, is_needed, tuple(choices), simulation, every) for path, is_needed in paths if path in labels
    ]
    for path, found in samples_of_files(tasks, workers, on_step):
        if isinstance(found, str):
            notes.append(found if path.name in found else f"{path.name}: {found}")
        elif found is not None:
            gathered.add(path, labels[path], found)
    notes += gathered.note()
    if not gathered.files:
        raise InputError("no vehicle can be judged: none in these files is recorded for a second")
    return PredictionEvaluation(
        tuple(gathered.files),
        tuple(choice.label for choice in choices),
        gathered.samples(),
        tuple(notes),
        {
            "every": every,
            "split": None if split is None else str(split),
            "part": None if split is None else part,
            "files": [str(path) for path in gathered.files],
            "settings": {
                name: value
                for name, value in flatten(simulation).items()
                if name.startswith(("predictor.", "recording.", "road.", "step."))
            },
        },
        tuple(choices),
        simulation,
    )


def _of_part(split: Split, part: str, paths: list[Path]) -> tuple[dict[Path, tuple[str, str]], str]:
    """Category and traffic of the files of a part, and a line about the others.

    Raises:
        InputError: The split has no such part, or none of the files is of it.
    """
    if part not in split.parts:
        raise InputError(f"{split.path}: there is no part {part!r}; there are {', '.join(split.parts)}")
    places = {path: split.place_of(path) for path in paths}
    chosen = {
        path: (place.category, place.traffic)
        for path, place in places.items()
        if place is not None and place.part == part
    }
    if not chosen:
        raise InputError(f"{split.path}: none of the {len(paths)} files is of the part {part}")
    unknown = sum(place is None for place in places.values())
    others = len(paths) - len(chosen) - unknown
    return (
        chosen,
        f"part {part} of {split.path}: {len(chosen)} files; {others} of other parts, {unknown} without a place",
    )
