"""Samples of files, found in this process or in several."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from interdrive.batches.pool import Pool, Task
from interdrive.config.specs import bound_predictor
from interdrive.errors import InterdriveError
from interdrive.prediction_evaluation.recordings import opened
from interdrive.prediction_evaluation.samples import FileSamples, file_samples

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from interdrive.config.schema import SimulationSettings
    from interdrive.config.specs import Resolved


@dataclass(frozen=True)
class FileTask:
    """A file to evaluate predictors on.

    Attributes:
        path: The file.
        is_needed: It is an error if it cannot be used.
        choices: The predictors.
        simulation: Settings of predictors, road and steps.
        every: Number of time steps between predictions.
    """

    path: Path
    is_needed: bool
    choices: tuple[Resolved, ...]
    simulation: SimulationSettings
    every: int


def samples_of_files(
    tasks: Sequence[FileTask], workers: int, on_step: Callable[[str, int, int], None] | None
) -> Iterator[tuple[Path, FileSamples | str | None]]:
    """Path and samples of every file, in order; a line if it cannot be used, None if it has no vehicle to judge.

    Raises:
        InputError: A file that is needed cannot be used.
        PredictorError: A predictor raised or returned garbage.
        InterdriveError: A process was lost twice.
    """
    for done, (task, found) in enumerate(_in_order(tasks, min(workers, len(tasks)))):
        if on_step is not None:
            on_step(task.path.name, done, len(tasks))
        if isinstance(found, InterdriveError):
            raise found
        yield task.path, found


def _in_order(
    tasks: Sequence[FileTask], workers: int
) -> Iterator[tuple[FileTask, FileSamples | str | InterdriveError | None]]:
    if workers <= 1:
        yield from ((task, _samples_of(task, 1)) for task in tasks)
        return
    waiting = iter([Task(task) for task in tasks])
    found: dict[Path, FileSamples | str | InterdriveError | None] = {}
    done = 0
    with Pool(workers) as pool:
        for end in pool.run(_samples_of, lambda _group: next(waiting, None)):
            path = end.task.payload.path
            found[path] = InterdriveError(str(path), end.why) if end.lost else end.value
            while done < len(tasks) and tasks[done].path in found:
                yield tasks[done], found.pop(tasks[done].path)
                done += 1


def _samples_of(task: FileTask, _attempt: int) -> FileSamples | str | InterdriveError | None:
    """Exceptions are answers: raised in a process they would end it."""
    try:
        recording = opened(task.path, task.simulation, is_needed=task.is_needed)
        if isinstance(recording, str):
            return recording
        asked = [bound_predictor(c, task.simulation.predictor, recording.core_scenario) for c in task.choices]
        return file_samples(recording, asked, task.every)
    except InterdriveError as error:
        return error
