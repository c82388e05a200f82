"""The score of every agent of a run: terms, blame, factors, and why in words."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive import _core
from interdrive.errors import InputError
from interdrive.reference_drivers import DRIVERS
from interdrive.run.goals import said_seconds, way_to_goal
from interdrive.scenario import KINDS
from interdrive.scenario.native import core_shape
from interdrive.scoring.drives import (
    along,
    motion_of,
    rear_axle_to_center,
    recorded_columns,
    site_of,
    traffic,
    window_of,
)
from interdrive.scoring.faults import is_thing, verdicts
from interdrive.scoring.preventability import preventable_collisions
from interdrive.scoring.settings import ScoringSettings
from interdrive.scoring.terms import Term, comfort_term, direction_term, progress_term, speed_term, ttc_term
from interdrive.storage import Origin, changed_settings

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.run import AgentRecord, RunRecord
    from interdrive.scoring.drives import Site
    from interdrive.scoring.faults import Verdict
    from interdrive.scoring.terms import Motion

#: Terms with weights, and what they are called in words.
TERMS = {"progress": "progress", "ttc": "time to contact straight on", "speed": "speed limit", "comfort": "comfort"}

#: Factors of the score in the order in which zeros are told.
FACTORS = ("alive", "fault", "road", "direction", "progress_min")

#: Lane keeping: largest distance from the reference path [m].
_LANE_KEEPING = 0.5

#: Values above this are not worth a word.
_NEARLY_ONE = 0.995

_BROKEN = ("planner_error", "infeasible")


@dataclass(frozen=True)
class Score:
    """Scores of agents; arrays of shape (agents,), sorted by id.

    Attributes:
        ids: Agents.
        score: From 0 to 1; a term does not count if the recording of the same vehicle fails it, too.
        score_strict: From 0 to 1; every term counts.
        terms: By name: `progress`, `ttc_term`, `speed_term`, `comfort_term`, `direction`, `lane_keeping` from 0 to 1,
            nan where unknown; `straight_ttc_min` [s], inf without a contact; `room` [m], nan without a contact.
        fault: Whether a collision with another participant was the agent's fault.
        fault_kind: One of `FAULT_KINDS`; "" without a fault.
        fault_nuplan: nuPlan's verdict, for comparison.
        collision_type: One of `COLLISION_TYPES`; "" without a collision with another participant.
        preventable: By reference driver, whether it would have avoided the collision: 1 or 0, nan without a collision
            with another participant or without a verdict (`interdrive.scoring.preventability`).
        excused: Names of factors and terms that count as 1 because the recording's are 0.
        reasons: In words, what made the score less than 1, for every agent.
        notes: One line per thing the user should know.
        origin: How the scores came about.
    """

    ids: Ints
    score: Floats
    score_strict: Floats
    terms: Mapping[str, Floats]
    fault: Bools
    fault_kind: tuple[str, ...]
    fault_nuplan: Bools
    collision_type: tuple[str, ...]
    preventable: Mapping[str, Floats]
    excused: tuple[tuple[str, ...], ...]
    reasons: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    origin: Origin = field(default_factory=Origin)

    def __repr__(self) -> str:
        mean = f", mean {100.0 * float(self.score.mean()):.1f}" if len(self.ids) else ""
        return f"<Score of {len(self.ids)} agents{mean}>"

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
        return "; ".join(self.reasons[row]) or "full score"


def score(run: RunRecord, ids: Sequence[int] | None = None, settings: ScoringSettings | None = None) -> Score:
    """Scores the agents of a run; the reference, page "Scores", defines the terms.

    Args:
        run: A run with its routes, as `simulate` and `load` give it.
        ids: Agents; None: all whose recordings overlap no others (`Scenario.overlaps`).
        settings: Bounds, weights and reactions; the defaults otherwise.

    Raises:
        InputError: An id that is not an agent of the run.
    """
    chosen = settings or ScoringSettings()
    known = run.outcomes.agent_id
    left_out = [number for number in known.tolist() if ids is None and number in run.scenario.overlapping]
    wanted = np.array(sorted(set(known.tolist() if ids is None else ids) - set(left_out)), dtype=np.int64)
    strangers = [number for number in wanted.tolist() if number not in known]
    if strangers:
        raise InputError(f"score: {strangers[0]} is not an agent of this run")
    site = site_of(run, run.settings.get("settings") or {})
    simulated = traffic(site, run)
    lengths = dict(zip(run.states.participant_id.tolist(), run.states.length.tolist(), strict=True))
    axles = [rear_axle_to_center(lengths[number]) for number in wanted.tolist()]
    times, partners = simulated.straight_times(wanted.tolist(), axles, chosen.ttc_horizon, 1)
    judged = verdicts(run, simulated, wanted.tolist(), chosen)
    prevented = preventable_collisions(run, simulated, wanted.tolist())
    notes = []
    if left_out:
        named = ", ".join(map(str, left_out[:5])) + (f" and {len(left_out) - 5} more" if len(left_out) > 5 else "")
        notes.append(f"not scored, because their recordings overlap those of others: {named}")
    is_original = has_recording(run)
    if not is_original:
        notes.append("the scenario file is gone or has changed: no recording to compare with, so every term counts")
    rows = [
        _Agent(run, site, simulated, number, is_original).judged(time, partner, judged.get(number), chosen)
        for number, time, partner in zip(wanted.tolist(), times, partners, strict=True)
    ]

    def column(name: str) -> Floats:
        return np.array([row[name] for row in rows], dtype=np.float64)

    names = (
        *("progress", "ttc_term", "speed_term", "comfort_term", "direction"),
        *("lane_keeping", "straight_ttc_min", "room"),
    )
    return Score(
        ids=wanted,
        score=column("score"),
        score_strict=column("score_strict"),
        terms={name: column(name) for name in names},
        fault=np.array([row["fault"] for row in rows], dtype=np.bool_),
        fault_kind=tuple(row["fault_kind"] for row in rows),
        fault_nuplan=np.array([row["fault_nuplan"] for row in rows], dtype=np.bool_),
        collision_type=tuple(row["collision_type"] for row in rows),
        preventable={
            name: np.array([prevented.get(number, {}).get(name, math.nan) for number in wanted.tolist()])
            for name in DRIVERS
        },
        excused=tuple(row["excused"] for row in rows),
        reasons=tuple(row["reasons"] for row in rows),
        notes=tuple(notes),
        origin=Origin(changed_settings(chosen, "scoring."), {"scenario": run.scenario.sha256, "run": run.digest}),
    )


def total(factors: Mapping[str, float], terms: Mapping[str, float], weights: Mapping[str, float]) -> float:
    """Product of the factors times the weighted mean of the terms that are not nan; nan without any."""
    known = {name: value for name, value in terms.items() if not math.isnan(value)}
    weight = sum(weights[name] for name in known)
    product = math.prod(factors.values())
    if product == 0.0:
        return 0.0
    if not weight > 0.0:
        return math.nan
    return product * sum(weights[name] * value for name, value in known.items()) / weight


def has_recording(run: RunRecord) -> bool:
    """Whether the scenario is the simulated one: a run folder keeps a copy without the recordings of agents."""
    path = run.scenario.path
    return path is None or not (path.name == "scenario.xml" and (path.parent / "run.json").exists())


class _Agent:
    """One agent with its recording."""

    def __init__(self, run: RunRecord, site: Site, simulated: _core.Traffic, number: int, has_recording: bool) -> None:
        self.run, self.site, self.simulated, self.number = run, site, simulated, number
        self.row = int(np.searchsorted(run.states.participant_id, number))
        place = int(np.searchsorted(run.outcomes.agent_id, number))
        self.outcome, self.partner = run.outcomes.outcome[place], int(run.outcomes.partner_id[place])
        self.off_road, self.reason = bool(run.outcomes.off_road[place]), run.outcomes.reason[place]
        self.record = next((agent for agent in run.agents if agent.id == number), None)
        self.columns = window_of(run.states, self.row)
        self.motion = motion_of(run.states, self.row, self.columns, run.states.first_time_step)
        self.recorded = self._recorded() if has_recording else None

    def _recorded(self) -> tuple[int, Ints] | None:
        """Row and columns of the recording of the same vehicle in the same window."""
        obstacles = self.run.scenario.obstacles
        row = int(np.searchsorted(obstacles.ids, self.number))
        if row >= len(obstacles.ids) or obstacles.ids[row] != self.number or obstacles.is_static[row]:
            return None
        columns = recorded_columns(obstacles, row, self.motion.time_step)
        return (row, columns) if len(columns) else None

    def judged(self, time: Floats, partner: Ints, verdict: Verdict | None, settings: ScoringSettings) -> dict[str, Any]:
        """All columns of one agent."""
        times, partners = time[self.columns], partner[self.columns]
        s, d = along(self._path(), self.motion)
        terms = self._common(self.motion, times, partners, settings)
        terms["progress"] = self._progress(s)
        recorded = self._of_recording(settings)
        factors, words = self._factors(verdict, terms, settings)
        excused = [name for name, value in recorded.items() if value == 0.0 and _value(name, factors, terms) < 1.0]
        weights = {name: getattr(settings.weights, name) for name in TERMS}
        plain = {name: terms[name].value for name in TERMS}
        strict = total(factors, plain, weights)
        kinder = {name: 1.0 if name in excused else value for name, value in factors.items()}
        excusing = total(kinder, {n: 1.0 if n in excused else v for n, v in plain.items()}, weights)
        return {
            "score": excusing,
            "score_strict": strict,
            "progress": terms["progress"].value,
            "ttc_term": terms["ttc"].value,
            "speed_term": terms["speed"].value,
            "comfort_term": terms["comfort"].value,
            "direction": terms["direction"].value,
            "lane_keeping": self._lane_keeping(d),
            "straight_ttc_min": float(times.min()) if len(times) else math.nan,
            "room": verdict.room if verdict else math.nan,
            "fault": bool(verdict and verdict.kind),
            "fault_kind": verdict.kind if verdict else "",
            "fault_nuplan": bool(verdict and verdict.fault_nuplan),
            "collision_type": verdict.collision_type if verdict else "",
            "excused": tuple(excused),
            "reasons": _reasons(kinder, words, terms, excused, verdict, self.run.scenario.dt),
        }

    def _path(self) -> Floats:
        return self.record.reference_path if self.record is not None else np.empty((0, 2))

    def _common(self, motion: Motion, times: Floats, partners: Ints, settings: ScoringSettings) -> dict[str, Term]:
        """The terms that are computed for agents and recordings alike."""
        dt = self.run.scenario.dt
        limit, off = self.site.road.lane_rules(motion.x, motion.y, motion.orientation)
        return {
            "ttc": ttc_term(times, partners, motion.time_step, dt, settings.ttc_bound),
            "speed": speed_term(motion.velocity, limit, dt, settings.overspeed),
            "comfort": comfort_term(motion, dt, settings.comfort),
            "direction": direction_term(motion, off, dt) if len(motion.x) else Term(math.nan),
        }

    def _of_recording(self, settings: ScoringSettings) -> dict[str, float]:
        """Terms and factors of the recording."""
        if self.recorded is None:
            return {}
        row, columns = self.recorded
        motion = motion_of(self.run.scenario.obstacles, row, columns, 0)
        times, partners = self.site.recorded_times(self.number, settings.ttc_horizon)
        found = {
            name: term.value for name, term in self._common(motion, times[columns], partners[columns], settings).items()
        }
        if self.off_road:
            found["road"] = 0.0 if self._recording_leaves_road(row, motion) else 1.0
        return found

    def _recording_leaves_road(self, row: int, motion: Motion) -> bool:
        states = self.run.states
        length, width = float(states.length[self.row]), float(states.width[self.row])
        vehicle = _core.Vehicle(KINDS.index(states.kinds[self.row]), length, width)
        shape = core_shape(self.run.scenario.obstacles.shapes[row])
        return _core.leaves_road(self.site.road, shape, vehicle, motion.x, motion.y, motion.orientation)

    def _progress(self, s: Floats) -> Term:
        if self.outcome == "goal_reached":
            return Term(1.0)
        if not len(s):
            return Term(math.nan)
        driven = float(s[-1] - s[0])
        if self.recorded is not None:
            motion = motion_of(self.run.scenario.obstacles, *self.recorded, 0)
            recorded = along(self._path(), motion)[0]
            return progress_term(driven, float(recorded[-1] - recorded[0]), "the recording")
        return progress_term(driven, self._expected(), "to be on time")

    def _expected(self) -> float:
        """Progress without a recording that leads to the goal at its latest time [m]."""
        agent = self.record
        if agent is None or not agent.goal_areas:
            return math.nan
        way = _way(agent, self.motion)
        available = agent.goal_time_step[1] - agent.start_time_step
        share = min(1.0, len(self.motion.x) / available) if available > 0 else 1.0
        return way * share if math.isfinite(way) else math.nan

    def _lane_keeping(self, d: Floats) -> float:
        if not len(d):
            return math.nan
        inside = ~self.simulated.is_on_crossing(self.motion.x, self.motion.y)
        return float((np.abs(d[inside]) <= _LANE_KEEPING).mean()) if inside.any() else math.nan

    def _factors(
        self, verdict: Verdict | None, terms: Mapping[str, Term], settings: ScoringSettings
    ) -> tuple[dict[str, float], dict[str, str]]:
        """Factors of the score, and in words why they are less than 1."""
        progress, direction = terms["progress"].value, terms["direction"].value
        factors = {
            "alive": 0.0 if self.outcome in _BROKEN else 1.0,
            "fault": self._fault(verdict),
            "road": 0.0 if self.outcome == "collision" and self.off_road else 1.0,
            "direction": 1.0 if math.isnan(direction) else direction,
            "progress_min": 0.0 if progress < settings.progress_min else 1.0,
        }
        words = {
            "alive": self.outcome + (f": {self.reason}" if self.reason else ""),
            "fault": f"at fault: {verdict.words}" if verdict else "",
            "road": "left the road",
            "direction": f"direction: {terms['direction'].words}",
            "progress_min": f"progress {progress:.2f}: {terms['progress'].words}",
        }
        return factors, words

    def _fault(self, verdict: Verdict | None) -> float:
        if verdict is None or not verdict.kind:
            return 1.0
        return 0.5 if is_thing(self.run, self.partner) else 0.0


def _way(agent: AgentRecord, motion: Motion) -> float:
    return way_to_goal(agent, float(motion.x[0]), float(motion.y[0])) if len(motion.x) else math.nan


def _value(name: str, factors: Mapping[str, float], terms: Mapping[str, Term]) -> float:
    return factors[name] if name in factors else terms[name].value


def _reasons(
    factors: Mapping[str, float],
    words: Mapping[str, str],
    terms: Mapping[str, Term],
    excused: Sequence[str],
    verdict: Verdict | None,
    dt: float,
) -> tuple[str, ...]:
    """What made the score less than 1, zeros first; then what happened without its fault, and what was excused."""
    found = [words[name] for name in FACTORS if factors[name] == 0.0]
    found += [f"{words[name]} (counts half)" for name in FACTORS if 0.0 < factors[name] < 1.0]
    told = factors["progress_min"] == 0.0
    for name, title in TERMS.items():
        term = terms[name]
        if term.value < _NEARLY_ONE and name not in excused and not (told and name == "progress"):
            found.append(f"{title} {term.value:.2f}: {term.words}")
    if verdict is not None and not verdict.kind:
        found.append(f"collision at {said_seconds(verdict.time_step, dt)} s, not its fault: {verdict.words}")
    if excused:
        named = " and ".join(TERMS.get(name, name) for name in excused)
        found.append(f"{named} not counted: the recorded driver was no better")
    return tuple(found)
