"""A run and what you can do with it: evaluate, save, load, look at, hand to other tools."""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from copy import copy
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from interdrive.errors import InputError
from interdrive.files import commonroad_objects, run_document, run_tracks, write_osi
from interdrive.results import read_part, read_run, save
from interdrive.results.tables import TABLES
from interdrive.run import RunRecord
from interdrive.run.arrays import Tabular
from interdrive.run.assemble import recorded_traffic
from interdrive.storage import replacing, resolved
from interdrive.storage.html import html_table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Self

    from matplotlib.figure import Figure

    from interdrive.criticality import Criticality, CriticalitySettings
    from interdrive.files import CommonRoadObjects
    from interdrive.results import Results
    from interdrive.scenario import Scenario


__all__ = ["Run", "RunInterrupted", "RunPage", "load", "recorded_run", "reopen"]

T = TypeVar("T")


@dataclass(frozen=True, repr=False)
class Run(RunRecord):
    """A finished (or interrupted) simulation; its attributes are those of `interdrive.run.RunRecord`."""

    def __post_init__(self) -> None:
        # Tables are made from parts that know of no run, so that a run and its parts do not hold each other.
        bare = RunRecord(**{field.name: _unbound(getattr(self, field.name)) for field in fields(self)})
        for name, maker in TABLES.items():
            field = {"timing": "timings"}.get(name, name)
            if isinstance(part := getattr(bare, field, None), Tabular):
                bound = copy(part)
                object.__setattr__(bound, "_as_table", partial(maker, bare))
                object.__setattr__(self, field, bound)

    def __repr__(self) -> str:
        counts = Counter(self.outcomes.outcome)
        outcomes = ", ".join(f"{n} {outcome}" for outcome, n in counts.most_common()) or "no agents"
        seconds = (self.states.n_steps - 1) * self.scenario.dt
        return f"<Run of {self.scenario.name}: {outcomes}; {seconds:.1f} s{'' if self.finished else ', interrupted'}>"

    def _repr_html_(self) -> str:
        """The line of `repr` and the table of outcomes, for notebooks."""
        from html import escape  # noqa: PLC0415 - a long table of entities

        columns = ("agent_id", "planner", "outcome", "time_s", "partner_id", "impact_speed", "reason")
        return f"<p>{escape(repr(self))}</p>{html_table(columns, self.outcomes.to_arrow().to_pylist())}"

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
            folder: A new or empty folder, or the folder of another run.
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

        Args:
            participant_ids: Vehicles to evaluate; None: all agents.
            other_ids: The participants that count as others; None: all.
            settings: Parameters and switches of the measures.
            deceleration: Available deceleration of single vehicles by id [m/s²].
            threads: None: the number of cores. Results do not depend on it.

        Raises:
            InputError: An unknown id, or a setting out of its range.
        """
        from interdrive.criticality import evaluate  # noqa: PLC0415 - loaded when asked for

        return evaluate(
            self, participant_ids, other_ids=other_ids, settings=settings, deceleration=deceleration, threads=threads
        )

    def plot(
        self,
        kind: str = "run",
        *,
        agents: Sequence[int] | None = None,
        measures: Sequence[str] = ("ttc", "thw"),
        columns: int | None = None,
    ) -> Figure:
        """A matplotlib figure of the run, as wide as one or two columns of a paper.

        Args:
            kind: "run", "trajectories", "velocity", "criticality", "messages", or "scene@SECONDS" such as "scene@3.5".
            agents: Ids of the agents to draw; None: all.
            measures: With "criticality": names of the measures, one panel each.
            columns: 1 (88 mm) or 2 (180 mm); None: what suits the kind.

        Raises:
            InputError: An unknown kind, id or measure, or too many agents for lines in one figure.
        """
        from interdrive.plots import draw_figure  # noqa: PLC0415 - matplotlib

        return draw_figure(self, kind, agents=agents, measures=measures, columns=columns)

    def animation(self, path: str | Path, *, fps: float = 10.0) -> Path:
        """Writes a film of the run and returns its path.

        Args:
            path: File that ends in .gif or .mp4.
            fps: Frames per second.

        Raises:
            InputError: `fps` is not positive.
            ResultsError: Another ending, or a file that cannot be written.
            MissingExtraError: MP4 without ffmpeg on the PATH.
        """
        from interdrive.plots import animate_run  # noqa: PLC0415 - matplotlib

        animate_run(self, path, fps=fps)
        return Path(path)

    def show(self) -> RunPage:
        """The interactive report: inline in Jupyter, otherwise in your browser; returns the page.

        The run and its page go into a new folder for temporary files, which stays; `interdrive.report` writes a page
        where you want it.
        """
        from interdrive.report import write_run_report  # noqa: PLC0415 - loaded when asked for

        folder = Path(tempfile.mkdtemp(prefix="interdrive-")) / "run"
        self.save(folder)
        page = RunPage(write_run_report(folder))
        if (cell := _cell()) is not None:
            from IPython.display import display  # noqa: PLC0415 - there in Jupyter only

            display(page)
            page.shown_in = cell
        else:
            import webbrowser  # noqa: PLC0415

            webbrowser.open(page.path.as_uri())
        return page

    def to_commonroad(self) -> CommonRoadObjects:
        """The simulated world as `(scenario, planning_problem_set)` of commonroad-io; see `run_document`."""
        return commonroad_objects(run_document(self))

    def export(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Writes the traffic for other tools and returns the path; `read_source` reads it back.

        Args:
            path: File that ends in .csv (tracks, one row for each participant and time), or in .mcap or .osi (ground
                truth of the Open Simulation Interface, for which the extra `osi` is needed).
            overwrite: Replace a file that is there.

        Raises:
            InputError: Another ending, a file that is there, or the extra is not installed.
            ResultsError: It cannot be written.
        """
        target = resolved(path)
        if target.suffix.lower() not in (".csv", ".mcap", ".osi"):
            raise InputError(f"{path}: name a file that ends in .csv, .mcap or .osi")
        if target.exists() and not overwrite:
            raise InputError(f"{path}: exists; choose another name or overwrite=True")
        with replacing(target) as partial:
            if target.suffix.lower() == ".csv":
                partial.write_bytes(run_tracks(self))
            else:
                write_osi(self, partial)
        return Path(path)


