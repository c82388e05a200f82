"""The run folder: its Parquet columns, its one writer and its one reader. pyarrow is loaded on first use.

A run folder holds outcomes.parquet, states.parquet, plans.parquet, timing.parquet, run.json and scenario.xml; and
views.parquet, predictions.parquet and candidates.parquet if the settings `record.*` asked for them. The same run gives
the same bytes. Absent numbers are null.
"""

from __future__ import annotations

import importlib.metadata
import json
import math
import os
import platform
import shutil
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from interdrive.criticality import IMPACT_AREAS, agent_harm
from interdrive.errors import ResultsError
from interdrive.run import PHASES, PLAN_STATUS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    import pyarrow as pa

    from interdrive.run import AgentRecord, Run
    from interdrive.scenario import Shape

    #: For signatures elsewhere: only this module knows pyarrow.
    ArrowTable: TypeAlias = pa.Table

#: Version of the folder's layout, written to run.json; raised when a column comes, goes, or changes name or meaning.
#: 2: outcomes with harm, partner_harm, impact_angle and impact_area.
FORMAT = 2

#: What a run folder may contain besides the tables; anything else makes it a folder that is never replaced.
_OTHER_FILES = (
    *(
        "run.json",
        "scenario.xml",
        "run.png",
        "run.pdf",
        "run.svg",
        "run.gif",
        "run.mp4",
        "agent_view.png",
        "report.html",
    ),
    *("criticality.parquet", "criticality_extremes.parquet", "criticality.png", "criticality_moment.png"),
)


@dataclass(frozen=True)
class Column:
    """One column: its name, its type ("integer", "number", "truth", "text", "label"), and what it says, with unit."""

    name: str
    kind: str
    text: str
    nullable: bool = False


#: Columns of every table. A "label" is a text from a short list and stored as such (dictionary encoded).
COLUMNS: Mapping[str, tuple[Column, ...]] = {
    "outcomes": (
        Column("agent_id", "integer", "participant id of the agent"),
        Column("planner", "label", "name of its planner"),
        Column("outcome", "label", "how it ended, one of interdrive.run.OUTCOMES, or running"),
        Column("time_step", "integer", "when it ended"),
        Column("partner_id", "integer", "the other participant of a collision", nullable=True),
        Column("off_road", "truth", "the collision was with the edge of the road"),
        Column("impact_speed", "number", "size of the relative velocity at a collision [m/s]", nullable=True),
        Column(
            "harm", "number", "probability of severe injuries (MAIS 3+) in the agent after a collision", nullable=True
        ),
        Column("partner_harm", "number", "the same in the other participant", nullable=True),
        Column(
            "impact_angle", "number", "direction to the other participant, seen from the agent [rad]", nullable=True
        ),
        Column("impact_area", "label", "front, left, right or rear of the agent", nullable=True),
        Column("message", "text", "why, in words"),
    ),
    "states": (
        Column("time_step", "integer", ""),
        Column("participant_id", "integer", ""),
        Column("kind", "label", "car, truck, ... (interdrive.scenario.KINDS)"),
        Column("is_agent", "truth", "driven by a planner, otherwise replayed"),
        Column("x", "number", "centre of the footprint [m]"),
        Column("y", "number", "centre of the footprint [m]"),
        Column("orientation", "number", "heading [rad]"),
        Column("velocity", "number", "speed along the heading [m/s]"),
        Column("acceleration", "number", "[m/s²]", nullable=True),
        Column("yaw_rate", "number", "[rad/s]", nullable=True),
        Column("length", "number", "of the footprint [m]"),
        Column("width", "number", "of the footprint [m]"),
    ),
    "plans": (
        Column("time_step", "integer", "when the plan was made"),
        Column("agent_id", "integer", "whose plan it is"),
        Column("status", "label", "how it came about, one of interdrive.run.PLAN_STATUS"),
        Column("cost", "number", "cost of the chosen trajectory", nullable=True),
        Column("point", "integer", "point i is i * dt after time_step; a plan without points keeps one row, point 0"),
        Column("x", "number", "centre of the footprint [m]", nullable=True),
        Column("y", "number", "centre of the footprint [m]", nullable=True),
        Column("orientation", "number", "heading [rad]", nullable=True),
        Column("velocity", "number", "[m/s]", nullable=True),
        Column("acceleration", "number", "[m/s²]", nullable=True),
    ),
    "views": (
        Column("observer_id", "integer", "the agent that saw"),
        Column("seen_id", "integer", "the participant that it saw"),
        Column("first_time_step", "integer", "first time step of a stretch without a break"),
        Column("last_time_step", "integer", "last time step of the stretch, included"),
    ),
    "predictions": (
        Column("time_step", "integer", "when it was predicted"),
        Column("participant_id", "integer", "whose future"),
        Column("mode", "integer", "number of the mode"),
        Column("probability", "number", "of the mode"),
        Column("point", "integer", "the point is point * dt after time_step"),
        Column("x", "number", "mean of the footprint's centre [m]", nullable=True),
        Column("y", "number", "mean of the footprint's centre [m]", nullable=True),
        Column("variance_x", "number", "of the position in world axes [m²]", nullable=True),
        Column("covariance_xy", "number", "of the position in world axes [m²]", nullable=True),
        Column("variance_y", "number", "of the position in world axes [m²]", nullable=True),
    ),
    "candidates": (
        Column("time_step", "integer", "when it was considered"),
        Column("agent_id", "integer", "who considered it"),
        Column("candidate", "integer", "number of the candidate among those that were kept of this plan"),
        Column("cost", "number", "total cost; null where it was not needed", nullable=True),
        Column("rejection", "label", "why it was rejected; empty where it was not"),
        Column("chosen", "truth", "it became the plan"),
        Column("point", "integer", "the point is point * dt after time_step"),
        Column("x", "number", "centre of the footprint [m]", nullable=True),
        Column("y", "number", "centre of the footprint [m]", nullable=True),
    ),
    "timing": (
        Column("time_step", "integer", ""),
        Column("phase", "label", "one of interdrive.run.PHASES; the phases of a time step add up to the step"),
        Column("seconds", "number", "wall time [s]"),
    ),
}


