"""How long a call of a predictor takes, by number of vehicles: copies of a shipped junction side by side, replayed."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from interdrive.config.specs import bound_predictor
from interdrive.files import read_scenario, shipped_scenario
from interdrive.prediction_evaluation.measures import HORIZONS
from interdrive.prediction_evaluation.recordings import JUDGED_KINDS, Recording
from interdrive.scenario import Lanelets, Scenario

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.config.schema import SimulationSettings
    from interdrive.config.specs import Resolved

#: Numbers of vehicles.
VEHICLES = (1, 25, 50, 200)
#: First of the time steps at which calls are timed: all have a past by then.
_FIRST = 20
#: Calls that are timed, and time after which no further one is [s].
_CALLS, _PATIENCE = 25, 3.0
#: Distance between two copies [m].
_APART = 2000.0


@dataclass(frozen=True)
class Timing:
    """Time per call of a predictor.

    Attributes:
        predictor: Its name.
        vehicles: How many were predicted.
        milliseconds: Median over calls at successive time steps [ms].
        calls: How many.
    """

    predictor: str
    vehicles: int
    milliseconds: float
    calls: int


def crowd(n: int) -> Scenario:
    """The shipped intersection, as many copies of it as it takes for n moving vehicles, and no other obstacles."""
    one = read_scenario(shipped_scenario("intersection"))
    obstacles = one.obstacles
    fit = np.array([kind in JUDGED_KINDS for kind in obstacles.kinds]) & ~obstacles.is_static
    rows = np.flatnonzero(fit & obstacles.valid.all(axis=1))
    copies = -(-n // len(rows))
    step = 1 + int(max(one.lanelets.ids.max(), obstacles.ids.max()))
    where = [(copy, row) for copy in range(copies) for row in rows.tolist()][:n]
    copy, row = np.array([c for c, _ in where]), np.array([r for _, r in where])
    copies_of = obstacles.only(row)
    moved = replace(copies_of, ids=copies_of.ids + copy * step, x=copies_of.x + (copy * _APART)[:, None])
    return replace(one, lanelets=_side_by_side(one.lanelets, copies, step), obstacles=moved, planning_problems=())


def _side_by_side(one: Lanelets, copies: int, step: int) -> Lanelets:
    numbers = range(copies)

    def shifted(bounds: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
        return tuple(bound + np.array([copy * _APART, 0.0]) for copy in numbers for bound in bounds)

    def renamed(lists: tuple[tuple[int, ...], ...]) -> tuple[tuple[int, ...], ...]:
        return tuple(tuple(i + copy * step for i in ids) for copy in numbers for ids in lists)

    def renamed_or_none(ids: np.ndarray) -> np.ndarray:
        return np.concatenate([np.where(ids < 0, ids, ids + copy * step) for copy in numbers])

    return Lanelets(
        ids=renamed_or_none(one.ids),
        left=shifted(one.left),
        right=shifted(one.right),
        predecessors=renamed(one.predecessors),
        successors=renamed(one.successors),
        adjacent_left=renamed_or_none(one.adjacent_left),
        adjacent_left_same_direction=np.tile(one.adjacent_left_same_direction, copies),
        adjacent_right=renamed_or_none(one.adjacent_right),
        adjacent_right_same_direction=np.tile(one.adjacent_right_same_direction, copies),
        speed_limit=np.tile(one.speed_limit, copies),
        types=one.types * copies,
    )


def measured_timings(
    choices: Sequence[Resolved], settings: SimulationSettings, numbers: Sequence[int] = VEHICLES
) -> tuple[Timing, ...]:
    """Median time per call of 3 s, for every predictor and every number of vehicles; one thread calls.

    Each call is for another time step, as in a run: what a predictor keeps between steps helps it, what it could only
    keep for the same step does not.
    """
    found = []
    for n in numbers:
        recording = Recording(crowd(n), settings)
        n_steps = round(HORIZONS[-1] / recording.scenario.dt)
        for choice in choices:
            predictor = bound_predictor(choice, settings.predictor, recording.core_scenario)
            recording.at(0)
            seconds: list[float] = []
            predictor.predict(recording.world, recording.at(_FIRST - 1).scene, n_steps)
            while len(seconds) < _CALLS and sum(seconds) < _PATIENCE:
                scene = recording.at(_FIRST + len(seconds)).scene
                start = time.perf_counter()
                predictor.predict(recording.world, scene, n_steps)
                seconds.append(time.perf_counter() - start)
            found.append(Timing(choice.label, n, 1000.0 * float(np.median(seconds)), len(seconds)))
    return tuple(found)


def timing_table(timings: Sequence[Timing]) -> str:
    """Milliseconds per call as Markdown, a row per predictor."""
    numbers = sorted({one.vehicles for one in timings})
    lines = [f"| ms per call, vehicles | {' | '.join(map(str, numbers))} |", "|---|" + "--:|" * len(numbers)]
    for name in dict.fromkeys(one.predictor for one in timings):
        by_number = {one.vehicles: one.milliseconds for one in timings if one.predictor == name}
        lines.append(f"| {name} | {' | '.join(f'{by_number[n]:.3g}' for n in numbers)} |")
    return "\n".join(lines)
