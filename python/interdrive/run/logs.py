"""What is noted while a run goes on: times, predictions and candidates, thinned out, and how old received plans are."""

from __future__ import annotations

import math
import time
from array import array
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from interdrive.run.arrays import PHASES, PLAN_PARTS, PLAN_STATUS, Profile, RecordedCandidates, RecordedPredictions
from interdrive.run.cooperation import PlanAges

if TYPE_CHECKING:
    from collections.abc import Callable, Container

    from numpy.typing import NDArray

    from interdrive import _core
    from interdrive.array_types import Floats, Ints
    from interdrive.run.record import Json

T = TypeVar("T")

#: Time between kept points [s].
_SPACING = 0.5

#: Kept positions are whole multiples of this [m]: about a millimetre, in few bits.
_RESOLUTION = 2.0**-10

#: One in this many of the kept candidates is a rejected one.
_ONE_REJECTED_IN = 5


class Logs:
    """All that a run notes of its steps."""

    def __init__(
        self, dt: float, *, v2x: bool, profile: bool, predictions: bool, candidates: CandidateLog | None
    ) -> None:
        """Starts empty.

        Args:
            dt: Time between steps [s].
            v2x: Whether agents receive plans.
            profile: Whether times of single plans are noted.
            predictions: Whether predictions are.
            candidates: Where candidates are noted; None: they are not.
        """
        self._dt = dt
        self._time_step = 0
        self._step: _core.Step | None = None
        self._timings = array("d")
        self._ages = PlanAges() if v2x else None
        self._profile = ProfileLog() if profile else None
        self._predictions = PredictionLog(dt) if predictions else None
        self._candidates = candidates

    def begin(self, time_step: int) -> None:
        """Times that follow belong to this time step."""
        self._time_step = time_step

    def timed(self, agent_id: int, part: str, work: Callable[..., T], *args: Any, **named: Any) -> T:  # noqa: ANN401
        """Calls `work`, and notes its time for a part of an agent's plan if there is a profile."""
        if self._profile is None:
            return work(*args, **named)
        begin = time.perf_counter()
        try:
            return work(*args, **named)
        finally:
            self.add_time(agent_id, part, time.perf_counter() - begin)

    def add_time(self, agent_id: int, part: str, seconds: float) -> None:
        """Notes time [s] for a part of an agent's plan, one of `PLAN_PARTS`, if there is a profile."""
        if self._profile is not None:
            self._profile.add(self._time_step, agent_id, part, seconds)

    def add_plans(self, world: _core.World, step: _core.Step, outside: Container[int]) -> None:
        """Notes what a step has when all plans are made.

        Args:
            world: Before it moves.
            step: The step.
            outside: Agents whose plans were not made by the core and have their times already.
        """
        self._step = step
        if self._profile is not None:
            for agent_id, seconds in zip(step.ids.tolist(), step.plan_seconds.tolist(), strict=True):
                if agent_id not in outside:
                    self.add_time(agent_id, "plan", seconds)
        if self._ages is not None:
            self._ages.add(*step.predictions.plan_ages())
        if self._predictions is not None:
            self._predictions.add(step.predictions)
        if self._candidates is not None:
            self._candidates.add(world, step)

    def end(self, step: _core.Step) -> None:
        """Notes the times of the phases of a step that is over."""
        self._timings.extend((self._time_step, *step.seconds))

    def catch_up(self, time_step: int) -> None:
        """Notes a step in which the world moved to this time step, but whose end Ctrl-C kept from being noted."""
        noted = self._timings[-1 - len(PHASES)] if self._timings else -math.inf
        if self._step is not None and noted < self._time_step < time_step:
            self.end(self._step)

    @property
    def times(self) -> Floats:
        """Time step and seconds of its phases, shape (steps, 1 + phases)."""
        return np.array(self._timings).reshape(-1, 1 + len(PHASES))

    def profile(self, end: int) -> Profile | None:
        """Times of single plans before a time step, if they are recorded."""
        return None if self._profile is None else self._profile.table(end)

    def predictions(self, end: int) -> RecordedPredictions | None:
        """Predictions before a time step, if they are recorded."""
        return None if self._predictions is None else self._predictions.table(end)

    def candidates(self, end: int) -> RecordedCandidates | None:
        """Candidates before a time step, if they are recorded."""
        return None if self._candidates is None else self._candidates.table(end)

    def cooperation(self, world: _core.World) -> dict[str, Json] | None:
        """What messages were good for, if agents receive plans."""
        return None if self._ages is None else self._ages.summary(world, self._dt)


