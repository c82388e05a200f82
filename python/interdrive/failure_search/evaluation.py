"""One drive in a disturbed world: whether the agent fails, by whose fault, and how near it came to that."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.config.binding import flatten
from interdrive.config.specs import spec_name
from interdrive.errors import InputError
from interdrive.failure_search.spaces import RECORDED
from interdrive.panel import PANEL
from interdrive.run import Plans, Timings
from interdrive.run.assemble import digest
from interdrive.runs import Run
from interdrive.scenario.inspection import candidates, lanelets_at
from interdrive.scoring.seen import Seen
from interdrive.scoring.settings import ScoringSettings
from interdrive.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.failure_search.disturbances import Disturbance
    from interdrive.run import Outcomes
    from interdrive.scenario import Scenario

#: What stands for failures that are no collision with a participant.
_BROKEN = ("infeasible", "planner_error")
#: Drivers that are tried in the place of an agent that failed, in this order: those that brake for what is ahead, the
#: panel of scores, and a careful one.
WITNESSES = tuple(
    dict.fromkeys(("cc", "lawful", "idm", *PANEL, "velocity_adjusting", "frenet,level=3,view.sensor_radius=150"))
)
#: Scales of the criticality of a drive without failure: time to contact straight on [s], time between the use of the
#: same ground [s], distance [m], impact speed [m/s].
_TTC_SCALE, _GAP_SCALE, _DISTANCE_MAX, _IMPACT_SCALE = 3.0, 3.0, 10.0, 20.0
#: What the gap in time and the distance count beside the time to contact, so that a drive far from any is not like all
#: others [1, 1/m].
_GAP_WEIGHT, _DISTANCE_WEIGHT = 0.1, 0.001
#: What a search does not look at.
_NO_PLANS, _NO_TIMINGS = Plans.empty(), Timings.empty()


@dataclass(frozen=True)
class Drivers:
    """Who drives in a search: the planner under test, the traffic, and the predictor of all; with settings of runs."""

    planner: str
    traffic: str
    predictor: str
    settings: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Drive:
    """All arguments of a run but its scenario, in plain values, so that a folder can keep them.

    Attributes:
        agents: Ids of the agents.
        agent_id: The agent under test.
        planner: Its planner, without `sight`, `occluded` and `perception`.
        others: Planners of the other agents, by id.
        predictor: Predictor of all agents.
        sight: Radius within which the agent sees [m]; None: as its settings say.
        occluded: The agent does not see through vehicles and buildings.
        settings: Settings of the run by dotted name, as on the command line.
        perception: Settings of the agent's view: the errors with which it perceives others.
    """

    agents: tuple[int, ...]
    agent_id: int
    planner: str
    others: dict[int, str] = field(default_factory=dict)
    predictor: str = "lane_following"
    sight: float | None = None
    occluded: bool = False
    settings: dict[str, str] = field(default_factory=dict)
    perception: dict[str, float] = field(default_factory=dict)

    def by(self, planner: str) -> Drive:
        """The same with another planner of the agent."""
        return replace(self, planner=planner)

    @property
    def planners(self) -> dict[int | str, Any]:
        """Planners by agent, as `interdrive.simulate` takes them."""
        own = self.planner
        if self.sight is not None and "view.sensor_radius" not in own:
            own = f"{own},view.sensor_radius={self.sight!r}"
        if self.occluded and "view.occlusion" not in own:
            own = f"{own},view.occlusion=true"
        own += "".join(
            f",view.{name}={value!r}" for name, value in self.perception.items() if f"view.{name}" not in own
        )
        found: dict[int | str, Any] = {self.agent_id: own}
        found.update(self.others.items())
        return found

    def simulation(self, scenario: Scenario) -> Simulation:
        """The run before its first time step."""
        return Simulation(
            scenario,
            agents=list(self.agents),
            planner=self.planners,
            predictor=self.predictor,
            settings=self.settings,
            threads=1,
            planner_processes=False,
        )

    def run(self, scenario: Scenario) -> Run:
        """Drives until all agents have their outcomes."""
        return self.simulation(scenario).run()

    def judged(self, scenario: Scenario) -> Judged:
        """Drives until the agent under test has its outcome, and judges it."""
        simulation = self.simulation(scenario)
        simulation.run_until_ended(self.agent_id)
        ended = simulation.outcomes()
        has_failed = ended.outcome[ended.agent_id.tolist().index(self.agent_id)] in ("collision", *_BROKEN)
        return judged(simulation.record() if has_failed else _plain_run(simulation, ended), self.agent_id)


def _plain_run(simulation: Simulation, outcomes: Outcomes) -> Run:
    """All that an agent is judged by that did not fail, which is less than a run is recorded with."""
    states = simulation.states()
    return Run(
        scenario=simulation.scenario,
        settings={"settings": {f"road.{name}": value for name, value in flatten(simulation.settings.road).items()}},
        agents=(),
        outcomes=outcomes,
        states=states,
        plans=_NO_PLANS,
        timings=_NO_TIMINGS,
        notes=(),
        digest=digest(states),
    )


@dataclass(frozen=True)
class Judged:
    """How the agent under test ended.

    Attributes:
        outcome: One of `interdrive.run.OUTCOMES`.
        failure: Kind of its failure: of its fault, "off_road", "infeasible" or "planner_error"; "" without one.
        partner_id: With whom it collided; -1: with no participant.
        criticality: Below 0: it failed, the lower the faster; otherwise 0 (near) or more.
        words: What happened.
        digest: Of the states of the run.
        lanelets: Of a failure, where the agent and its partner were: the lanelet with the smallest id; -1: on none.
    """

    outcome: str
    failure: str
    partner_id: int
    criticality: float
    words: str
    digest: str
    lanelets: tuple[int, ...] = ()


def judged(run: Run, agent_id: int) -> Judged:
    """Judges an agent of a run, which may have been driven no further than to its outcome."""
    ended = run.outcomes
    row = ended.agent_id.tolist().index(agent_id)
    outcome, partner = ended.outcome[row], int(ended.partner_id[row])
    failure, words, impact = "", ended.reason[row], 0.0
    seen = Seen.of(run, [agent_id], ScoringSettings())
    if outcome in _BROKEN:
        failure = outcome
    elif outcome == "collision" and ended.off_road[row]:
        failure = "off_road"
    elif outcome == "collision" and (verdict := seen.verdicts.get(agent_id)) is not None:
        failure, words = verdict.kind, f"{'at fault: ' if verdict.kind else ''}{verdict.words}"
        impact = float(ended.impact_speed[row]) if failure else 0.0
    critical = -1.0 - max(impact, 0.0) / _IMPACT_SCALE if failure else _nearness(run, agent_id, seen)
    places = _lanelets(run, [agent_id, *([partner] if partner >= 0 else [])]) if failure else ()
    return Judged(outcome, failure, partner, critical, words, run.digest, places)


def _lanelets(run: Run, participants: Sequence[int]) -> tuple[int, ...]:
    """The lanelet with the smallest id on which each participant was when the first of them ended; -1: on none."""
    states, lanelets = run.states, run.scenario.lanelets
    rows = np.searchsorted(states.participant_id, participants)
    last = int(np.flatnonzero(states.valid[rows[0]])[-1])
    inside = lanelets_at(lanelets, states.x[rows, last], states.y[rows, last])
    return tuple(int(lanelets.ids[own].min()) if own.any() else -1 for own in inside)


def _nearness(run: Run, agent_id: int, seen: Seen) -> float:
    """How near an agent came to others: 0 at a contact straight on, and a number above 1 far from everybody."""
    states, dt = run.states, run.scenario.dt
    row = int(np.searchsorted(states.participant_id, agent_id))
    times = seen.times[agent_id][0][np.flatnonzero(states.valid[row])[1:]]
    straight = min(float(np.nanmin(times, initial=math.inf)) / _TTC_SCALE, 1.0)
    most = math.ceil(_GAP_SCALE / dt)
    distance, steps = seen.traffic.approach(agent_id, states.length, states.width, most)
    gap = math.inf if steps is None else dt * steps
    near = min(max(distance, 0.0), _DISTANCE_MAX)
    return straight + _GAP_WEIGHT * min(gap / _GAP_SCALE, 1.0) + _DISTANCE_WEIGHT * near


def drive_of(scenario: Scenario, agent_id: int, drivers: Drivers) -> Drive:
    """The drive of an agent among others that a planner drives, or that replay their recordings (`RECORDED`)."""
    others: list[int] = []
    if drivers.traffic != RECORDED:
        able = candidates(scenario)
        others = [number for number in able.ids[able.accepted].tolist() if number != agent_id]
    planners = dict.fromkeys(others, drivers.traffic)
    settings = dict(drivers.settings)
    return Drive((agent_id, *others), agent_id, drivers.planner, planners, drivers.predictor, settings=settings)


def in_disturbed(drive: Drive, change: Disturbance) -> Drive:
    """The same drive with what is disturbed of the others' planners and of the agent's sight."""
    others = {
        number: ",".join(
            [
                name,
                *(
                    f"{key}={value!r}"
                    for key, value in change.drivers.get(number, {}).items()
                    if f",{key}=" not in name
                ),
            ]
        )
        for number, name in drive.others.items()
    }
    lost = {} if change.loss is None else {"v2x.loss": f"{change.loss!r}"}
    settings = {**drive.settings, **lost}
    sight, occluded, perception = change.sight, change.occluded, change.perception
    found = replace(drive, others=others, sight=sight, occluded=occluded, settings=settings, perception=perception)
    error = change.error
    if error is None or error.who not in others:
        return found
    if error.kind == "disobeys":
        return replace(found, others={**others, error.who: f"{others[error.who]},rules.enabled=false"})
    if error.kind == "inattentive":
        lapse = f"view.inattentive_from={error.time!r},view.inattentive_for={error.duration!r}"
        return replace(found, others={**others, error.who: f"{others[error.who]},{lapse}"})
    left = {number: name for number, name in others.items() if number != error.who}
    return replace(found, agents=tuple(number for number in drive.agents if number != error.who), others=left)


def witness(scenario: Scenario, drive: Drive) -> tuple[str, Run | None]:
    """The first of `WITNESSES` that ends without a collision and without failure in the agent's place, and its run."""
    planner = avoided_by(scenario, drive)
    return planner, drive.by(planner).run(scenario) if planner else None


def avoided_by(scenario: Scenario, drive: Drive, planners: Sequence[str] = WITNESSES) -> str:
    """The first of some planners that ends without a collision and without failure in the agent's place; "": none."""
    for planner in planners:
        try:
            found = drive.by(planner).judged(scenario)
        except InputError:
            continue
        if not found.failure and found.outcome != "collision":
            return planner
    return ""


def require_text(planner: object) -> str:
    """The planner as text, which a folder can keep.

    Raises:
        InputError: It is an object, which nothing can repeat.
    """
    if isinstance(planner, str):
        return planner
    raise InputError(f"planner {spec_name(planner)!r}", "a search keeps failures: name the planner, as module:object")
