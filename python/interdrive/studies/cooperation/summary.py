"""The table of the study of cooperation by variant."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.storage import Column, arrow_table

if TYPE_CHECKING:
    from interdrive.storage import ArrowTable
    from interdrive.studies.cooperation.measure import CooperationStudy

_COLUMNS = (
    Column("variant", "label", "name of the variant"),
    Column("penetration", "number", "share of equipped agents", "1"),
    Column("negotiate", "truth", "agents agree which goes first"),
    Column("delay", "number", "delay of messages", "s"),
    Column("loss", "number", "probability that a message is lost", "1"),
    Column("occlusion", "truth", "agents do not see what vehicles hide"),
    Column("services", "label", "what is sent"),
    Column("runs", "integer", "number of runs"),
    Column("reached", "number", "share of agents that reached their goal in time", "1"),
    Column("reached_change", "number", "its difference to no V2X, mean over scenarios", "1"),
    Column("reached_low", "number", "95 % interval of that over scenarios", "1"),
    Column("reached_high", "number", "95 % interval of that over scenarios", "1"),
    Column("time_lost", "number", "mean time of an agent until its outcome, more than without V2X", "s"),
    Column("time_low", "number", "95 % interval of that over scenarios", "s"),
    Column("time_high", "number", "95 % interval of that over scenarios", "s"),
    Column("collisions", "number", "agents that collided or left the road, per seed", "1"),
    Column("ttc_share", "number", "share of time with a TTC below 1.5 s, mean over scenarios", "1"),
    Column("ttc_change", "number", "its difference to no V2X, mean over scenarios", "1"),
    Column("ttc_low", "number", "95 % interval of that over scenarios", "1"),
    Column("ttc_high", "number", "95 % interval of that over scenarios", "1"),
    Column("deadlocks", "number", "circles of waiting agents, per seed", "1"),
    Column(
        "used_share", "number", "share of known participants planned with a received plan", "1", null="no agent has V2X"
    ),
    Column("plan_age", "number", "mean age of these plans", "s", null="no agent has V2X"),
)

#: Number of bootstrap samples.
_SAMPLES = 2000


def summary_table(study: CooperationStudy) -> ArrowTable:
    """One row per variant, as an Arrow table; intervals by bootstrap over scenarios.

    Differences are to runs without V2X, with occlusion to those with occlusion.
    """
    rows: list[dict[str, Any]] = study.table.to_pylist()
    names = list(dict.fromkeys(row["variant"] for row in rows))
    base = {(row["scenario"], row["occlusion"]): row for row in rows if row["penetration"] == 0}
    found = [_summary([row for row in rows if row["variant"] == name], base) for name in names]
    return arrow_table(_COLUMNS, {column.name: [row[column.name] for row in found] for column in _COLUMNS})


def _summary(rows: list[dict[str, Any]], bases: dict[tuple[str, bool], dict[str, Any]]) -> dict[str, Any]:
    occlusion = rows[0]["occlusion"]
    base = {name: row for (name, occluded), row in bases.items() if occluded == occlusion}
    scenarios = list(dict.fromkeys(row["scenario"] for row in rows))
    of = {name: [row for row in rows if row["scenario"] == name] for name in scenarios}
    share = {name: np.mean([row["reached"] / max(1, row["agents"]) for row in mine]) for name, mine in of.items()}
    time = {name: np.mean([row["time"] for row in mine]) for name, mine in of.items()}
    critical = {name: np.mean([row["ttc_share"] for row in mine]) for name, mine in of.items()}
    reached = [share[name] - base[name]["reached"] / max(1, base[name]["agents"]) for name in scenarios if name in base]
    lost = [time[name] - base[name]["time"] for name in scenarios if name in base]
    risked = [critical[name] - base[name]["ttc_share"] for name in scenarios if name in base]
    seeds = len({row["seed"] for row in rows})
    (reached_low, reached_high), (time_low, time_high) = _interval(reached), _interval(lost)
    ttc_low, ttc_high = _interval(risked)
    return {
        **{
            name: rows[0][name]
            for name in ("variant", "penetration", "negotiate", "delay", "loss", "occlusion", "services")
        },
        "runs": len(rows),
        "reached": sum(row["reached"] for row in rows) / max(1, sum(row["agents"] for row in rows)),
        "reached_change": float(np.mean(reached)) if reached else 0.0,
        "reached_low": reached_low,
        "reached_high": reached_high,
        "time_lost": float(np.mean(lost)) if lost else 0.0,
        "time_low": time_low,
        "time_high": time_high,
        "collisions": sum(row["collisions"] for row in rows) / seeds,
        "ttc_share": float(np.mean(list(critical.values()))),
        "ttc_change": float(np.mean(risked)) if risked else 0.0,
        "ttc_low": ttc_low,
        "ttc_high": ttc_high,
        "deadlocks": sum(row["deadlocks"] for row in rows) / seeds,
        "used_share": _mean([row["used_share"] for row in rows]),
        "plan_age": _mean([row["plan_age"] for row in rows]),
    }


def _interval(values: list[Any]) -> tuple[float, float]:
    """95 % interval of the mean by bootstrap, with a fixed seed."""
    if not values:
        return 0.0, 0.0
    picked = np.random.default_rng(0).integers(0, len(values), (_SAMPLES, len(values)))
    low, high = np.quantile(np.array(values)[picked].mean(axis=1), [0.025, 0.975])
    return float(low), float(high)


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None