#: Tables that a run has only if its settings asked for them; run.json says under their names whether it does.
_ON_DEMAND = ("views", "predictions", "candidates")

#: Everything a run folder may contain.
_RUN_FILES = {*_OTHER_FILES, *(f"{name}.parquet" for name in COLUMNS)}


@dataclass(frozen=True)
class Results:
    """What a run folder says: Arrow tables (`to_pandas()`, `polars.from_arrow`) and run.json as a dictionary.

    `views`, `predictions` and `candidates` are None unless the settings `record.*` asked for them. `missing` names the
    tables that are not there although they should be; `load` returns them only if it is told to.
    """

    outcomes: pa.Table
    states: pa.Table
    plans: pa.Table
    timing: pa.Table
    info: dict[str, Any]
    views: pa.Table | None = None
    predictions: pa.Table | None = None
    candidates: pa.Table | None = None
    missing: tuple[str, ...] = ()


def outcome_table(run: Run) -> pa.Table:
    """How every agent ended, one row each, as an Arrow table (`to_pandas()`, `polars.from_arrow`)."""
    ended, harm = run.outcomes, agent_harm(run)
    return _table(
        "outcomes",
        agent_id=ended.agent_id,
        planner=labels(ended.planner),
        outcome=labels(ended.outcome),
        time_step=ended.time_step,
        partner_id=np.ma.masked_equal(ended.partner_id, -1),
        off_road=ended.off_road,
        impact_speed=ended.impact_speed,
        harm=harm.harm,
        partner_harm=harm.partner_harm,
        impact_angle=harm.impact_angle,
        impact_area=labels(
            IMPACT_AREAS, np.array([IMPACT_AREAS.index(a) if a else -1 for a in harm.impact_area], dtype=np.int64)
        ),
        message=ended.message,
    )


def states_table(run: Run) -> pa.Table:
    """One row per time step and participant that is present then, in that order, as an Arrow table."""
    states = run.states
    step, row = np.nonzero(states.valid.T)
    moving = {
        name: getattr(states, name)[row, step]
        for name in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate")
    }
    return _table(
        "states",
        time_step=states.first_time_step + step,
        participant_id=states.ids[row],
        kind=labels(states.kinds, row),
        is_agent=states.is_agent[row],
        length=states.length[row],
        width=states.width[row],
        **moving,
    )


