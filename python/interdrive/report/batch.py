"""What the page of a batch shows: planners compared, distributions over agents, and every run with its own page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.batches.plan import ALONE
from interdrive.batches.store import BatchFolder
from interdrive.comparison import METRICS, compare
from interdrive.comparison.caveats import SCENARIOS_MIN, is_sure
from interdrive.comparison.variants import arrays, categories_of, compared_sets, variants_of
from interdrive.errors import ResultsError
from interdrive.report.contents import FORMAT, Contents
from interdrive.report.packing import Packer
from interdrive.report.repeat import command

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.comparison import ComparedSet, Comparison

#: Columns of the data set whose distributions are drawn, and the factor to their unit.
_DRAWN = (
    ("ttc_min", "min TTC", "s", 1.0),
    ("jerk_rms", "jerk (rms)", "m/s³", 1.0),
    ("lateral_acceleration_rms", "lateral acceleration (rms)", "m/s²", 1.0),
    ("deceleration_max", "largest deceleration", "m/s²", 1.0),
    ("harm", "harm of collisions", "", 1.0),
    ("plan_seconds", "time per plan", "ms", 1000.0),
)

#: What the list of runs says about each, besides counts of its agents.
_ABOUT = ("scenario", "category", "traffic", "agents", "seed", "status", "error")

#: What decides, with the ids of agents, which command does a run again.
_COMMAND = ("path", "planner", "predictor", "settings", "traffic", "agents", "seed")


def batch_contents(folder: str | Path, pages: Mapping[str, str], damaged: Mapping[str, str] | None = None) -> Contents:
    """Everything about a batch that its page shows.

    Args:
        folder: Of the batch.
        pages: Where the page of a run is, relative to that of the batch, by key of the run.
        damaged: Why there is no page of a run whose folder was kept, by key of the run.

    Raises:
        ResultsError: The folder is no batch, or holds no run.
    """
    table = BatchFolder.open(folder).table()
    if not table.num_rows:
        raise ResultsError(f"{folder}: this batch holds no run yet")
    packer, missing = Packer(), []
    column = arrays(table)
    column["variant"], column["category"] = variants_of(column), categories_of(column)
    variants = sorted(set(column["variant"].tolist()))
    counted = column["under_test"] == 1
    try:
        comparison = compare(folder)
        counted = _counted(column)
    except ResultsError as cause:
        comparison = None
        missing.append({"what": "comparison", "text": f"No comparison: {cause}"})
    if damaged:
        count = "One run" if len(damaged) == 1 else f"{len(damaged)} runs"
        text = f"{count} whose folder was kept cannot be shown; the list of runs says why."
        missing.append({"what": "pages", "text": text})
    elif not pages:
        text = "No run folder was kept; `interdrive batch --keep all` (or failed) keeps them, and runs get pages."
        missing.append({"what": "runs", "text": text})
    tested = np.flatnonzero(counted)
    packer.add("variant", np.array([variants.index(column["variant"][row]) for row in tested.tolist()], dtype=np.int64))
    parts = _parts(column)
    packer.add("part", np.array([parts.index(_part(column, row)) for row in tested.tolist()], dtype=np.int64))
    for name, _, _, factor in _DRAWN:
        packer.add(name, factor * column[name][tested].astype(np.float64))
    header = {
        "format": FORMAT,
        "kind": "batch",
        "name": Path(folder).resolve().name,
        "version": sorted(set(column["version"].tolist())),
        "variants": variants,
        "parts": [dict(zip(("traffic", "agents", "category"), part, strict=True)) for part in parts],
        "sets": [] if comparison is None else [_set(one) for one in comparison.sets],
        "metrics": [
            {"name": m.name, "heading": m.heading, "better": m.better, "digits": m.digits, "outcome": m.outcome}
            for m in METRICS
        ],
        "table": [] if comparison is None else _plain(comparison.table.to_pylist()),
        "differences": [] if comparison is None else _differences(comparison),
        "level": None if comparison is None else comparison.level,
        "scenarios_min": SCENARIOS_MIN,
        "reservations": [] if comparison is None else list(comparison.reservations),
        "drawn": [{"name": name, "title": title, "unit": unit} for name, title, unit, _ in _DRAWN],
        "runs": _runs(column, pages, damaged or {}),
        "missing": missing,
        "arrays": packer.header,
    }
    return Contents(header, packer.text())


def _part(column: Mapping[str, Any], row: int) -> tuple[str, str, str]:
    return tuple(str(column[name][row]) for name in ("traffic", "agents", "category"))  # type: ignore[return-value]


def _parts(column: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    return sorted({_part(column, row) for row in range(len(column["key"]))})


def _runs(column: Mapping[str, Any], pages: Mapping[str, str], damaged: Mapping[str, str]) -> list[dict[str, Any]]:
    """One entry per run, in the order of the data set."""
    ttc = column["ttc_min"].astype(np.float64)
    keys, first, number = np.unique(column["key"].astype(str), return_index=True, return_inverse=True)
    made = []
    for run in np.argsort(first).tolist():
        rows = np.flatnonzero(number == run)
        mine = rows[column["under_test"][rows] == 1]
        outcomes, least = column["outcome"][mine].tolist(), ttc[mine]
        at = int(rows[0])
        entry = {name: _plain_value(column[name][at]) for name in _ABOUT}
        entry |= {
            "variant": column["variant"][at],
            "n_agents": len(mine),
            "agent": int(column["agent_id"][mine[0]]) if entry["agents"] == ALONE and len(mine) else None,
            "outcomes": {name: outcomes.count(name) for name in sorted(set(outcomes))},
            "ttc_min": float(np.nanmin(least)) if np.isfinite(least).any() else None,
            "page": pages.get(str(keys[run])),
            "damage": damaged.get(str(keys[run]), ""),
        }
        if entry["page"] is None and entry["status"] == "finished":
            about = {name: column[name][at] for name in _COMMAND}
            tested, others = (column["agent_id"][who].astype(int).tolist() for who in (mine, np.setdiff1d(rows, mine)))
            entry["command"] = command(about, tested, others)
        made.append(entry)
    return made


def _counted(column: Mapping[str, Any]) -> Any:  # noqa: ANN401 - array of truths
    """Rows of agents that the comparison is about."""
    rows = {**column, "row": np.arange(len(column["key"]))}
    found = np.zeros(len(rows["row"]), dtype=np.bool_)
    for _, here in compared_sets(rows):
        found[here["row"][here["counts"]]] = True
    return found


def _differences(comparison: Comparison) -> list[dict[str, Any]]:
    """Rows for JSON, each with 1 if it may be called a difference, 0 otherwise."""
    rows = comparison.differences.to_pylist()
    return [{**plain, "sure": int(is_sure(row))} for plain, row in zip(_plain(rows), rows, strict=True)]


def _set(one: ComparedSet) -> dict[str, str]:
    return {"traffic": one.traffic, "agents": one.agents, "title": one.title, "size": one.size}


def _plain_value(value: Any) -> Any:  # noqa: ANN401 - a number or a text
    return value.item() if isinstance(value, np.generic) else value


def _plain(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rows for JSON, which knows no infinity: "inf" and "-inf" stand for it."""
    return [
        {
            name: str(value) if isinstance(value, float) and not np.isfinite(value) else value
            for name, value in row.items()
        }
        for row in rows
    ]
