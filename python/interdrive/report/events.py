"""Moments of a run that one wants to jump to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.criticality import MEASURES, measure_named
from interdrive.plots.style import EVENT_MARKS, OUTCOME_MARKS
from interdrive.report.planning import made_at
from interdrive.run import RULES
from interdrive.run.reasons import STANDSTILL, said_rejection
from interdrive.storage.arrow_arrays import values_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from interdrive.report.measured import Measured
    from interdrive.run import RunRecord
    from interdrive.storage import ArrowTable

#: Moments at which a measure goes beyond this are events; of each agent the most critical one.
THRESHOLDS = {"ttc": 2.0, "pet": 1.0, "btn": 1.0}

#: Plans of these kinds are events when they begin; an emergency plan brakes or evades (planner_frenet.md).
_EMERGENCIES = {"emergency_braking": "falls back on an emergency plan", "infeasible": "has no plan (infeasible)"}

_ENDS = {
    "goal_reached": "reaches its goal",
    "goal_reached_late": "reaches its goal late",
    "time_limit": "runs out of time",
    "goal_missed": "misses its goal",
    "infeasible": "ends as infeasible",
    "collision": "collides",
    "planner_error": "ends: its planner failed",
    "running": "still drives when the run is stopped",
}


@dataclass(frozen=True)
class Event:
    """A moment.

    Attributes:
        step: Column of the states.
        kind: An outcome, or one of `EVENT_MARKS`.
        rows: Rows of the states that it is about, the judged one first.
        text: For people.
        value: Of a measure.
    """

    step: int
    kind: str
    rows: tuple[int, ...]
    text: str
    value: float | None = None

    def __post_init__(self) -> None:
        """Checks that the page can draw it.

        Raises:
            ValueError: Its kind has no mark.
        """
        if self.kind not in EVENT_MARKS and self.kind not in OUTCOME_MARKS:
            raise ValueError(f"events of the kind {self.kind!r} have no mark in plots/style.py")


def events_of(
    run: RunRecord,
    plans: ArrowTable,
    measured: Measured | None,
    replan_every: int,
    violations: ArrowTable | None = None,
) -> list[Event]:
    """All events, sorted by time, then by participant; agents planned anew every `replan_every` time steps."""
    every = [
        *_ends(run),
        *_emergencies(run, plans, replan_every),
        *(_violations(run, violations) if violations is not None else ()),
        *_holds(run),
        *(_critical(run, measured) if measured is not None else ()),
    ]
    return sorted(every, key=lambda event: (event.step, event.rows, event.kind))


def _row(run: RunRecord, number: int) -> int:
    return int(np.searchsorted(run.states.participant_id, number))


def _ends(run: RunRecord) -> Iterator[Event]:
    ended = run.outcomes
    for index, number in enumerate(ended.agent_id.tolist()):
        outcome, partner = ended.outcome[index], int(ended.partner_id[index])
        text = f"{number} {_ENDS[outcome]}"
        rows: tuple[int, ...] = (_row(run, number),)
        if outcome == "collision" and partner >= 0:
            text, rows = f"{text} with {partner}", (*rows, _row(run, partner))
        elif outcome == "collision":
            text = f"{number} leaves the road"
        elif outcome == "time_limit" and ended.message[index].startswith(STANDSTILL):
            text = f"{number} ends, as nothing moves any more"
        if np.isfinite(ended.impact_speed[index]):
            text += f" at {ended.impact_speed[index]:.1f} m/s"
        step = int(ended.time_step[index]) - run.states.first_time_step
        yield Event(min(max(step, 0), run.states.n_steps - 1), outcome, rows, text)


def _emergencies(run: RunRecord, plans: ArrowTable, replan_every: int) -> Iterator[Event]:
    """Plans that brake in emergency, or are none, where the plan that the agent made before was of another kind."""
    if not plans.num_rows:
        return
    starts = np.flatnonzero(values_of(plans["point"]) == 0)
    status, rejection = (values_of(plans[name])[starts] for name in ("status", "rejection"))
    agent, step = (values_of(plans[name])[starts] for name in ("agent_id", "time_step"))
    length = np.diff(np.append(starts, plans.num_rows))
    for number in np.unique(agent[np.isin(status, list(_EMERGENCIES))]).tolist():
        mine = np.flatnonzero(agent == number)
        anew = mine[made_at(step[mine], length[mine], replan_every) == step[mine]].tolist()
        for before, at in zip([None, *anew], anew, strict=False):
            name = status[at]
            if name not in _EMERGENCIES or (before is not None and status[before] == name):
                continue
            kind, moment = "infeasible_plan" if name == "infeasible" else name, int(step[at])
            why = f"; most samples were rejected: {said_rejection(rejection[at])}" if rejection[at] else ""
            text = f"{number} {_EMERGENCIES[name]}{why}"
            yield Event(moment - run.states.first_time_step, kind, (_row(run, number),), text)


def _violations(run: RunRecord, table: ArrowTable) -> Iterator[Event]:
    """Rules of the road that agents and replayed vehicles broke, when each violation begins."""
    for row in table.to_pylist():
        if row["source"] != "recording":
            number, partner = row["participant_id"], row["partner_id"]
            text = f"{number} {RULES[row['rule']].words.format(value=row['value'], partner=partner)}"
            rows = tuple(_row(run, one) for one in (number, partner) if one is not None)
            yield Event(row["first_time_step"] - run.states.first_time_step, "violation", rows, text)


def _holds(run: RunRecord) -> Iterator[Event]:
    """Agents that hold before road that others need as well, when they begin to."""
    found = run.agreements
    if found is None:
        return
    columns = (found.holding_id, found.going_id, found.first_time_step, found.last_time_step)
    for holding, going, first, last in zip(*(one.tolist() for one in columns), strict=True):
        seconds = (last - first + 1) * run.scenario.dt
        what = f"holds for {going}" if going >= 0 else "leaves the way to others: its own is blocked"
        rows = (_row(run, holding), _row(run, going)) if going >= 0 else (_row(run, holding),)
        yield Event(first - run.states.first_time_step, "hold", rows, f"{holding} {what} ({seconds:.1f} s)")


def _critical(run: RunRecord, measured: Measured) -> Iterator[Event]:
    """The most critical moment of each agent and measure with a threshold, if it goes beyond it."""
    names = [measure.name for measure in MEASURES]
    for name, threshold in THRESHOLDS.items():
        measure, index = measure_named(name), names.index(name)
        for place, number in enumerate(run.outcomes.agent_id.tolist()):
            value, partner = float(measured.extreme[index, place]), int(measured.extreme_partner[index, place])
            step = int(measured.extreme_step[index, place])
            beyond = value >= threshold if measure.grows else value <= threshold
            if not np.isfinite(value) or not beyond:
                continue
            rows = (_row(run, number), partner) if partner >= 0 else (_row(run, number),)
            other = f" with {run.states.participant_id[partner]}" if partner >= 0 else ""
            size = measure.text(value).replace(" ", "\N{NO-BREAK SPACE}")
            yield Event(step, "critical", rows, f"{number}: {measure.title} {size}{other}", value)
