"""Runs that are written while they are simulated: what has left is no longer held, however long they are.

The folder is that of `Run.save`, with the same states, plans, outcomes, violations and digest. Only scenario.xml
differs: it holds the map and what never moves, as the vehicles of an hour would make a file that no tool opens.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.criticality import AgentHarm, agent_harm
from interdrive.errors import InputError
from interdrive.results import RUN_FOLDER
from interdrive.results.stream import RunTables
from interdrive.run import PLAN_STATUS, Plans, RunRecord, Violations
from interdrive.run.assemble import FirstState, agent_records, first_states, states_of
from interdrive.run.flows import LaneFlow, counted_time, flows_of
from interdrive.run.reasons import reasons
from interdrive.run.spool import Spool
from interdrive.run.violations import joined, recorded_violations, violations
from interdrive.runs import Run
from interdrive.simulation.record import assembled_run, orders_until_now
from interdrive.storage import resolved, whole_folder
from interdrive.storage.interrupts import uninterrupted

if TYPE_CHECKING:
    from collections.abc import Callable, Set
    from pathlib import Path

    from interdrive.array_types import Ints
    from interdrive.run import States
    from interdrive.simulation import Simulation


#: A state of a table takes so much memory [B].
_STATE = 49
#: States and plans are written after so many time steps, ...
_PART = 100
#: ... and outcomes and violations are judged when so many participants have left with all that they met, ...
_BATCH = 64
#: ... but participants that stay longer than this [s] are judged in pieces of this length, ...
_PIECE = 300.0
#: ... each with so much before and behind it [s].
_MARGIN = 60.0


@dataclass(frozen=True)
class WrittenRun:
    """A run that lies in its folder.

    Attributes:
        run: Its agents, outcomes and what else is small; it has neither states nor plans.
        harm: Harm of its agents.
        flows: Traffic by lane; empty without generated traffic.
    """

    run: Run
    harm: AgentHarm
    flows: tuple[LaneFlow, ...]


def can_be_streamed(simulation: Simulation) -> bool:
    """Whether a run needs nothing but its states and plans to be kept until its end."""
    record, settings = simulation.settings.record, simulation.settings
    keeps = record.views or record.predictions or record.candidates or record.profile or record.messages != "none"
    return not (keeps or settings.collision.not_at_fault == "hitter_leaves" or simulation.world.equipped)


def size_at_most(simulation: Simulation) -> int:
    """How much the states of a run need if all are held and it takes its longest time [B]."""
    last = simulation.world.last_time_step
    n_steps = 0 if last is None else last - simulation.time_step + 1
    return (len(simulation.agents) + len(simulation.scenario.obstacles.ids)) * n_steps * _STATE


def write_run(
    simulation: Simulation,
    folder: str | Path,
    *,
    overwrite: bool = False,
    on_step: Callable[[int, int, int, int], None] | None = None,
) -> WrittenRun:
    """Simulates until every agent has its outcome, and writes the run folder meanwhile, whole or not at all.

    Args:
        simulation: At its first time step.
        folder: A new or empty folder, or the folder of another run.
        overwrite: Replace the other run.
        on_step: Called after every step with time step, driving agents, all agents, latest possible time step.

    Raises:
        InputError: The run has to be held (`can_be_streamed`).
        PredictorError: The predictor raised an exception or returned invalid predictions.
        ResultsError: The folder cannot be used or written.
        KeyboardInterrupt: Ctrl-C; the folder holds the run until then, if that is more than its first time step.
    """
    if not can_be_streamed(simulation):
        raise InputError("a run that records views, predictions, candidates, messages or a profile cannot be streamed")
    if states_of(simulation.world.states()).n_steps > 1:
        now = simulation.time_step
        raise InputError(f"the simulation is at time step {now} already: only a new one can be streamed")
    path = simulation.scenario.path
    inputs = () if path is None else (path,)
    # Ctrl-C while the run is finished comes after its folder is in place.
    with ExitStack() as delayed, whole_folder(folder, RUN_FOLDER, overwrite=overwrite, inputs=inputs) as partial:
        writer = _Writer(simulation, partial)
        try:
            writer.simulate(on_step)
            delayed.enter_context(uninterrupted())
            written = writer.finished()
        finally:
            writer.close()
    if not written.run.finished:
        raise KeyboardInterrupt(f"interrupted; the run until then is in {resolved(folder)}")
    return written


class _Writer:
    """What is known of a run that is under way, apart from what lies in its folder."""

    def __init__(self, simulation: Simulation, folder: Path) -> None:
        self._simulation, self._folder = simulation, folder
        self._dt = simulation.scenario.dt
        self._first = simulation.time_step
        self._next = simulation.time_step
        base = simulation.record(explained=False)
        self._base = RunRecord(**{one.name: getattr(base, one.name) for one in fields(RunRecord)})
        self._tables = RunTables(folder, base)
        self._spool = Spool(folder)
        self._firsts: dict[int, FirstState] = {}
        self._judged: set[int] = set()
        self._reasons: dict[int, str] = {}
        self._harm: dict[int, dict[str, Any]] = {}
        self._violations: list[Violations] = []
        #: Rows of plans that say why an agent could not drive as it wanted.
        self._obstructed: list[Plans] = []

    def close(self) -> None:
        self._spool.close()
        self._tables.close()

    def simulate(self, on_step: Callable[[int, int, int, int], None] | None) -> None:
        """Simulates until every agent has its outcome, or until Ctrl-C; parts are written whole."""
        simulation = self._simulation
        world, latest = simulation.world, simulation.world.last_time_step or 0
        try:
            while not world.is_done:
                simulation.step()
                if on_step is not None:
                    on_step(world.time_step, len(world.driving), len(simulation.agents), latest)
                if world.time_step - self._next >= _PART:
                    with uninterrupted():
                        self._take(end=False)
        except KeyboardInterrupt:
            if world.time_step == self._first:
                raise
            simulation.stop()

    def _take(self, *, end: bool) -> None:
        """Writes what has happened since the last time, and judges participants that have left."""
        raw, raw_plans = self._simulation.world.take_recorded(end)
        raw.pop("row")
        states, plans = states_of(raw), Plans(**raw_plans)
        self._tables.write(states, plans)
        self._spool.add(states)
        self._next = states.first_time_step + states.n_steps
        new = [number for number in self._simulation.preparation.waiting if number not in self._firsts]
        self._firsts |= first_states(states, new)
        told = np.array([bool(text) for text in plans.rejection], dtype=np.bool_)
        kept = told | (plans.status == PLAN_STATUS.index("emergency_braking"))
        if kept.any():
            grids = [name for name, column in Plans.stored.items() if column.axes == "row and point"]
            bare: dict[str, Any] = dict.fromkeys(grids, np.empty((len(plans.time_step), 0)))
            self._obstructed.append(replace(plans, **bare).where(kept))
        present = states.participant_id[states.valid[:, -1]] if states.n_steps else states.participant_id
        self._judge(set(present.tolist()) if not end else set(), end=end)

    def _judge(self, present: Set[int], *, end: bool) -> None:
        """Judges participants that have left, and those that they met, too."""
        participants = self._participants
        ids, first, last = self._spool.spans()
        is_static = participants.is_static[np.searchsorted(participants.participant_id, ids)]
        moves = ~is_static & ~np.isin(ids, list(self._judged))
        stays = np.isin(ids, list(present))
        is_long = (last - first) * self._dt > _PIECE
        horizon = first[moves & stays & ~is_long].min(initial=np.iinfo(np.int64).max)
        ripe = moves & ~stays & ((last < horizon) | end)
        if not ripe.any() or (int(ripe.sum()) < _BATCH and not end):
            return
        brief = ripe & ~is_long
        if brief.any():
            begin, until = first[brief].min(), last[brief].max()
            met = (first <= until) & (last >= begin)
            within = met & ~is_long & ~is_static
            # A column in which they are gone says that they have left.
            window = int(first[within].min()), min(int(last[within].max()) + 1, self._next - 1)
            run = self._part(ids[met], *window)
            own = set(ids[brief].tolist())
            self._add_violations(run, own)
            self._explain(run, own)
        for number, a, b in zip(*(x[ripe & is_long].tolist() for x in (ids, first, last)), strict=True):
            self._judge_piecewise(number, a, b, (ids, first, last))
        self._judged |= set(ids[ripe].tolist())
        self._forget_obstructions(ids[ripe])

    def _judge_piecewise(self, number: int, first: int, last: int, spans: tuple[Ints, Ints, Ints]) -> None:
        """Judges one that stayed for long; a violation belongs to the piece in which it begins."""
        ids, begin, end = spans
        size, margin = (max(1, round(seconds / self._dt)) for seconds in (_PIECE, _MARGIN))
        for start in range(first, last + 1, size):
            window = max(first, start - margin), min(start + size + margin, self._next - 1)
            run = self._part(ids[(begin <= window[1]) & (end >= window[0])], *window)
            since = (start if start > first else window[0], start + size)
            self._add_violations(run, {number}, since)
        window = max(first, last - size - margin), min(last + 1, self._next - 1)
        self._explain(self._part(ids[(begin <= window[1]) & (end >= window[0])], *window), {number})

    def _add_violations(self, run: RunRecord, judged: Set[int], since: tuple[int, int] | None = None) -> None:
        """Adds the violations of some participants; `since`: only those that begin at these time steps."""
        simulation = self._simulation
        if not simulation.settings.record.violations:
            return
        world = simulation.world
        found = violations(run, simulation.road, simulation.preparation.areas, world.obeying, world.entries(), judged)
        if since is not None:
            found = found.where((found.first_time_step >= since[0]) & (found.first_time_step < since[1]))
        if len(found.rule):
            self._violations.append(found)

    def _explain(self, run: RunRecord, judged: Set[int]) -> None:
        """Notes why agents ended as they did, and what that did to them."""
        ended = run.outcomes.where(np.isin(run.outcomes.agent_id, list(judged)))
        one = replace(run, outcomes=ended)
        self._reasons |= dict(zip(ended.agent_id.tolist(), reasons(one, self._simulation.road), strict=True))
        if "collision" in ended.outcome:
            harm = agent_harm(one)
            for place, number in enumerate(ended.agent_id.tolist()):
                self._harm[number] = {name: getattr(harm, name)[place] for name in AgentHarm.stored}

    def _part(self, ids: Ints, first: int, last: int) -> RunRecord:
        """The run of some participants from one time step to another."""
        whole, wanted = self._participants, set(ids.tolist())
        outcomes = self._simulation.outcomes()
        agents = self._simulation.preparation.as_entered(self._firsts, wanted)
        return replace(
            self._base,
            agents=agent_records(agents, dict(zip(outcomes.agent_id.tolist(), outcomes.planner, strict=True))),
            outcomes=outcomes.where(np.isin(outcomes.agent_id, ids)),
            states=self._spool.window(whole.where(np.isin(whole.participant_id, ids)), first, last),
            plans=_joined(self._obstructed),
            orders=orders_until_now(self._simulation.progress) if self._simulation.settings.record.orders else None,
        )

    def _forget_obstructions(self, ids: Ints) -> None:
        """Gives back the plans of judged participants."""
        whole = _joined(self._obstructed)
        self._obstructed = [whole.where(~np.isin(whole.agent_id, ids))]

    @property
    def _participants(self) -> States:
        """All participants until now, without states."""
        return states_of(self._simulation.world.participants())

    def finished(self) -> WrittenRun:
        """Writes what is left, and what is known only at the end."""
        self._take(end=True)
        simulation, participants = self._simulation, self._participants
        number = participants.participant_id
        digest = self._spool.digest(number, self._first, self._next - self._first)
        still = self._spool.window(participants, self._first, self._first)
        still = replace(still, valid=still.valid & participants.is_static[:, None])
        run = assembled_run(simulation.progress, states=still, plans=Plans.empty(), firsts=self._firsts, digest=digest)
        ids = run.outcomes.agent_id
        others = ids[~np.isin(ids, list(self._reasons))]
        if len(others):  # they never entered
            self._explain(self._part(others, self._first, self._first), set(others.tolist()))
        broken = None
        if simulation.settings.record.violations:
            broken = joined(
                [*self._violations, recorded_violations(run, simulation.road, simulation.preparation.areas)]
            )
        run = replace(
            run,
            outcomes=replace(run.outcomes, reason=tuple(self._reasons[i] for i in ids.tolist())),
            violations=broken,
        )
        harm = AgentHarm(
            **{
                name: _column([self._harm.get(i, {}).get(name, column.absent) for i in ids.tolist()])
                for name, column in AgentHarm.stored.items()
            }
        )
        flows = self._flows(run)
        self._tables.finish(run, harm)
        return WrittenRun(run, harm, flows)

    def _flows(self, run: Run) -> tuple[LaneFlow, ...]:
        if run.demand is None:
            return ()
        begin, end = counted_time(run.settings, run.outcomes, (self._first, self._next - 1), self._dt)
        steps = begin / self._dt - 1e-9, end / self._dt - 1e-9
        return flows_of(run.demand, self._spool.mean_speeds(run.demand.agent_id, *steps), begin, end, self._dt)


def _joined(parts: list[Plans]) -> Plans:
    """Plans one below the other."""
    if not parts:
        return Plans.empty()
    found: dict[str, Any] = {}
    for name in Plans.stored:
        values: list[Any] = [getattr(part, name) for part in parts]
        found[name] = sum(values, ()) if isinstance(values[0], tuple) else np.concatenate(values)
    return Plans(**found)


def _column(values: list[Any]) -> Any:  # noqa: ANN401 - an array, or texts
    return tuple(values) if isinstance(values[0] if values else 0.0, str) else np.array(values, dtype=np.float64)
