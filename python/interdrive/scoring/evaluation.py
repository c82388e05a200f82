"""Scores of the agents of a run: facts, judgements against what others reach in the same place, and why in words."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from interdrive.errors import InputError
from interdrive.reference_drivers import DRIVERS
from interdrive.scoring.drive_facts import drives_of
from interdrive.scoring.hindrance import Hindrance
from interdrive.scoring.judgement import PanelDrives, judged
from interdrive.scoring.preventability import preventable_collisions
from interdrive.scoring.score_1 import score_1
from interdrive.scoring.seen import Seen
from interdrive.scoring.settings import ScoringSettings
from interdrive.scoring.total import GATES
from interdrive.storage import Origin, changed_settings
from interdrive.storage.html import html_head

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.run import RunRecord
    from interdrive.scoring.drive_facts import Drive
    from interdrive.scoring.total import Facts, Total

    #: Finds what others reach in the place of a drive: the drive itself, which goes on if it was hit, the drives of the
    #: panel, and what it takes from others.
    Places: TypeAlias = Callable[[Drive], tuple[Drive, PanelDrives, Hindrance]]

#: Parts of the score and what it is made of, as numbers of a judgement and of its facts.
_OF_TOTAL = ("arrival", "pace", "hindrance", "yard", "cls", "epdms")
_OF_FACTS = ("duration", "way", "free_flow", "lost")

#: Numbers of `Score.terms`, in the order of tables.
TERMS = (
    *(f"gate_{name}" for name in GATES),
    *("arrival", "pace", "ttc_term", "hindrance", "comfort_term"),
    *(*_OF_FACTS, "yard", "cls", "epdms"),
    *("straight_ttc_min", "lane_keeping", "room"),
)

_UNRECORDED = "violations were not recorded: lights, signs, crosswalks and right of way do not count"


@dataclass(frozen=True)
class Score:
    """Scores of agents; arrays of shape (agents,), sorted by id; nan for agents that never entered.

    Attributes:
        ids: Agents.
        planners: Names of their planners.
        score: From 0 to 1.
        score_1: The score of earlier releases, from 0 to 1; this is the last release that has it.
        terms: By name: gates (`gate_...`), `arrival`, `pace`, `ttc_term`, `hindrance` and `comfort_term` as they count,
            after excuses, from 0 to 1, nan where absent; `duration`, `free_flow` and `yard` [s], `way` [m], `lost`
            [vehicle seconds]; `cls` and `epdms`, scores in the forms of nuPlan and NAVSIM; `straight_ttc_min` [s],
            inf without a contact; `lane_keeping` from 0 to 1; `room` [m], nan without a contact.
        in_time: Whether it reached its goal in time. arrived: Whether it did, in time or later.
        forced: Whether another vehicle had to brake hard for it.
        hits: How often others hit it without its fault.
        fault: Whether a collision with another participant was the agent's fault.
        fault_kind: One of `FAULT_KINDS`; "" without a fault.
        fault_nuplan: nuPlan's verdict, for comparison.
        collision_type: One of `COLLISION_TYPES`; "" without a collision with another participant.
        preventable: By reference driver, whether it would have avoided the collision: 1 or 0, nan without a collision
            with another participant or without a verdict (`interdrive.scoring.preventability`).
        excused: Names of gates and terms that count as 1, as no driver of the panel does better.
        reasons: In words, what made the score less than 1, for every agent.
        panel: Drivers that drove in the agents' places; empty: none did, and the scores are absolute.
        facts: What decided; None for an agent that never entered. totals: The judgements; likewise.
        hindrances: What others lost.
        notes: One line per thing the user should know.
        origin: How the scores came about.
    """

    ids: Ints
    planners: tuple[str, ...]
    score: Floats
    score_1: Floats
    terms: Mapping[str, Floats]
    in_time: Bools
    arrived: Bools
    forced: Bools
    hits: Ints
    fault: Bools
    fault_kind: tuple[str, ...]
    fault_nuplan: Bools
    collision_type: tuple[str, ...]
    preventable: Mapping[str, Floats]
    excused: tuple[tuple[str, ...], ...]
    reasons: tuple[tuple[str, ...], ...]
    panel: tuple[str, ...] = ()
    facts: tuple[Facts | None, ...] = ()
    totals: tuple[Total | None, ...] = ()
    hindrances: tuple[Hindrance, ...] = ()
    notes: tuple[str, ...] = ()
    origin: Origin = field(default_factory=Origin)

    def __repr__(self) -> str:
        mean = f", mean {100.0 * float(np.nanmean(self.score)):.1f}" if np.isfinite(self.score).any() else ""
        return f"<Score of {len(self.ids)} agents{mean}>"

    def _repr_html_(self) -> str:
        """The agents with their scores from 0 to 100 and why, for notebooks."""
        rows: list[dict[str, float | str | None]] = [
            {
                "agent_id": agent,
                "planner": self.planners[row],
                "score": None if np.isnan(self.score[row]) else 100.0 * float(self.score[row]),
                "arrived": "yes" if self.arrived[row] else "no",
                "fault": self.fault_kind[row],
                "why": self.why(agent),
            }
            for row, agent in enumerate(self.ids.tolist())
        ]
        names = ("agent_id", "planner", "score", "arrived", "fault", "why")
        return f"<p>{escape(repr(self))}</p>{html_head(names, rows, len(rows))}"

    def row(self, agent_id: int) -> int:
        """Row of the agent with id `agent_id`.

        Raises:
            InputError: It was not scored.
        """
        rows = np.flatnonzero(self.ids == agent_id)
        if not len(rows):
            raise InputError(f"agent {agent_id} was not scored")
        return int(rows[0])

    def why(self, agent_id: int) -> str:
        """Why the agent with id `agent_id` has no higher score, in one line.

        Raises:
            InputError: It was not scored.
        """
        row = self.row(agent_id)
        return "; ".join(self.reasons[row]) or ("full score" if self.score[row] == 1.0 else "almost full score")


def score(run: RunRecord, ids: Sequence[int] | None = None, settings: ScoringSettings | None = None) -> Score:
    """Absolute scores of the agents of a run, from the run alone: free flow sets the pace, and nothing is excused.

    `interdrive.score` scores against a panel, too. The reference, page "Scores", defines all parts.

    Args:
        run: A run with its routes, as `simulate` and `load` give it.
        ids: Agents; None: all whose recordings overlap no others (`Scenario.overlaps`).
        settings: Bounds, weights and reactions; the defaults otherwise.

    Raises:
        InputError: An id that is not an agent of the run, or a run without routes.
    """
    return evaluated(run, scored_agents(run, ids), settings or ScoringSettings(), _alone)


def scored_agents(run: RunRecord, ids: Sequence[int] | None) -> list[int]:
    """Ids of the agents that are scored, ascending.

    Raises:
        InputError: An id that is not an agent of the run.
    """
    known = run.outcomes.agent_id.tolist()
    if ids is None:
        return sorted(set(known) - run.scenario.overlapping)
    strangers = sorted(set(ids) - set(known))
    if strangers:
        raise InputError(f"score: {strangers[0]} is not an agent of this run")
    return sorted(set(ids))


def evaluated(
    run: RunRecord,
    ids: Sequence[int],
    settings: ScoringSettings,
    places: Places,
    *,
    panel: Sequence[str] = (),
    notes: Sequence[str] = (),
) -> Score:
    """Scores of some agents of a run.

    Args:
        run: The run.
        ids: The agents, ascending.
        settings: Bounds, weights and reactions.
        places: Finds what others reach in the place of an agent.
        panel: Names of the drivers that it has drive there.
        notes: What the user should know.
    """
    seen = Seen.of(run, ids, settings)
    is_original = has_recording(run)
    old = score_1(run, seen, settings, has_recording=is_original)
    own = drives_of(run, ids, settings, seen)
    said = [*_left_out(run, ids), *notes]
    found: dict[int, tuple[Drive, Facts, Total, tuple[str, ...], Hindrance]] = {}
    for number, first in own.items():
        drive, place, taken = places(first)
        found[number] = (drive, *judged(drive, taken, place, settings), taken)
        said += [note for note in place.notes if note not in said]
    if run.violations is None:
        said.append(_UNRECORDED)
    if not is_original:
        said.append("the scenario file is gone or has changed: score_1 has no recording to compare with")
    prevented = preventable_collisions(run, seen.traffic, ids)
    verdicts = [seen.verdicts.get(number) for number in ids]
    there = [found.get(number) for number in ids]
    planners = dict(zip(run.outcomes.agent_id.tolist(), run.outcomes.planner, strict=True))

    def numbers(values: Sequence[float]) -> Floats:
        return np.array(values, dtype=np.float64)

    def truths(values: Sequence[bool]) -> Bools:
        return np.array(values, dtype=np.bool_)

    terms = {f"gate_{name}": numbers([one[2].gates[name] if one else math.nan for one in there]) for name in GATES}
    terms |= {name: numbers([getattr(one[2], name) if one else math.nan for one in there]) for name in _OF_TOTAL}
    terms |= {name: numbers([getattr(one[1], name) if one else math.nan for one in there]) for name in _OF_FACTS}
    terms |= {
        f"{name}_term": numbers([getattr(one[2], name) if one else math.nan for one in there])
        for name in ("ttc", "comfort")
    }
    terms["straight_ttc_min"] = numbers([_least(run, seen, number) for number in ids])
    terms["lane_keeping"] = numbers([old[number][1] for number in ids])
    terms["room"] = numbers([verdict.room if verdict else math.nan for verdict in verdicts])
    return Score(
        ids=np.array(ids, dtype=np.int64),
        planners=tuple(planners[number] for number in ids),
        score=numbers([one[2].score if one else math.nan for one in there]),
        score_1=numbers([old[number][0] for number in ids]),
        terms={name: terms[name] for name in TERMS},
        in_time=truths([bool(one and one[1].in_time) for one in there]),
        arrived=truths([bool(one and one[1].arrived) for one in there]),
        forced=truths([bool(one and one[1].forced) for one in there]),
        hits=np.array([len(one[0].hits) + one[0].was_hit if one else 0 for one in there], dtype=np.int64),
        fault=truths([bool(verdict and verdict.kind) for verdict in verdicts]),
        fault_kind=tuple(verdict.kind if verdict else "" for verdict in verdicts),
        fault_nuplan=truths([bool(verdict and verdict.fault_nuplan) for verdict in verdicts]),
        collision_type=tuple(verdict.collision_type if verdict else "" for verdict in verdicts),
        preventable={
            name: numbers([prevented.get(number, {}).get(name, math.nan) for number in ids]) for name in DRIVERS
        },
        excused=tuple(one[2].excused if one else () for one in there),
        reasons=tuple(one[3] if one else () for one in there),
        panel=tuple(panel),
        facts=tuple(one[1] if one else None for one in there),
        totals=tuple(one[2] if one else None for one in there),
        hindrances=tuple(one[4] if one else Hindrance() for one in there),
        notes=tuple(said),
        origin=Origin(changed_settings(settings, "scoring."), {"scenario": run.scenario.sha256, "run": run.digest}),
    )


def has_recording(run: RunRecord) -> bool:
    """Whether the scenario is the simulated one: a run folder keeps a copy without the recordings of agents."""
    path = run.scenario.path
    return path is None or not (path.name == "scenario.xml" and (path.parent / "run.json").exists())


def _alone(drive: Drive) -> tuple[Drive, PanelDrives, Hindrance]:
    return drive, PanelDrives(), Hindrance()


def _least(run: RunRecord, seen: Seen, number: int) -> float:
    """The smallest time to contact straight on behind the first state [s]; nan without such states."""
    row = int(np.searchsorted(run.states.participant_id, number))
    columns = np.flatnonzero(run.states.valid[row])[1:]
    return float(seen.times[number][0][columns].min()) if len(columns) else math.nan


def _left_out(run: RunRecord, ids: Sequence[int]) -> list[str]:
    """Which agents are not scored, as their recordings overlap others."""
    left = [
        number for number in run.outcomes.agent_id.tolist() if number in run.scenario.overlapping and number not in ids
    ]
    if not left:
        return []
    named = ", ".join(map(str, left[:5])) + (f" and {len(left) - 5} more" if len(left) > 5 else "")
    return [f"not scored, because their recordings overlap those of others: {named}"]