def plans_table(run: Run) -> pa.Table:
    """One row per plan and point, sorted by time step, agent and point, as an Arrow table."""
    plans = run.plans
    present = np.isfinite(plans.x)
    if present.shape[1]:
        present[:, 0] = True
        row, point = np.nonzero(present)
        along = {
            name: getattr(plans, name)[row, point] for name in ("x", "y", "orientation", "velocity", "acceleration")
        }
    else:
        row, point = np.arange(len(plans.time_step)), np.zeros(len(plans.time_step), dtype=np.int64)
        along = dict.fromkeys(("x", "y", "orientation", "velocity", "acceleration"), np.full(len(row), np.nan))
    return _table(
        "plans",
        time_step=plans.time_step[row],
        agent_id=plans.agent_id[row],
        status=labels(PLAN_STATUS, plans.status[row]),
        cost=plans.cost[row],
        point=point,
        **along,
    )


def timing_table(run: Run) -> pa.Table:
    """Wall time per time step and phase, as an Arrow table."""
    names = (*PHASES, *sorted(set(run.timings.phase) - set(PHASES)))
    order = {phase: index for index, phase in enumerate(names)}
    index = np.array([order[phase] for phase in run.timings.phase], dtype=np.int64)
    return _table("timing", time_step=run.timings.time_step, phase=labels(names, index), seconds=run.timings.seconds)


def views_table(run: Run) -> pa.Table | None:
    """Who saw whom, one row per stretch of time steps, as an Arrow table; None if that was not recorded."""
    seen = run.views
    if seen is None:
        return None
    names = [column.name for column in COLUMNS["views"]]
    return _table("views", **{name: getattr(seen, name) for name in names})


def predictions_table(run: Run) -> pa.Table | None:
    """One row per time step, participant, mode and point, as an Arrow table; None if that was not recorded."""
    found = run.predicted
    if found is None:
        return None
    points = len(found.point)
    names = ("time_step", "participant_id", "mode", "probability")
    return _table(
        "predictions",
        **{name: np.repeat(getattr(found, name), points) for name in names},
        point=np.tile(found.point, len(found.time_step)),
        x=found.x.ravel(),
        y=found.y.ravel(),
        variance_x=found.covariance[..., 0, 0].ravel(),
        covariance_xy=found.covariance[..., 0, 1].ravel(),
        variance_y=found.covariance[..., 1, 1].ravel(),
    )


def candidates_table(run: Run) -> pa.Table | None:
    """One row per kept candidate and point, as an Arrow table; None if that was not recorded."""
    found = run.considered
    if found is None:
        return None
    points, reasons = len(found.point), tuple(sorted(set(found.rejection)))
    change = np.flatnonzero((np.diff(found.time_step) != 0) | (np.diff(found.agent_id) != 0)) + 1
    first = np.repeat(np.append(0, change), np.diff(np.concatenate([[0], change, [len(found.time_step)]])))
    reason = np.array([reasons.index(text) for text in found.rejection], dtype=np.int64)
    return _table(
        "candidates",
        **{name: np.repeat(getattr(found, name), points) for name in ("time_step", "agent_id", "cost", "chosen")},
        candidate=np.repeat(np.arange(len(first)) - first, points),
        rejection=labels(reasons, np.repeat(reason, points)),
        point=np.tile(found.point, len(found.time_step)),
        x=found.x.ravel(),
        y=found.y.ravel(),
    )


def information(run: Run) -> dict[str, Any]:
    """What run.json says: everything that is needed to know and to repeat the run, as plain values."""
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
        "settings": run.settings,
        "seed": run.settings.get("seed"),
        "digest": run.digest,
        "finished": run.finished,
        "views": None if run.views is None else "views.parquet",
        "predictions": None if run.predicted is None else "predictions.parquet",
        "candidates": None if run.considered is None else "candidates.parquet",
        "agents": [_facts(agent) for agent in run.agents],
        "notes": list(run.notes),
        **software(),
    }


