"""Doing a batch: what is missing is claimed, done by worker processes or a Ray cluster, and stored as it ends."""

from __future__ import annotations

import math
import multiprocessing
import os
import time
from collections import Counter, deque
from contextlib import closing
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol

from interdrive.batches.job import KEEP, Finished, Job, agents_of, content_of, execute, failed, no_rows
from interdrive.batches.plan import Problem, planned
from interdrive.batches.pool import Pool, Task
from interdrive.batches.store import BatchFolder, recordings_in
from interdrive.config.plugins import DEFAULT_PLANNER
from interdrive.config.schema import settings_of
from interdrive.errors import InputError, InterdriveError
from interdrive.panel import NONE, PanelFolder, chosen_panel
from interdrive.storage import keep_inputs, resolved

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from interdrive.batches.plan import BatchPlan, RunSpec
    from interdrive.batches.pool import End
    from interdrive.batches.store import Done
    from interdrive.config.schema import SettingsSpec
    from interdrive.config.specs import PlannerSpecs, PredictorSpecs
    from interdrive.storage import ArrowTable

#: Where drives of the panel are stored in the folder of a batch.
_PANEL = "panel"

#: How often it is looked whether another batch has done the runs that it claimed [s].
_LOOK_EVERY = 0.5


@dataclass(frozen=True)
class Progress:
    """How far a batch is.

    Attributes:
        done: Runs that have ended, those of earlier calls not counted. total: Runs to do.
        failures: Runs among them that did not finish.
        text: What has just ended.
    """

    done: int
    total: int
    failures: int
    text: str


@dataclass(frozen=True)
class BatchSummary:
    """What a batch did.

    Attributes:
        folder: Where the results are.
        keys: Of all runs that were asked for.
        found: So many of them were there already.
        status: Number of runs by how they ended, including existing runs.
        seconds: Wall time of this call [s].
        notes: One line per thing the user should know.
        panel_notes: Those of them that concern a stored panel.
    """

    folder: Path
    keys: tuple[str, ...]
    found: int
    status: Mapping[str, int]
    seconds: float
    notes: tuple[str, ...] = field(default=())
    panel_notes: tuple[str, ...] = field(default=())

    @property
    def table(self) -> ArrowTable:
        """The rows of these runs; the columns are `interdrive.batches.COLUMNS`."""
        return self.select(None)

    def select(self, columns: Sequence[str] | None) -> ArrowTable:
        """Some columns of the rows of these runs; all if None. Of large batches a few take much less memory."""
        return BatchFolder.open(self.folder).table(columns, set(self.keys))


class Backend(Protocol):
    """Worker processes or a cluster that do tasks."""

    def run(self, function: Callable[[Any, int], Any], take: Callable[[str], Task[Any] | None]) -> Iterator[End[Any]]:
        """Does tasks until there are none and yields how they ended."""

    def close(self) -> None:
        """Ends what is still being done."""


