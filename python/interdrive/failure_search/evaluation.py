"""One drive in a disturbed world: whether the agent fails, by whose fault, and how near it came to that."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from interdrive.config.specs import spec_name
from interdrive.errors import InputError
from interdrive.scenario.inspection import candidates
from interdrive.scoring import score
from interdrive.simulation import simulate

if TYPE_CHECKING:
    from interdrive.runs import Run
    from interdrive.scenario import Scenario

#: What stands for failures that are no collision with a participant.
_BROKEN = ("infeasible", "planner_error")
#: Drivers that are tried in the place of an agent that failed, in this order.
WITNESSES = ("cc", "lawful", "idm", "frenet,level=3,view.sensor_radius=150")
#: Scales of the criticality of a drive without failure: time to contact straight on [s], impact speed [m/s].
_TTC_SCALE, _IMPACT_SCALE = 3.0, 20.0


@dataclass(frozen=True)
class Drive:
    """All arguments of a run but its scenario, in plain values, so that a folder can keep them.

    Attributes:
        agents: Ids of the agents.
        agent_id: The agent under test.
        planner: Its planner, without `sight`.
        others: Planners of the other agents, by id.
        predictor: Predictor of all agents.
        sight: Radius within which the agent sees [m]; None: as its settings say.
    """

    agents: tuple[int, ...]
    agent_id: int
    planner: str
    others: dict[int, str] = field(default_factory=dict)
    predictor: str = "lane_following"
    sight: float | None = None

    def by(self, planner: str) -> Drive:
        """The same with another planner of the agent."""
        return replace(self, planner=planner)

    @property
    def planners(self) -> dict[int | str, Any]:
        """Planners by agent, as `interdrive.simulate` takes them."""
        own = self.planner
        if self.sight is not None and "view.sensor_radius" not in own:
            own = f"{own},view.sensor_radius={self.sight!r}"
        found: dict[int | str, Any] = {self.agent_id: own}
        found.update(self.others.items())
        return found

    def run(self, scenario: Scenario | str) -> Run:
        """Drives."""
        return simulate(
            scenario,
            agents=list(self.agents),
            planner=self.planners,
            predictor=self.predictor,
            threads=1,
        )


@dataclass(frozen=True)
class Judged:
    """How the agent under test ended.

    Attributes:
        outcome: One of `interdrive.run.OUTCOMES`.
        failure: Kind of its failure: of its fault, "off_road", "infeasible" or "planner_error"; "" without one.
        partner_id: With whom it collided; -1: with no participant.
        criticality: Below 0: it failed, the lower the faster; otherwise from 0 (near) to 1.
        words: What happened.
        digest: Of the run.
    """

    outcome: str
    failure: str
    partner_id: int
    criticality: float
    words: str
    digest: str


def judged(run: Run, agent_id: int) -> Judged:
    """Judges an agent of a run."""
    ended = run.outcomes
    row = ended.agent_id.tolist().index(agent_id)
    outcome, partner = ended.outcome[row], int(ended.partner_id[row])
    found = score(run, [agent_id])
    failure, words = "", found.why(agent_id)
    if outcome in _BROKEN:
        failure = outcome
    elif outcome == "collision":
        failure = found.fault_kind[0] or ("off_road" if ended.off_road[row] else "")
    if failure:
        impact = float(ended.impact_speed[row]) if failure in found.fault_kind else 0.0
        critical = -1.0 - (impact / _IMPACT_SCALE if impact > 0.0 else 0.0)
    else:
        critical = min(float(found.terms["straight_ttc_min"][0]) / _TTC_SCALE, 1.0)
        critical = critical if critical >= 0.0 else 1.0  # nan: it never drove
    return Judged(outcome, failure, partner, critical, words, run.digest)


def drive_of(scenario: Scenario, agent_id: int, planner: str, traffic: str, predictor: str) -> Drive:
    """The drive of an agent among others that a planner drives, or that replay their recordings ("recorded")."""
    if traffic == "recorded":
        return Drive((agent_id,), agent_id, planner, {}, predictor)
    able = candidates(scenario)
    others = [number for number in able.ids[able.accepted].tolist() if number != agent_id]
    return Drive((agent_id, *others), agent_id, planner, dict.fromkeys(others, traffic), predictor)


def witness(scenario: Scenario | str, drive: Drive) -> tuple[str, Run | None]:
    """The first of `WITNESSES` that ends without a collision and without failure in the agent's place, and its run."""
    for planner in WITNESSES:
        try:
            run = drive.by(planner).run(scenario)
        except InputError:
            continue
        found = judged(run, drive.agent_id)
        if not found.failure and found.outcome != "collision":
            return planner, run
    return "", None


def require_text(planner: object) -> str:
    """The planner as text, which a folder can keep.

    Raises:
        InputError: It is an object, which nothing can repeat.
    """
    if isinstance(planner, str):
        return planner
    raise InputError(f"planner {spec_name(planner)!r}", "a search keeps failures: name the planner, as module:object")
