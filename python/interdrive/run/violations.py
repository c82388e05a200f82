"""Which rules of the road agents, replayed vehicles and recorded drivers broke."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from interdrive import _core
from interdrive.run.record import VIOLATIONS, Violations
from interdrive.scenario import SIGNALS
from interdrive.scenario.control import shown_together

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive.run.record import RunRecord
    from interdrive.scenario import Scenario, StopLine

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]
    Bools = NDArray[np.bool_]

#: A vehicle is speeding that is faster than the limit by more than this [m/s] for at least this long [s].
SPEED_MARGIN, SPEEDING_TIME = 0.5, 0.3
#: ... unless it has braked at least this hard since its first state [m/s²].
BRAKING = 1.0
#: It drives the wrong way if no lanelet below it leads within this angle of its heading [rad], for so long [s].
WRONG_WAY, WRONG_WAY_TIME = np.radians(120.0), 1.0
#: A stop counts if the vehicle is at most this fast [m/s] for so long [s].
STOP_SPEED, STOP_TIME = 0.2, 0.3

_RED, _GREEN, _DARK = SIGNALS.index("red"), SIGNALS.index("green"), SIGNALS.index("dark")
_VEHICLES = ("car", "truck", "bus", "motorcycle", "priority_vehicle", "taxi")


class _Row(NamedTuple):
    """A violation; the fields are the columns of `Violations`."""

    source: str
    participant_id: int
    rule: str
    first_time_step: int
    last_time_step: int
    lanelet_id: int
    x: float
    y: float
    value: float


@dataclass(frozen=True)
class _Drives:
    """Motion of vehicles, shape (vehicles, time steps), and where the centres of their fronts are."""

    source: str
    ids: Ints
    first_time_step: int
    valid: Bools
    x: Floats
    y: Floats
    orientation: Floats
    velocity: Floats
    acceleration: Floats
    front_x: Floats
    front_y: Floats


def violations(run: RunRecord, road: _core.RoadNetwork) -> Violations:
    """All violations of a run, sorted by source, participant, rule and time.

    Cars, trucks, buses, motorcycles and taxis are judged, whichever planner drives them; of agents that replace a
    recorded vehicle the recording, too. Speed limits and directions are those of the lanelets below the centre.

    Args:
        run: The run; its violations are not read.
        road: Its road network.
    """
    rows = [
        row
        for drives in _sources(run)
        for row in (*_lane_rules(drives, run.scenario, road), *_lines(drives, run.scenario, road))
    ]
    rows.sort(key=lambda row: (Violations.SOURCES.index(row.source), row.participant_id, VIOLATIONS.index(row.rule)))
    return Violations(
        source=tuple(row.source for row in rows),
        participant_id=np.array([row.participant_id for row in rows], dtype=np.int64),
        rule=tuple(row.rule for row in rows),
        first_time_step=np.array([row.first_time_step for row in rows], dtype=np.int64),
        last_time_step=np.array([row.last_time_step for row in rows], dtype=np.int64),
        lanelet_id=np.array([row.lanelet_id for row in rows], dtype=np.int64),
        x=np.array([row.x for row in rows], dtype=np.float64),
        y=np.array([row.y for row in rows], dtype=np.float64),
        value=np.array([row.value for row in rows], dtype=np.float64),
    )


def _sources(run: RunRecord) -> list[_Drives]:
    """Agents, replayed vehicles, and the recordings of agents."""
    states, obstacles = run.states, run.scenario.obstacles
    is_vehicle = np.isin(states.kinds, _VEHICLES) & ~states.is_static
    fields = ("x", "y", "orientation", "velocity", "acceleration", "valid")

    def drives(source: str, table: object, rows: Ints, ids: Ints, first: int, length: Floats) -> _Drives:
        motion = {name: getattr(table, name)[rows] for name in fields}
        ahead = 0.5 * length[:, None]
        return _Drives(
            source, ids[rows], first, **motion,
            front_x=motion["x"] + ahead * np.cos(motion["orientation"]),
            front_y=motion["y"] + ahead * np.sin(motion["orientation"]),
        )  # fmt: skip

    found = []
    for source, wanted in (("agent", states.is_agent), ("replayed", ~states.is_agent)):
        rows = np.flatnonzero(is_vehicle & wanted)
        ids, first = states.participant_id, states.first_time_step
        found.append(drives(source, states, rows, ids, first, states.length[rows]))
    agents = states.participant_id[is_vehicle & states.is_agent]
    rows = np.flatnonzero(np.isin(obstacles.ids, agents) & ~obstacles.is_static)
    length = states.length[np.searchsorted(states.participant_id, obstacles.ids[rows])]
    found.append(drives("recording", obstacles, rows, obstacles.ids, 0, length))
    return found


def _lane_rules(drives: _Drives, scenario: Scenario, road: _core.RoadNetwork) -> list[_Row]:
    """Speeding and driving the wrong way."""
    row, step = np.nonzero(drives.valid)
    x, y, orientation = (getattr(drives, name)[row, step] for name in ("x", "y", "orientation"))
    limit, off = np.full(drives.valid.shape, np.nan), np.full(drives.valid.shape, np.nan)
    limit[row, step], off[row, step] = road.lane_rules(x, y, orientation)
    dt, rows = scenario.dt, []
    excess = np.where(drives.valid & np.isfinite(limit), drives.velocity - limit, -np.inf)
    for k in range(len(drives.ids)):
        for first, last in _stretches(excess[k] > SPEED_MARGIN, SPEEDING_TIME / dt):
            if not _brakes_from_the_start(drives, k, last):
                value = float(excess[k, first : last + 1].max())
                rows.append(_row(drives, road, k, "speeding", (first, last), value))
        for first, last in _stretches(drives.valid[k] & (off[k] > WRONG_WAY), WRONG_WAY_TIME / dt):
            value = float(np.abs(drives.velocity[k, first : last + 1]).sum() * dt)
            rows.append(_row(drives, road, k, "wrong_way", (first, last), value))
    return rows


def _brakes_from_the_start(drives: _Drives, k: int, last: int) -> bool:
    """The vehicle entered too fast and has braked ever since."""
    first = int(np.argmax(drives.valid[k]))
    return bool(last > first and np.all(drives.acceleration[k, first + 1 : last + 1] <= -BRAKING))


def _stretches(holds: Bools, least: float) -> list[tuple[int, int]]:
    """First and last positions of runs of true values of at least so many steps."""
    change = np.diff(np.concatenate([[False], holds, [False]]).astype(np.int8))
    starts, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1) - 1
    return [(int(a), int(b)) for a, b in zip(starts, ends, strict=True) if b - a + 1 >= least - 1e-9]


def _row(drives: _Drives, road: _core.RoadNetwork, k: int, rule: str, steps: tuple[int, int], value: float) -> _Row:
    x, y = float(drives.x[k, steps[0]]), float(drives.y[k, steps[0]])
    first, last = (step + drives.first_time_step for step in steps)
    lanelet = next(iter(road.lanelets_at(x, y)), -1)
    return _Row(drives.source, int(drives.ids[k]), rule, first, last, lanelet, x, y, value)


def _lines(drives: _Drives, scenario: Scenario, road: _core.RoadNetwork) -> list[_Row]:
    """Red lights and stop signs that were passed."""
    rows: list[_Row] = []
    if not scenario.stop_lines or not drives.valid.size:
        return rows
    lights = {light.id: light for light in scenario.traffic_lights}
    n_steps = drives.first_time_step + drives.valid.shape[1]
    for line in scenario.stop_lines:
        for k, step in _passings(drives, line, scenario):
            passed = _row(drives, road, k, "stop_sign", (step, step), 0.0)._replace(lanelet_id=line.lanelet_id)
            if line.has_stop_sign and (least := _least_speed(drives, line, k, step, scenario.dt)) > STOP_SPEED:
                rows.append(passed._replace(value=least))
            shown = shown_together([lights[i] for i in _lights_passed(drives, line, road, k, step)], n_steps)
            shown = shown[drives.first_time_step :]
            if shown[step] == _RED and not _was_too_near(drives, k, _last_change(shown, step), step, scenario.dt):
                red = (step - _last(shown[: step + 1] != _RED)) * scenario.dt
                rows.append(passed._replace(rule="red_light", value=red))
    return rows


def _passings(drives: _Drives, line: StopLine, scenario: Scenario) -> list[tuple[int, int]]:
    """Vehicle and step of every front that has just crossed the line in the direction of its lanelet."""
    row = int(np.searchsorted(scenario.lanelets.ids, line.lanelet_id))
    middle = 0.5 * (scenario.lanelets.left[row][-2:] + scenario.lanelets.right[row][-2:])
    ahead = middle[1] - middle[0]
    left, right = line.ends
    across = (right - left) / max(float(np.hypot(*(right - left))), 1e-9)
    normal = np.array([-across[1], across[0]])
    normal = normal if normal @ ahead >= 0.0 else -normal
    past = (drives.front_x - left[0]) * normal[0] + (drives.front_y - left[1]) * normal[1]
    beside = (drives.front_x - left[0]) * across[0] + (drives.front_y - left[1]) * across[1]
    width = float(np.hypot(*(right - left)))
    within = (beside >= 0.0) & (beside <= width)
    there = drives.valid[:, 1:] & drives.valid[:, :-1]
    crossed = there & (past[:, :-1] < 0.0) & (past[:, 1:] >= 0.0) & (within[:, 1:] | within[:, :-1])
    along = np.cos(drives.orientation[:, 1:] - np.arctan2(ahead[1], ahead[0])) > 0.5
    return [(int(k), int(step) + 1) for k, step in np.argwhere(crossed & along)]


def _lights_passed(drives: _Drives, line: StopLine, road: _core.RoadNetwork, k: int, step: int) -> tuple[int, ...]:
    """The lights of the way that the vehicle takes behind the line; of all ways if that cannot be told."""
    seen: dict[int, int] = {}
    for later in range(step, drives.valid.shape[1], 2):
        if not drives.valid[k, later] or later - step > 100:
            break
        here = set(road.lanelets_at(float(drives.x[k, later]), float(drives.y[k, later])))
        for following, _ in line.light_ids:
            seen[following] = seen.get(following, 0) + (following in here)
    most = max(seen.values(), default=0)
    taken = [lights for following, lights in line.light_ids if not most or seen[following] == most]
    return tuple(sorted({i for lights in taken for i in lights}))


def _last_change(shown: Ints, step: int) -> int:
    """Position at which the light stopped being green or dark for the last time up to `step`."""
    return _last((shown[: step + 1] == _GREEN) | (shown[: step + 1] == _DARK))


def _last(holds: Bools) -> int:
    """Position behind the last true value; 0 if there is none."""
    places = np.flatnonzero(holds)
    return int(places[-1]) + 1 if len(places) else 0


def _was_too_near(drives: _Drives, k: int, since: int, step: int, dt: float) -> bool:
    """Stopping took too much when the light changed, or when the vehicle entered."""
    since = max(since, int(np.argmax(drives.valid[k])))
    way = float(np.abs(drives.velocity[k, since:step]).sum() * dt)
    return bool(drives.velocity[k, since] ** 2 > 2.0 * _core.LIGHT_DECELERATION * way)


def _least_speed(drives: _Drives, line: StopLine, k: int, step: int, dt: float) -> float:
    """The least speed that the vehicle kept for `STOP_TIME` within `_core.STOP_REACH` before the line."""
    needed = max(1, round(STOP_TIME / dt))
    middle = line.ends.mean(axis=0)
    near = np.hypot(drives.front_x[k, :step] - middle[0], drives.front_y[k, :step] - middle[1])
    wide = 0.5 * float(np.hypot(*(line.ends[1] - line.ends[0])))
    places = np.flatnonzero(drives.valid[k, :step] & (near <= np.hypot(_core.STOP_REACH, wide)))
    if len(places) < needed:
        return float(np.abs(drives.velocity[k, step]))
    speeds = np.abs(drives.velocity[k, places])
    return float(np.lib.stride_tricks.sliding_window_view(speeds, needed).max(axis=1).min())
