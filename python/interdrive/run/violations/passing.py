"""Driving on the lane of the other direction to pass what stands, which is not driving the wrong way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.run.violations.markings import is_closed

if TYPE_CHECKING:
    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.run.record import RunRecord
    from interdrive.run.violations.drives import Drives
    from interdrive.scenario import Lanelets

#: A vehicle swings out and back within this time [s], but in no less than this distance [m].
_SWING_TIME, _SWING = 3.0, 10.0


@dataclass(frozen=True)
class Standing:
    """Participants that may stand in the way, and the road.

    Attributes:
        ids: Their ids. length: Footprint length [m], shape (participants,).
        x: Centre [m], shape (participants, columns). y: Centre [m].
        stands: Present and standing.
        lanelets: The lanelets. road: The same as a road network.
    """

    ids: Ints
    length: Floats
    x: Floats
    y: Floats
    stands: Bools
    lanelets: Lanelets
    road: _core.RoadNetwork

    def is_passed(self, drives: Drives, k: int, columns: Ints) -> Bools:
        """Columns in which a vehicle is beside something on its own lane and on the lane beside, which it may use."""
        return np.array([self._is_passed(drives, k, int(column)) for column in columns], dtype=np.bool_)

    def _is_passed(self, drives: Drives, k: int, column: int) -> bool:
        x, y, heading = (float(getattr(drives, name)[k, column]) for name in ("x", "y", "orientation"))
        along = (self.x[:, column] - x) * np.cos(heading) + (self.y[:, column] - y) * np.sin(heading)
        swing = max(_SWING, _SWING_TIME * float(drives.velocity[k, column]))
        near = np.abs(along) <= 0.5 * (self.length + drives.length[k]) + swing
        rows = np.flatnonzero(self.stands[:, column] & near & (self.ids != drives.ids[k]))
        if not len(rows):
            return False
        own = {number for below in self.road.lanelets_at(x, y) for number in self._beside(below)}
        return any(
            own.intersection(self.road.lanelets_at(float(self.x[i, column]), float(self.y[i, column]))) for i in rows
        )

    def _beside(self, opposite: int) -> set[int]:
        """Lanelets from which a lane of the other direction may be used, and those before and after them."""
        lanelets, found = self.lanelets, set()
        for side in ("left", "right"):
            beside, same = (getattr(lanelets, f"adjacent_{side}{name}") for name in ("", "_same_direction"))
            for row in np.flatnonzero((beside == opposite) & ~same).tolist():
                if not is_closed(lanelets, row, side):
                    found |= {int(lanelets.ids[row]), *lanelets.predecessors[row], *lanelets.successors[row]}
        return found


def standing(run: RunRecord, road: _core.RoadNetwork) -> Standing:
    """All participants as they were in a run."""
    states = run.states
    stands = states.valid & ((np.abs(states.velocity) < _core.JUDGED_STANDSTILL_SPEED) | states.is_static[:, None])
    lanelets = run.scenario.lanelets
    return Standing(states.participant_id, states.length, states.x, states.y, stands, lanelets, road)


def recorded_standing(run: RunRecord, road: _core.RoadNetwork) -> Standing:
    """All obstacles as they were recorded."""
    obstacles = run.scenario.obstacles
    stands = obstacles.valid & (
        (np.abs(obstacles.velocity) < _core.JUDGED_STANDSTILL_SPEED) | obstacles.is_static[:, None]
    )
    length = np.array([max(shape.length, 2.0 * shape.radius) for shape in obstacles.shapes], dtype=np.float64)
    return Standing(obstacles.ids, length, obstacles.x, obstacles.y, stands, run.scenario.lanelets, road)