class ProfileLog:
    """Collects how long the plans of single agents took."""

    def __init__(self) -> None:
        """Starts empty."""
        self._seconds: dict[tuple[int, int, int], float] = {}

    def add(self, time_step: int, agent_id: int, part: str, seconds: float) -> None:
        """Adds time [s] to a part, one of `PLAN_PARTS`."""
        key = time_step, agent_id, PLAN_PARTS.index(part)
        self._seconds[key] = self._seconds.get(key, 0.0) + seconds

    def table(self, end: int) -> Profile:
        """All rows before a time step."""
        rows = sorted(key for key in self._seconds if key[0] < end)
        return Profile(
            time_step=np.array([key[0] for key in rows], dtype=np.int64),
            agent_id=np.array([key[1] for key in rows], dtype=np.int64),
            part=tuple(PLAN_PARTS[key[2]] for key in rows),
            seconds=np.array([self._seconds[key] for key in rows], dtype=np.float64),
        )


class PredictionLog:
    """Collects the predictions of every time step."""

    def __init__(self, dt: float) -> None:
        """Starts empty; `dt` is the time between steps [s]."""
        self._stride = max(1, round(_SPACING / dt))
        self._rows: list[tuple[NDArray[Any], ...]] = []

    def add(self, predictions: _core.Predictions) -> None:
        """Keeps every mode that has a probability, and what agents were told."""
        n = len(predictions.ids)
        self._add(predictions, np.full(n, -1), np.full(n, np.nan))
        if (told := predictions.received()) is not None:
            self._add(*told)

    def _add(self, predictions: _core.Predictions, sender: Ints, age: Floats) -> None:
        row, mode = np.nonzero(predictions.probability > 0)
        # Column i is i + 1 time steps ahead.
        columns = np.arange(self._stride - 1, predictions.x.shape[-1], self._stride)
        there = predictions.valid[row, mode][:, columns]
        picked = row[:, None], mode[:, None], columns[None]
        covariance = np.where(there[..., None, None], predictions.covariance[picked], np.nan)
        x, y = (np.where(there, _rounded(table[picked]), np.nan) for table in (predictions.x, predictions.y))
        step, probability = np.full(len(row), predictions.time_step), predictions.probability[row, mode]
        self._rows.append((step, predictions.ids[row], mode, probability, sender[row], age[row], x, y, covariance))

    def table(self, end: int) -> RecordedPredictions:
        """All rows before a time step."""
        made = [rows for rows in self._rows if not len(rows[0]) or rows[0][0] < end]
        points = max((rows[6].shape[1] for rows in made), default=0)
        ints, floats, empty = np.empty(0, dtype=np.int64), np.empty(0), np.empty((0, points))
        parts: list[tuple[NDArray[Any], ...]]
        parts = [(ints, ints, ints, floats, ints, floats, empty, empty, np.empty((0, points, 2, 2)))]
        parts += [(*rows[:6], *(_widened(table, points) for table in rows[6:])) for rows in made]
        step, participant, mode, probability, sender, age, *motion = map(np.concatenate, zip(*parts, strict=True))
        order = np.lexsort((mode, age, sender, participant, step))
        x, y, covariance = (table[order] for table in motion)
        return RecordedPredictions(
            point=self._stride * np.arange(1, points + 1),
            time_step=step[order],
            participant_id=participant[order],
            mode=mode[order],
            probability=probability[order],
            x=x,
            y=y,
            covariance=covariance,
            sender_id=sender[order],
            age=age[order],
        )


