"""Reads a run folder back into arrays."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from interdrive.files import content_of_file, read_scenario
from interdrive.results.folder import read_results
from interdrive.run import (
    PLAN_STATUS,
    SERVICES,
    AgentRecord,
    Agreements,
    Messages,
    Orders,
    Outcomes,
    Plans,
    RecordedCandidates,
    RecordedPredictions,
    RunRecord,
    States,
    Timings,
    Views,
    Violations,
)
from interdrive.run.assemble import no_plans, no_timings
from interdrive.scenario import STATE_FIELDS, GoalState, Shape

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from interdrive.results.folder import Results
    from interdrive.results.information import RunInformation
    from interdrive.scenario import Scenario
    from interdrive.storage import ArrowTable

    Ints = NDArray[np.int64]

Record = TypeVar("Record", bound=RunRecord)


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
    states, outcomes = _states(results, scenario), _outcomes(results)
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
        timings=_timings(results),
        views=None if results.views is None else Views(**_columns(results.views)),
        predictions=None if results.predictions is None else _predictions(_columns(results.predictions)),
        candidates=None if results.candidates is None else _candidates(_columns(results.candidates)),
        orders=None if results.orders is None else _orders(_columns(results.orders)),
        cooperation=results.info.get("cooperation"),
    )


def with_routes(part: RunRecord, results: Results) -> RunRecord:
    """`part`, as `read_part` gave it, with settings, routes and violations of `results`: all that scores need."""
    routes = _columns(results.routes)
    paths = np.stack([routes["x"], routes["y"]], axis=1)
    return replace(
        part,
        settings=results.info["settings"],
        agents=tuple(replace(agent, reference_path=paths[routes["agent_id"] == agent.id]) for agent in part.agents),
        violations=None if results.violations is None else _violations(_columns(results.violations)),
    )


def with_cooperation(part: Record, results: Results) -> Record:
    """`part`, as `read_part` gave it, with messages and agreements of `results`."""
    return replace(
        part,
        messages=None if results.messages is None else _messages(_columns(results.messages)),
        agreements=None if results.agreements is None else _agreements(_columns(results.agreements)),
    )


def _columns(table: ArrowTable) -> dict[str, Any]:
    return {name: table[name].to_numpy(zero_copy_only=False) for name in table.column_names}


def _violations(column: dict[str, Any]) -> Violations:
    ids = {name: _ids(column[name]) for name in ("lanelet_id", "partner_id")}
    texts = {name: tuple(column[name].tolist()) for name in ("source", "rule")}
    return Violations(**{**column, **texts, **ids})


def _orders(column: dict[str, Any]) -> Orders:
    return Orders(**{**column, "kind": tuple(column["kind"].tolist()), "by_id": _ids(column["by_id"])})


def _messages(column: dict[str, Any]) -> Messages:
    nulls = {name: _ids(column[name]) for name in ("receiver_id", "arrived")}
    service = np.array([SERVICES.index(name) for name in column["service"]], dtype=np.int64)
    return Messages(**{**column, **nulls, "service": service})


def _agreements(column: dict[str, Any]) -> Agreements:
    return Agreements(**{**column, "going_id": _ids(column["going_id"])})


def _ids(column: NDArray[Any]) -> NDArray[np.int64]:
    """Integers, -1 where there is none."""
    return np.nan_to_num(column.astype(np.float64), nan=-1.0).astype(np.int64)


def _timings(results: Results) -> Timings:
    column = _columns(results.timing)
    return Timings(column["time_step"], tuple(column["phase"].tolist()), column["seconds"])


def _blocks(column: Mapping[str, Any]) -> tuple[Ints, dict[str, Any]]:
    """The points that every row of a prediction or candidate has, and the columns with shape (rows, points)."""
    points = np.unique(column["point"])
    return points, {name: values.reshape(-1, max(1, len(points))) for name, values in column.items()}


def _predictions(column: Mapping[str, Any]) -> RecordedPredictions:
    points, table = _blocks({**column, "sender_id": _ids(column["sender_id"])})
    xx, xy, yy = (table[name] for name in ("variance_x", "covariance_xy", "variance_y"))
    names = ("time_step", "participant_id", "sender_id", "age", "mode", "probability")
    return RecordedPredictions(
        point=points,
        **{name: table[name][:, 0] for name in names},
        x=table["x"],
        y=table["y"],
        covariance=np.stack([np.stack([xx, xy], axis=-1), np.stack([xy, yy], axis=-1)], axis=-2),
    )


def _candidates(column: Mapping[str, Any]) -> RecordedCandidates:
    points, table = _blocks(column)
    return RecordedCandidates(
        point=points,
        **{name: table[name][:, 0] for name in ("time_step", "agent_id", "cost", "chosen")},
        rejection=tuple(table["rejection"][:, 0].tolist()),
        x=table["x"],
        y=table["y"],
    )


def stored_plans(results: Results) -> Plans:
    """The plans of a run folder as arrays; empty if the folder has none."""
    table = results.plans
    column = _columns(table)
    starts = column["point"] == 0
    row = np.cumsum(starts) - 1
    shape = int(starts.sum()), int(column["point"].max(initial=-1)) + 1

    def filled(name: str) -> Any:  # noqa: ANN401 - array of numbers
        values = np.full(shape, np.nan)
        values[row, column["point"]] = column[name]
        return values

    return Plans(
        time_step=column["time_step"][starts],
        agent_id=column["agent_id"][starts],
        status=np.array([PLAN_STATUS.index(name) for name in column["status"][starts].tolist()], dtype=np.int64),
        cost=column["cost"][starts].astype(np.float64),
        **{name: filled(name) for name in STATE_FIELDS[:5]},
        rejection=tuple(column["rejection"][starts].tolist()),
        **{
            name: column[name][starts].astype(np.float64)
            for name in ("rejection_x", "rejection_y", "rejection_overhang")
        },
    )


def _scenario_of(folder: Path, info: RunInformation) -> Scenario:
    stored = info["scenario"]
    if stored["path"] is not None:
        path = Path(stored["path"])
        try:
            if hashlib.sha256(content_of_file(path)).hexdigest() == stored["sha256"]:
                # Runs from before recordings were repaired do not say it.
                said = info.get("settings", {}).get("settings", {})
                return read_scenario(path, raw=bool(said.get("recording.raw", True)))
        except OSError:
            pass  # moved away; the folder has a copy of the road
    return read_scenario(folder / "scenario.xml", raw=True)


def _states(results: Results, scenario: Scenario) -> States:
    table = results.states
    column = _columns(table)
    # Agents that had not started when the run was stopped have no state.
    ids = np.union1d(column["participant_id"], results.outcomes["agent_id"].to_numpy())
    row = np.searchsorted(ids, column["participant_id"])
    there, place = np.unique(row, return_index=True)
    first = int(column["time_step"].min(initial=0)) if not len(row) else int(column["time_step"].min())
    step = column["time_step"] - first
    shape = (len(ids), int(step.max(initial=-1)) + 1)
    valid = np.zeros(shape, dtype=np.bool_)
    valid[row, step] = True

    def filled(name: str) -> Any:  # noqa: ANN401 - array of numbers
        values = np.full(shape, np.nan)
        values[row, step] = column[name]
        return values

    def of_participant(name: str, absent: object) -> Any:  # noqa: ANN401 - array
        values = np.full(len(ids), absent, dtype=column[name].dtype)
        values[there] = column[name][place]
        return values

    standing = set(scenario.obstacles.ids[scenario.obstacles.is_static].tolist())
    return States(
        participant_id=ids,
        kinds=tuple(of_participant("kind", "unknown").tolist()),
        first_time_step=first,
        is_agent=of_participant("is_agent", absent=True).astype(np.bool_),
        is_static=np.array([number in standing for number in ids.tolist()], dtype=np.bool_),
        length=of_participant("length", 0.0),
        width=of_participant("width", 0.0),
        **{name: filled(name) for name in STATE_FIELDS},
        valid=valid,
    )


def _outcomes(results: Results) -> Outcomes:
    table = results.outcomes
    partner = [-1 if number is None else number for number in table["partner_id"].to_pylist()]
    return Outcomes(
        agent_id=table["agent_id"].to_numpy(),
        planner=tuple(table["planner"].to_pylist()),
        outcome=tuple(table["outcome"].to_pylist()),
        time_step=table["time_step"].to_numpy(),
        partner_id=np.array(partner, dtype=np.int64),
        off_road=table["off_road"].to_numpy(zero_copy_only=False),
        impact_speed=table["impact_speed"].to_numpy(zero_copy_only=False),
        off_lanelets=table["off_lanelets"].to_numpy(zero_copy_only=False),
        off_lanelets_s=table["off_lanelets_s"].to_numpy(zero_copy_only=False),
        message=tuple(table["message"].to_pylist()),
        reason=tuple(table["reason"].to_pylist()),
        traceback=tuple(table["traceback"].to_pylist()),
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
            start_time_step=states.first_time_step + int(rows[number].argmax())
            if rows[number].any()
            else known.get(number, {}).get("start_time_step", 0),
            goal=tuple(_goal_state(said) for said in known.get(number, {}).get("goal", ())),
            route_lanelet_ids=tuple(known.get(number, {}).get("route_lanelet_ids", ())),
            reference_path=np.empty((0, 2)),
        )
        for number, planner in zip(outcomes.agent_id.tolist(), outcomes.planner, strict=True)
    )
    return RunRecord(scenario, {}, agents, outcomes, states, no_plans(), no_timings(), notes, digest)


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
