"""The stages of a calibration: populations behind recorded leaders, then in the world, then the best ones elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from interdrive.calibration.evolution import Evolution
from interdrive.calibration.variables import VARIABLES, population, values_at
from interdrive.calibration.worlds import Worlds

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from interdrive.array_types import Floats
    from interdrive.calibration.following import Following
    from interdrive.calibration.log import Log

#: Points of a generation, and the first steps of both stages in units of the variables.
_SIZE_A, _STEP_A, _SIZE_B, _STEP_B = 14, 0.7, 10, 0.35
#: The best populations of stage A begin stage B, with these spreads of the time gap, which stage A cannot tell apart.
_SPREADS = (0.15, 0.3, 0.45, 0.6, 0.2, 0.35, 0.5, 0.25)
#: Weight of the squared distance from the usual numbers.
_PRIOR_WEIGHT = 0.002
#: So many of the best populations are compared on recordings that choose.
_CANDIDATES = 8


@dataclass
class Stages:
    """A calibration under way."""

    log: Log
    followings: Sequence[Following]
    on_step: Callable[[str, int, int], None] | None

    def short(self, evaluations: int, seed: int) -> tuple[list[Floats], list[float]]:
        """Stage A: points and their objectives, the usual population first."""
        n = len(VARIABLES)
        points, objectives = [np.zeros(n)], [self._short_objective(np.zeros(n))]
        search = Evolution(np.zeros(n), _STEP_A, _SIZE_A, seed)
        while len(points) < evaluations:
            asked = search.ask()
            own = []
            for z in asked:
                self._say("stage A: populations behind recorded leaders", len(points), evaluations)
                own.append(self._short_objective(z))
                points.append(z)
            search.tell(np.array(own))
            objectives += own
        return points, objectives

    def _short_objective(self, z: Floats) -> float:
        return self.log.objective("A", z, partial(_parts, z, self.followings))

    @property
    def n_choice(self) -> int:
        """Populations that were compared on other recordings."""
        return sum(row["stage"] == "choice" for row in self.log.rows)

    @staticmethod
    def spread_out(best: Sequence[Floats]) -> list[Floats]:
        """Where stage B begins: the best points of stage A with different spreads of the time gap."""
        column = next(i for i, one in enumerate(VARIABLES) if one.name == "time_gap.sd")
        found = [z.copy() for z in best[: len(_SPREADS)]]
        for z, spread in zip(found, _SPREADS, strict=False):
            z[column] = VARIABLES[column].units(spread)
        return found

    def long(self, worlds: Worlds, begin: Sequence[Floats], drives: int, seed: int) -> tuple[list[Floats], list[float]]:
        """Stage B: points and their objectives; the usual population and the best ones of stage A first."""
        n = len(VARIABLES)
        points = [np.zeros(n), *begin][: max(drives, 2)]
        objectives = [self._long_objective(worlds, z, i, drives) for i, z in enumerate(points)]
        best = points[1 + int(np.argmin(objectives[1:]))]
        varied = np.array([one.in_worlds for one in VARIABLES])
        search = Evolution(best[varied], _STEP_B, _SIZE_B, seed)
        while len(points) < drives:
            own = []
            for given in search.ask():
                z = best.copy()
                z[varied] = given
                own.append(self._long_objective(worlds, z, len(points), drives))
                points.append(z)
            search.tell(np.array(own))
            objectives += own
        return points, objectives

    def _long_objective(self, worlds: Worlds, z: Floats, number: int, total: int) -> float:
        def parts() -> dict[str, float]:
            self._say("stage B: populations in the world", number, total)
            return _parts(z, worlds)

        return self.log.objective("B", z, parts)

    def _say(self, what: str, done: int, total: int) -> None:
        if self.on_step is not None:
            self.on_step(what, min(done, total), total)

    def chosen(
        self, points: Sequence[Floats], objectives: Sequence[float], judges: Sequence[Following] | Worlds
    ) -> tuple[Floats, tuple[float, float]]:
        """The best of the best points on other recordings, and the objectives there of the usual one and of it."""
        best = [points[i] for i in np.argsort(objectives, kind="stable")[:_CANDIDATES]]
        costs = []
        for i, z in enumerate([np.zeros(len(VARIABLES)), *best]):
            self._say("choice: the best populations on other recordings", i, len(best) + 1)
            costs.append(self.log.objective("choice", z, partial(_parts, z, judges)))
        return best[int(np.argmin(costs[1:]))], (costs[0], min(costs[1:]))


def _parts(z: Floats, judges: Sequence[Following] | Worlds) -> dict[str, float]:
    drivers = population("candidate", values_at(z))
    if isinstance(judges, Worlds):
        return {**judges.parts(drivers), "prior": _prior(z)}
    return {"places": float(np.mean([one.objective(drivers) for one in judges])), "prior": _prior(z)}


def _prior(z: Floats) -> float:
    return _PRIOR_WEIGHT * float((z**2).sum())