def steps_between(spacing: float, dt: float, replan_every: int) -> int:
    """Time steps between plans whose candidates are kept: at least `spacing` [s], rounded up to a new plan."""
    steps = max(1, round(min(spacing / dt, 1e9)))
    return -(-steps // replan_every) * replan_every


class CandidateLog:
    """Collects candidates of native sampling planners; other planners have no candidates."""

    def __init__(self, dt: float, count: int, spacing: float, threads: int) -> None:
        """Starts empty; keeps at most `count` candidates of one new plan of each agent per `spacing` [s]."""
        self._every = steps_between(spacing, dt, 1)
        self._next: dict[int, int] = {}
        self._stride, self._count, self._threads = max(1, round(_SPACING / dt)), count, threads
        self._rows: list[tuple[int, int, Floats, list[str], NDArray[np.bool_], Floats, Floats]] = []

    def add(self, world: _core.World, step: _core.Step) -> None:
        """Keeps the candidates of agents with new plans, if they are due."""
        carried_over = (step.status == PLAN_STATUS.index("planned")) & np.isnan(step.cost)
        new = step.ids[~carried_over].tolist()
        agents = [agent for agent in new if self._next.get(agent, world.time_step) <= world.time_step]
        self._next |= dict.fromkeys(agents, world.time_step + self._every)
        with ThreadPoolExecutor(self._threads) as pool:
            every = list(pool.map(lambda agent: world.candidates(agent, step), agents))
        for agent, found in zip(agents, every, strict=True):
            if found is None or not len(found["cost"]):
                continue
            kept = _spread(found["cost"], found["rejection"], int(found["chosen"]), self._count)
            columns = np.arange(0, found["x"].shape[1], self._stride)
            self._rows.append(
                (
                    world.time_step,
                    agent,
                    found["cost"][kept],
                    [found["rejection"][i] for i in kept.tolist()],
                    kept == found["chosen"],
                    _rounded(found["x"][kept][:, columns]),
                    _rounded(found["y"][kept][:, columns]),
                )
            )

    def table(self, end: int) -> RecordedCandidates:
        """All rows before a time step."""
        made = [rows for rows in self._rows if rows[0] < end]
        points = max((rows[5].shape[1] for rows in made), default=0)
        counts = [len(rows[2]) for rows in made]
        empty = np.empty((0, points))
        return RecordedCandidates(
            point=self._stride * np.arange(points),
            time_step=np.repeat(np.array([rows[0] for rows in made], dtype=np.int64), counts),
            agent_id=np.repeat(np.array([rows[1] for rows in made], dtype=np.int64), counts),
            cost=np.concatenate([np.empty(0), *(rows[2] for rows in made)]),
            rejection=tuple(text for rows in made for text in rows[3]),
            chosen=np.concatenate([np.empty(0, dtype=np.bool_), *(rows[4] for rows in made)]),
            x=np.concatenate([empty, *(_widened(rows[5], points) for rows in made)]),
            y=np.concatenate([empty, *(_widened(rows[6], points) for rows in made)]),
        )


def _spread(cost: Floats, rejection: list[str], chosen: int, count: int) -> Ints:
    """Rows of at most `count` candidates: the chosen one, then others by ascending cost, then some rejected ones."""
    usable = np.array([not reason for reason in rejection])
    usable[chosen if chosen >= 0 else slice(0, 0)] = False
    # nan sorts after every number.
    admissible, rejected = np.flatnonzero(usable), np.flatnonzero([bool(reason) for reason in rejection])
    admissible = admissible[np.argsort(cost[admissible], kind="stable")]
    first = np.array([chosen] if chosen >= 0 else [], dtype=np.int64)
    room = count - len(first)
    quota = min(len(rejected), max(count // _ONE_REJECTED_IN, room - len(admissible)))
    picked = [_evenly(admissible, room - quota), _evenly(rejected, quota)]
    return np.concatenate([first, *picked])[:count]


def _evenly(rows: Ints, count: int) -> Ints:
    """At most `count` of the rows, evenly spaced, including first and last."""
    if len(rows) <= count:
        return rows
    return rows[np.round(np.linspace(0, len(rows) - 1, max(count, 0))).astype(np.int64)]


def _rounded(positions: Floats) -> Floats:
    return np.round(positions / _RESOLUTION) * _RESOLUTION


def _widened(table: Floats, points: int) -> Floats:
    """The table padded with nan to this number of points."""
    wide = np.full((len(table), points, *table.shape[2:]), np.nan)
    wide[:, : table.shape[1]] = table
    return wide
