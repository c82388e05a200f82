"""One run of a batch, wherever it is done: its rows and, if wanted, its run folder, as bytes."""

from __future__ import annotations

import hashlib
import io
import tarfile
import tempfile
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive.batches.columns import COLUMNS, NOT_ARRIVED, failure_row, finished_rows
from interdrive.batches.dataset import encoded
from interdrive.batches.plan import Problem, parts_hash
from interdrive.errors import InputError, InterdriveError
from interdrive.files import content_of_file, content_sha256, open_scenario, scenario_parts
from interdrive.foreign import failure
from interdrive.panel import NONE, PanelFolder, score, why_driven_anew
from interdrive.planners import RECORDED_PATH
from interdrive.results import save
from interdrive.scenario.agents import select
from interdrive.scenario.native import core_road
from interdrive.scoring import save_score
from interdrive.simulation import reachable_agents, simulate
from interdrive.storage import arrow_table

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.batches.plan import RunSpec
    from interdrive.config.agent_config import PlannersSpec
    from interdrive.config.specs import PlannerSpec
    from interdrive.runs import Run
    from interdrive.scenario import Scenario
    from interdrive.scenario.agents import Agent
    from interdrive.scoring import Score

#: Which run folders are kept: none, those in which an agent under test did not arrive, or all.
KEEP = ("none", "failed", "all")


@dataclass(frozen=True)
class Finished:
    """What a run leaves behind.

    Attributes:
        status: One of `interdrive.batches.columns.STATUS`.
        error: Why it did not finish.
        rows: Its rows of the data set, as a Parquet file.
        recording: Its run folder as a tar archive; empty if it is not kept.
        outcomes: Of the agents under test.
        driven_anew: Why drivers of the panel drove although a panel is stored; "" if they did not.
    """

    status: str
    error: str
    rows: bytes
    recording: bytes = b""
    outcomes: tuple[str, ...] = ()
    driven_anew: str = ""


@dataclass(frozen=True)
class Job:
    """What a process is told to do.

    Attributes:
        spec: The run.
        keep: One of `KEEP`.
        content: Content of the scenario file and of files that belong to it, by name; empty: they lie where they were
            found.
        stored: Where the drives of the panel are stored.
    """

    spec: RunSpec
    keep: str
    content: Mapping[str, bytes] | None = None
    stored: PanelFolder | None = None


#: The scenario that was read last: runs of the same scenario follow each other.
_AT_HAND: dict[str, Scenario] = {}


def execute(job: Job, attempts: int) -> Finished:
    """Does one run with one thread. Failures are part of its result; it raises no exception."""
    spec = job.spec
    if spec.problem is not None:
        return failed(spec, *spec.problem, attempts)
    try:
        return _finished(job, attempts)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - a run that fails is a row, not the end
        return failed(spec, *_problem(error), attempts)


def _problem(error: BaseException) -> Problem:
    """Status and reason of a failure."""
    if isinstance(error, InterdriveError):
        return Problem("refused" if isinstance(error, InputError) else "failed", str(error))
    return Problem("failed", failure(error))


def failed(spec: RunSpec, status: str, error: str, attempts: int) -> Finished:
    """The result of a run that did not finish."""
    return Finished(status, " ".join(error.split()), encoded(failure_row(spec, status, error, attempts)))


def no_rows() -> Finished:
    """Empty rows, which replace rows that are no longer valid."""
    return Finished("", "", encoded(arrow_table(COLUMNS, {column.name: [] for column in COLUMNS})))


def agents_of(job: Job, _attempts: int) -> tuple[int, ...] | Problem:
    """Ids of the agents that a run would test, or why there are none."""
    spec = job.spec
    if spec.problem is not None:
        return spec.problem
    try:
        return _ids(spec, read_scenario_of(job)[0])
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - likewise
        return _problem(error)


def _finished(job: Job, attempts: int) -> Finished:
    spec = job.spec
    scenario, read_seconds = read_scenario_of(job)
    start = time.perf_counter()
    run, under_test = simulated(spec, scenario)
    criticality = run.criticality(threads=1)
    panel = NONE if not spec.panel else job.stored if job.stored is not None else spec.panel
    scores = score(run, sorted(under_test - scenario.overlapping), panel=panel, trust=True)
    run_seconds = time.perf_counter() - start
    ended = zip(run.outcomes.agent_id.tolist(), run.outcomes.outcome, strict=True)
    outcomes = tuple(outcome for number, outcome in ended if number in under_test)
    kept = job.keep == "all" or (job.keep == "failed" and any(outcome in NOT_ARRIVED for outcome in outcomes))
    rows = finished_rows(
        spec,
        run,
        criticality,
        scores,
        under_test,
        attempts=attempts,
        read_seconds=read_seconds,
        run_seconds=run_seconds,
        kept=kept,
    )
    archive = _archive(run, scores) if kept else b""
    return Finished("finished", "", encoded(rows), archive, outcomes, why_driven_anew(scores.notes))


