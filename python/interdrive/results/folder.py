"""The only writer and the only reader of run folders."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interdrive.results.columns import COLUMNS, ON_DEMAND
from interdrive.results.information import information, origin_of_run, read_information
from interdrive.results.tables import TABLES
from interdrive.results.validation import check_tables
from interdrive.storage.folders import FolderKind, check_folder, whole_folder
from interdrive.storage.tables import empty_table, read_table, write_parquet
from interdrive.storage.writing import resolved, write_json

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pyarrow as pa

    from interdrive.results.information import RunInformation
    from interdrive.run import RunRecord


#: Other files of a run folder; a folder with any further file is never replaced.
_OTHER_FILES = (
    *("run.json", "scenario.xml", "run.png", "run.pdf", "run.svg", "run.gif", "run.mp4", "report.html"),
    "agent_view.png",  # of older versions
    *("criticality.parquet", "criticality_extremes.parquet", "criticality.png", "criticality_moment.png"),
    "score.parquet",
    *("preventability.parquet", "preventability_drives.parquet"),
    "solution.xml",
)


#: All files that a run folder may contain.
_RUN_FILES = {*_OTHER_FILES, *(f"{name}.parquet" for name in COLUMNS)}

RUN_FOLDER = FolderKind("run", "run.json", lambda entry: entry.name in _RUN_FILES)


@dataclass(frozen=True)
class Results:
    """Contents of a run folder: Arrow tables (`to_pandas()`, `polars.from_arrow`) and run.json as a dictionary.

    Attributes:
        outcomes: One row per agent.
        states: One row per participant and time step.
        plans: One row per point of a plan.
        timing: One row per time step and phase.
        routes: One row per point of a reference path.
        info: Contents of run.json.
        views: Intervals in which agents saw participants; None unless `record.views`.
        predictions: None unless `record.predictions`.
        candidates: None unless `record.candidates`.
        violations: Violations of rules of the road; None with `record.violations=false`.
        orders: Orders to wait before junctions; None if no agent gets any, and with `record.orders=false`.
        messages: V2X messages; None unless `record.messages`.
        agreements: Which agent held for which; None if no agents negotiate.
        hits: Contacts after which the agent that was hit drove on; None unless `collision.not_at_fault` lets it.
        profile: How long the plans of single agents took; None unless `record.profile`.
        demand: Generated vehicles; None without generated traffic.
        sumo: Participants that SUMO drove; None without SUMO.
        missing: Names of tables that are unexpectedly missing; `read_results` accepts this only with `in_part`.
    """

    outcomes: pa.Table
    states: pa.Table
    plans: pa.Table
    timing: pa.Table
    routes: pa.Table
    info: RunInformation
    views: pa.Table | None = None
    predictions: pa.Table | None = None
    candidates: pa.Table | None = None
    violations: pa.Table | None = None
    orders: pa.Table | None = None
    messages: pa.Table | None = None
    agreements: pa.Table | None = None
    hits: pa.Table | None = None
    profile: pa.Table | None = None
    demand: pa.Table | None = None
    sumo: pa.Table | None = None
    missing: tuple[str, ...] = ()

    def __repr__(self) -> str:
        name = self.info["scenario"]["name"]
        return f"<Results of {name}: {self.outcomes.num_rows} agents, {self.states.num_rows} states>"


def save(run: RunRecord, folder: str | Path, *, overwrite: bool = False) -> Path:
    """Writes the run folder, whole or not at all, and returns its path.

    All files are written into a hidden folder beside the target, flushed to disk, and then renamed. Nothing is left
    behind if this fails.

    Args:
        run: The run to write.
        folder: A new or empty folder, or the folder of another run.
        overwrite: Replace the other run. A folder with other contents is never touched.

    Raises:
        ResultsError: if the folder cannot be used or written; one line with path and cause.
    """
    inputs = () if run.scenario.path is None else (run.scenario.path,)
    with whole_folder(folder, RUN_FOLDER, overwrite=overwrite, inputs=inputs) as partial:
        rows, origin = {}, origin_of_run(run)
        for name, made in TABLES.items():
            table = made(run)
            if table is None:
                continue
            write_parquet(table, partial / f"{name}.parquet", origin)
            rows[name] = table.num_rows
        write_information(run, partial, rows)
    return resolved(folder)


def write_information(run: RunRecord, folder: Path, rows: Mapping[str, int], *, lacks: Sequence[str] = ()) -> None:
    """Writes run.json and scenario.xml beside the tables of a run.

    Args:
        run: The run.
        folder: Where.
        rows: Number of rows by table.
        lacks: What scenario.xml does not have.
    """
    from interdrive.files import road_losses, run_document  # noqa: PLC0415 - commonroad-io takes a second to load

    about = information(run)
    lost = road_losses(run.scenario) if run.scenario.path is None else ()
    about["notes"] = [*about["notes"], *(f"scenario.xml lacks {line}" for line in (*lost, *lacks))]
    write_json({**about, "rows": rows}, folder / "run.json")
    (folder / "scenario.xml").write_bytes(run_document(run))


def inputs_of(folder: str | Path, run: RunRecord | None = None) -> list[Path]:
    """What makes up the run in a folder: its tables, run.json and scenario, which no figure or page may replace.

    Args:
        folder: A run folder.
        run: The run in it; the file that it was simulated from counts, too.
    """
    made = {"run.json", "scenario.xml", *(f"{name}.parquet" for name in COLUMNS)}
    source = None if run is None else run.scenario.path
    return [*(Path(folder) / name for name in sorted(made)), *(() if source is None else (source,))]


def read_results(folder: str | Path, *, in_part: bool = False) -> Results:
    """Reads a run folder, and checks that its files are valid and belong to the same run.

    Args:
        folder: Folder written by `save`.
        in_part: Tables besides outcomes and states may be missing; plans and timing are empty then.

    Raises:
        ResultsError: if the folder or one of its files is missing, damaged or of another format; one line names file
            and column or field.
    """
    folder = Path(folder)
    resolved(folder)  # refuses paths that Arrow cannot open
    info = read_information(folder)
    tables: dict[str, Any] = {}
    missing = []
    for name in COLUMNS:
        if name in ON_DEMAND and info.get(name) is None:
            continue
        path = folder / f"{name}.parquet"
        if in_part and name not in ("outcomes", "states") and not path.exists():
            missing.append(name)
            if name not in ON_DEMAND:
                tables[name] = empty_table(COLUMNS[name])
            continue
        tables[name] = read_table(path, COLUMNS[name])
    check_tables(folder, tables, info, missing)
    return Results(**tables, info=info, missing=tuple(missing))


def check_target(folder: str | Path, *, overwrite: bool = False) -> Path:
    """The folder a run can be saved to, as an absolute path; useful before a long simulation.

    Args:
        folder: A new or empty folder, or the folder of another run.
        overwrite: Another run in it may be replaced.

    Raises:
        ResultsError: if something is there that must not be replaced.
    """
    return check_folder(folder, RUN_FOLDER, overwrite=overwrite)


def holds_run(folder: Path) -> bool:
    """Whether the folder is a run folder without other contents."""
    inside = {entry.name for entry in folder.iterdir()} if folder.is_dir() else set()
    return "run.json" in inside and inside <= _RUN_FILES
