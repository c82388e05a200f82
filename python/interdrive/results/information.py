"""The contents of run.json: all information needed to identify and to repeat a run."""

from __future__ import annotations

import os
import platform
from functools import cache
from typing import TYPE_CHECKING, Any, TypedDict, cast

import numpy as np

from interdrive.config.binding import flatten
from interdrive.config.plugins import DEFAULT_PLANNER
from interdrive.config.schema import SimulationSettings
from interdrive.errors import ResultsError
from interdrive.results.run_json import check_information
from interdrive.storage.origin import Origin
from interdrive.storage.reading import read_json
from interdrive.storage.writing import json_text, one_line

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from interdrive.run import AgentRecord, Json, RunRecord, RunSettings
    from interdrive.scenario import ScenarioSource, Shape

#: Version of the folder's layout, written to run.json; increased when a column is added or removed, or changes name or
#: meaning.
FORMAT = 4


class ScenarioInformation(TypedDict):
    """The simulated scenario: `path` is None if it was made in Python, `sha256` that of its content, `dt` in s."""

    name: str
    benchmark_id: str
    path: str | None
    sha256: str
    dt: float
    notes: list[str]


class FileInformation(TypedDict):
    """A file that was read."""

    name: str
    sha256: str


class SourceInformation(TypedDict):
    """Files of another format from which the scenario was made, and the options that were not the defaults."""

    format: str
    files: list[FileInformation]
    options: Mapping[str, str]


class GoalInformation(TypedDict):
    """One alternative of a goal: first and last admissible time step, intervals of speed [m/s] and heading [rad]."""

    areas: list[Mapping[str, Json]]
    lanelet_ids: list[int]
    time_step: list[int]
    velocity: list[float] | None
    orientation: list[float] | None


class AgentInformation(TypedDict):
    """Constant properties of one agent; `goal` are its alternatives."""

    id: int
    origin: str
    start_time_step: int
    goal: list[GoalInformation]
    route_lanelet_ids: list[int]


class SoftwareInformation(TypedDict):
    """What a file of results was made with."""

    versions: Mapping[str, str | None]
    platform: Mapping[str, str | int | None]


class RunInformation(SoftwareInformation):
    """The contents of run.json.

    Attributes:
        format: `FORMAT`.
        scenario: The simulated scenario.
        source: Files of another format from which it was made, None if it was a CommonRoad file or made in Python.
        settings: What repeats the run.
        seed: Seed of what is drawn.
        digest: SHA-256 of all states.
        finished: False if the run was stopped from outside.
        views: Name of the table of visibility intervals, None if there is none.
        predictions: Name of the table of predictions, None if there is none.
        candidates: Name of the table of candidates, None if there is none.
        violations: The same for violations. orders: The same for orders at junctions.
        messages: The same for V2X messages. agreements: The same for agreements about shared road.
        hits: The same for contacts after which an agent drove on. profile: The same for the time of single plans.
        demand: The same for generated vehicles. sumo: The same for participants that SUMO drove.
        cooperation: Totals of V2X messages and of their use, None if no agent has V2X.
        agents: One entry per agent, sorted by id.
        notes: Remarks, one line each.
    """

    format: int
    scenario: ScenarioInformation
    source: SourceInformation | None
    settings: RunSettings
    seed: int | None
    digest: str
    finished: bool
    views: str | None
    predictions: str | None
    candidates: str | None
    violations: str | None
    orders: str | None
    messages: str | None
    agreements: str | None
    hits: str | None
    profile: str | None
    demand: str | None
    sumo: str | None
    cooperation: Mapping[str, Json] | None
    agents: list[AgentInformation]
    notes: list[str]


def information(run: RunRecord) -> RunInformation:
    """The contents of run.json as plain values."""
    scenario = run.scenario
    return {
        "format": FORMAT,
        "scenario": {
            "name": scenario.name,
            "benchmark_id": scenario.benchmark_id,
            "path": None if scenario.path is None else str(scenario.path.resolve()),
            "sha256": scenario.sha256,
            "dt": scenario.dt,
            "notes": list(scenario.notes),
        },
        "source": None if scenario.source is None else _source(scenario.source),
        "settings": run.settings,
        "seed": run.settings.get("seed"),
        "digest": run.digest,
        "finished": run.finished,
        "views": None if run.views is None else "views.parquet",
        "predictions": None if run.predictions is None else "predictions.parquet",
        "candidates": None if run.candidates is None else "candidates.parquet",
        "violations": None if run.violations is None else "violations.parquet",
        "orders": None if run.orders is None else "orders.parquet",
        "messages": None if run.messages is None else "messages.parquet",
        "agreements": None if run.agreements is None else "agreements.parquet",
        "hits": None if run.hits is None else "hits.parquet",
        "profile": None if run.profile is None else "profile.parquet",
        "demand": None if run.demand is None else "demand.parquet",
        "sumo": None if run.sumo is None else "sumo.parquet",
        "cooperation": run.cooperation,
        "agents": [_facts(agent) for agent in run.agents],
        "notes": list(run.notes),
        **_software(run),
    }


