"""Crosswalks that vehicles drive onto although a person uses their lane there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive import _core
    from interdrive.array_types import Floats, Ints
    from interdrive.run.arrays import States
    from interdrive.run.record import RunRecord
    from interdrive.run.violations.drives import Drives, Row
    from interdrive.scenario import Obstacles, Scenario

#: A person is on the lane of a vehicle within this distance of its line [m] ...
_HALF_LANE = 1.75
#: ... and this much farther away, if they walk towards it with at least this speed [m/s].
_NEAR, _WALKING = 2.0, 0.3
#: Slower vehicles roll, and let the person pass [m/s].
_ROLLING = 0.5
#: Time over which the speed of people is measured, and for which their distance is looked at, at most [s].
_PAST, _PASSING = 0.3, 5.0


@dataclass(frozen=True)
class People:
    """Pedestrians, with the columns of the drives that are judged.

    Attributes:
        ids: Their ids. x: Centre [m], shape (people, columns), nan while absent. y: Centre [m].
    """

    ids: Ints
    x: Floats
    y: Floats

    def velocity(self, person: int, column: int, dt: float) -> tuple[float, float]:
        """How a person moves [m/s]; (0, 0) at their first column."""
        n = max(1, round(_PAST / dt))
        before = next((c for c in range(max(0, column - n), column) if np.isfinite(self.x[person, c])), column)
        if before == column:
            return 0.0, 0.0
        time = (column - before) * dt
        dx, dy = (float(axis[person, column] - axis[person, before]) for axis in (self.x, self.y))
        return dx / time, dy / time


def people(run: RunRecord) -> People:
    """Pedestrians of a run."""
    return _people(run.states, run.states.participant_id)


def recorded_people(run: RunRecord) -> People:
    """Pedestrians as they were recorded."""
    return _people(run.scenario.obstacles, run.scenario.obstacles.ids)


def _people(table: States | Obstacles, ids: Ints) -> People:
    rows = np.array([row for row, kind in enumerate(table.kinds) if kind == "pedestrian"], dtype=np.int64)
    there = table.valid[rows]
    return People(ids[rows], np.where(there, table.x[rows], np.nan), np.where(there, table.y[rows], np.nan))


def crosswalks(drives: Drives, walking: People, scenario: Scenario, road: _core.RoadNetwork) -> list[Row]:
    """Crosswalks that vehicles drove onto although a person was on their lane there, or about to walk onto it.

    Not if stopping would have taken too much when the person came, as before lights.
    """
    if not scenario.crosswalks or not len(walking.ids):
        return []
    rows = []
    for lanelet in scenario.crosswalks:
        for k, column, beyond in _enterings(drives, scenario, road, lanelet):
            for person in range(len(walking.ids)):
                since = _since(drives, k, column, walking, person, lanelet, road)
                if since is None or drives.was_too_near(k, since, column, beyond):
                    continue
                value = _distance(drives, k, column, walking, person)
                partner = int(walking.ids[person])
                rows.append(
                    drives.row(k, "crosswalk", (column, column), value, road=road, lanelet=lanelet, partner=partner)
                )
                break
    return rows


def _enterings(
    drives: Drives, scenario: Scenario, road: _core.RoadNetwork, lanelet: int
) -> list[tuple[int, int, float]]:
    """Vehicle and column of every front that has just come onto a crosswalk, along the road, and how far [m]."""
    row = int(np.searchsorted(scenario.lanelets.ids, lanelet))
    outline = np.concatenate([scenario.lanelets.left[row], scenario.lanelets.right[row]])
    (west, south), (east, north) = outline.min(axis=0), outline.max(axis=0)
    front_x, front_y = drives.front
    near = drives.valid & (front_x >= west) & (front_x <= east) & (front_y >= south) & (front_y <= north)
    found = []
    for k in drives.judged:
        was_on = True  # A drive may begin on it.
        for column in np.flatnonzero(drives.valid[k]).tolist():
            x, y = float(front_x[k, column]), float(front_y[k, column])
            is_on = bool(near[k, column]) and lanelet in road.lanelets_at(x, y)
            if is_on and not was_on and drives.velocity[k, column] > _ROLLING:
                found.append((k, column, _beyond(drives, road, lanelet, k, column)))
            was_on = is_on
    return found


def _beyond(drives: Drives, road: _core.RoadNetwork, lanelet: int, k: int, column: int) -> float:
    """How far a front is on a lanelet [m] that it was not on before, within a sixteenth of its last step."""
    front_x, front_y = (axis[k, column - 1 : column + 1] for axis in drives.front)
    outside, inside = 0.0, 1.0
    for _ in range(4):
        share = 0.5 * (outside + inside)
        x, y = (float(axis[0] + share * (axis[1] - axis[0])) for axis in (front_x, front_y))
        if lanelet in road.lanelets_at(x, y):
            inside = share
        else:
            outside = share
    return (1.0 - inside) * float(np.hypot(front_x[1] - front_x[0], front_y[1] - front_y[0]))


def _since(
    drives: Drives, k: int, column: int, walking: People, person: int, lanelet: int, road: _core.RoadNetwork
) -> int | None:
    """Column since which a person has used the lane of a vehicle on a crosswalk; None if they do not when it comes."""
    front_x, front_y = (float(axis[k, column]) for axis in drives.front)
    heading = float(drives.orientation[k, column])
    across = np.array([-np.sin(heading), np.cos(heading)])
    since = None
    for at in range(column, -1, -1):
        x, y = float(walking.x[person, at]), float(walking.y[person, at])
        if not np.isfinite(x) or lanelet not in road.lanelets_at(x, y):
            break
        aside = float(across @ (x - front_x, y - front_y))
        towards = -np.sign(aside) * float(across @ walking.velocity(person, at, drives.dt))
        comes = abs(aside) <= _HALF_LANE + _NEAR and towards >= _WALKING
        if abs(aside) > _HALF_LANE and not comes:
            break
        since = at
    return since


def _distance(drives: Drives, k: int, column: int, walking: People, person: int) -> float:
    """Least distance from the body of the vehicle to the middle of the person, until that is behind its rear."""
    least = np.inf
    for at in range(column, min(drives.valid.shape[1], column + round(_PASSING / drives.dt))):
        if not drives.valid[k, at] or not np.isfinite(walking.x[person, at]):
            break
        heading = float(drives.orientation[k, at])
        dx, dy = float(walking.x[person, at] - drives.x[k, at]), float(walking.y[person, at] - drives.y[k, at])
        along, aside = dx * np.cos(heading) + dy * np.sin(heading), dy * np.cos(heading) - dx * np.sin(heading)
        beyond = abs(along) - 0.5 * drives.length[k], abs(aside) - 0.5 * drives.width[k]
        least = min(least, float(np.hypot(*np.maximum(beyond, 0.0))))
        if along < -0.5 * drives.length[k]:
            break
    return least
