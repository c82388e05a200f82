"""Whose fault the collisions of a run are: the core's verdicts, and the rules of the road that decide at crossings."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from interdrive.run.goals import said_seconds

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive import _core
    from interdrive.run import RunRecord, Violations
    from interdrive.scoring.settings import ScoringSettings

#: Violations by which a driver that had to yield did not.
YIELD_RULES = ("red_light", "stop_sign", "right_of_way")

#: Why a collision can be an agent's fault.
FAULT_KINDS = ("cut_off", "ran_into", "wrong_side", "reversed", *YIELD_RULES)

#: Headings that differ by more than this cross [rad].
_CROSSING_ANGLE = math.radians(45.0)

#: Participants whose heading is no direction of travel on a lane.
_NOT_ON_LANES = ("pedestrian", "construction_zone", "structure", "unknown", "parked_vehicle")

#: Things, not participants in traffic.
_THINGS = ("construction_zone", "structure")

#: What is said of faults that no distance decides.
_UNMEASURED = {"wrong_side": "met oncoming {} outside the lanes that lead its way", "reversed": "reversed into {}"}

_TOLD = {"red_light": "passed a red light", "stop_sign": "passed a stop sign", "right_of_way": "did not yield"}


@dataclass(frozen=True)
class Verdict:
    """Whose fault a collision with another participant is.

    Attributes:
        kind: One of `FAULT_KINDS`; "" if it is not the agent's fault.
        room: Distance that was left minus the distance needed by the rule that decided [m]; nan if none measured it.
        collision_type: One of `COLLISION_TYPES`. fault_nuplan: nuPlan's verdict.
        instant: Time of the contact itself [s], between two time steps; it decides, but is not told.
        time_step: Of the first state after the contact: the time of the collision wherever it is told.
        words: Why.
    """

    kind: str
    room: float
    collision_type: str
    fault_nuplan: bool
    instant: float
    time_step: int
    words: str


def is_thing(run: RunRecord, participant_id: int) -> bool:
    """Whether a participant is a thing, not a road user: a fault against it counts half."""
    states = run.states
    row = int(np.searchsorted(states.participant_id, participant_id))
    kind = states.kinds[row]
    return kind in _THINGS or (kind == "unknown" and bool(states.is_static[row]))


def verdicts(
    run: RunRecord, traffic: _core.Traffic, ids: Sequence[int], settings: ScoringSettings
) -> dict[int, Verdict]:
    """Verdicts on all agents of these that collided with another participant, by id."""
    ended, states = run.outcomes, run.states
    kinds = dict(zip(states.participant_id.tolist(), states.kinds, strict=True))
    rows = zip(ended.agent_id.tolist(), ended.partner_id.tolist(), ended.time_step.tolist(), ended.outcome, strict=True)
    contacts = [
        (who, whom, when, kinds[whom] not in _NOT_ON_LANES)
        for who, whom, when, how in rows
        if how == "collision" and whom >= 0 and who in ids
    ]
    reaction = settings.reaction
    found = traffic.blame(
        contacts, (reaction.delay, reaction.deceleration), (reaction.others_delay, reaction.others_deceleration)
    )
    dt, judged = run.scenario.dt, {}
    for i, (who, whom, when, _) in enumerate(contacts):
        gap, needed = float(found["gap"][i]), float(found["needed"][i])
        kind, side = found["kind"][i], found["side"][i]
        verdict = Verdict(
            kind=kind,
            room=gap - needed,
            collision_type=found["collision_type"][i],
            fault_nuplan=bool(found["fault_nuplan"][i]),
            instant=float(found["instant"][i]) * dt,
            time_step=when,
            words=_words(kind, whom, side, gap, needed, said_seconds(int(found["decided_at"][i]), dt)),
        )
        if found["angle"][i] > _CROSSING_ANGLE and run.violations is not None:
            verdict = _at_crossing(verdict, run.violations, who, whom, dt, settings.yield_time)
        judged[who] = verdict
    return judged


def _at_crossing(verdict: Verdict, broken: Violations, who: int, whom: int, dt: float, time: float) -> Verdict:
    """The same where ways cross: the vehicle that had to yield is at fault, unless the other one came too late."""
    own, others = (
        _last_violation(broken, number, other, verdict, dt, time) for number, other in ((who, whom), (whom, who))
    )
    if own is not None:
        rule, before = own
        return replace(verdict, kind=rule, words=f"{_TOLD[rule]} {before} s before the contact with {whom}")
    if others is not None and verdict.kind == "cut_off":
        rule, before = others
        return replace(verdict, kind="", words=f"{whom} {_TOLD[rule]} {before} s before")
    return verdict


def _last_violation(
    broken: Violations, number: int, other: int, verdict: Verdict, dt: float, time: float
) -> tuple[str, str] | None:
    """The last rule that a participant broke instead of yielding to another, and the seconds up to the collision."""
    rules, sources = np.array(broken.rule, dtype=object), np.array(broken.source, dtype=object)
    before = verdict.instant - broken.first_time_step * dt
    counts = (broken.participant_id == number) & (sources != "recording") & (before >= 0.0) & (before <= time)
    counts &= np.isin(rules, YIELD_RULES) & ((broken.partner_id == other) | (rules != "right_of_way"))
    if not counts.any():
        return None
    last = int(np.flatnonzero(counts)[before[counts].argmin()])
    return str(rules[last]), said_seconds(verdict.time_step - int(broken.first_time_step[last]), dt)


def _words(kind: str, whom: int, side: str, gap: float, needed: float, when: str) -> str:
    measured = f"at {when} s with {gap:.1f} m left, {needed:.1f} m needed"
    if kind in _UNMEASURED:
        return _UNMEASURED[kind].format(whom)
    if kind == "cut_off":
        return f"cut off {whom} {measured}" if gap < needed else f"left its lane beside {whom} at {when} s"
    if kind == "ran_into":
        return f"ran into {whom}, which was in its way {measured}"
    if not math.isfinite(gap):
        return f"touched by {whom} at its {side}"
    if side == "front" and gap < needed:
        return f"{whom} came into its way {measured}"
    return f"touched by {whom} at its {side}; entered its way {measured}"