def software() -> dict[str, Any]:
    """Versions and platform, for the files that say how results came about."""
    return {
        "versions": {
            "interdrive": _version("interdrive"),
            "python": platform.python_version(),
            "numpy": _version("numpy"),
            "commonroad-io": _version("commonroad-io"),
        },
        "platform": {"system": platform.platform(), "machine": platform.machine(), "cpus": os.cpu_count()},
    }


def save(run: Run, folder: str | Path, *, overwrite: bool = False) -> Path:
    """Writes the run folder, whole or not at all, and returns its path.

    Everything goes into a hidden folder beside the target, reaches the disk, and is then renamed. Nothing is left
    behind if that fails.

    Args:
        run: What to write.
        folder: New or empty folder, or one that holds another run.
        overwrite: Replace the other run. A folder with anything else in it is never touched.

    Raises:
        ResultsError: if the folder cannot be used or written; one line with path and cause.
    """
    from interdrive.files import write_scenario  # noqa: PLC0415 - commonroad-io takes a second to load

    target = check_target(folder, overwrite=overwrite)
    with _replacing(target) as partial:
        partial.mkdir()
        for name, table in (
            ("outcomes", outcome_table(run)),
            ("states", states_table(run)),
            ("plans", plans_table(run)),
            ("timing", timing_table(run)),
            ("views", views_table(run)),
            ("predictions", predictions_table(run)),
            ("candidates", candidates_table(run)),
        ):
            if table is None:
                continue
            _write_parquet(table, partial / f"{name}.parquet")
        write_json(information(run), partial / "run.json")
        _write_bytes(write_scenario(run), partial / "scenario.xml")
    return target


def load(folder: str | Path, *, in_part: bool = False) -> Results:
    """Reads a run folder.

    Args:
        folder: As `save` wrote it.
        in_part: Tables besides outcomes and states may be missing; plans and timing are empty then.

    Raises:
        ResultsError: if the folder or one of its files is missing, damaged or of another format; one line.
    """
    folder = Path(folder)
    info = _read_information(folder)
    tables: dict[str, Any] = {}
    missing = []
    for name in COLUMNS:
        if name in _ON_DEMAND and info.get(name) is None:
            continue
        path = folder / f"{name}.parquet"
        if in_part and name not in ("outcomes", "states") and not path.exists():
            missing.append(name)
            if name not in _ON_DEMAND:
                tables[name] = _schema(COLUMNS[name]).empty_table()
            continue
        tables[name] = read_table(path, COLUMNS[name])
    return Results(**tables, info=info, missing=tuple(missing))


def read_table(path: Path, columns: Sequence[Column]) -> pa.Table:
    """A Parquet file of a run, as an Arrow table.

    Raises:
        ResultsError: if it is missing, damaged or has other columns; one line.
    """
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.parquet as pq  # noqa: PLC0415

    try:
        table = pq.read_table(path, partitioning=None)
    except FileNotFoundError:
        raise ResultsError(f"{path}: this file of the run is missing") from None
    except (OSError, pa.ArrowException) as cause:
        raise ResultsError(f"{path}: cannot be read: {_line(cause)}") from cause
    if not table.schema.equals(_schema(columns), check_metadata=False):
        raise ResultsError(f"{path}: the columns are not those of a run ({', '.join(table.column_names)})")
    return table


def check_target(folder: str | Path, *, overwrite: bool = False) -> Path:
    """The folder a run can be saved to, as an absolute path; useful before a long simulation.

    Raises:
        ResultsError: if something is there that must not be replaced.
    """
    return check_folder(folder, "run", "run.json", lambda entry: entry.name in _RUN_FILES, overwrite=overwrite)


def holds_run(folder: Path) -> bool:
    """The folder is a run folder and nothing else."""
    inside = {entry.name for entry in folder.iterdir()} if folder.is_dir() else set()
    return "run.json" in inside and inside <= _RUN_FILES