def read_scenario_of(job: Job) -> tuple[Scenario, float]:
    """The scenario, and how long reading it took [s].

    Raises:
        InputError: It cannot be read.
        InterdriveError: It is gone, or has changed since the batch was planned: its key is that of another content.
    """
    spec = job.spec
    source, recording = spec.settings.source, spec.settings.recording
    opened = partial(open_scenario, raw=recording.raw, start=recording.start, source=source)
    key = f"{spec.sha256}{spec.parts_sha256}{recording}{source.texts()}"
    if key in _AT_HAND:
        return _AT_HAND[key], 0.0
    start = time.perf_counter()
    if job.content is None:
        if not Path(spec.path).is_dir():
            content_of(spec)
        scenario = opened(Path(spec.path))
    else:
        with tempfile.TemporaryDirectory() as folder:
            for name, content in job.content.items():
                (Path(folder) / name).write_bytes(content)
            copied = opened(Path(folder) / Path(spec.path).name)
            scenario = replace(copied, path=Path(spec.path))
    found = scenario.sha256 if scenario.source is None else content_sha256(Path(spec.path))
    if found != spec.sha256:
        raise InterdriveError(f"{spec.path}: the file has changed since the batch was started")
    _AT_HAND.clear()
    _AT_HAND[key] = scenario
    return scenario, time.perf_counter() - start


def simulated(spec: RunSpec, scenario: Scenario) -> tuple[Run, set[int]]:
    """The run, and the ids of the agents under test."""
    driven = partial(simulate, scenario, predictor=spec.predictor, settings=spec.settings, seed=spec.seed, threads=1)
    if spec.agents == "all":
        run = driven(agents="all", planner=spec.planner)
        return run, {agent.id for agent in run.agents if agent.origin != "generated"} - _unable(spec, run)
    ids, others = _ids(spec, scenario), []
    recorded = set(scenario.obstacles.ids.tolist())
    follows = spec.planner.planner.native in RECORDED_PATH
    if follows and ids and not recorded.intersection(ids):
        raise InputError(f"no agent under test has a recording for planner {spec.planner_label}")
    if spec.traffic != "recorded":
        able = _able(spec, scenario, "all")
        # A planning problem without a recorded vehicle is not part of the traffic: it has no recording to replay.
        others = [agent.id for agent in able if agent.id not in ids and agent.id in recorded]
    planner: PlannersSpec = spec.planner
    if spec.traffic not in ("recorded", "same"):
        by_agent: dict[int | str, PlannerSpec] = dict.fromkeys(
            (n for n in ids if not follows or n in recorded), spec.planner
        )
        planner = by_agent | {"default": spec.traffic}
    run = driven(agents=[*ids, *others], planner=planner)
    return run, set(ids) - _unable(spec, run)


def _unable(spec: RunSpec, run: Run) -> set[int]:
    """Agents that another planner drives, because the planner under test follows recordings and they have none."""
    if spec.planner.planner.native not in RECORDED_PATH:
        return set()
    drivers = zip(run.outcomes.agent_id.tolist(), run.outcomes.planner, strict=True)
    return {number for number, name in drivers if name not in RECORDED_PATH}


def _ids(spec: RunSpec, scenario: Scenario) -> tuple[int, ...]:
    """Ids of the agents under test; of a number at most as many as there can be."""
    if isinstance(spec.agents, tuple):
        return spec.agents
    if spec.agents == "reachable":
        return tuple(reachable_agents(scenario, spec.settings))
    found = _able(spec, scenario, spec.agents)
    return tuple(agent.id for agent in found)


def _able(spec: RunSpec, scenario: Scenario, wanted: str | int) -> list[Agent]:
    """Agents of the scenario: all, or at most a number of them."""
    road = core_road(scenario, spec.settings.road)

    def chosen(agents: str | int) -> list[Agent]:
        return select(
            scenario,
            road,
            agents,
            agent_settings=spec.settings.agents,
            goal_settings=spec.settings.goal,
            max_steps=spec.settings.step.steps_at_most(scenario),
            seed=spec.seed,
        )[0]

    if wanted == "all":
        return chosen("all")
    try:
        return chosen(wanted)
    except InputError:
        found = chosen("all")
        if len(found) > int(wanted):
            raise
        return found


def _archive(run: Run, scores: Score) -> bytes:
    """The run folder as a tar archive, with the scores of the agents under test."""
    archive = io.BytesIO()
    with tempfile.TemporaryDirectory() as folder, tarfile.open(fileobj=archive, mode="w") as tar:
        saved = save(run, Path(folder) / "run")
        save_score(scores, saved)
        for path in sorted(saved.iterdir()):
            tar.add(path, arcname=path.name)
    return archive.getvalue()


def content_of(spec: RunSpec) -> dict[str, bytes]:
    """Content of the scenario file and of files that belong to it, by name, unchanged.

    Raises:
        InterdriveError: One is gone, or has changed since the batch was planned.
    """
    path = Path(spec.path)
    try:
        content = {part.name: content_of_file(part) for part in (path, *scenario_parts(path))}
    except OSError as cause:
        raise InterdriveError(f"{spec.path}: cannot be read: {cause.strerror or cause}") from cause
    own, *others = content.values()
    if hashlib.sha256(own).hexdigest() != spec.sha256 or parts_hash(others) != spec.parts_sha256:
        raise InterdriveError(f"{spec.path}: the file has changed since the batch was started")
    return content
