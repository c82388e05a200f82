"""What drives are judged on: the road with its crossings, traffic as simulated, and traffic as recorded."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive import _core
from interdrive.criticality.source import traffic_of
from interdrive.native_settings import RoadSettings
from interdrive.scenario import KINDS
from interdrive.scenario.native import core_road
from interdrive.scoring.terms import Motion

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.array_types import Floats, Ints
    from interdrive.run import RunRecord, States
    from interdrive.scenario import Obstacles, Scenario

#: Lanelets cross that overlap by more than this [m²] once they are eroded by this [m]; as in `interdrive.criticality`.
_EROSION, _OVERLAP_MIN = 0.3, 0.1


@dataclass
class Site:
    """A scenario's road and recording; what is looked up once serves all runs.

    Attributes:
        scenario: The scenario.
        settings: Of the road.
        road: The road network.
        crossing: Ids of lanelets that cross others.
    """

    scenario: Scenario
    settings: RoadSettings
    road: _core.RoadNetwork
    crossing: list[int]
    _recorded: _core.Traffic | None = None
    _times: dict[tuple[int, float], tuple[Floats, Ints]] = field(default_factory=dict)

    def recorded_times(self, number: int, horizon: float) -> tuple[Floats, Ints]:
        """Time to contact straight on of a recorded vehicle and the other one's id, from time step 0 on."""
        if (number, horizon) not in self._times:
            if self._recorded is None:
                self._recorded = traffic(self, self.scenario)
            axle = [_axle(self.scenario.obstacles, number)]
            time, partner = self._recorded.straight_times([number], axle, horizon, 1)
            self._times[number, horizon] = time[0], partner[0]
        return self._times[number, horizon]


#: The site that was used last: runs of a batch come scenario by scenario.
_last: list[Site] = []


def site_of(run: RunRecord, settings: Mapping[str, Any]) -> Site:
    """The site of a run, whose settings are given by their dotted names."""
    own = {name.partition(".")[2]: value for name, value in settings.items() if name.startswith("road.")}
    known = {name: value for name, value in own.items() if name in RoadSettings.__dataclass_fields__}
    road_settings = RoadSettings(**known)
    if not (_last and _last[0].scenario is run.scenario and _last[0].settings == road_settings):
        road = core_road(run.scenario, road_settings)
        # Disturbed scenarios are on one road.
        is_known = bool(_last) and _last[0].road is road
        crossing = _last[0].crossing if is_known else _core.crossing_lanelets(road, _EROSION, _OVERLAP_MIN)
        _last[:] = [Site(run.scenario, road_settings, road, crossing)]
    return _last[0]


def traffic(site: Site, source: Scenario | RunRecord) -> _core.Traffic:
    """Traffic as simulated or recorded, in the core."""
    return _core.Traffic(site.scenario.dt, site.road, traffic_of(source).in_core, site.crossing)


def _axle(obstacles: Obstacles, number: int) -> float:
    shape = obstacles.shapes[int(np.searchsorted(obstacles.ids, number))]
    x = shape.vertices[:, 0] if len(shape.vertices) else np.array([0.0])
    return rear_axle_to_center(shape.length or 2.0 * shape.radius or float(np.ptp(x)))


def rear_axle_to_center(length: float) -> float:
    """Distance from the rear axle forward to the centre of a footprint of that length [m]."""
    size = max(length, 0.1)
    return _core.Vehicle(KINDS.index("car"), size, size).rear_axle_to_center


def motion_of(table: States | Obstacles, row: int, columns: Ints, first_time_step: int) -> Motion:
    """Some states of one participant."""

    def taken(name: str) -> Floats:
        values: Floats = np.ascontiguousarray(getattr(table, name)[row, columns], dtype=np.float64)
        return values

    names = ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate")
    return Motion(columns + first_time_step, **{name: taken(name) for name in names})


def window_of(states: States, row: int) -> Ints:
    """Columns from the first planned state of an agent to its last one; its first state is given, not planned."""
    columns: Ints = np.flatnonzero(states.valid[row])[1:]
    return columns


def recorded_columns(obstacles: Obstacles, row: int, time_steps: Ints) -> Ints:
    """Columns of those time steps at which a vehicle was recorded."""
    there = time_steps[(time_steps >= 0) & (time_steps < obstacles.n_steps)]
    found: Ints = there[obstacles.valid[row, there]]
    return found


def along(path: Floats, motion: Motion) -> tuple[Floats, Floats]:
    """Arc length [m] and lateral distance [m] on a path; empty where either is."""
    if len(path) < 2 or not len(motion.x):
        return np.empty(0), np.empty(0)
    return _core.follow_path(np.ascontiguousarray(path), motion.x, motion.y)