def batch(
    paths: Iterable[str | Path] | str | Path,
    out: str | Path,
    *,
    planner: PlannerSpecs = DEFAULT_PLANNER,
    predictor: PredictorSpecs = "neural",
    agents: str | int = "all",
    traffic: str | None = None,
    alone: bool = False,
    listed: Mapping[str, Collection[int]] | None = None,
    seeds: int = 1,
    settings: SettingsSpec | None = None,
    workers: int | None = None,
    run_timeout: float = math.inf,
    memory: float = math.inf,
    keep: str = "none",
    panel: str | Path = NONE,
    retry: bool = False,
    ray: str | None = None,
    on_progress: Callable[[Progress], None] | None = None,
) -> BatchSummary:
    """Runs every combination of scenario, planner, predictor and seed that is not in the folder yet.

    Worker processes start new interpreters: a script that calls this needs `if __name__ == "__main__":`.

    Args:
        paths: CommonRoad files, folders of them, or names of shipped scenarios.
        out: Folder of the batch, new or existing.
        planner: Under test: one (see `interdrive.PlannerSpec`), several separated by commas or in a list, or a mapping
            from labels to planners.
        predictor: The same for predictors.
        agents: Agents under test: "all", or a maximum number of vehicles per scenario, chosen with the seed.
        traffic: Behaviour of vehicles that could be agents but are not under test: "recorded" or "replay" (the
            default), a native planner such as "velocity_adjusting" or "idm", or "same" (the planner under test). With
            all agents no vehicles are left and it is "same".
        alone: Simulate each agent under test in a run of its own, in which all others are traffic.
        listed: With `alone`: of each file, by the SHA-256 of its content, only these agents; None: all.
        seeds: Number of seeds, which choose agents: 0 to `seeds - 1`.
        settings: Settings, or a mapping of dotted names.
        workers: Number of processes; None: the number of cores. With Ray, the number of concurrent tasks; None: its
            CPUs.
        run_timeout: Time limit of a run [s].
        memory: Memory limit of a worker process [bytes].
        keep: Run folders to keep: "none", "failed" (an agent under test did not reach its goal) or "all".
        panel: Against what agents are scored: "none" (the run alone: absolute scores), "default" (four drivers drive in
            the place of each, once for all planners, stored in the folder `panel` of the batch), or the folder of a
            stored panel. Only with `alone`.
        retry: Repeat runs that did not finish.
        ray: Address of a Ray cluster ("auto": the cluster of this machine); None: worker processes.
        on_progress: Called whenever a run has ended.

    Returns:
        What was done; its `table` has the rows.

    Raises:
        InputError: An argument cannot be used; raised before anything is simulated.
        ResultsError: The folder cannot be used.
        MissingExtraError: Ray or a planner is not installed.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise SystemExit(1)  # a worker reads a script that calls this without a guard; the pool says so
    start = time.monotonic()
    _check(workers, run_timeout, memory, keep)
    if listed is not None and not alone:
        raise InputError("listed: agents are listed for runs of single agents; add alone")
    paths = [paths] if isinstance(paths, str | os.PathLike) else list(paths)
    drivers, stored = chosen_panel(panel)
    plan = planned(
        paths,
        planner=planner,
        predictor=predictor,
        agents=agents,
        traffic=traffic,
        alone=alone,
        seeds=seeds,
        settings=settings_of(settings),
        panel=drivers,
    )
    resolved(out)  # refused by its own name
    keep_inputs(recordings_in(out), {spec.path for spec in plan.specs})
    workers_max = workers or os.cpu_count() or 1
    if ray is None:
        backend: Backend = Pool(min(workers_max, len(plan.specs)), timeout_s=run_timeout, memory=memory)
    else:
        from interdrive.batches.ray import Cluster  # noqa: PLC0415 - optional

        backend = Cluster(ray, workers, timeout_s=run_timeout, memory=memory)
    with closing(backend), closing(BatchFolder.create(out)) as folder:
        if alone:
            plan = replace(plan, specs=_expanded(plan, folder, backend, listed, send=ray is not None))
        specs = {spec.key: spec for spec in plan.specs}
        if drivers and stored is None and ray is None:
            stored = PanelFolder.create(folder.path / _PANEL, drivers)
        before = folder.done()
        missing = [spec for key, spec in specs.items() if _is_missing(before.get(key), keep, retry=retry)]
        try:
            anew = _conduct(missing, folder, backend, keep, stored, send=ray is not None, on_progress=on_progress)
        finally:
            folder.tidy(now=True)
        done = folder.done()
        panel_notes = () if stored is None else stored.said_lacking(anew, len(missing), "runs")
        return BatchSummary(
            folder.path,
            tuple(specs),
            len(specs) - len(missing),
            Counter(done[key].status for key in specs),
            time.monotonic() - start,
            (*plan.notes, *panel_notes),
            panel_notes,
        )


#: More processes than this no machine has a use for.
_WORKERS_MAX = 1024


def _check(workers: int | None, run_timeout: float, memory: float, keep: str) -> None:
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int)):
        raise InputError(f"workers: expected a whole number, not {workers!r}")
    if workers is not None and not 1 <= workers <= _WORKERS_MAX:
        raise InputError(f"workers: expected at least 1 and at most {_WORKERS_MAX}, not {workers}")
    if not run_timeout > 0:
        raise InputError(f"run timeout: expected a positive number of seconds, not {run_timeout}")
    if not memory >= 2**20:
        raise InputError(f"memory: expected at least 1 MiB, not {memory} bytes")
    if keep not in KEEP:
        raise InputError(f"keep: expected one of {', '.join(KEEP)}, not {keep!r}")


def _is_missing(known: Done | None, keep: str, *, retry: bool) -> bool:
    if known is None:
        return True
    if known.status != "finished":
        return retry
    return not known.kept and (keep == "all" or (keep == "failed" and not known.arrived))


def _expanded(
    plan: BatchPlan,
    folder: BatchFolder,
    backend: Backend,
    listed: Mapping[str, Collection[int]] | None,
    *,
    send: bool,
) -> tuple[RunSpec, ...]:
    """A run per agent, of those `listed` alone. The agents are the same for all planners; workers find them."""
    asked: dict[tuple[str, str, int], list[RunSpec]] = {}
    for spec in plan.specs:
        asked.setdefault((spec.sha256 + spec.parts_sha256, spec.agents_label, spec.seed), []).append(spec)
    queue = iter([specs[0] for specs in asked.values()])
    answers: dict[tuple[str, str, int], tuple[int, ...] | Problem] = {}

    def take(_group: str) -> Task[Job] | None:
        spec = next(queue, None)
        return None if spec is None else Task(_job(spec, "none", None, send=send), spec.sha256)

    for end in backend.run(agents_of, take):
        spec = end.task.payload.spec
        answer = Problem(end.lost, f"its agents could not be determined: {_twice(end)}") if end.lost else end.value
        answers[spec.sha256 + spec.parts_sha256, spec.agents_label, spec.seed] = answer
    known = folder.done()
    found: list[RunSpec] = []
    for about, specs in asked.items():
        answer = answers[about]
        for spec in specs:
            # A run without particular agents, as long as they are not known.
            unspecified = spec.of_agents([])
            if isinstance(answer, Problem):
                found.append(unspecified.impossible(answer))
                continue
            if unspecified.key in known and folder.claim(unspecified.key):
                folder.store(unspecified.key, no_rows())
                folder.release(unspecified.key)
            own = answer if listed is None else [number for number in answer if number in listed.get(spec.sha256, ())]
            found += [spec.of_agents([number]) for number in own]
    return tuple(found)


class _Queue:
    """Runs that wait: first those of large scenarios, those of one scenario by one process as long as that helps."""

    def __init__(self, specs: Sequence[RunSpec], claim: Callable[[RunSpec], bool]) -> None:
        self._groups: dict[str, deque[RunSpec]] = {}
        for spec in sorted(specs, key=lambda spec: (-spec.size, spec.sha256)):
            self._groups.setdefault(spec.sha256, deque()).append(spec)
        self._untouched = deque(self._groups)
        self._begun: set[str] = set()
        self._claim = claim

    def take(self, group: str) -> RunSpec | None:
        """The next run that can be claimed, if possible of the scenario that the process knows already."""
        while self._groups:
            if group not in self._groups:
                group = self._other()
            self._begun.add(group)
            spec = self._groups[group].popleft()
            if not self._groups[group]:
                del self._groups[group]
            if self._claim(spec):
                return spec
        return None

    def _other(self) -> str:
        """An untouched scenario, or the one with most runs; then there are hardly more than processes."""
        while self._untouched:
            name = self._untouched.popleft()
            if name not in self._begun:
                return name
        return max(self._groups, key=lambda name: len(self._groups[name]))


def _conduct(
    missing: Sequence[RunSpec],
    folder: BatchFolder,
    backend: Backend,
    keep: str,
    stored: PanelFolder | None,
    *,
    send: bool,
    on_progress: Callable[[Progress], None] | None,
) -> list[str]:
    """Does the missing runs, waits for runs of another batch, and stores the results.

    Returns:
        Why drivers of a stored panel drove anew, for each run in which they did.
    """
    elsewhere: list[RunSpec] = []
    count = failures = 0
    anew: list[str] = []

    def claimed(spec: RunSpec) -> bool:
        """Whether this batch has claimed the run, and no other has done it in the meantime."""
        if not folder.claim(spec.key):
            elsewhere.append(spec)
            return False
        # The retry of a run is done once, however it ends.
        if not _is_missing(folder.stored_since(spec.key), keep, retry=False):
            folder.release(spec.key)
            report(spec, "done by another batch")
            return False
        return True

    def report(spec: RunSpec, status: str) -> None:
        nonlocal count
        count += 1
        if on_progress is not None:
            on_progress(Progress(count, len(missing), failures, f"{spec.scenario}, {spec.planner_label}: {status}"))

    def take(group: str) -> Task[Job] | None:
        spec = queue.take(group)
        return None if spec is None else Task(_job(spec, keep, stored, send=send), spec.sha256)

    waiting = list(missing)
    while waiting:
        queue = _Queue(waiting, claimed)
        for end in backend.run(execute, take):
            spec = end.task.payload.spec
            finished: Finished = failed(spec, end.lost, _twice(end), end.attempts) if end.lost else end.value
            folder.store(spec.key, finished)
            folder.release(spec.key)
            failures += finished.status not in ("finished", "refused")
            anew += [finished.driven_anew] if finished.driven_anew else []
            report(spec, finished.status)
            folder.tidy()
        waiting, elsewhere = elsewhere, []
        if waiting:
            time.sleep(_LOOK_EVERY)
    return anew


def _twice(end: End[Any]) -> str:
    times = {1: "once", 2: "twice"}.get(end.attempts, f"{end.attempts} times")
    return f"{end.why}, {times}"


def _job(spec: RunSpec, keep: str, stored: PanelFolder | None, *, send: bool) -> Job:
    """What a worker is told; one on another machine is sent the scenario, too."""
    if not send:
        return Job(spec, keep, stored=stored)
    try:
        return Job(spec, keep, content_of(spec), stored)
    except InterdriveError as error:
        return Job(spec.impossible(Problem("failed", str(error))), keep)