def check_folder(folder: str | Path, what: str, mark: str, belongs: Callable[[Path], bool], *, overwrite: bool) -> Path:
    """A folder that can be written whole, as an absolute path.

    Args:
        folder: New or empty, or one that holds the same kind of thing.
        what: The kind of thing, for the reader.
        mark: File without which a folder is not of that kind.
        belongs: Whether an entry of the folder is part of such a thing.
        overwrite: It may be replaced.

    Raises:
        ResultsError: if something is there that must not be replaced.
    """
    target = Path(folder).resolve()
    try:
        if not target.exists():
            nearest = next(parent for parent in target.parents if parent.exists())
            if not nearest.is_dir():
                raise ResultsError(f"{folder}: {nearest} is not a folder")
            if not os.access(nearest, os.W_OK | os.X_OK):
                raise ResultsError(f"{folder}: there is no permission to write in {nearest}")
            return target
        if not target.is_dir():
            raise ResultsError(f"{folder}: a file of that name is in the way")
        entries = sorted(target.iterdir())
        foreign = [entry.name for entry in entries if not belongs(entry)]
    except OSError as cause:
        raise ResultsError(f"{folder}: cannot be used as a {what} folder: {_line(cause)}") from cause
    inside = [entry.name for entry in entries]
    if inside and (mark not in inside or foreign):
        example = (foreign or inside)[0]
        raise ResultsError(
            f"{folder}: this folder holds other things ({example}) and is left alone; choose another one"
        )
    if inside and not overwrite:
        raise ResultsError(f"{folder}: a {what} is there already; ask for overwriting or choose another folder")
    return target


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A path to write one file or folder to, which takes the place of `path` if all goes well and vanishes if not.

    Raises:
        ResultsError: if it cannot be written; one line with path and cause.
    """
    with _replacing(Path(path).resolve()) as partial:
        yield partial


@contextmanager
def _replacing(target: Path) -> Iterator[Path]:
    # Keeps the ending: writers of pictures choose the format by it.
    partial = target.with_name(f".{target.name}.{os.getpid()}.partial{target.suffix}")
    created: list[Path] = []
    try:
        for parent in reversed([parent for parent in target.parents if not parent.exists()]):
            parent.mkdir(exist_ok=True)
            created.append(parent)
        _remove(partial)
        yield partial
        _move(partial, target)
    except BaseException as cause:
        _remove(partial)
        for parent in reversed(created):
            if parent.exists() and not any(parent.iterdir()):
                parent.rmdir()
        if isinstance(cause, (OSError, _arrow_exception())):
            raise ResultsError(f"{target}: cannot be written: {_line(cause)}") from cause
        raise


def _move(partial: Path, target: Path) -> None:
    if partial.is_dir():
        _sync(partial)
    old = target.with_name(f".{target.name}.{os.getpid()}.old")
    if not target.is_dir():
        partial.replace(target)
    else:
        target.rename(old)
        try:
            partial.rename(target)
        except BaseException:
            old.rename(target)
            raise
        shutil.rmtree(old, ignore_errors=True)
    _sync(target.parent)


def _remove(path: Path) -> None:
    """Removes what can be removed: the reason why the writing failed is the one to report."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()


