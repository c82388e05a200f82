"""What is known of one drive: how far it came when, which gates it lowers, its terms, and its free flow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive import _core
from interdrive.errors import InputError
from interdrive.native_settings import CoreStepSettings, RulesSettings
from interdrive.run.goals import said_seconds
from interdrive.scenario import KINDS
from interdrive.scenario.control import SIGNALS, shown_together
from interdrive.scoring.drives import along, motion_of
from interdrive.scoring.faults import is_thing
from interdrive.scoring.free_flow import (
    LATERAL_ACCELERATION,
    SPACING,
    Stop,
    free_flow_times,
    speed_caps,
    stated_limits,
    time_at,
)
from interdrive.scoring.seen import Seen
from interdrive.scoring.settings import ScoringSettings
from interdrive.scoring.terms import comfort_term, direction_term, speed_term, ttc_term

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.array_types import Floats, Ints
    from interdrive.run import AgentRecord, RunRecord
    from interdrive.scenario import StopLine
    from interdrive.scoring.drives import Site
    from interdrive.scoring.faults import Verdict
    from interdrive.scoring.terms import Motion, Term

#: Outcomes of planners that broke.
BROKEN = ("planner_error", "infeasible")
ARRIVED = ("goal_reached", "goal_reached_late")

#: What violations lower gates to. Right of way is decided by whether another vehicle had to brake hard.
_VIOLATIONS = {"red_light": 0.0, "crosswalk": 0.0, "stop_sign": 0.5, "right_of_way": 0.5}
_WRONG_WAY = 0.5
_SAID = {
    "red_light": "passed a red light",
    "crosswalk": "did not give way to a person on a crosswalk",
    "stop_sign": "passed a stop sign without standing",
    "right_of_way": "took the right of way of {}",
    "wrong_way": "drove the wrong way",
}

#: Where no limit is stated near by, at least this speed is lawful [m/s], and that of what moves so near [m] and heads
#: so much the agent's way (cosine).
_UNSTATED_VELOCITY_MIN, _TRAFFIC_WITHIN, _TRAFFIC_HEADING = 5.0, 100.0, math.sqrt(0.5)
#: A line counts if the path crosses it this much along its lanelet (cosine).
_LINE_HEADING = 0.5
#: Lights are known for so long behind the end of a drive [s].
_LIGHTS_FURTHER = 120.0
#: Share of the vehicle's largest lateral acceleration in curves.
_CORNERING_SHARE = 0.75


@dataclass(frozen=True)
class Drive:
    """What is known of one drive; arrays of shape (states,), the first state included.

    Attributes:
        agent_id: Participant id. planner: Name of its planner.
        column: Column of its first state in the states of the run.
        dt: Time between states [s].
        time: Since the first state [s]. way: Distance on the reference path, largest until then [m].
        velocity: Speed [m/s]. s: Arc length on the reference path [m]. x: Centre [m]. y: Centre [m].
        duration: Length of the drive [s]; up to the time limit if another participant ended it by its fault.
        in_time: It reached its goal in time. arrived: It did, or later.
        gates: Values below 1 by name (`interdrive.scoring.total.GATES`). words: Why, by the same names.
        ttc: Term. comfort: Term.
        cut_off_from: Participants whose right of way it took.
        free: Free-flow times at multiples of 0.5 m of the way [s]; empty without a path.
        hits: Contacts without its fault after which it drove on, in words: with whom, and when.
        hit: The contact that ended the drive without its fault, in words; empty without one.
        was_hit: Another participant ended it by its fault; false if it ran into one that stood.
        end: Why it ended without arriving, as the run says; empty if it arrived.
    """

    agent_id: int
    planner: str
    column: int
    dt: float
    time: Floats
    way: Floats
    velocity: Floats
    s: Floats
    x: Floats
    y: Floats
    duration: float
    in_time: bool
    arrived: bool
    gates: Mapping[str, float]
    words: Mapping[str, str]
    ttc: Term
    comfort: Term
    cut_off_from: frozenset[int]
    free: Floats
    hits: tuple[str, ...] = ()
    hit: str = ""
    was_hit: bool = False
    end: str = ""

    @property
    def distance(self) -> float:
        """Distance on the reference path [m]."""
        return float(self.way[-1])

    @property
    def free_flow(self) -> float:
        """Time that this distance takes in free flow [s]; nan without a path."""
        return time_at(self.free, self.distance)

    @property
    def ended_badly(self) -> bool:
        """It ended at fault, off the road, or with a broken planner."""
        return not {"alive", "fault", "road"}.isdisjoint(self.gates)

    def time_to(self, way: float) -> float:
        """When it came as far as a way [m], within half a metre [s]; inf if never, or within 3 s of a bad end.

        A drive that ended as it arrived goes on in free flow: others may arrive, or miss the goal, some metres further.
        """
        there = np.flatnonzero(self.way >= way - SPACING)
        if not len(there):
            if not self.arrived:
                return math.inf
            beyond = time_at(self.free, way - SPACING) - time_at(self.free, self.distance)
            return float(self.time[-1]) + max(beyond, 0.0)
        time = float(self.time[there[0]])
        return math.inf if self.ended_badly and time > self.time[-1] - _BAD_END else time

    def way_at(self, time: float) -> float:
        """Distance at a time [s] [m]."""
        return float(np.interp(time, self.time, self.way))


#: Contacts without fault, by nuPlan's types.
_CONTACTS = {
    "stopped_agent": "hit by {} while it stood",
    "stopped_other": "ran into {}, which stood,",
    "rear": "hit by {} from behind",
    "front": "ran into {}",
    "lateral": "touched {} side to side",
}
#: What happens this long before a bad end does not count as an example [s].
_BAD_END = 3.0


def drives_of(
    run: RunRecord, ids: Sequence[int], settings: ScoringSettings | None = None, seen: Seen | None = None
) -> dict[int, Drive]:
    """What is known of the drives of some agents of a run, by id; agents that never entered are missing.

    Violations that were not recorded lower no gate. `seen` is what was looked up of these agents already.

    Raises:
        InputError: An id is not that of an agent, or the run has no routes.
    """
    chosen = settings or ScoringSettings()
    records = {agent.id: agent for agent in run.agents}
    known = set(run.outcomes.agent_id.tolist())
    for number in ids:
        if number not in known:
            raise InputError(f"score: {number} is not an agent of this run")
        if number not in records or len(records[number].reference_path) < 2:
            raise InputError(f"score: the run has no route of agent {number}, so nothing says how far it came")
    rows = dict(zip(run.states.participant_id.tolist(), range(len(run.states.participant_id)), strict=True))
    wanted = [number for number in ids if run.states.valid[rows[number]].any()]
    told = seen or Seen.of(run, wanted, chosen)
    return {
        number: _Drive(run, told.site, records[number], rows[number], chosen).facts(
            *told.times[number], told.verdicts.get(number)
        )
        for number in wanted
    }


class _Drive:
    """One agent of a run."""

    def __init__(self, run: RunRecord, site: Site, record: AgentRecord, row: int, settings: ScoringSettings) -> None:
        self.run, self.site, self.record, self.row, self.settings = run, site, record, row, settings
        self.dt = run.scenario.dt
        self.columns: Ints = np.flatnonzero(run.states.valid[row])
        self.motion = motion_of(run.states, row, self.columns, run.states.first_time_step)
        place = int(np.searchsorted(run.outcomes.agent_id, record.id))
        self.outcome, self.reason = run.outcomes.outcome[place], run.outcomes.reason[place]
        self.partner, self.off_road = int(run.outcomes.partner_id[place]), bool(run.outcomes.off_road[place])

    def facts(self, times: Floats, partners: Ints, verdict: Verdict | None) -> Drive:
        """Everything, from the times to contact straight on at all columns and the verdict on its collision."""
        motion, states = self.motion, self.columns[1:]
        planned = motion_of(self.run.states, self.row, states, self.run.states.first_time_step)
        s = along(self.record.reference_path, motion)[0]
        gates, words, cut_off_from = self._gates(planned, verdict)
        was_hit = self.outcome == "collision" and not self.off_road and not (verdict and verdict.kind)
        lasted = max(len(self.columns) - 1, 1) * self.dt
        return Drive(
            agent_id=self.record.id,
            planner=self.record.planner,
            column=int(self.columns[0]),
            dt=self.dt,
            time=(self.columns - self.columns[0]) * self.dt,
            way=np.maximum.accumulate(s) - s[0],
            velocity=motion.velocity,
            s=s,
            x=motion.x,
            y=motion.y,
            duration=max(lasted, self._time_limit()) if was_hit else lasted,
            in_time=self.outcome == ARRIVED[0],
            arrived=self.outcome in ARRIVED,
            gates=gates,
            words=words,
            ttc=ttc_term(times[states], partners[states], planned.time_step, self.dt, self.settings.ttc_bound),
            comfort=comfort_term(planned, self.dt, self.settings.comfort),
            cut_off_from=cut_off_from,
            free=self._free_flow(float(s[0])),
            hits=self._hits(),
            hit=self._hit_words() if was_hit else "",
            was_hit=was_hit and not self._met_one_that_stood(),
            end="" if self.outcome in ARRIVED else self.reason,
        )

    def _hit_words(self) -> str:
        """What a collision without fault was: who stood has hit nothing."""
        when = self._when(int(self.columns[-1]))
        if self._met_one_that_stood():
            return f"ran into {self.partner}, which stood, at {when} s"
        return f"hit by {self.partner} at {when} s"

    def _met_one_that_stood(self) -> bool:
        states, before = self.run.states, max(int(self.columns[-1]) - 1, 0)
        row = int(np.searchsorted(states.participant_id, self.partner))
        return abs(float(states.velocity[row, before])) <= _core.STANDSTILL_SPEED

    def _when(self, column: int) -> str:
        return said_seconds(column + self.run.states.first_time_step, self.dt)

    def _hits(self) -> tuple[str, ...]:
        hits = self.run.hits
        if hits is None:
            return ()
        rows = np.flatnonzero(hits.agent_id == self.record.id).tolist()
        contacts = [_CONTACTS[hits.collision_type[k]].format(hits.by_id[k]) for k in rows]
        times = [said_seconds(int(hits.time_step[k]), self.dt) for k in rows]
        return tuple(f"{contact} at {when} s" for contact, when in zip(contacts, times, strict=True))

    def _time_limit(self) -> float:
        """Time from the start until the agent is stopped [s]."""
        chosen: Mapping[str, Any] = self.run.settings.get("settings") or {}
        grace = float(chosen.get("step.grace_factor", CoreStepSettings().grace_factor))
        return math.floor(grace * (self.record.goal_time_step[1] - self.record.start_time_step)) * self.dt

    def _gates(
        self, planned: Motion, verdict: Verdict | None
    ) -> tuple[dict[str, float], dict[str, str], frozenset[int]]:
        limit, off = self.site.road.lane_rules(planned.x, planned.y, planned.orientation)
        direction = direction_term(planned, off, self.dt) if len(planned.x) else None
        speed = speed_term(planned.velocity, limit, self.dt, self.settings.overspeed)
        found: list[tuple[str, float, str]] = []
        if self.outcome in BROKEN:
            found.append(("alive", 0.0, self.outcome + (f": {self.reason}" if self.reason else "")))
        if verdict is not None and verdict.kind:
            found.append(("fault", 0.5 if is_thing(self.run, self.partner) else 0.0, f"at fault: {verdict.words}"))
        if self.outcome == "collision" and self.off_road:
            found.append(("road", 0.0, "left the road"))
        if direction is not None and direction.value < 1.0:
            found.append(("direction", direction.value, f"direction: {direction.words}"))
        if speed.value < 1.0:
            found.append(("speed", speed.value, f"speed limit {speed.value:.2f}: {speed.words}"))
        rows, partners = self._violations()
        found += rows
        gates: dict[str, float] = {}
        words: dict[str, str] = {}
        for name, value, why in found:
            if value < gates.get(name, 1.0):
                gates[name], words[name] = value, why
        return gates, words, partners

    def _violations(self) -> tuple[list[tuple[str, float, str]], frozenset[int]]:
        broken = self.run.violations
        if broken is None:
            return [], frozenset()
        rows, partners = [], set()
        for k in np.flatnonzero(broken.participant_id == self.record.id).tolist():
            rule, partner = broken.rule[k], int(broken.partner_id[k])
            if broken.source[k] != "agent" or rule not in _SAID:
                continue
            when = said_seconds(int(broken.first_time_step[k]), self.dt)
            words = f"{_SAID[rule].format(partner)} at {when} s"
            if rule == "wrong_way":
                rows.append(("direction", _WRONG_WAY, f"direction: {words}"))
                continue
            if rule == "right_of_way":
                partners.add(partner)
            rows.append((rule, _VIOLATIONS[rule], words))
        return rows, frozenset(partners)

    def _free_flow(self, start: float) -> Floats:
        """Free-flow times along the reference path from an arc length on."""
        path = self.record.reference_path
        steps = np.hypot(*np.diff(path, axis=0).T)
        knots = np.concatenate([[0.0], np.cumsum(steps)])
        places = start + np.arange(int(max(knots[-1] - start, 0.0) / SPACING) + 1) * SPACING
        if len(places) < 2:
            return np.empty(0)
        x, y = (np.interp(places, knots, path[:, axis]) for axis in (0, 1))
        bearing = np.unwrap(np.arctan2(*np.diff(path, axis=0).T[::-1]))
        middles = 0.5 * (knots[1:] + knots[:-1])
        heading = np.interp(places, middles, bearing)
        bends = np.diff(bearing) / np.maximum(np.diff(middles), 1e-9)
        curvature = np.interp(places, knots[1:-1], bends) if len(bends) else np.zeros(len(places))
        states = self.run.states
        vehicle = _core.Vehicle(
            KINDS.index(states.kinds[self.row]), float(states.length[self.row]), float(states.width[self.row])
        )
        across = min(LATERAL_ACCELERATION, _CORNERING_SHARE * vehicle.lateral_acceleration_max)
        limit = self.site.road.lane_rules(x, y, heading)[0]
        limits = stated_limits(np.where(limit > 0.0, limit, np.nan), self._unstated())
        caps = speed_caps(curvature, limits, across, vehicle.velocity_max)
        return free_flow_times(caps, abs(float(self.motion.velocity[0])), self._stops(path, knots, start))

    def _unstated(self) -> float:
        """What counts as lawful where no limit is stated [m/s]."""
        states, column = self.run.states, int(self.columns[0])
        own = self.motion
        there = states.valid[:, column] & ~states.is_static
        there[self.row] = False
        x, y, angle = (getattr(states, name)[there, column] for name in ("x", "y", "orientation"))
        speed = states.velocity[there, column]
        near = np.hypot(x - own.x[0], y - own.y[0]) <= _TRAFFIC_WITHIN
        along_it = np.cos(angle - own.orientation[0]) >= _TRAFFIC_HEADING
        moving = speed[near & along_it & (speed > _core.JUDGED_STANDSTILL_SPEED)]
        return max(
            _UNSTATED_VELOCITY_MIN, abs(float(own.velocity[0])), float(np.median(moving)) if len(moving) else 0.0
        )

    def _stops(self, path: Floats, knots: Floats, start: float) -> list[Stop]:
        """Lights and stop signs on the path, in the order in which the front comes to them."""
        front = 0.5 * float(self.run.states.length[self.row])
        found = []
        for line in self.run.scenario.stop_lines:
            stop = self._stop(line)
            if stop is None:
                continue
            closed, duration = stop
            for s in _crossings(path, knots, line.ends):
                if s - front > start:
                    found.append(Stop(s - front - start, closed, duration))
        return sorted(found, key=lambda stop: stop.way)

    def _stop(self, line: StopLine) -> tuple[tuple[tuple[float, float], ...], float] | None:
        """When a line is closed [s since the start], and how long a vehicle has to stand there; None if neither."""
        duration = RulesSettings().stop_duration if line.has_stop_sign else 0.0
        route = set(self.record.route_lanelet_ids)
        ways = [following for following, _ in line.light_ids if following in route]
        if ways and set(ways) <= set(line.turns_on_red):
            return ((), duration) if duration else None
        ids = {i for following, lights in line.light_ids if not ways or following in ways for i in lights}
        if not ids and not duration:
            return None
        first = int(self.motion.time_step[0])
        n = first + len(self.columns) + round((max(self._time_limit(), 0.0) + _LIGHTS_FURTHER) / self.dt)
        lights = [light for light in self.run.scenario.traffic_lights if light.id in ids]
        codes = shown_together(lights, n)[first:] if lights else np.zeros(1, dtype=np.int64)
        is_closed = (codes != SIGNALS.index("green")) & (codes != SIGNALS.index("dark"))
        edges = np.flatnonzero(np.diff(np.concatenate([[False], is_closed, [False]]).astype(np.int8)))
        spans = [(float(a) * self.dt, float(b) * self.dt) for a, b in edges.reshape(-1, 2)]
        return tuple(spans), duration


def _crossings(path: Floats, knots: Floats, ends: Floats) -> list[float]:
    """Arc lengths at which a path crosses a line from behind; the line's ends are left before right."""
    across = ends[1] - ends[0]
    width = float(np.hypot(*across))
    if width == 0.0:
        return []
    across = across / width
    ahead = np.array([-across[1], across[0]])
    past, beside = (path - ends[0]) @ ahead, (path - ends[0]) @ across
    found = []
    for k in np.flatnonzero((past[:-1] < 0.0) & (past[1:] >= 0.0)).tolist():
        share = past[k] / (past[k] - past[k + 1])
        at = beside[k] + share * (beside[k + 1] - beside[k])
        step = path[k + 1] - path[k]
        if 0.0 <= at <= width and float(step @ ahead) > _LINE_HEADING * float(np.hypot(*step)):
            found.append(float(knots[k] + share * (knots[k + 1] - knots[k])))
    return found
