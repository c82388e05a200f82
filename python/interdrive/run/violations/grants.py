"""Agents that enter junctions when they are told to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive import _core
from interdrive.run.arrays import ORDERS
from interdrive.run.phases import path_coordinates

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from interdrive.run.violations.drives import Drives

#: Largest distance of areas beyond the place of an order that concerns them [m].
_PASSAGE = 40.0


@dataclass(frozen=True)
class Grants:
    """What agents were told about junctions.

    Attributes:
        obeying: Reference paths of the agents that enter when they are told to, by id [m], shape (points, 2).
        waits: When they were told to wait and where, as `_core.World.waits` tells.
    """

    obeying: Mapping[int, NDArray[np.float64]]
    waits: Mapping[str, Any]

    def cover(self, drives: Drives, k: int, column: int) -> bool:
        """An agent that enters an area after a column had been told to, or had never been told to wait for it."""
        number = int(drives.ids[k])
        if number not in self.obeying:
            return False
        step, waits = column + drives.first_time_step, self.waits
        at_junctions = waits["kind"] != ORDERS.index("crosswalk")
        told = np.flatnonzero((waits["agent_id"] == number) & at_junctions & (waits["first_time_step"] <= step))
        if not len(told):
            return True
        last, stop = int(waits["last_time_step"][told[-1]]), float(waits["stop_s"][told[-1]])
        entering = self._front(drives, k, column + 1)
        if entering <= stop or entering - stop > _PASSAGE:
            return True
        if last >= step:
            return False
        # Orders to wait end when the agent may go, and when it cannot stop any more.
        then = last + 1 - drives.first_time_step
        room, speed = stop - self._front(drives, k, then), float(drives.velocity[k, then])
        return speed * speed < 2.0 * _core.COMMITTED * room

    def _front(self, drives: Drives, k: int, column: int) -> float:
        """Arc length of the front of an agent on its path [m]."""
        column = min(column, int(np.flatnonzero(drives.valid[k])[-1]))
        x, y = (float(axis[k, column]) for axis in drives.front)
        return float(path_coordinates(self.obeying[int(drives.ids[k])], np.array([[x, y]]))[0][0])
