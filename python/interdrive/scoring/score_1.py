"""The score of interdrive until this release, for one release more: nuPlan's form with excuses of the recording."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.run.goals import way_to_goal
from interdrive.scenario import KINDS
from interdrive.scenario.native import core_shape
from interdrive.scoring.drives import along, motion_of, recorded_columns, window_of
from interdrive.scoring.faults import is_thing
from interdrive.scoring.terms import Term, comfort_term, direction_term, progress_term, speed_term, ttc_term

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.array_types import Floats, Ints
    from interdrive.run import AgentRecord, RunRecord
    from interdrive.scoring.faults import Verdict
    from interdrive.scoring.seen import Seen
    from interdrive.scoring.settings import ScoringSettings
    from interdrive.scoring.terms import Motion

#: Terms with weights.
TERMS = ("progress", "ttc", "speed", "comfort")

#: Lane keeping: largest distance from the reference path [m].
_LANE_KEEPING = 0.5

_BROKEN = ("planner_error", "infeasible")


def score_1(
    run: RunRecord, seen: Seen, settings: ScoringSettings, *, has_recording: bool
) -> dict[int, tuple[float, float]]:
    """The old score and lane keeping of the agents of `seen`, by id; nan where they cannot be told."""
    return {
        number: _Agent(run, seen, number, has_recording).judged(seen.verdicts.get(number), settings)
        for number in seen.ids
    }


def weighted(factors: Mapping[str, float], terms: Mapping[str, float], weights: Mapping[str, float]) -> float:
    """Product of the factors times the weighted mean of the terms that are not nan; nan without any."""
    known = {name: value for name, value in terms.items() if not math.isnan(value)}
    weight = sum(weights[name] for name in known)
    product = math.prod(factors.values())
    if product == 0.0:
        return 0.0
    if not weight > 0.0:
        return math.nan
    return product * sum(weights[name] * value for name, value in known.items()) / weight


class _Agent:
    """One agent with its recording."""

    def __init__(self, run: RunRecord, seen: Seen, number: int, has_recording: bool) -> None:
        self.run, self.seen, self.site, self.number = run, seen, seen.site, number
        self.row = int(np.searchsorted(run.states.participant_id, number))
        place = int(np.searchsorted(run.outcomes.agent_id, number))
        self.outcome, self.partner = run.outcomes.outcome[place], int(run.outcomes.partner_id[place])
        self.off_road = bool(run.outcomes.off_road[place])
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

    def judged(self, verdict: Verdict | None, settings: ScoringSettings) -> tuple[float, float]:
        """The score, and lane keeping."""
        time, partner = self.seen.times[self.number]
        s, d = along(self._path(), self.motion)
        terms = self._common(self.motion, time[self.columns], partner[self.columns], settings)
        terms["progress"] = self._progress(s)
        recorded = self._of_recording(settings)
        factors = self._factors(verdict, terms, settings)
        excused = [name for name, value in recorded.items() if value == 0.0 and _value(name, factors, terms) < 1.0]
        weights = {name: getattr(settings.weights, name) for name in TERMS}
        kinder = {name: 1.0 if name in excused else value for name, value in factors.items()}
        found = weighted(kinder, {name: 1.0 if name in excused else terms[name].value for name in TERMS}, weights)
        return found, self._lane_keeping(d)

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
        inside = ~self.seen.traffic.is_on_crossing(self.motion.x, self.motion.y)
        return float((np.abs(d[inside]) <= _LANE_KEEPING).mean()) if inside.any() else math.nan

    def _factors(
        self, verdict: Verdict | None, terms: Mapping[str, Term], settings: ScoringSettings
    ) -> dict[str, float]:
        """Factors of the score."""
        progress, direction = terms["progress"].value, terms["direction"].value
        return {
            "alive": 0.0 if self.outcome in _BROKEN else 1.0,
            "fault": self._fault(verdict),
            "road": 0.0 if self.outcome == "collision" and self.off_road else 1.0,
            "direction": 1.0 if math.isnan(direction) else direction,
            "progress_min": 0.0 if progress < settings.progress_min else 1.0,
        }

    def _fault(self, verdict: Verdict | None) -> float:
        if verdict is None or not verdict.kind:
            return 1.0
        return 0.5 if is_thing(self.run, self.partner) else 0.0


def _way(agent: AgentRecord, motion: Motion) -> float:
    return way_to_goal(agent, float(motion.x[0]), float(motion.y[0])) if len(motion.x) else math.nan


def _value(name: str, factors: Mapping[str, float], terms: Mapping[str, Term]) -> float:
    return factors[name] if name in factors else terms[name].value
