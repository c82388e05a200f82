"""Checks that the tables of a run folder are as written by `save`: values, order, and consistency."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import ResultsError
from interdrive.results.columns import COLUMNS
from interdrive.scenario import limits
from interdrive.storage import check_order, check_table
from interdrive.storage.checks import Damage, refuse

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    import pyarrow as pa
    from numpy.typing import NDArray

    Columns = Mapping[str, Any]
    from interdrive.array_types import Ints

#: Columns by which rows are sorted; no two rows have the same values in them.
ORDER: Mapping[str, Sequence[str]] = {
    "outcomes": ("agent_id",),
    "states": ("time_step", "participant_id"),
    "plans": ("time_step", "agent_id", "point"),
    "routes": ("agent_id", "point"),
    "views": ("observer_id", "seen_id", "first_time_step"),
    "predictions": ("time_step", "participant_id", "sender_id", "age", "mode", "point"),
    "candidates": ("time_step", "agent_id", "candidate", "point"),
    "orders": ("agent_id", "first_time_step"),
}

#: Largest position [m].
_POSITION_MAX = limits.LARGEST_COORDINATE

#: Largest number of cells of arrays of participants and time steps, or of plans and points, and additional cells per
#: row.
_CELLS, _CELLS_PER_ROW = 10_000_000, limits.CELLS_PER_STATE


def check_tables(folder: Path, tables: Mapping[str, pa.Table], info: Mapping[str, Any], missing: Sequence[str]) -> None:
    """Raises ResultsError unless every table is valid and all of them belong to the same run.

    Args:
        folder: Folder of the run.
        tables: Tables by name.
        info: Checked contents of run.json.
        missing: Tables that are empty because their files are not there.
    """
    found: dict[str, Columns] = {}
    for name, table in tables.items():
        path = folder / f"{name}.parquet"
        expected = info.get("rows", {}).get(name)
        if expected is not None and name not in missing and table.num_rows != expected:
            raise ResultsError(f"{path}: it has {table.num_rows} rows, run.json says {expected}; the file is damaged")
        found[name] = check_table(table, path, COLUMNS[name])
        if name in ORDER:
            check_order(found[name], path, ORDER[name])
    for name, check in _ACROSS.items():
        if name in found and name not in missing:
            try:
                check(found, info)
            except Damage as cause:
                raise ResultsError(f"{folder / f'{name}.parquet'}: {cause}; the folder is damaged") from None


def _check_timing(found: Mapping[str, Columns], _: Mapping[str, Any]) -> None:
    timing = found["timing"]
    steps = np.unique(timing["time_step"])
    if len(steps) and (np.any(np.diff(timing["time_step"]) < 0) or steps[-1] - steps[0] != len(steps) - 1):
        raise Damage("time_step: time steps are missing or out of order")
    refuse("seconds", timing["seconds"], timing["seconds"] < 0, "is negative")


def _check_outcomes(found: Mapping[str, Columns], info: Mapping[str, Any]) -> None:
    outcomes, states = found["outcomes"], found["states"]
    ids = outcomes["agent_id"]
    if "agents" in info and sorted(agent["id"] for agent in info["agents"]) != ids.tolist():
        raise Damage("agent_id: the agents are not those of run.json")
    drives = np.unique(states["participant_id"][states["is_agent"].astype(np.bool_)])
    _known("agent_id", drives, ids, "drives in states.parquet, but has no row")
    # A run may be stopped or end before an agent has started, and some find no room to enter.
    waits = np.isin(outcomes["outcome"], ("running", "time_limit")) & ~np.isin(ids, drives)
    _known("agent_id", ids[~waits], drives, "has no states as an agent")
    partners = outcomes["partner_id"][outcomes["partner_id"] != -1]
    _known("partner_id", partners, states["participant_id"], "has no states")
    is_outside = ~waits & ~_is_recorded(outcomes["time_step"], states)
    refuse("time_step", outcomes["time_step"], is_outside, "is not in states.parquet")
    _check_seconds(outcomes, info)


def _check_states(found: Mapping[str, Columns], info: Mapping[str, Any]) -> None:
    states, timing = found["states"], found["timing"]
    steps, ids = states["time_step"], np.unique(states["participant_id"])
    for name in ("length", "width"):
        refuse(name, states[name], states[name] < 0, "is negative")
    for name in ("x", "y", "length", "width"):
        refuse(name, states[name], np.abs(states[name]) > _POSITION_MAX, "is too large")
    if not len(steps):
        return
    if len(timing["time_step"]):
        first, last = int(timing["time_step"].min()), int(timing["time_step"].max()) + 1
        refuse("time_step", steps, (steps < first) | (steps > last), f"is outside of the run ({first} to {last})")
    _bounded("time_step", (int(steps[-1]) - int(steps[0]) + 1) * len(ids), len(steps))
    row = np.searchsorted(ids, states["participant_id"])
    first_row = np.unique(row, return_index=True)[1]
    for name in ("kind", "is_agent", "length", "width"):
        values = states[name]
        refuse(name, values, values != values[first_row][row], "differs from the participant's first one")
    _check_seconds(states, info)


def _check_plans(found: Mapping[str, Columns], info: Mapping[str, Any]) -> None:
    plans, states = found["plans"], found["states"]
    point, starts = plans["point"], plans["point"] == 0
    # Rows are sorted by point within a plan, so only gaps have to be found.
    refuse("point", point, ~starts & (np.diff(point, prepend=-1) != 1), "does not follow the point before")
    _bounded("point", int(starts.sum()) * (int(point.max(initial=0)) + 1), len(point))
    _known("agent_id", plans["agent_id"], found["outcomes"]["agent_id"], "has no outcome")
    refuse("time_step", plans["time_step"], ~_is_recorded(plans["time_step"], states), "is not in states.parquet")
    driving = states["is_agent"].astype(np.bool_)
    driven_at, driver = states["time_step"][driving], states["participant_id"][driving]
    driven, made = (
        (steps - states["time_step"][:1].sum()) * len(known) + np.searchsorted(known, ids)
        for known in [found["outcomes"]["agent_id"]]
        for steps, ids in ((driven_at, driver), (plans["time_step"][starts], plans["agent_id"][starts]))
    )
    astray = np.flatnonzero(~np.isin(made, driven))
    if len(astray):
        at = np.flatnonzero(starts)[astray[0]]
        raise Damage(f"time_step: agent {plans['agent_id'][at]} does not drive at time step {plans['time_step'][at]}")
    # Every state of an agent but its last one has a plan; before its start it replays.
    begins = {agent["id"]: agent.get("start_time_step", 0) for agent in info.get("agents", ())}
    known = np.unique(driver)
    start = np.array([begins.get(number, 0) for number in known.tolist()], dtype=np.int64)
    replays = driven_at < start[np.searchsorted(known, driver)]
    last = np.unique(driver[::-1], return_index=True)[1]
    has_ended = np.zeros(len(driver), dtype=np.bool_)
    has_ended[len(driver) - 1 - last] = True
    lost = np.flatnonzero(~has_ended & ~replays & ~np.isin(driven, made))
    if len(lost):
        raise Damage(f"time_step: agent {driver[lost[0]]} has no plan at time step {driven_at[lost[0]]}")


def _check_routes(found: Mapping[str, Columns], _: Mapping[str, Any]) -> None:
    _known("agent_id", found["routes"]["agent_id"], found["outcomes"]["agent_id"], "has no outcome")


def _check_views(found: Mapping[str, Columns], _: Mapping[str, Any]) -> None:
    views, states = found["views"], found["states"]
    _known("observer_id", views["observer_id"], found["outcomes"]["agent_id"], "is not an agent")
    _known("seen_id", views["seen_id"], states["participant_id"], "has no states")
    first, last = views["first_time_step"], views["last_time_step"]
    refuse("last_time_step", last, last < first, "is before the first one")
    for name in ("first_time_step", "last_time_step"):
        refuse(name, views[name], ~_is_recorded(views[name], states), "is not in states.parquet")


def _check_predictions(found: Mapping[str, Columns], _: Mapping[str, Any]) -> None:
    predictions = found["predictions"]
    _known("participant_id", predictions["participant_id"], found["states"]["participant_id"], "has no states")
    refuse("probability", predictions["probability"], ~_is_share(predictions["probability"]), "is not a probability")
    is_told = predictions["sender_id"] >= 0
    _known("sender_id", predictions["sender_id"][is_told], found["states"]["participant_id"], "has no states")
    names = ("time_step", "participant_id", "sender_id", "age", "mode", "probability")
    _check_blocks(predictions, names, found["states"])


def _check_candidates(found: Mapping[str, Columns], _: Mapping[str, Any]) -> None:
    candidates = found["candidates"]
    _known("agent_id", candidates["agent_id"], found["outcomes"]["agent_id"], "has no outcome")
    _check_blocks(candidates, ("time_step", "agent_id", "candidate", "rejection", "chosen"), found["states"])


def _check_violations(found: Mapping[str, Columns], _: Mapping[str, Any]) -> None:
    violations = found["violations"]
    _known("participant_id", violations["participant_id"], found["states"]["participant_id"], "has no states")
    partners = violations["partner_id"]
    _known("partner_id", partners[partners >= 0], found["states"]["participant_id"], "has no states")
    first, last = violations["first_time_step"], violations["last_time_step"]
    refuse("last_time_step", last, last < first, "is before the first one")
    for name in ("x", "y"):
        refuse(name, violations[name], np.abs(violations[name]) > _POSITION_MAX, "is too large")


def _check_orders(found: Mapping[str, Columns], _: Mapping[str, Any]) -> None:
    orders, states = found["orders"], found["states"]
    _known("agent_id", orders["agent_id"], found["outcomes"]["agent_id"], "has no outcome")
    _known("by_id", orders["by_id"][orders["by_id"] >= 0], states["participant_id"], "has no states")
    first, last = orders["first_time_step"], orders["last_time_step"]
    refuse("last_time_step", last, last < first, "is before the first one")
    for name in ("first_time_step", "last_time_step"):
        refuse(name, orders[name], ~_is_recorded(orders[name], states), "is not in states.parquet")


def _check_profile(found: Mapping[str, Columns], _: Mapping[str, Any]) -> None:
    profile = found["profile"]
    _known("agent_id", profile["agent_id"], found["outcomes"]["agent_id"], "has no outcome")
    steps = profile["time_step"]
    refuse("time_step", steps, ~_is_recorded(steps, found["states"]), "is not in states.parquet")
    refuse("seconds", profile["seconds"], profile["seconds"] < 0.0, "is negative")


def _check_demand(found: Mapping[str, Columns], _: Mapping[str, Any]) -> None:
    _known("agent_id", found["demand"]["agent_id"], found["outcomes"]["agent_id"], "has no outcome")


def _check_sumo(found: Mapping[str, Columns], _: Mapping[str, Any]) -> None:
    _known("participant_id", found["sumo"]["participant_id"], found["states"]["participant_id"], "has no state")


def _check_blocks(columns: Columns, alike: Sequence[str], states: Columns) -> None:
    """Checks that every prediction or candidate has the same points, and equal values in these columns."""
    steps, points = columns["time_step"], np.unique(columns["point"])
    if not len(steps):
        return  # planners that weigh no candidates leave an empty table
    refuse("time_step", steps, ~_is_recorded(steps, states), "is not in states.parquet")
    if len(steps) % len(points) or np.any(columns["point"].reshape(-1, len(points)) != points):
        raise Damage("point: points are missing")
    for name in alike:
        values = np.nan_to_num(columns[name], nan=-1.0).reshape(-1, len(points))
        if np.any(values != values[:, :1]):
            raise Damage(f"{name}: it changes from point to point")


def _check_seconds(columns: Columns, info: Mapping[str, Any]) -> None:
    expected = columns["time_step"] * info["scenario"]["dt"]
    refuse("time_s", columns["time_s"], ~np.isclose(columns["time_s"], expected), "is not that of the time step")


_ACROSS: Mapping[str, Callable[[Mapping[str, Columns], Mapping[str, Any]], None]] = {
    "timing": _check_timing,
    "states": _check_states,
    "outcomes": _check_outcomes,
    "plans": _check_plans,
    "routes": _check_routes,
    "views": _check_views,
    "predictions": _check_predictions,
    "candidates": _check_candidates,
    "violations": _check_violations,
    "orders": _check_orders,
    "profile": _check_profile,
    "demand": _check_demand,
    "sumo": _check_sumo,
}


def _known(name: str, ids: Ints, known: Ints, why: str) -> None:
    strangers = ids[~np.isin(ids, known)]
    if len(strangers):
        raise Damage(f"{name}: {strangers[0]} {why}")


def _is_recorded(steps: Ints, states: Columns) -> NDArray[np.bool_]:
    """Whether time steps are between the first and the last state."""
    there = states["time_step"]
    found: NDArray[np.bool_] = (
        (steps >= there[0]) & (steps <= there[-1]) if len(there) else np.zeros(len(steps), dtype=np.bool_)
    )
    return found


def _is_share(values: Any) -> Any:  # noqa: ANN401 - arrays
    return (values >= 0.0) & (values <= 1.0 + 1e-6)


def _bounded(name: str, cells: int, rows: int) -> None:
    if cells > _CELLS + _CELLS_PER_ROW * rows:
        raise Damage(f"{name}: {rows} rows are spread over {cells} places")
