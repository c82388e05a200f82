"""Kinds of damage to a saved run, each with what the one line about it must say."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


@dataclass(frozen=True)
class Damage:
    """What happens to a folder, and which words name it."""

    name: str
    do: Callable[[Path], None]
    words: str


def edited(path: Path, change: Callable[[dict[str, Any]], object]) -> None:
    info = json.loads(path.read_bytes())
    change(info)
    path.write_text(json.dumps(info))


def _said(name: str, change: Callable[[dict[str, Any]], object], words: str) -> Damage:
    """A field of run.json."""
    return Damage(name, lambda folder: edited(folder / "run.json", change), f"run.json: {words}")


def _put(*keys: str | int, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(info: dict[str, Any]) -> None:
        for key in keys[:-1]:
            info = info[key]
        info[keys[-1]] = value

    return change


def _replaced(name: str, old: bytes, new: bytes, words: str) -> Damage:
    """Bytes of run.json."""

    def do(folder: Path) -> None:
        content = (folder / "run.json").read_bytes()
        assert old in content
        (folder / "run.json").write_bytes(content.replace(old, new, 1))

    return Damage(name, do, f"run.json: {words}")


def _table(
    name: str,
    table: str,
    change: Callable[[pa.Table], pa.Table],
    words: str,
    found_in: str = "",
    *,
    counted: bool = True,
) -> Damage:
    """Rows of a table; `counted`: run.json still says how many there were. Found in that table, or in another one."""

    def do(folder: Path) -> None:
        path = folder / f"{table}.parquet"
        pq.write_table(change(pq.read_table(path, partitioning=None)), path)
        if not counted:
            edited(folder / "run.json", lambda info: info.pop("rows"))

    return Damage(name, do, f"{found_in or table}.parquet: {words}")


def with_cell(column: str, value: Any, row: int = -1) -> Callable[[pa.Table], pa.Table]:
    """The table with another value in one row."""

    def change(table: pa.Table) -> pa.Table:
        values = table[column].to_pylist()
        values[row] = value
        field = table.schema.field(column)
        return table.set_column(table.column_names.index(column), field, pa.array(values, field.type))

    return change


def _shuffled(table: pa.Table) -> pa.Table:
    return table.take(np.random.default_rng(0).permutation(table.num_rows))


def _half(table: pa.Table) -> pa.Table:
    return table.slice(0, table.num_rows // 2)


def _without(column: str, value: int) -> Callable[[pa.Table], pa.Table]:
    return lambda table: table.filter(pc.not_equal(table[column], value))


def _file(name: str, table: str, content: Callable[[bytes], bytes], words: str) -> Damage:
    def do(folder: Path) -> None:
        path = folder / f"{table}.parquet"
        path.write_bytes(content(path.read_bytes()))

    return Damage(name, do, f"{table}.parquet: {words}")


def _folder_instead(folder: Path) -> None:
    (folder / "timing.parquet").unlink()
    (folder / "timing.parquet").mkdir()


_SETTINGS = ("settings", "settings")
_GOAL = ("agents", 0, "goal")

#: Every one is found when the folder is read, whatever it is read for.
DAMAGES = (
    _said("settings are a list", _put("settings", value=[1]), "settings: expected a table, not [1]"),
    _said("a setting is a word", _put(*_SETTINGS, "step.replan_every", value="often"), "settings.settings.step.replan"),
    _said("a setting is a list", _put(*_SETTINGS, "view.sensor_radius", value=[80]), "settings.settings.view.sensor"),
    _said("a setting is out of range", _put(*_SETTINGS, "step.replan_every", value=0), "settings.settings.step.replan"),
    _said(
        "a view is out of range", _put("settings", "views", value={"1": {"sensor_radius": -1}}), "settings.views.1: "
    ),
    _said("a view of no agent", _put("settings", "views", value={"all": {}}), "settings.views: expected an agent id"),
    _said("agents are a table", _put("agents", value={}), "agents: expected a list, not {}"),
    _said("an agent occurs twice", lambda info: info["agents"].append(info["agents"][0]), "agents: agent 1 occurs t"),
    _said("a goal is no list", _put(*_GOAL, value=7), "agents[0].goal: expected a list, not 7"),
    _said("a goal's time is a word", _put(*_GOAL, 0, "time_step", value="soon"), "agents[0].goal[0].time_step: expec"),
    _said("a goal's time is half a step", _put(*_GOAL, 0, "time_step", value=[1.5, 3]), "agents[0].goal[0].time_step"),
    _said("a goal's speed is a word", _put(*_GOAL, 0, "velocity", value=["fast", 3]), "agents[0].goal[0].velocity[0]"),
    _said(
        "a goal of another shape",
        _put(*_GOAL, 0, "areas", value=[{"kind": "blob"}]),
        "agents[0].goal[0].areas[0].kind: expected a k",
    ),
    _said(
        "a goal's corner is a word",
        _put(*_GOAL, 0, "areas", value=[{"kind": "polygon", "vertices": [[0, 0], [1, "x"], [1, 1]]}]),
        'agents[0].goal[0].areas[0].vertices[1][1]: expected a number, not "x"',
    ),
    _said(
        "a goal of two corners",
        _put(*_GOAL, 0, "areas", value=[{"kind": "polygon", "vertices": [[0, 0], [1, 1]]}]),
        "agents[0].goal[0].areas[0].vertices: expected a list of at least 3",
    ),
    _said("a note is a number", _put("notes", value=[3]), "notes[0]: expected a text, not 3"),
    _said("the digest is short", _put("digest", value="abc"), "digest: expected 64 hexadecimal digits"),
    _said("there is no digest", lambda info: info.pop("digest"), "digest: missing"),
    _said("no scenario", _put("scenario", value=None), "scenario: expected a table, not null"),
    _said("steps of no length", _put("scenario", "dt", value=0), "scenario.dt: expected a positive number, not 0"),
    _said("a path is a number", _put("scenario", "path", value=5), "scenario.path: expected a text or null, not 5"),
    _said("versions are a list", _put("versions", value=["1"]), 'versions: expected a table, not ["1"]'),
    _said("the format is true", _put("format", value=True), "it states no format"),
    _replaced("nan", b'"dt": 0.1', b'"dt": NaN', "cannot be read: NaN is not a JSON number"),
    _replaced("infinity", b'"seed": 0', b'"seed": -Infinity', "cannot be read: -Infinity is not a JSON number"),
    _replaced("a number beyond all", b'"dt": 0.1', b'"dt": 1e999', "cannot be read: 1e999 is not a JSON number"),
    _replaced("brackets", b'"notes": []', b'"notes": ' + 100_000 * b"[", "cannot be read: it is nested too deeply"),
    _replaced("bytes that are no text", b'"recorded"', b'"\xff\xfe"', "cannot be read: "),
    _table("states in disorder", "states", _shuffled, "time_step, participant_id: row "),
    _table("half of the states", "states", _half, "it has "),
    _table(
        "half of the states of an older run",
        "states",
        _half,
        "time_step: 15 in row 0 is not in",
        "outcomes",
        counted=False,
    ),
    _table("a state far away in time", "states", with_cell("time_step", 2**31), "time_step: 2147483648 in row "),
    _table("a state far before", "states", with_cell("time_step", -(2**62), 0), "time_step: -4611686018427387904 in"),
    _table("seconds of another time step", "states", with_cell("time_s", 77.0), "time_s: 77.0 in row "),
    _table("a state nowhere", "states", with_cell("x", float("inf")), "x: inf in row "),
    _table("a state that is no number", "states", with_cell("y", float("nan")), "y: nan in row "),
    _table("a state beyond everything", "states", with_cell("x", 1e300), "x: 1e+300 in row "),
    _table("a kind that is none", "states", with_cell("kind", "tank"), "kind: 'tank' is not one of unknown, car, "),
    _table("a length below 0", "states", with_cell("length", -4.5), "length: -4.5 in row "),
    _table("an agent that grows", "states", with_cell("width", 9.0), "width: 9.0 in row "),
    _table(
        "a stranger",
        "states",
        with_cell("participant_id", 77),
        "agent_id: 77 drives in states.parquet, but has no row",
        "outcomes",
    ),
    _table("half of the agents", "outcomes", _half, "it has 1 rows, run.json says 3"),
    _table("half of the agents of an older run", "outcomes", _half, "agent_id: the agents are not th", counted=False),
    _table("an outcome that is none", "outcomes", with_cell("outcome", "won"), "outcome: 'won' is not one of "),
    _table("a partner that is none", "outcomes", with_cell("partner_id", 4711), "partner_id: 4711 has no states"),
    _table("an end after the end", "outcomes", with_cell("time_step", 10**9), "time_step: 1000000000 in row 2 is "),
    _table("outcomes in disorder", "outcomes", lambda table: table.take([1, 0, 2]), "agent_id: row 1 is out of order"),
    _table("plans in disorder", "plans", _shuffled, "time_step, agent_id, point: row "),
    _table("half of the plans", "plans", _half, "it has "),
    _table("half of the plans of an older run", "plans", _half, "time_step: agent ", counted=False),
    _table("plans with holes", "plans", _without("point", 3), "point: 4 in row 3 does not follow", counted=False),
    _table("a point far away", "plans", with_cell("point", 2**31), "point: 2147483648 in row "),
    _table("a plan of an unknown agent", "plans", with_cell("agent_id", 4711), "agent_id: 4711 has no outcome"),
    _table("a status that is none", "plans", with_cell("status", "dreamt"), "status: 'dreamt' is not one of none, "),
    _table(
        "a time step without time", "timing", _without("time_step", 3), "time_step: time steps are miss", counted=False
    ),
    _table("a time below 0", "timing", with_cell("seconds", -1.0), "seconds: -1.0 in row "),
    _table("an unknown participant was seen", "views", with_cell("seen_id", 4711), "seen_id: 4711 has no states"),
    _table("seen to the end of time", "views", with_cell("last_time_step", 2**40), "last_time_step: 1099511627776 in"),
    _table("a probability of 2", "predictions", with_cell("probability", 2.0), "probability: 2.0 in row "),
    _table("predictions with holes", "predictions", _without("point", 5), "it has "),
    _table(
        "half a prediction", "predictions", lambda t: t.slice(0, t.num_rows - 1), "point: points are mis", counted=False
    ),
    _table("candidates in disorder", "candidates", _shuffled, "time_step, agent_id, candidate, point: row "),
    _table("a column too few", "states", lambda table: table.drop_columns(["yaw_rate"]), "the columns are not those"),
    _table(
        "a column of another type", "states", lambda t: t.set_column(5, "x", t["x"].cast("float32")), "the columns ar"
    ),
    _file("an empty file", "plans", lambda _: b"", "cannot be read: "),
    _file("half a file", "states", lambda content: content[: len(content) // 2], "cannot be read: "),
    Damage("a folder instead of a file", _folder_instead, "timing.parquet: not a file"),
    Damage(
        "no states", lambda folder: (folder / "states.parquet").unlink(), "states.parquet: this file of the run is m"
    ),
)
