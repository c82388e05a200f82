"""What the page of a batch shows: planners compared, distributions over agents, and every run with its own page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.batch_report.comparison import compared_of
from interdrive.batch_report.repeat import command
from interdrive.batches.plan import ALONE
from interdrive.batches.store import BatchFolder
from interdrive.comparison import compare
from interdrive.comparison.variants import ALL, arrays, categories_of, compared_sets, variants_of
from interdrive.criticality import measure_named
from interdrive.errors import ResultsError
from interdrive.report.contents import Contents
from interdrive.report.contract import FORMAT
from interdrive.report.packing import Packer

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from interdrive.comparison import Comparison
    from interdrive.report.contract import BatchHeader, BatchRun, Compared, Missing

#: Columns of the data set whose distributions are drawn, the factor to their unit, and beyond what no value matters.
_DRAWN = (
    ("score", "score", "", 100.0, None),
    ("ttc_min", "min TTC", "s", 1.0, measure_named("ttc").drawn_to),
    ("jerk_rms", "jerk (rms)", "m/s³", 1.0, None),
    ("lateral_acceleration_rms", "lateral acceleration (rms)", "m/s²", 1.0, None),
    ("deceleration_max", "largest deceleration", "m/s²", 1.0, None),
    ("harm", "harm of collisions", "", 1.0, None),
    ("plan_seconds", "time per plan", "ms", 1000.0, None),
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
    packer = Packer()
    missing: list[Missing] = []
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
    for name, _, _, factor, _ in _DRAWN:
        packer.add(name, factor * column[name][tested].astype(np.float64))
    header: BatchHeader = {
        "format": FORMAT,
        "kind": "batch",
        "name": Path(folder).resolve().name,
        "version": sorted(set(column["version"].tolist())),
        "variants": variants,
        "parts": [{"traffic": part[0], "agents": part[1], "category": part[2]} for part in parts],
        "compared": [*compared_of(comparison), *_unfinished(comparison, parts)],
        "caveats": [] if comparison is None else list(comparison.caveats),
        "drawn": [{"name": name, "title": title, "unit": unit, "cap": cap} for name, title, unit, _, cap in _DRAWN],
        "runs": _runs(column, pages, damaged or {}),
        "missing": missing,
        "arrays": packer.header,
    }
    return Contents(header, packer.text())


def _unfinished(comparison: Comparison | None, parts: Sequence[tuple[str, str, str]]) -> list[Compared]:
    """Traffic and agents of which no run has finished."""
    known = set() if comparison is None else {(one.traffic, one.agents) for one in comparison.sets}
    return [
        {
            "traffic": traffic,
            "agents": agents,
            "category": ALL,
            "title": f"Traffic {traffic}, agents {agents}",
            "size": "None of these runs has finished.",
            "headings": [],
            "rows": [],
            "pairs": [],
            "note": "",
        }
        for traffic, agents in dict.fromkeys(part[:2] for part in parts)
        if (traffic, agents) not in known
    ]


def _part(column: Mapping[str, Any], row: int) -> tuple[str, str, str]:
    return tuple(str(column[name][row]) for name in ("traffic", "agents", "category"))  # type: ignore[return-value]


def _parts(column: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    return sorted({_part(column, row) for row in range(len(column["key"]))})


def _least(values: NDArray[np.float64]) -> float | None:
    return float(np.nanmin(values)) if np.isfinite(values).any() else None


def _runs(column: Mapping[str, Any], pages: Mapping[str, str], damaged: Mapping[str, str]) -> list[BatchRun]:
    """One entry per run, in the order of the data set."""
    ttc = column["ttc_min"].astype(np.float64)
    keys, first, number = np.unique(column["key"].astype(str), return_index=True, return_inverse=True)
    made: list[BatchRun] = []
    for run in np.argsort(first).tolist():
        rows = np.flatnonzero(number == run)
        mine = rows[column["under_test"][rows] == 1]
        outcomes, least = column["outcome"][mine].tolist(), ttc[mine]
        at = int(rows[0])
        about = {name: _plain_value(column[name][at]) for name in (*_ABOUT, *_COMMAND)}
        entry: BatchRun = {
            "scenario": about["scenario"],
            "category": about["category"],
            "variant": column["variant"][at],
            "traffic": about["traffic"],
            "agents": about["agents"],
            "seed": about["seed"],
            "status": about["status"],
            "error": about["error"],
            "n_agents": len(mine),
            "agent": int(column["agent_id"][mine[0]]) if about["agents"] == ALONE and len(mine) else None,
            "outcomes": {name: outcomes.count(name) for name in sorted(set(outcomes))},
            "ttc_min": _least(least),
            "ttc": measure_named("ttc").text(_least(least), with_unit=False),
            "page": pages.get(str(keys[run])),
            "damage": damaged.get(str(keys[run]), ""),
        }
        if entry["page"] is None and entry["status"] == "finished":
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


def _plain_value(value: Any) -> Any:  # noqa: ANN401 - a number or a text
    return value.item() if isinstance(value, np.generic) else value
