"""A run and what you can do with it: evaluate, save, load."""

from __future__ import annotations

from typing import TYPE_CHECKING

from interdrive.results.folder import save
from interdrive.results.reader import read_part, read_run
from interdrive.run import RunRecord
from interdrive.run.assemble import recorded_traffic

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path
    from typing import Self

    from interdrive.criticality import Criticality, CriticalitySettings
    from interdrive.results.folder import Results
    from interdrive.scenario import Scenario


class Run(RunRecord):
    """A finished (or interrupted) simulation; its attributes are those of `interdrive.run.RunRecord`."""

    @classmethod
    def load(cls, folder: str | Path) -> Self:
        """The run that was saved in a folder, with everything that `save` wrote.

        The scenario is the simulated file if it still exists unchanged, otherwise scenario.xml in the folder.

        Raises:
            ResultsError: The folder or one of its files is missing, damaged or of another format.
            InputError: The scenario cannot be read.
        """
        return cls(**vars(read_run(folder)))

    def save(self, folder: str | Path, *, overwrite: bool = False) -> Path:
        """Writes the run folder, whole or not at all, and returns its path; `load` is the inverse.

        Args:
            folder: New or empty folder, or one that holds another run.
            overwrite: Replace the other run. A folder with other contents is never touched.

        Raises:
            ResultsError: The folder cannot be used or written.
        """
        return save(self, folder, overwrite=overwrite)

    def criticality(
        self,
        participant_ids: Sequence[int] | None = None,
        *,
        other_ids: Sequence[int] | None = None,
        settings: CriticalitySettings | None = None,
        deceleration: Mapping[int, float] | None = None,
        threads: int | None = None,
    ) -> Criticality:
        """All criticality measures at every time step, of all agents by default.

        Arguments and errors are those of `interdrive.criticality.evaluate`.
        """
        from interdrive.criticality import evaluate  # noqa: PLC0415 - only who asks pays for it

        return evaluate(
            self, participant_ids, other_ids=other_ids, settings=settings, deceleration=deceleration, threads=threads
        )


def load(folder: str | Path) -> Run:
    """The run that was saved in a folder; as `Run.load`."""
    return Run.load(folder)


def reopen(folder: str | Path, results: Results | None = None) -> Run:
    """A run folder for evaluation and figures: states, outcomes and scenario, without plans and timings.

    Args:
        folder: Folder written by `save`.
        results: Its contents, if they were read before.

    Raises:
        ResultsError: The folder or one of its files is missing, damaged or of another format.
        InputError: The scenario cannot be read.
    """
    return Run(**vars(read_part(folder, results)))


def recorded_run(scenario: Scenario) -> Run:
    """The recorded traffic of a scenario as a run without agents."""
    return Run(**vars(recorded_traffic(scenario)))
