"""Reads a run folder back into arrays."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from interdrive.errors import InputError
from interdrive.files import content_of_file, later, read_scenario, read_source
from interdrive.results.folder import read_results
from interdrive.run import (
    AgentRecord,
    Agreements,
    Demand,
    Hits,
    Messages,
    Orders,
    Outcomes,
    Plans,
    Profile,
    RecordedCandidates,
    RecordedPredictions,
    RunRecord,
    States,
    SumoParticipants,
    Timings,
    Views,
    Violations,
)
from interdrive.scenario import GoalState, Shape
from interdrive.storage import Record
from interdrive.storage.arrow_arrays import values_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.array_types import Ints
    from interdrive.results.folder import Results
    from interdrive.results.information import RunInformation, SourceInformation
    from interdrive.scenario import Scenario
    from interdrive.storage import ArrowTable

Part = TypeVar("Part", bound=RunRecord)
Rows = TypeVar("Rows", bound=Record)


def read_part(folder: str | Path, results: Results | None = None) -> RunRecord:
    """Scenario, states and outcomes of a run folder; settings, plans, timings and what `record.*` keeps are left out.

    The scenario is the simulated file if it still exists unchanged, otherwise scenario.xml in the folder.

    Args:
        folder: Folder written by `results.save`.
        results: Its contents, if they were read before.

    Raises:
        ResultsError: if the folder or one of its files is missing, damaged or of another format.
        InputError: if the scenario cannot be read.
    """
    results = results or read_results(folder)
    info = results.info
    scenario = _scenario_of(Path(folder), info)
    states, outcomes = _states(results, scenario), Outcomes.of(results.outcomes)
    facts = {agent["id"]: agent for agent in info.get("agents", ())}
    part = _run(scenario, states, outcomes, info["digest"], tuple(info["notes"]), facts)
    return replace(part, finished=info.get("finished", True))


def read_run(folder: str | Path) -> RunRecord:
    """Everything that `results.save` wrote.

    Raises:
        ResultsError: if the folder or one of its files is missing, damaged or of another format.
        InputError: if the scenario cannot be read.
    """
    results = read_results(folder)
    return replace(
        with_cooperation(with_routes(read_part(folder, results), results), results),
        plans=stored_plans(results),
        timings=Timings.of(results.timing),
        views=_rows(Views, results.views),
        predictions=None if results.predictions is None else _predictions(results.predictions),
        candidates=None if results.candidates is None else _candidates(results.candidates),
        orders=_rows(Orders, results.orders),
        profile=_rows(Profile, results.profile),
        demand=_rows(Demand, results.demand),
        sumo=_rows(SumoParticipants, results.sumo),
        cooperation=results.info.get("cooperation"),
    )


def with_routes(part: RunRecord, results: Results) -> RunRecord:
    """`part`, as `read_part` gave it, with what scores need of `results`: settings, routes, violations, hits."""
    owner, x, y = (values_of(results.routes[name]) for name in ("agent_id", "x", "y"))
    paths = np.stack([x, y], axis=1)
    return replace(
        part,
        settings=results.info["settings"],
        agents=tuple(replace(agent, reference_path=paths[owner == agent.id]) for agent in part.agents),
        violations=_rows(Violations, results.violations),
        hits=_rows(Hits, results.hits),
    )


def with_cooperation(part: Part, results: Results) -> Part:
    """`part`, as `read_part` gave it, with messages and agreements of `results`."""
    return replace(part, messages=_rows(Messages, results.messages), agreements=_rows(Agreements, results.agreements))


def with_demand(part: RunRecord, results: Results) -> RunRecord:
    """`part`, as `read_part` gave it, with the generated traffic of `results` and its settings."""
    return replace(part, settings=results.info["settings"], demand=_rows(Demand, results.demand))


def sumo_names(results: Results) -> dict[int, str]:
    """What SUMO calls the participants that it drove, by id; empty without SUMO.

    Args:
        results: Of the run.
    """
    found = _rows(SumoParticipants, results.sumo)
    return {} if found is None else dict(zip(found.participant_id.tolist(), found.name, strict=True))


def _rows(kind: type[Rows], table: ArrowTable | None) -> Rows | None:
    """The record of a table with a row for each of its own; None if there is no table."""
    return None if table is None else kind.of(table)


def _predictions(table: ArrowTable) -> RecordedPredictions:
    row, point, shape = _blocks(table)
    covariance = np.full((*shape, 2, 2), np.nan)
    for name, axes in (("variance_x", [(0, 0)]), ("covariance_xy", [(0, 1), (1, 0)]), ("variance_y", [(1, 1)])):
        for i, j in axes:
            covariance[row, point, i, j] = values_of(table[name])
    return RecordedPredictions.gathered(table, row, point, shape, covariance=covariance)


def _candidates(table: ArrowTable) -> RecordedCandidates:
    return RecordedCandidates.gathered(table, *_blocks(table))


def _blocks(table: ArrowTable) -> tuple[Ints, Ints, tuple[int, int]]:
    """Row and point of each row of a table in which all rows of the record have the same points; their numbers."""
    n, n_points = table.num_rows, len(np.unique(values_of(table["point"])))
    place = np.arange(n)
    return place // max(1, n_points), place % max(1, n_points), (n // max(1, n_points), n_points)


def stored_plans(results: Results) -> Plans:
    """The plans of a run folder as arrays; empty if the folder has none."""
    point = values_of(results.plans["point"])
    row = np.cumsum(point == 0) - 1
    return Plans.gathered(results.plans, row, point, (int(row.max(initial=-1)) + 1, int(point.max(initial=-1)) + 1))


def _scenario_of(folder: Path, info: RunInformation) -> Scenario:
    said = info.get("settings", {}).get("settings", {}).get("recording.start", 0)
    start = said if isinstance(said, int) else 0
    found = _simulated_file(info)
    if found is not None:
        return later(found, start) if start else found
    # The file was moved away; the folder has a copy of the road.
    return replace(read_scenario(folder / "scenario.xml", raw=True), start=start)


def _simulated_file(info: RunInformation) -> Scenario | None:
    """The file that was simulated, if it is there and unchanged."""
    stored, source = info["scenario"], info.get("source")
    if stored["path"] is None:
        return None
    path = Path(stored["path"])
    if source is not None:
        return source_again(path, source, info)
    try:
        if hashlib.sha256(content_of_file(path)).hexdigest() != stored["sha256"]:
            return None
    except OSError:
        return None
    # Runs from before recordings were repaired do not say it.
    said = info.get("settings", {}).get("settings", {})
    return read_scenario(path, raw=bool(said.get("recording.raw", True)))


#: What an agent has that had not started when the run was stopped: it has no state.
_NOT_STARTED = {"kinds": "unknown", "is_agent": True, "length": 0.0, "width": 0.0}


def _states(results: Results, scenario: Scenario) -> States:
    table = results.states
    there, time_step = (values_of(table[name]) for name in ("participant_id", "time_step"))
    ids = np.union1d(there, values_of(results.outcomes["agent_id"]))
    first = int(time_step.min(initial=0)) if not len(there) else int(time_step.min())
    row, step = np.searchsorted(ids, there), time_step - first
    shape = len(ids), int(step.max(initial=-1)) + 1
    valid = np.zeros(shape, dtype=np.bool_)
    valid[row, step] = True
    return States.gathered(
        table,
        row,
        step,
        shape,
        _NOT_STARTED,
        participant_id=ids,
        first_time_step=first,
        is_static=np.isin(ids, scenario.obstacles.ids[scenario.obstacles.is_static]),
        valid=valid,
    )


def _run(
    scenario: Scenario,
    states: States,
    outcomes: Outcomes,
    digest: str,
    notes: tuple[str, ...],
    facts: Mapping[int, Mapping[str, Any]] | None = None,
) -> RunRecord:
    """A run without plans and timings; `facts` are the entries of agents in run.json, by id."""
    known = facts or {}
    rows = dict(zip(states.participant_id.tolist(), states.valid, strict=True))
    agents = tuple(
        AgentRecord(
            id=number,
            planner=planner,
            origin=str(known.get(number, {}).get("origin", "recorded")),
            # It may have replayed before, or waited for room to enter.
            start_time_step=max(
                states.first_time_step + int(rows[number].argmax()) if rows[number].any() else 0,
                known.get(number, {}).get("start_time_step", 0),
            ),
            goal=tuple(_goal_state(said) for said in known.get(number, {}).get("goal", ())),
            route_lanelet_ids=tuple(known.get(number, {}).get("route_lanelet_ids", ())),
            reference_path=np.empty((0, 2)),
        )
        for number, planner in zip(outcomes.agent_id.tolist(), outcomes.planner, strict=True)
    )
    return RunRecord(scenario, {}, agents, outcomes, states, Plans.empty(), Timings.empty(), notes, digest)


def _goal_state(said: Mapping[str, Any]) -> GoalState:
    """An alternative of a goal from run.json."""
    speeds, headings = said["velocity"], said["orientation"]
    first, last = said["time_step"]
    return GoalState(
        areas=tuple(_area(area) for area in said["areas"]),
        lanelet_ids=tuple(said["lanelet_ids"]),
        time_step=(first, last),
        velocity=None if speeds is None else (float(speeds[0]), float(speeds[1])),
        orientation=None if headings is None else (float(headings[0]), float(headings[1])),
    )


def _area(said: Mapping[str, Any]) -> Shape:
    """A goal area from run.json."""
    given = {name: value for name, value in said.items() if name not in ("vertices", "members", "center")}
    vertices = np.array(said.get("vertices", ()), dtype=np.float64).reshape(-1, 2)
    members = tuple(_area(member) for member in said.get("members", ()))
    return Shape(**given, vertices=vertices, members=members, center=tuple(said.get("center", (0.0, 0.0))))


def source_again(path: Path, source: SourceInformation, info: RunInformation) -> Scenario | None:
    """The scenario of files of another format, read again with the options of the run.

    Args:
        path: Where the file or folder is now.
        source: What run.json says of it.
        info: The contents of run.json.

    Returns:
        The scenario; None: a file is gone, or is not what it was.
    """
    try:
        said = info["settings"]["settings"]
        found = read_source(path, raw=bool(said.get("recording.raw", False)), **dict(source["options"]))
    except InputError:
        return None
    hashes = [file["sha256"] for file in source["files"]]
    known = found.source
    return found if known is not None and [sha256 for _, sha256 in known.files] == hashes else None