def _sync(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _write_bytes(data: bytes, path: Path) -> None:
    with path.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _write_parquet(table: pa.Table, path: Path) -> None:
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.parquet as pq  # noqa: PLC0415

    numbers = [field.name for field in table.schema if pa.types.is_floating(field.type)]
    named = [field.name for field in table.schema if pa.types.is_dictionary(field.type)]
    with path.open("wb") as file:
        # Numbers hardly repeat: splitting their bytes compresses better than looking for repetitions.
        pq.write_table(
            table, file, compression="zstd", compression_level=1, use_dictionary=named, use_byte_stream_split=numbers
        )
        file.flush()
        os.fsync(file.fileno())


def _read_information(folder: Path) -> dict[str, Any]:
    path = folder / "run.json"
    try:
        info = json.loads(path.read_bytes())
    except (FileNotFoundError, NotADirectoryError):
        raise ResultsError(f"{folder}: this is not a run folder, it has no run.json") from None
    except (OSError, ValueError) as cause:
        raise ResultsError(f"{path}: cannot be read: {_line(cause)}") from cause
    if not isinstance(info, dict) or not isinstance(found := info.get("format"), int):
        raise ResultsError(f"{path}: it states no format, so this is not a run folder")
    if found == FORMAT:
        return info
    if found > FORMAT:
        raise ResultsError(f"{path}: format {found} is newer than what this interdrive reads ({FORMAT}); update it")
    raise ResultsError(
        f"{path}: format {found} is that of an older interdrive, this one reads {FORMAT}; simulate again "
        "(scenario and settings are in run.json)"
    )


def _schema(columns: Sequence[Column]) -> pa.Schema:
    import pyarrow as pa  # noqa: PLC0415

    types = {
        "integer": pa.int64(),
        "number": pa.float64(),
        "truth": pa.bool_(),
        "text": pa.string(),
        "label": pa.dictionary(pa.int32(), pa.string()),
    }
    return pa.schema(
        pa.field(
            column.name, types[column.kind], column.nullable, {"description": column.text} if column.text else None
        )
        for column in columns
    )


def arrow_table(columns: Sequence[Column], values: Mapping[str, Any]) -> pa.Table:
    """A table with the given columns, whose values are arrays, sequences or Arrow arrays; nan becomes null."""
    import pyarrow as pa  # noqa: PLC0415

    schema = _schema(columns)
    # from_pandas: nan and masked entries become null.
    arrays = [
        pa.array(values[field.name], type=field.type, from_pandas=field.nullable)
        if not isinstance(values[field.name], pa.Array)
        else values[field.name]
        for field in schema
    ]
    return pa.Table.from_arrays(arrays, schema=schema)


def _table(name: str, **columns: Any) -> pa.Table:  # noqa: ANN401 - arrays, tuples and Arrow arrays alike
    return arrow_table(COLUMNS[name], columns)


def write_table(table: pa.Table, path: Path) -> None:
    """Writes a table as Parquet or, if the path ends so, as CSV."""
    if path.suffix != ".csv":
        _write_parquet(table, path)
        return
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.csv  # noqa: PLC0415

    sink = pa.BufferOutputStream()
    pa.csv.write_csv(table, sink, pa.csv.WriteOptions(quoting_style="needed"))
    _write_bytes(sink.getvalue().to_pybytes(), path)


def write_json(values: Mapping[str, Any], path: Path) -> None:
    """Writes plain values as JSON; infinities and nan as texts."""
    text = json.dumps(_finite(values), indent=2, ensure_ascii=False, allow_nan=False)
    _write_bytes(text.encode() + b"\n", path)


def labels(names: tuple[str, ...], index: Any = None) -> pa.Array:  # noqa: ANN401 - integer array
    """Texts from a short list; `index` picks from `names` (null where negative), without it each name is one row."""
    import pyarrow as pa  # noqa: PLC0415

    places: dict[str, int] = {}
    place = np.array([places.setdefault(name, len(places)) for name in names], dtype=np.int32)
    picked = place if index is None else np.append(place, np.int32(-1))[index]
    indices = pa.array(picked, pa.int32(), mask=picked < 0)
    return pa.DictionaryArray.from_arrays(indices, pa.array(list(places), pa.string()))


def _finite(value: Any) -> Any:  # noqa: ANN401 - any JSON value
    """The same value with infinities and nan as texts, which JSON can hold; arrays and paths become plain values."""
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _finite(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return str(value) if isinstance(value, Path) else value


def _facts(agent: AgentRecord) -> dict[str, Any]:
    """What run.json says about an agent besides its outcome."""
    return {
        "id": agent.id,
        "origin": agent.origin,
        "start_time_step": agent.start_time_step,
        "goal_time_step": list(agent.goal_time_step),
        "goal_areas": [_shape(area) for area in agent.goal_areas],
        "route_lanelet_ids": list(agent.route_lanelet_ids),
    }


def _shape(shape: Shape) -> dict[str, Any]:
    """Kind and fields of a shape that are not empty."""
    said = {name: getattr(shape, name) for name in ("length", "width", "radius", "center", "orientation", "vertices")}
    plain = {name: value for name, value in said.items() if np.any(value)}
    members = [_shape(member) for member in shape.members]
    return {"kind": shape.kind, **plain, **({"members": members} if members else {})}


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _arrow_exception() -> type[Exception]:
    import pyarrow as pa  # noqa: PLC0415

    exception: type[Exception] = pa.ArrowException
    return exception


def _line(cause: BaseException) -> str:
    """The cause on one line; for errors of the operating system without their number."""
    text = cause.strerror if isinstance(cause, OSError) and cause.strerror else str(cause)
    return " ".join(text.split()) or type(cause).__name__