def _software(run: RunRecord) -> SoftwareInformation:
    found = software()
    with_sumo = {} if run.sumo is None else {"libsumo": _version("libsumo")}
    return {**found, "versions": {**found["versions"], **with_sumo}}


def _source(source: ScenarioSource) -> SourceInformation:
    return {
        "format": source.format,
        "files": [{"name": name, "sha256": sha256} for name, sha256 in source.files],
        "options": dict(source.options),
    }


#: Choices of a run that were left to their defaults.
_USUAL = {"agents": "all", "planner": DEFAULT_PLANNER, "predictor": "neural", "seed": 0}


def origin_of_run(run: RunRecord) -> Origin:
    """How the tables of a run came about: choices and settings that are not the defaults, scenario and states."""
    chosen = run.settings
    usual = {**_USUAL, **_usual_settings()}
    given: dict[str, Any] = {name: chosen.get(name, value) for name, value in _USUAL.items()}
    given |= dict(chosen.get("settings") or {})
    changed = {name: value for name, value in given.items() if json_text(value) != json_text(usual.get(name))}
    return Origin(changed, {"scenario": run.scenario.sha256, "run": run.digest})


@cache
def _usual_settings() -> dict[str, Any]:
    return flatten(SimulationSettings())


def software() -> SoftwareInformation:
    """Versions and platform, for files that document the origin of results."""
    return {
        "versions": {
            "interdrive": _version("interdrive"),
            "python": platform.python_version(),
            "numpy": _version("numpy"),
            "commonroad-io": _version("commonroad-io"),
        },
        "platform": {"system": platform.platform(), "machine": platform.machine(), "cpus": os.cpu_count()},
    }


def read_information(folder: Path) -> RunInformation:
    """Reads the run.json of a folder.

    Raises:
        ResultsError: The folder is not a run folder or has another format, or a field has the wrong type; one line.
    """
    path = folder / "run.json"
    try:
        info: Any = read_json(path)
    except (FileNotFoundError, NotADirectoryError):
        raise ResultsError(f"{folder}: this is not a run folder, it has no run.json") from None
    except (OSError, ValueError) as cause:
        raise ResultsError(f"{path}: cannot be read: {one_line(cause)}") from cause
    if not isinstance(info, dict) or type(found := info.get("format")) is not int:
        raise ResultsError(f"{path}: it states no format, so this is not a run folder")
    if found == FORMAT:
        check_information(path, info)
        return cast("RunInformation", info)
    if found > FORMAT:
        raise ResultsError(f"{path}: format {found} is newer than what this interdrive reads ({FORMAT}); update it")
    raise ResultsError(
        f"{path}: format {found} is that of an older interdrive, this version reads {FORMAT}; simulate again "
        "(scenario and settings are in run.json)"
    )


def _facts(agent: AgentRecord) -> AgentInformation:
    """The entry of an agent in run.json, without its outcome."""
    return {
        "id": agent.id,
        "origin": agent.origin,
        "start_time_step": agent.start_time_step,
        "goal": [
            {
                "areas": [_shape(area) for area in alternative.areas],
                "lanelet_ids": list(alternative.lanelet_ids),
                "time_step": list(alternative.time_step),
                "velocity": None if alternative.velocity is None else list(alternative.velocity),
                "orientation": None if alternative.orientation is None else list(alternative.orientation),
            }
            for alternative in agent.goal
        ],
        "route_lanelet_ids": list(agent.route_lanelet_ids),
    }


def _shape(shape: Shape) -> dict[str, Any]:
    """Kind and non-empty fields of a shape."""
    said = {name: getattr(shape, name) for name in ("length", "width", "radius", "center", "orientation", "vertices")}
    plain = {name: value for name, value in said.items() if np.any(value)}
    members = [_shape(member) for member in shape.members]
    return {"kind": shape.kind, **plain, **({"members": members} if members else {})}


def _version(package: str) -> str | None:
    import importlib.metadata  # noqa: PLC0415 - for run.json alone

    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None
