"""From times of steps to numbers that can be compared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.storage import Column, arrow_table

if TYPE_CHECKING:
    from interdrive.storage import ArrowTable
    from interdrive.studies.runtime.measure import RuntimeStudy

#: Parts of a step that are summarized.
PARTS = ("observe", "predict", "plan", "collision", "update", "python")
#: Parts of a step that tables for people show.
STEP_PARTS = ("predict", "plan", "collision", "update")
#: Up to this load per core times are those of a quiet machine.
QUIET = 0.3
#: Steps count in which at least this share of the agents drives.
_DRIVING = 0.9

_KEYS = ("kind", "scenario", "predictor", "agents", "threads")
SUMMARY_COLUMNS = (
    Column("kind", "label", "what the scenario shows"),
    Column("scenario", "label", "name of the scenario"),
    Column("predictor", "label", "name of the predictor"),
    Column("agents", "integer", "number of agents"),
    Column("threads", "integer", "threads that plan"),
    Column("participants", "number", "agents and recorded vehicles present, mean", "1"),
    Column("steps", "integer", "steps that count"),
    Column("mean", "number", "time per step, mean", "s"),
    Column("lower", "number", "lower quartile", "s"),
    Column("median", "number", "median", "s"),
    Column("upper", "number", "upper quartile", "s"),
    Column("slow", "number", "99 % quantile", "s"),
    *(Column(part, "number", f"{part} per step, median", "s") for part in PARTS),
)


def summary_table(study: RuntimeStudy) -> ArrowTable:
    """One row per scenario, predictor, number of agents and number of threads, over all repetitions.

    Only steps count in which at least 90 % of the agents drive.
    """
    steps: dict[str, Any] = study.steps.to_pydict()
    places: dict[tuple[Any, ...], list[int]] = {}
    for index, (agents, driving) in enumerate(zip(steps["agents"], steps["driving"], strict=True)):
        if driving >= _DRIVING * agents:
            places.setdefault(tuple(steps[key][index] for key in _KEYS), []).append(index)
    columns: dict[str, list[Any]] = {column.name: [] for column in SUMMARY_COLUMNS}
    for key, rows in places.items():
        seconds = np.array([steps["step"][row] for row in rows])
        lower, median, upper, slow = np.quantile(seconds, (0.25, 0.5, 0.75, 0.99)).tolist()
        values = dict(zip(_KEYS, key, strict=True))
        values |= {"participants": float(np.mean([steps["participants"][row] for row in rows])), "steps": len(rows)}
        values |= {"mean": float(seconds.mean()), "lower": lower, "median": median, "upper": upper}
        values["slow"] = slow
        values |= {part: float(np.median([steps[part][row] for row in rows])) for part in PARTS}
        for name, value in values.items():
            columns[name].append(value)
    return arrow_table(SUMMARY_COLUMNS, columns)


def step_rows(study: RuntimeStudy) -> list[tuple[str, ...]]:
    """A row per scenario and number of agents: medians (quartiles) and, with all threads, slow steps and parts [ms]."""
    found: dict[tuple[Any, ...], dict[int, dict[str, Any]]] = {}
    for row in summary_table(study).to_pylist():
        found.setdefault((row["kind"], row["predictor"], row["agents"]), {})[row["threads"]] = row
    rows = []
    for (kind, predictor, agents), by_threads in found.items():
        name = kind if predictor == "lane_following" else f"{kind}, {predictor}"
        several = by_threads.get(study.threads)
        if several is None:
            continue
        alone = by_threads.get(1)
        parts = [f"{1e3 * several[part]:.2f}" for part in STEP_PARTS]
        ratio = f"{alone['median'] / several['median']:.2f}" if alone is not None else "–"
        share = f"{100 * several['python'] / several['median']:.1f} %"
        rows.append(
            (name, str(agents), _spread(alone), _spread(several), ratio, f"{1e3 * several['slow']:.3g}", *parts, share)
        )
    return rows


def _spread(row: dict[str, Any] | None) -> str:
    if row is None:
        return "–"
    lower, median, upper = (f"{1e3 * row[name]:.3g}" for name in ("lower", "median", "upper"))
    return f"{median} ({lower}–{upper})"


@dataclass(frozen=True)
class Growth:
    """How the time of a step grows with the number of agents.

    Attributes:
        agents: Numbers of agents, ascending.
        seconds: Median time of a step for each [s].
        exponent: b of the power law seconds = a * agents**b, by least squares of the logarithms.
        factor: a of the power law [s].
        to_linear: Growth from the smallest to the largest number, divided by what linear growth would give.
    """

    agents: tuple[int, ...]
    seconds: tuple[float, ...]
    exponent: float
    factor: float
    to_linear: float


def growth(study: RuntimeStudy, threads: int, kind: str = "town") -> Growth | None:
    """Growth in one kind of scenario; None if it was driven with fewer than two numbers of agents."""
    rows = [row for row in summary_table(study).to_pylist() if row["kind"] == kind and row["threads"] == threads]
    rows.sort(key=lambda row: row["agents"])
    if len(rows) < 2:
        return None
    agents, seconds = (np.array([row[name] for row in rows], dtype=np.float64) for name in ("agents", "median"))
    exponent, intercept = np.polyfit(np.log(agents), np.log(seconds), 1).tolist()
    return Growth(
        agents=tuple(int(n) for n in agents),
        seconds=tuple(seconds.tolist()),
        exponent=exponent,
        factor=float(np.exp(intercept)),
        to_linear=float(seconds[-1] / seconds[0] / (agents[-1] / agents[0])),
    )