class RunInterrupted(KeyboardInterrupt):
    """Ctrl-C during a simulation.

    Attributes:
        run: The run until the interruption, with `finished` False; `save` and everything else work.
    """

    def __reduce__(self) -> tuple[type[RunInterrupted], tuple[Run]]:
        return RunInterrupted, (self.run,)

    def __init__(self, run: Run) -> None:
        super().__init__(f"interrupted after {(run.states.n_steps - 1) * run.scenario.dt:.1f} s")
        self.run = run


class RunPage:
    """The page of a run; Jupyter shows it where it is the value of a cell, unless that cell has shown it already.

    Attributes:
        path: The file.
        shown_in: Number of the cell that has shown it; None: none.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.shown_in: int | None = None

    def __repr__(self) -> str:
        return f"<RunPage {self.path}>"

    def _repr_html_(self) -> str | None:
        if self.shown_in is not None and self.shown_in == _cell():
            return None
        from html import escape  # noqa: PLC0415 - a long table of entities

        page = escape(self.path.read_text(encoding="utf-8"), quote=True)
        return f'<iframe srcdoc="{page}" style="width: 100%; height: 720px; border: 0"></iframe>'


def _cell() -> int | None:
    """Number of the notebook's cell that is executed; None outside of notebooks."""
    # Other programs may have loaded these packages; only the shell of a notebook has a kernel.
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return int(shell.execution_count) if shell is not None and hasattr(shell, "kernel") else None


def _unbound(part: T) -> T:
    """A part of a run as it was before a run had it."""
    if not isinstance(part, Tabular):
        return part
    single = copy(part)
    vars(single).pop("_as_table", None)
    return single


def load(folder: str | Path) -> Run:
    """Loads the run that was saved in a folder; the same as `Run.load`.

    Args:
        folder: Folder that `save`, `interdrive run` or a batch wrote.

    Raises:
        ResultsError: The folder or one of its files is missing, damaged or of another format.
        InputError: The scenario cannot be read.
    """
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
    """The recorded traffic of a `scenario` as a run without agents."""
    return Run(**vars(recorded_traffic(scenario)))
