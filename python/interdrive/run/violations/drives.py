"""The drives that are judged, and rows of violations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from interdrive import _core

if TYPE_CHECKING:
    from collections.abc import Collection

    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.run.record import RunRecord

_VEHICLES = ("car", "truck", "bus", "motorcycle", "priority_vehicle", "taxi")
_FIELDS = ("x", "y", "orientation", "velocity", "acceleration", "valid")


class Row(NamedTuple):
    """A violation; the fields are the columns of `Violations`."""

    source: str
    participant_id: int
    rule: str
    first_time_step: int
    last_time_step: int
    lanelet_id: int
    partner_id: int
    x: float
    y: float
    value: float


@dataclass(frozen=True)
class Drives:
    """Motion of vehicles that share a road, tables of shape (vehicles, time steps).

    Attributes:
        sources: One of `Violations.SOURCES` each; "" for vehicles that are not judged.
        ids: Their ids, ascending. kinds: One of `interdrive.scenario.KINDS` each.
        first_time_step: Time step of column 0. dt: Time between columns [s].
        length: Footprint length [m], shape (vehicles,). width: Footprint width [m].
        valid: Whether the vehicle is present.
        x: Centre [m]. y: Centre [m]. orientation: Heading [rad]. velocity: Speed along the heading [m/s].
        acceleration: Along the heading [m/s²].
    """

    sources: tuple[str, ...]
    ids: Ints
    kinds: tuple[str, ...]
    first_time_step: int
    dt: float
    length: Floats
    width: Floats
    valid: Bools
    x: Floats
    y: Floats
    orientation: Floats
    velocity: Floats
    acceleration: Floats

    @property
    def judged(self) -> list[int]:
        """Positions of the judged vehicles."""
        return [k for k, source in enumerate(self.sources) if source]

    @cached_property
    def front(self) -> tuple[Floats, Floats]:
        """Centres of the fronts [m]."""
        ahead = 0.5 * self.length[:, None]
        return self.x + ahead * np.cos(self.orientation), self.y + ahead * np.sin(self.orientation)

    def was_too_near(self, k: int, since: int, column: int, beyond: float) -> bool:
        """Whether stopping would have taken more than is asked for before a light, from `since` or its entry on.

        The place to stop at lies `beyond` [m] behind its front in a column.
        """
        since = max(since, int(np.argmax(self.valid[k])))
        speeds = self.velocity[k, since : column + 1]
        way = float(0.5 * (speeds[1:] + speeds[:-1]).sum() * self.dt) - beyond
        velocity = float(self.velocity[k, since])
        return velocity > 0.0 and not _core.could_stop(velocity, way)

    def row(
        self,
        k: int,
        rule: str,
        columns: tuple[int, int],
        value: float,
        *,
        road: _core.RoadNetwork,
        lanelet: int | None = None,
        partner: int = -1,
    ) -> Row:
        """A violation by a vehicle from one column to another; the lanelet is the one below it unless it is given."""
        x, y = float(self.x[k, columns[0]]), float(self.y[k, columns[0]])
        first, last = (column + self.first_time_step for column in columns)
        lanelet = next(iter(road.lanelets_at(x, y)), -1) if lanelet is None else lanelet
        return Row(self.sources[k], int(self.ids[k]), rule, first, last, lanelet, partner, x, y, value)


def driven(run: RunRecord, judged: Collection[int] | None = None) -> Drives:
    """Agents and replayed vehicles of a run; only those of `judged` are judged, or all for None."""
    states = run.states
    rows = np.flatnonzero(np.isin(states.kinds, _VEHICLES) & ~states.is_static)
    return Drives(
        sources=tuple(
            ("agent" if is_agent else "replayed") if judged is None or number in judged else ""
            for is_agent, number in zip(
                states.is_agent[rows].tolist(), states.participant_id[rows].tolist(), strict=True
            )
        ),
        ids=states.participant_id[rows],
        kinds=tuple(states.kinds[row] for row in rows),
        first_time_step=states.first_time_step,
        dt=run.scenario.dt,
        length=states.length[rows],
        width=states.width[rows],
        **{name: getattr(states, name)[rows] for name in _FIELDS},
    )


def recorded(run: RunRecord) -> Drives:
    """The same vehicles as recorded; vehicles that became agents are judged."""
    states, obstacles = run.states, run.scenario.obstacles
    vehicles = np.isin(states.kinds, _VEHICLES) & ~states.is_static
    rows = np.flatnonzero(np.isin(obstacles.ids, states.participant_id[vehicles]) & ~obstacles.is_static)
    place = np.searchsorted(states.participant_id, obstacles.ids[rows])
    return Drives(
        sources=tuple("recording" if is_agent else "" for is_agent in states.is_agent[place].tolist()),
        ids=obstacles.ids[rows],
        kinds=tuple(obstacles.kinds[row] for row in rows),
        first_time_step=0,
        dt=run.scenario.dt,
        length=states.length[place],
        width=states.width[place],
        **{name: getattr(obstacles, name)[rows] for name in _FIELDS},
    )


def stretches(holds: Bools, least: float = 1.0) -> list[tuple[int, int]]:
    """First and last positions of runs of true values with a minimum length."""
    change = np.diff(np.concatenate([[False], holds, [False]]).astype(np.int8))
    starts, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1) - 1
    return [(int(a), int(b)) for a, b in zip(starts, ends, strict=True) if b - a + 1 >= least - 1e-9]
