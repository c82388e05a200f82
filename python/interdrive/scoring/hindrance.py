"""What a drive takes from others: the same world with and without the agent, compared vehicle by vehicle."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from interdrive.scenario.inspection import DRIVABLE_KINDS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.run import RunRecord
    from interdrive.scoring.drive_facts import Drive

#: Less than this is not lost, and as far as this counts as there [m].
_LOST_MIN, _THERE = 0.2, 0.05
#: A vehicle is forced to brake by so long a stretch [s] of so much mean deceleration [m/s²], so much more than without
#: the agent [m/s²], within this distance of it [m]. Published scores rest on them, so a test compares the deceleration
#: with what the rules expect of others (`_core.EXPECTED_DECELERATION`).
FORCED_TIME, FORCED_DECELERATION, _FORCED_MORE, _FORCED_WITHIN = 0.5, 3.0, 1.5, 40.0


@dataclass(frozen=True)
class Braking:
    """A vehicle that has to brake hard.

    Attributes:
        participant_id: The vehicle. time_step: First time step of the stretch.
        deceleration: Mean of the stretch [m/s²]. without: The same without the agent [m/s²].
    """

    participant_id: int
    time_step: int
    deceleration: float
    without: float


@dataclass(frozen=True)
class Hindrance:
    """What others lose by a drive.

    Attributes:
        lost: Together [vehicle seconds]; nan where no vehicle can react.
        losers: Time lost by each vehicle that loses some [s], by id.
        forced: Ids of the vehicles that have to brake hard.
    """

    lost: float = math.nan
    losers: Mapping[int, float] = field(default_factory=dict)
    forced: Mapping[int, Braking] = field(default_factory=dict)


@dataclass(frozen=True)
class Undisturbed:
    """Vehicles of a world without the agent and its recording; arrays of shape (vehicles, steps).

    Attributes:
        participant_id: The vehicles, ascending, shape (vehicles,).
        first_time_step: Of the first column.
        valid: A vehicle is there. x: [m]. y: [m]. velocity: [m/s].
    """

    participant_id: Ints
    first_time_step: int
    valid: Bools
    x: Floats
    y: Floats
    velocity: Floats

    @classmethod
    def of(cls, run: RunRecord) -> Undisturbed:
        """All that can lose time, in a run without the agent."""
        states = run.states
        rows = [k for k, kind in enumerate(states.kinds) if kind in DRIVABLE_KINDS and not states.is_static[k]]
        return cls(
            states.participant_id[rows],
            states.first_time_step,
            states.valid[rows],
            states.x[rows],
            states.y[rows],
            states.velocity[rows],
        )


def hindrance_of(drive: Drive, run: RunRecord, without: Undisturbed) -> Hindrance:
    """What others lose in a run by one of its drives.

    Args:
        drive: The drive in `run`.
        run: The world with the agent.
        without: The same world without the agent and its recording.
    """
    states = run.states
    rows = {int(number): k for k, number in enumerate(without.participant_id.tolist())}
    own = int(np.searchsorted(states.participant_id, drive.agent_id))
    first = drive.column + states.first_time_step
    last = first + len(drive.time) - 1
    losers, forced = {}, {}
    for k, number in enumerate(states.participant_id.tolist()):
        if number not in rows or states.is_static[k] or states.kinds[k] not in DRIVABLE_KINDS or k == own:
            continue
        pair = _Pair(run, without, (k, rows[number]), (first, last))
        if not len(pair.steps):
            continue
        time = pair.lost()
        if time > 0.0:
            losers[number] = time
        braking = pair.forced(own)
        if braking is not None:
            forced[number] = braking
    return Hindrance(float(sum(losers.values())), losers, forced)


class _Pair:
    """One vehicle in both worlds, at the time steps at which both have it."""

    def __init__(self, run: RunRecord, without: Undisturbed, rows: tuple[int, int], window: tuple[int, int]) -> None:
        self.run, self.without, self.rows, self.dt = run, without, rows, run.scenario.dt
        steps = np.arange(window[0], window[1] + 1)
        there = np.ones(len(steps), dtype=np.bool_)
        for table, row in ((run.states, rows[0]), (without, rows[1])):
            columns = steps - table.first_time_step
            inside = (columns >= 0) & (columns < table.valid.shape[1])
            there &= inside
            there[inside] &= table.valid[row, columns[inside]]
        self.steps = steps[there]

    def _taken(self, world: int, name: str) -> Floats:
        table, row = ((self.run.states, self.rows[0]), (self.without, self.rows[1]))[world]
        values: Floats = getattr(table, name)[row, self.steps - table.first_time_step]
        return values

    def _way(self, world: int) -> Floats:
        x, y = self._taken(world, "x"), self._taken(world, "y")
        return np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])

    def lost(self) -> float:
        """How long ago it would have been where it is at last [s]."""
        own, free = self._way(0), self._way(1)
        if free[-1] - own[-1] < _LOST_MIN:
            return 0.0
        reached = int(np.flatnonzero(free >= own[-1] - _THERE)[0])
        return float(self.steps[-1] - self.steps[reached]) * self.dt

    def forced(self, agent: int) -> Braking | None:
        """The hardest braking for the agent in a row of the states."""
        n = max(1, round(FORCED_TIME / self.dt))
        if len(self.steps) <= n:
            return None
        whole = self.steps[n:] - self.steps[:-n] == n
        changes = [(speed[n:] - speed[:-n]) / (n * self.dt) for speed in (self._taken(w, "velocity") for w in (0, 1))]
        states = self.run.states
        columns = self.steps[:-n] - states.first_time_step
        away = np.hypot(
            self._taken(0, "x")[:-n] - states.x[agent, columns], self._taken(0, "y")[:-n] - states.y[agent, columns]
        )
        is_forced = whole & (changes[0] <= -FORCED_DECELERATION) & (changes[0] <= changes[1] - _FORCED_MORE)
        is_forced &= away <= _FORCED_WITHIN
        if not is_forced.any():
            return None
        at = int(np.where(is_forced, changes[0], np.inf).argmin())
        number = int(states.participant_id[self.rows[0]])
        return Braking(number, int(self.steps[at]), -float(changes[0][at]), -float(changes[1][at]))
