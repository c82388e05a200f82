"""Stop lines that vehicles pass: red lights and stop signs."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from interdrive import _core
from interdrive.scenario import SIGNALS
from interdrive.scenario.control import GOING_SIGNALS, shown_together

if TYPE_CHECKING:
    from interdrive.array_types import Bools, Ints
    from interdrive.run.violations.drives import Drives, Row
    from interdrive.scenario import Scenario, StopLine

#: A stop counts if the vehicle stands for so long [s].
STOP_TIME = 0.3

_RED = SIGNALS.index("red")


class Passing(NamedTuple):
    """A vehicle passes a stop line.

    Attributes:
        vehicle: Its position among the drives.
        column: Column in which its front is beyond the line for the first time.
        line: The line.
        shown: What the lights of its way show, as positions in `SIGNALS`, by columns.
        may_turn_on_red: It takes a way onto which drivers may turn on red after stopping.
        beyond: How far its front is beyond the line then [m].
    """

    vehicle: int
    column: int
    line: StopLine
    shown: Ints
    may_turn_on_red: bool = False
    beyond: float = 0.0

    @property
    def is_red(self) -> bool:
        """It passes a red light."""
        return bool(self.shown[self.column] == _RED)

    def holds(self, column: int) -> bool:
        """Its light is yellow or red in a column."""
        return bool(self.shown[column] not in GOING_SIGNALS)


def passings(drives: Drives, scenario: Scenario, road: _core.RoadNetwork) -> list[Passing]:
    """All stop lines that vehicles pass, by lines."""
    if not scenario.stop_lines or not drives.valid.size:
        return []
    lights = {light.id: light for light in scenario.traffic_lights}
    n_steps = drives.first_time_step + drives.valid.shape[1]
    found = []
    for line in scenario.stop_lines:
        for k, column, beyond in _crossings(drives, line, scenario):
            ways = _ways_taken(drives, line, road, k, column)
            counting = sorted(
                {i for following, lights_there in line.light_ids if following in ways for i in lights_there}
            )
            shown = shown_together([lights[i] for i in counting], n_steps)[drives.first_time_step :]
            found.append(Passing(k, column, line, shown, bool(ways) and ways <= set(line.turns_on_red), beyond))
    return found


def line_rules(drives: Drives, passed: list[Passing], road: _core.RoadNetwork) -> list[Row]:
    """Red lights and stop signs that were passed."""
    rows = []
    for one in passed:
        k, column, line, shown, may_turn, beyond = one
        if not drives.sources[k]:
            continue
        least = _least_speed(drives, line, k, column) if line.has_stop_sign or may_turn else np.inf
        if line.has_stop_sign and least > _core.JUDGED_STANDSTILL_SPEED:
            rows.append(drives.row(k, "stop_sign", (column, column), least, road=road, lanelet=line.lanelet_id))
        if may_turn and least <= _core.JUDGED_STANDSTILL_SPEED:
            continue
        if one.is_red and not drives.was_too_near(k, _last_change(shown, column), column, beyond):
            red = (column - _last(shown[: column + 1] != _RED)) * drives.dt
            rows.append(drives.row(k, "red_light", (column, column), red, road=road, lanelet=line.lanelet_id))
    return rows


def _crossings(drives: Drives, line: StopLine, scenario: Scenario) -> list[tuple[int, int, float]]:
    """Vehicle and step of every front that has just crossed the line along its lanelet, and by how much [m]."""
    row = int(np.searchsorted(scenario.lanelets.ids, line.lanelet_id))
    middle = 0.5 * (scenario.lanelets.left[row][-2:] + scenario.lanelets.right[row][-2:])
    ahead = middle[1] - middle[0]
    left, right = line.ends
    across = (right - left) / max(float(np.hypot(*(right - left))), 1e-9)
    normal = np.array([-across[1], across[0]])
    normal = normal if normal @ ahead >= 0.0 else -normal
    front_x, front_y = drives.front
    past = (front_x - left[0]) * normal[0] + (front_y - left[1]) * normal[1]
    beside = (front_x - left[0]) * across[0] + (front_y - left[1]) * across[1]
    width = float(np.hypot(*(right - left)))
    within = (beside >= 0.0) & (beside <= width)
    there = drives.valid[:, 1:] & drives.valid[:, :-1]
    crossed = there & (past[:, :-1] < 0.0) & (past[:, 1:] >= 0.0) & (within[:, 1:] | within[:, :-1])
    along = np.cos(drives.orientation[:, 1:] - np.arctan2(ahead[1], ahead[0])) > 0.5
    return [(int(k), int(step) + 1, float(past[k, step + 1])) for k, step in np.argwhere(crossed & along)]


def _ways_taken(drives: Drives, line: StopLine, road: _core.RoadNetwork, k: int, step: int) -> set[int]:
    """The lanelet that the vehicle takes behind the line; all that follow if that cannot be told."""
    seen: dict[int, int] = {}
    for later in range(step, drives.valid.shape[1], 2):
        if not drives.valid[k, later] or later - step > 100:
            break
        here = set(road.lanelets_at(float(drives.x[k, later]), float(drives.y[k, later])))
        for following, _ in line.light_ids:
            seen[following] = seen.get(following, 0) + (following in here)
    most = max(seen.values(), default=0)
    return {following for following, _ in line.light_ids if not most or seen[following] == most}


def _last_change(shown: Ints, step: int) -> int:
    """Position at which the light stopped being green or dark for the last time up to `step`."""
    return _last(np.isin(shown[: step + 1], GOING_SIGNALS))


def _last(holds: Bools) -> int:
    """Position behind the last true value; 0 if there is none."""
    places = np.flatnonzero(holds)
    return int(places[-1]) + 1 if len(places) else 0


def _least_speed(drives: Drives, line: StopLine, k: int, step: int) -> float:
    """The least speed that the vehicle kept for `STOP_TIME` within `_core.STOP_REACH` before the line."""
    needed = max(1, round(STOP_TIME / drives.dt))
    middle = line.ends.mean(axis=0)
    front_x, front_y = drives.front
    near = np.hypot(front_x[k, :step] - middle[0], front_y[k, :step] - middle[1])
    wide = 0.5 * float(np.hypot(*(line.ends[1] - line.ends[0])))
    places = np.flatnonzero(drives.valid[k, :step] & (near <= np.hypot(_core.STOP_REACH, wide)))
    if len(places) < needed:
        return float(np.abs(drives.velocity[k, step]))
    speeds = np.abs(drives.velocity[k, places])
    return float(np.lib.stride_tricks.sliding_window_view(speeds, needed).max(axis=1).min())
